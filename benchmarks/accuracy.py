"""How exactly a tag is measured: against the noise's bound, plain detection, and its own standard errors.

    python benchmarks/accuracy.py [--repeats 200] [--frames 200]

Raw images first, then videos of three tags (a swinging one, one that goes along a line, one at rest) in each codec.
A normalised variance of 1 means honest errors. Set OPENBLAS_NUM_THREADS=1.
"""

import argparse
import math
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from tagsway.model import FloatArray, GreyArray
from tagsway.tags.align import Aligner
from tagsway.tags.find import find_tags
from tagsway.tags.follow import follow_tags
from tagsway.tags.pose import find_homography
from tagsway.video.reading import read_clock, read_frames
from tagsway.video.writing import Codec, write_video

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from tag_images import bound_centre, make_pose, photograph, see_tag

WIDTH, HEIGHT, FPS, NOISE, SETTLED = 640, 480, 200.0, 3.0, 16
PLACES = ("along a line", "swinging", "at rest")
CODECS: tuple[tuple[Codec, float, str], ...] = (
    ("raw", 0, ".avi"),
    ("mjpeg", 3, ".avi"),
    ("mjpeg", 8, ".avi"),
    ("h264", 10, ".mp4"),
    ("h264", 18, ".mp4"),
    ("h264", 26, ".mp4"),
    ("hevc", 20, ".mp4"),
)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--repeats", type=int, default=200)
    parser.add_argument("--frames", type=int, default=200)
    options = parser.parse_args()
    compare_accuracy(options.repeats)
    for side in (35.0, 60.0, 90.0):
        compare_codecs(side, options.frames)


def places(time_s: float, side: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the poses of the three tags."""
    tool = 320 + 120 * math.sin(2 * math.pi * 0.4 * time_s)
    swing = 0.25 * math.sin(2 * math.pi * 2.3 * time_s)
    product = (tool + 200 * math.sin(swing), 150 + 200 * math.cos(swing))
    return (
        make_pose((tool, 100.0), side, 0.01),
        make_pose(product, side, swing, (0.01, 0.005)),
        make_pose((70.3, 380.6), side, 0.02),
    )


def film(frames: int, side: float) -> Iterator[GreyArray]:
    """Draw a clip before clutter, 2 ms of exposure; each image has noise of its own."""
    rng = np.random.default_rng(0)
    wall = cv2.GaussianBlur(rng.normal(size=(HEIGHT, WIDTH)), (0, 0), 9)
    wall = 120 + 35 * wall / wall.std()
    for k in range(frames):
        image = wall
        now, soon = places(k / FPS, side), places(k / FPS + 0.002, side)
        for tag_id, (pose, later) in enumerate(zip(now, soon, strict=True)):
            motion = tuple(later[:2, 2] - pose[:2, 2])
            image = see_tag(pose, image.shape, tag_id=tag_id, motion_px=motion, onto=image)
        yield photograph(image, NOISE, rng)


def compare_codecs(side: float, frames: int) -> None:
    """Print each tag's RMS over the bound of the raw images, and its normalised variance, codec by codec."""
    images = list(film(frames, side))
    bound = bound_centre(make_pose((150.3, 150.2), side, 0.1), (300, 300), NOISE)
    with tempfile.TemporaryDirectory() as folder:
        for codec, quality, suffix in CODECS:
            path = Path(folder) / f"{codec}{quality:g}{suffix}"
            write_video(path, images, fps_hz=FPS, codec=codec, quality=quality)
            with read_frames(path, read_clock(path), full_range=False) as video:
                tracks = follow_tags(video, family="tag36h11", tag_ids=[0, 1, 2])
            words = []
            for tag in tracks.tags:
                truth = np.array([places(t, side)[tag.tag_id][:2, 2] for t in tracks.time_s])
                error = (tag.centre_px - truth)[SETTLED:]
                variance = np.diagonal(tag.covariance_px2, axis1=1, axis2=2)[SETTLED:]
                rms, normalised = np.sqrt(np.nanmean(error**2)), np.nanmean(error**2 / variance)
                words.append(f"{PLACES[tag.tag_id]} {rms / bound:.2f}, {normalised:.2f}")
            print(
                f"side {side:.0f} px, {codec} {quality:g}: RMS / bound, normalised variance: {'; '.join(words)}",
                flush=True,
            )


def compare_accuracy(repeats: int) -> None:
    """Print the RMS of the centre over its Cramér-Rao bound, on raw images."""
    for noise in (3.0, 8.0):
        for motion in ((0.0, 0.0), (5.0, 1.5)):
            for side in (15.0, 30.0, 60.0, 120.0, 200.0):
                if math.hypot(*motion) > 0 and side < 30:
                    continue
                ratio, normalised, plain = measure_accuracy(side, noise, motion, repeats)
                print(
                    f"side {side:3.0f} px, noise {noise:.0f}, blur of the motion {math.hypot(*motion):.1f} px: "
                    f"RMS / bound {ratio:.2f}, normalised error {normalised:.2f}, "
                    f"RMS / plain detection {plain:.2f}",
                    flush=True,
                )


def measure_accuracy(
    side: float, noise: float, motion: tuple[float, float], repeats: int
) -> tuple[float, float, float]:
    """Return the centre's RMS over its bound, of its error over its standard error, and over plain detection's."""
    rng = np.random.default_rng(1)
    size = int(1.6 * side) + 40
    aligner = Aligner("tag36h11", 0)
    errors, normalised, bounds, detected = [], [], [], []
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
        picture = photograph(image, noise, rng)
        seen = find_tags(picture, family="tag36h11")
        detected += [find_homography(tag.corners_px)[:2, 2] - pose[:2, 2] for tag in seen if tag.tag_id == 0]
        sighting = aligner.align(picture, start, travel_px=travel)
        if sighting is not None and k >= 5:
            error = sighting.centre_px - pose[:2, 2]
            errors.append(error)
            normalised.append(error @ np.linalg.solve(sighting.covariance_px2, error) / 2)
    rms, plain = (float(np.sqrt(np.mean(np.square(some)))) if some else math.nan for some in (errors, detected))
    return rms / float(np.mean(bounds)), float(np.sqrt(np.mean(normalised))), rms / plain


if __name__ == "__main__":
    main()
