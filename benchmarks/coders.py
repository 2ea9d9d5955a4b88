"""Fit the laws of `tagsway.tags.coder` anew, and print them as they stand there.

    python benchmarks/coders.py --sides 20 40 60 90 --noises 1 2 3 5 8 [--only hevc] [--frames 240]

Films of `benchmarks/accuracy.py`, of each size and noise one that nothing else uses, are written in every codec that is
there and in more presets and qualities of them; what tells a coder's pull is recorded at each image, and the powers are
those of the largest likelihood of the centres' errors. By itself it fits one size and noise, in some minutes; all of
them take hours. Beside each law: how much larger its mean log-likelihood is, to a coordinate, than that of the law in
use.
"""

import argparse
import math
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from scipy.optimize import minimize

import tagsway.tags.align
from tagsway.model import Coding, FloatArray
from tagsway.tags.coder import LONGEST_PX, CoderPull, Powers
from tagsway.tags.follow import follow_tags
from tagsway.video.reading import read_clock, read_frames

sys.path.insert(0, str(Path(__file__).parent))
import accuracy

RIDGE = 1e-4  # of the powers: two that tell the same share it
QUALITIES = {  # presets, and their crf or Mb/s; with B-frames, and in line
    ("libx264", False): "veryfast 23, fast 20, slow 26",
    ("libx264", True): "superfast 20, faster 18, faster 24, fast 8M, medium 23, slow 20",
    ("libx265", False): "ultrafast 18, ultrafast 3M, superfast 22, fast 27, fast 3M, medium 18, medium 4M, slow 22",
    ("libx265", True): "ultrafast 18, ultrafast 24, ultrafast 30, ultrafast 3M, fast 20, fast 27, fast 6M, medium 20, "
    "medium 26, medium 3M",
}


class Seen(NamedTuple):
    """What is known of a tag in an image, and where it is, shape (2,) each but for the factors', (2, 8)."""

    time_s: float
    place_px: Sequence[float]
    shown_px2: Sequence[float]
    held_px2: Sequence[float]
    apart_px2: Sequence[float]
    reached_px2: Sequence[float]
    factors: Sequence[Powers]


class Recorder(CoderPull):
    """A coder's pull that notes what it is made from."""

    seen: ClassVar[defaultdict[tuple[str, str], list[list[Seen]]]] = defaultdict(list)

    def __init__(self) -> None:
        super().__init__()
        self._mine: dict[tuple[str, str], list[Seen]] = {}

    def measure(self, time_s: float, place: Sequence[float], **known: Any) -> list[float]:
        """Note the place as well."""
        self._here = time_s, (place[0], place[1]), known["blocks"][:2]
        return super().measure(time_s, place, **known)

    def _measure_held(self, predicted: bool, coding: Coding, *known: Any) -> list[float]:
        held = super()._measure_held(predicted, coding, *known)
        if predicted:
            gain, side_px, white, uneven = known
            noise = [(axis, white[axis], uneven[axis]) for axis in (0, 1)]
            factors = [self.list_factors(axis, coding.step / gain, side_px, even, apart) for axis, even, apart in noise]
            kind = "between" if coding.between else "across" if self.is_across else "in line"
            key = coding.family, kind
            if key not in self._mine:
                self._mine[key] = []
                self.seen[key].append(self._mine[key])
            reached = [self.reach(*one) for one in noise]
            self._mine[key].append(Seen(*self._here, held[:2], uneven[:2], reached, factors))
        return held


def main() -> None:
    """Film, fit and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--only", default="", help="the codecs whose name contains this")
    parser.add_argument("--sides", type=float, nargs="+", default=[40.0])
    parser.add_argument("--noises", type=float, nargs="+", default=[3.0])
    parser.add_argument("--frames", type=int, default=240)
    options = parser.parse_args()
    tagsway.tags.align.CoderPull = Recorder  # type: ignore[misc]
    measured: defaultdict[tuple[str, str], list[FloatArray]] = defaultdict(list)
    for side in options.sides:
        for seed, noise in enumerate(options.noises, 100):
            for family, records in film(side, noise, seed, options.frames, options.only).items():
                measured[family] += records
            print(f"filmed: {side:.0f} px, noise {noise:.0f}", flush=True)
    print("family, kind: px, least; " + ", ".join(Powers._fields))
    for (family, kind), records in sorted(measured.items()):
        law, gained = fit_law(records)
        print(f'{kind}: "{family}": {law}  # {gained:+.3f}', flush=True)


def list_codecs(only: str) -> Iterator[tuple[str, str, str, dict[str, str], int]]:
    """Yield the codecs of `accuracy` and more, as these are written there."""
    more = [
        ("vp8 20", "libvpx", ".mkv", {"crf": "20", "b": "8000000", "deadline": "good", "cpu-used": "4"}, 0),
        *((f"av1 {crf}", "libsvtav1", ".mkv", {"crf": crf, "preset": "9"}, 0) for crf in ("30", "45")),
    ]
    for (encoder, in_line), qualities in QUALITIES.items():
        for name in qualities.split(", "):
            preset, quality = name.split(" ")
            options = {"preset": preset} | ({"g": "60"} if in_line else {})
            options |= {"b": quality.replace("M", "000000")} if quality.endswith("M") else {"crf": quality}
            if encoder == "libx265":
                options |= accuracy.X265_IN_LINE if in_line else accuracy.X265
            elif in_line:
                options["bf"] = "0"
            more.append((f"{encoder[3:]} {name}" + " in line" * in_line, encoder, ".mp4", options, 0))
    return (codec for codec in (*accuracy.CODECS, *more) if only in codec[0])


def film(side: float, noise: float, seed: int, frames: int, only: str) -> dict[tuple[str, str], list[FloatArray]]:
    """Return what was seen of each tag in each codec, shape (images, 2, 5 + 8) each, by family and kind."""
    accuracy.NOISE = noise
    images = list(accuracy.film(frames, side, seed))
    measured: defaultdict[tuple[str, str], list[FloatArray]] = defaultdict(list)
    with tempfile.TemporaryDirectory() as folder:
        for _, encoder, suffix, options, quantiser in list_codecs(only):
            path = Path(folder) / f"clip{suffix}"
            accuracy.encode(path, images, encoder, options, quantiser)
            Recorder.seen.clear()
            with read_frames(path, read_clock(path), full_range=False) as video:
                follow_tags(video, family="tag36h11", tag_ids=list(range(accuracy.MOVING + len(accuracy.RESTS))))
            for key, records in Recorder.seen.items():
                measured[key] += [tabulate(seen, side, seed) for seen in records if len(seen) > 2 * accuracy.SETTLED]
    return measured


def tabulate(record: list[Seen], side: float, seed: int) -> FloatArray:
    """Return squared error, shown, held, apart, reached and the factors' logarithms, by image and axis."""
    rows = []
    for seen in record:
        if seen.time_s * accuracy.FPS < accuracy.SETTLED:
            continue
        centres = [pose[:2, 2] for pose in accuracy.places(seen.time_s, side, seed)]
        truth = min(centres, key=lambda centre: math.dist(centre, seen.place_px))
        error = (np.array(seen.place_px) - truth) ** 2
        known = np.stack([error, seen.shown_px2, seen.held_px2, seen.apart_px2, seen.reached_px2], axis=1)
        rows.append(np.concatenate([known, np.log(np.maximum(seen.factors, 1e-9))], axis=1))
    return np.array(rows)


def fit_law(records: list[FloatArray]) -> tuple[str, float]:
    """Return a law as it is written, and what it gains in likelihood over the one in use; each tag weighs the same."""
    table = np.concatenate([record.reshape(-1, record.shape[2]) for record in records])
    weight = np.concatenate([np.full(2 * len(record), 0.5 / len(record) / len(records)) for record in records])
    error, shown, held, apart, reached = table[:, :5].T
    design = np.column_stack([np.ones(len(table)), table[:, 5:]])

    def cost(law: FloatArray) -> tuple[float, FloatArray]:
        """Return twice the mean negative log-likelihood, and its gradient."""
        pull, least = np.exp(np.minimum(design @ law[:-1], 5)), np.exp(law[-1]) * apart
        limited = np.minimum(np.minimum(pull, reached), LONGEST_PX**2)
        variance = shown + np.maximum(limited, least)
        slope = weight * (1 - error / variance) / variance
        is_free = (limited == pull) & (pull > least)
        gradient = np.append(design.T @ (slope * np.where(is_free, pull, 0)), slope @ np.where(is_free, 0, least))
        ridge = RIDGE * np.append(0.0, law[1:])
        return float(weight @ (np.log(variance) + error / variance)) + ridge @ law / 2, gradient + ridge

    start = np.zeros(design.shape[1] + 1)
    start[0] = math.log(4e-4)
    law = minimize(cost, start, jac=True, method="L-BFGS-B", options={"maxiter": 800}).x
    in_use = float(weight @ (np.log(shown + held) + error / (shown + held)))
    powers = ", ".join(f"{power + 0:.2f}" for power in law[1:-1])
    written = f"_Law({math.exp(law[0] / 2):.4f}, {math.exp(law[-1]):.2f}, Powers({powers})),"
    return written, (in_use - cost(law)[0]) / 2


if __name__ == "__main__":
    main()
