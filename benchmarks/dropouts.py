"""What is lost, and nothing invented: dropped frames, a hand before the tags, glare.

    python benchmarks/dropouts.py [--frames 10000] [--runs 24]

Prints false positions ÷ positions given (a position is false when it is off by more than five of its own standard
errors, or by 0.3 px), and the errors of frequency and damping ÷ the Cramér-Rao bound of the frames that were seen.
"""

import argparse
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from tagsway.filters import clean_track
from tagsway.modal import find_window, identify_modes
from tagsway.modal.bound import find_bound
from tagsway.model import FloatArray, Frame, GreyArray, ModalEstimate, Settings, Sightings, VideoInfo
from tagsway.scene.optics import Picture
from tagsway.scene.render import expose_film, plan_film
from tagsway.scene.truth import describe_film
from tagsway.tags.follow import TagTracks, follow_tags
from tagsway.tracks import join_tags

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from scenes import released_scene, small_scene
from tag_images import bound_centre, make_pose, see_tag

SHAPE, SIDE_PX, FPS, LOST = (330, 380), 44.0, 200.0, 0.3
PERIOD = 400  # frames after which the scene repeats itself
NOISE_GREY = 2.0
RELEASE_RAD, LOUD_GREY = 0.04, 8.0  # of the decay: so small a swing does not soften by more than the bound


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=10_000)
    parser.add_argument("--runs", type=int, default=24)
    options = parser.parse_args()
    count_false_positions(options.frames)
    compare_with_bound(options.runs)


def places(k: float) -> tuple[FloatArray, FloatArray]:
    """Return the poses of the tool's tag and the product's: 1.5 Hz and 5 Hz, up to 8 px a frame."""
    slow, fast = 2 * math.pi * 3 * k / PERIOD, 2 * math.pi * 10 * k / PERIOD
    swing = 0.25 * math.sin(fast)
    tool = (190 + 60 * math.sin(slow), 60 + 10 * math.cos(slow))
    product = (tool[0] + 190 * math.sin(swing), tool[1] + 190 * math.cos(swing))
    return make_pose(tool, SIDE_PX, 0.01), make_pose(product, SIDE_PX, swing, (0.01, 0.005))


def see_clearly() -> list[FloatArray]:
    """Return one period of images without noise; each is exposed for 2 ms."""
    rng = np.random.default_rng(0)
    wall = cv2.GaussianBlur(rng.normal(size=SHAPE), (0, 0), 5)
    wall = 120 + 35 * wall / wall.std()
    images = []
    for k in range(PERIOD):
        image = wall
        for tag_id, (pose, soon) in enumerate(zip(places(k), places(k + 0.4), strict=True)):
            image = see_tag(pose, SHAPE, tag_id=tag_id, motion_px=tuple(soon[:2, 2] - pose[:2, 2]), onto=image)
        images.append(image.astype(np.float32))
    return images


@dataclass(frozen=True)
class Trouble:
    """Something that comes before a tag from one side and goes again; glare where it is white."""

    first: int
    length: int
    tag_id: int
    share: float
    direction_rad: float
    grey: float

    def cover(self, k: int, image: FloatArray) -> None:
        """Cover the part of the tag's square that is on one side of a line."""
        pose = places(k)[self.tag_id]
        depth = self.share * math.sin(math.pi * (k - self.first + 0.5) / self.length)
        y, x = np.indices(image.shape)
        u, v = (x - pose[0, 2]) / (SIDE_PX / 2), (y - pose[1, 2]) / (SIDE_PX / 2)
        c, s = math.cos(self.direction_rad), math.sin(self.direction_rad)
        reach = abs(c) + abs(s)
        along, across = u * c + v * s, u * s - v * c
        beyond = (along - reach * (1 - 2 * depth)) * SIDE_PX / 2
        weight = np.clip(beyond + 0.5, 0, 1) * (along < reach + 1) * (np.abs(across) < 2)
        image += (self.grey - image) * weight.astype(np.float32)


def plan_troubles(frames: int, rng: np.random.Generator) -> list[Trouble]:
    """Return, for every second of film: a hand for 0.3 s over the whole of a tag, or something over a part of it."""
    troubles = []
    for first in range(100, frames - 80, 200):
        whole = (first // 200) % 3 == 0
        grey = float(rng.choice([250.0, 95.0, 140.0, 30.0, 190.0]))
        share = 1.0 if whole else float(rng.uniform(0.03, 0.4))
        place = (int(rng.integers(2)), share, float(rng.uniform(-math.pi, math.pi)), grey)
        troubles.append(Trouble(first, 60 if whole else int(rng.integers(10, 80)), *place))
    return troubles


def film(images: list[FloatArray], frames: int, troubles: list[Trouble], rng: np.random.Generator) -> Iterator[Frame]:
    """Yield the frames that are not lost, with noise."""
    noise = rng.normal(scale=NOISE_GREY, size=(8, *SHAPE)).astype(np.float32)
    for k in range(frames):
        if k >= 3 and rng.random() < LOST:
            continue
        image = images[k % PERIOD].copy()
        for trouble in troubles:
            if trouble.first <= k < trouble.first + trouble.length:
                trouble.cover(k, image)
        image += np.roll(noise[rng.integers(8)], rng.integers(SHAPE[0] * SHAPE[1]))
        yield Frame(index=k, time_s=k / FPS, grey=np.clip(np.rint(image), 0, 255).astype(np.uint8))


def count_false_positions(frames: int) -> None:
    """Print how many positions are false, and how much of what could be seen was."""
    rng = np.random.default_rng(2)
    troubles = plan_troubles(frames, rng)
    tracks = follow_tags(film(see_clearly(), frames, troubles, rng), family="tag36h11", tag_ids=[0, 1])
    for tag in tracks.tags:
        covered = np.zeros(frames, bool)
        for trouble in troubles:
            covered[trouble.first : trouble.first + trouble.length] |= trouble.tag_id == tag.tag_id
        covered = covered[tracks.frame]
        truth = np.array([places(k)[tag.tag_id][:2, 2] for k in tracks.frame])
        errors = np.abs(tag.centre_px - truth)[tag.seen]
        sigmas = errors / np.sqrt(np.diagonal(tag.covariance_px2[tag.seen], axis1=1, axis2=2))
        print(
            f"tag {tag.tag_id}: positions off by more than 5 sigma ÷ positions "
            f"{np.count_nonzero(sigmas.max(axis=1) > 5)}/{len(errors)}, "
            f"by more than 0.3 px {np.count_nonzero(errors.max(axis=1) > 0.3)}/{len(errors)} "
            f"(the farthest {errors.max():.3f} px, {sigmas.max():.1f} sigma); "
            f"normalised error {math.sqrt((sigmas**2).mean()):.2f}; "
            f"positions ÷ frames: not covered {np.count_nonzero(tag.seen & ~covered)}/{np.count_nonzero(~covered)}, "
            f"covered in part or whole {np.count_nonzero(tag.seen & covered)}/{np.count_nonzero(covered)}",
            flush=True,
        )
    print(f"detector calls ÷ frames {tracks.detector_calls}/{len(tracks.frame)}")


def compare_with_bound(runs: int) -> None:
    """Print the errors of frequency and damping, over runs that lose other frames, over the bound of what was seen."""
    payload = replace(small_scene().payload, release_angle_rad=RELEASE_RAD)
    scene = released_scene(payload=payload, picture=Picture(exposure_s=0.001, noise_grey=0.0, supersampling=3))
    film = plan_film(scene)
    truth, clear = describe_film(film), list(expose_film(film))
    product = truth.tags["pcp"]
    side = product.size_mm / product.mm_per_px
    pose = make_pose((50.3, 50.4), side)
    look = {"dark": float(scene.picture.black_grey), "white": float(scene.picture.white_grey)}
    noise_m = bound_centre(pose, (100, 100), LOUD_GREY, tag_id=1, **look) * product.mm_per_px / 1000
    ratios = []
    for run in range(runs):
        tracks = lose_some(clear, np.asarray(truth.time_s), product.centre_px, side, np.random.default_rng(run))
        modal, start_s = identify_tracks(tracks, clear[0].shape)
        used = np.all([tag.seen for tag in tracks.tags], axis=0) & (tracks.time_s >= start_s)
        decayed = math.exp(-truth.damping_ratio * 2 * math.pi * truth.natural_frequency_hz * start_s)
        bound = find_bound(
            tracks.time_s[used] - start_s,
            natural_frequency_hz=truth.natural_frequency_hz,
            damping_ratio=truth.damping_ratio,
            amplitude=truth.free_amplitude_m * decayed,
            noise=math.sqrt(2) * noise_m,  # the sway is the difference of two tags' places
        )
        assert modal.natural_frequency_hz is not None
        assert modal.damping_ratio is not None
        ratios.append(
            (
                (modal.natural_frequency_hz.value - truth.natural_frequency_hz) / bound.natural_frequency_hz,
                (modal.damping_ratio.value - truth.damping_ratio) / bound.damping_ratio,
            )
        )
    frequency, damping = np.sqrt(np.mean(np.square(ratios), axis=0))
    print(
        f"{runs} runs, {LOST:.0%} of the frames lost and 0.3 s covered: RMS error ÷ bound of the frames seen: "
        f"frequency {frequency:.2f}, damping {damping:.2f} (means {np.mean(ratios, axis=0).round(2).tolist()})"
    )


def lose_some(
    clear: list[GreyArray],
    time_s: FloatArray,
    product_px: list[tuple[float, float]],
    side: float,
    rng: np.random.Generator,
) -> TagTracks:
    """Track a film of which 30 % is lost and in which a hand covers the product for 0.3 s."""
    first = int(rng.integers(60, len(clear) - 160))

    def frames() -> Iterator[Frame]:
        for k, image in enumerate(clear):
            if k >= 3 and rng.random() < LOST:
                continue
            seen = image + LOUD_GREY * rng.standard_normal(image.shape)
            if first <= k < first + 60:
                left, top = (max(int(edge - side), 0) for edge in product_px[k])
                seen[top : top + int(2 * side), left : left + int(2 * side)] = 140
            yield Frame(index=k, time_s=float(time_s[k]), grey=np.clip(np.rint(seen), 0, 255).astype(np.uint8))

    return follow_tags(frames(), family="tag36h11", tag_ids=[0, 1])


def identify_tracks(tracks: TagTracks, shape: tuple[int, ...]) -> tuple[ModalEstimate, float]:
    """Identify the payload from what was followed, as `identify` does; return also when its window starts."""
    video = VideoInfo(
        frames=len(tracks.frame),
        fps_hz=FPS,
        time_source="container",
        pts_rounding_s=0.0,
        dropped=0,
        duplicated=0,
        width=shape[1],
        height=shape[0],
        duration_s=float(tracks.time_s[-1]),
    )
    sightings = Sightings(
        video=video,
        frame=tracks.frame,
        time_s=tracks.time_s,
        tags=tracks.tags,
        detector_calls=tracks.detector_calls,
    )
    track, _, _ = join_tags(sightings, Settings(tcp_tag_size_m=0.03, pcp_tag_size_m=0.03))
    window = find_window(track, clean_track(track))
    return identify_modes(track, window).estimate, window.start_s


if __name__ == "__main__":
    main()
