"""How fast a video is tracked, against decoding alone and the plain loop, and how exactly, against the noise's bound.

    python benchmarks/tracking.py [--frames 400] [--threads 1]

Every number is a ratio of two measurements of one run. Set OPENBLAS_NUM_THREADS=1: the decoder needs the cores.
"""

import argparse
import math
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import av
import cv2
import numpy as np

from tagsway.model import FloatArray, GreyArray
from tagsway.tags.align import Aligner
from tagsway.tags.find import load_detector
from tagsway.tags.follow import follow_tags
from tagsway.video.reading import read_clock, read_frames
from tagsway.video.writing import write_video

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from tag_images import bound_centre, make_pose, photograph, see_tag

WIDTH, HEIGHT, SIDE_PX, FPS = 1280, 1024, 60.0, 200.0


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--frames", type=int, default=400)
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for codec, suffix in (("h264", ".mp4"), ("mjpeg", ".avi")):
            path = Path(folder) / f"clip{suffix}"
            write_video(path, film(options.frames), fps_hz=FPS, codec=codec, quality=18.0)
            compare_speed(path, codec, options.threads, options.frames)
    compare_accuracy()


def places(time_s: float) -> tuple[FloatArray, FloatArray]:
    """Return the poses of the tool's tag and the product's."""
    tool = 640 + 260 * math.sin(2 * math.pi * 0.4 * time_s)
    swing = 0.25 * math.sin(2 * math.pi * 2.3 * time_s)
    product = (tool + 330 * math.sin(swing), 300 + 330 * math.cos(swing))
    return make_pose((tool, 300.0), SIDE_PX, 0.01), make_pose(product, SIDE_PX, swing, (0.01, 0.005))


def film(frames: int) -> Iterator[GreyArray]:
    """Draw a clip: two tags before clutter, 2 ms of exposure, noise of three grey levels."""
    rng = np.random.default_rng(0)
    wall = cv2.GaussianBlur(rng.normal(size=(HEIGHT, WIDTH)), (0, 0), 9)
    wall = 120 + 35 * wall / wall.std()
    noise = rng.normal(scale=3.0, size=(8, HEIGHT, WIDTH)).astype(np.float32)
    for k in range(frames):
        image = wall
        now, soon = places(k / FPS), places(k / FPS + 0.002)
        for tag_id, (pose, later) in enumerate(zip(now, soon, strict=True)):
            motion = tuple(later[:2, 2] - pose[:2, 2])
            image = see_tag(pose, image.shape, tag_id=tag_id, motion_px=motion, onto=image)
        yield np.clip(np.rint(image + noise[rng.integers(8)]), 0, 255).astype(np.uint8)


def compare_speed(path: Path, codec: str, threads: int, frames: int) -> None:
    """Print the frames per second of tracking over those of decoding, and of the plain loop."""
    rates: dict[str, list[float]] = {"decoding": [], "tracking": [], "plain": []}
    for _ in range(3):
        rates["decoding"].append(frames / measure(lambda: decode(path, threads)))
        rates["tracking"].append(frames / measure(lambda: track(path, threads)))
    rates["plain"].append(min(frames, 60) / measure(lambda: detect_plainly(path, min(frames, 60))))
    best = {name: max(values) for name, values in rates.items()}
    calls, rms_px = track(path, threads)
    print(
        f"{codec}, {threads} decoder thread(s): tracking / decoding {best['tracking'] / best['decoding']:.2f}, "
        f"tracking / plain loop {best['tracking'] / best['plain']:.1f} "
        f"({best['tracking']:.0f}, {best['decoding']:.0f}, {best['plain']:.0f} fps); "
        f"detector calls {calls} in {frames} frames; RMS of the centres {rms_px:.4f} px"
    )


def measure(work: Callable[[], object]) -> float:
    """Return the seconds that a piece of work takes."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def decode(path: Path, threads: int) -> None:
    """Decode a video, and nothing else."""
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        stream.codec_context.thread_count = threads
        stream.codec_context.thread_type = "AUTO" if threads > 1 else "NONE"
        for _ in container.decode(stream):
            pass


def track(path: Path, threads: int) -> tuple[int, float]:
    """Track both tags as `identify` does; return the detector's calls and the error of the centres."""
    with read_frames(path, read_clock(path), decoder_threads=threads, full_range=False) as frames:
        tracks = follow_tags(frames, family="tag36h11", tag_ids=[0, 1])
    errors = []
    for tag in tracks.tags:
        truth = np.array([places(t)[tag.tag_id][:2, 2] for t in tracks.time_s])
        errors.append(tag.centre_px - truth)
    return tracks.detector_calls, float(np.sqrt(np.nanmean(np.square(errors))))


def detect_plainly(path: Path, frames: int) -> None:
    """Detect on every whole frame, as one does without this package."""
    detector, video = load_detector()(families="tag36h11"), cv2.VideoCapture(str(path))
    for _ in range(frames):
        _, image = video.read()
        detector.detect(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))


def compare_accuracy(repeats: int = 200) -> None:
    """Print the RMS of the centre over its Cramér-Rao bound, on raw images."""
    for noise in (3.0, 8.0):
        for motion in ((0.0, 0.0), (5.0, 1.5)):
            for side in (15.0, 30.0, 60.0, 120.0, 200.0):
                if math.hypot(*motion) > 0 and side < 30:
                    continue
                ratio, normalised = measure_accuracy(side, noise, motion, repeats)
                print(
                    f"side {side:3.0f} px, noise {noise:.0f}, blur of the motion {math.hypot(*motion):.1f} px: "
                    f"RMS / bound {ratio:.2f}, normalised error {normalised:.2f}",
                    flush=True,
                )


def measure_accuracy(side: float, noise: float, motion: tuple[float, float], repeats: int) -> tuple[float, float]:
    """Return the centre's RMS over its bound, and the RMS of its error over its own standard error."""
    rng = np.random.default_rng(1)
    size = int(1.6 * side) + 40
    aligner = Aligner("tag36h11", 0)
    errors, normalised, bounds = [], [], []
    for k in range(repeats):
        if k % 20 == 0:
            place = (size / 2 + rng.uniform(-0.5, 0.5), size / 2 + rng.uniform(-0.5, 0.5))
            pose = make_pose(place, side, rng.uniform(-0.3, 0.3), (0.02, 0.01))
            image = see_tag(pose, (size, size), motion_px=motion)
        if k % 100 == 0:
            bounds.append(bound_centre(pose, (size, size), noise, motion_px=motion))
        start = pose.copy()
        start[:2] += np.outer(rng.normal(scale=0.2, size=2), pose[2])
        travel = (2 * motion[0], 2 * motion[1])
        sighting = aligner.align(photograph(image, noise, rng), start, travel_px=travel)
        if sighting is not None and k >= 5:
            error = sighting.centre_px - pose[:2, 2]
            errors.append(error)
            normalised.append(error @ np.linalg.solve(sighting.covariance_px2, error) / 2)
    return float(np.sqrt(np.mean(np.square(errors))) / np.mean(bounds)), float(np.sqrt(np.mean(normalised)))


if __name__ == "__main__":
    main()
