"""How exactly a tag is measured: against the noise's bound, plain detection, and its own standard errors.

    python benchmarks/accuracy.py [--repeats 200] [--frames 240] [--sides 20 40 60 90] [--films 1] [--only mpeg4]

Raw images first; then, for each size, videos in every codec and preset: a tag that goes along a line, one that swings,
one whose swing dies out to a third of a pixel, one that creeps by a tenth of a pixel an image, and three at rest. A
normalised variance of 1 means honest errors; a tag at rest has one error for the whole video, so its number is the mean
of three draws. A coder's errors last, so one video holds few that are independent: with more films than one their mean
is printed, each of other noise, before another wall, and from another place and moment on. Set OPENBLAS_NUM_THREADS=1.
"""

import argparse
import math
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import av
import cv2
import numpy as np

from tagsway.model import FloatArray, GreyArray
from tagsway.tags.align import Aligner
from tagsway.tags.find import find_tags
from tagsway.tags.follow import follow_tags
from tagsway.tags.pose import find_homography
from tagsway.video.reading import read_clock, read_frames

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from tag_images import bound_centre, make_pose, photograph, see_tag

WIDTH, HEIGHT, FPS, NOISE, SETTLED = 640, 480, 200.0, 3.0, 16
PLACES = ("along a line", "swinging", "dying out", "creeping", "at rest")
MOVING = len(PLACES) - 1
RESTS = ((70.3, 380.6), (65.7, 70.2), (575.1, 385.3))
X265 = {"x265-params": "log-level=none:pools=1:frame-threads=1"}
X265_IN_LINE = {"x265-params": X265["x265-params"] + ":bframes=0"}
IN_LINE = {"tune": "zerolatency", "profile": "baseline"}
# Name, FFmpeg's encoder, container, options; quantiser, where it is fixed.
CODECS: tuple[tuple[str, str, str, dict[str, str], int], ...] = (
    ("raw", "rawvideo", ".avi", {}, 0),
    ("ffv1", "ffv1", ".mkv", {}, 0),
    ("h264 qp 0", "libx264", ".mkv", {"qp": "0", "preset": "ultrafast"}, 0),
    ("mjpeg q 3", "mjpeg", ".avi", {}, 3),
    ("mjpeg q 8", "mjpeg", ".avi", {}, 8),
    ("h264 faster 12", "libx264", ".mp4", {"preset": "faster", "crf": "12"}, 0),
    ("h264 faster 18", "libx264", ".mp4", {"preset": "faster", "crf": "18"}, 0),
    ("h264 faster 26", "libx264", ".mp4", {"preset": "faster", "crf": "26"}, 0),
    ("h264 medium 23", "libx264", ".mp4", {"preset": "medium", "crf": "23"}, 0),
    ("h264 medium 28", "libx264", ".mp4", {"preset": "medium", "crf": "28"}, 0),
    ("h264 slow 20", "libx264", ".mp4", {"preset": "slow", "crf": "20"}, 0),
    ("h264 superfast 16", "libx264", ".mp4", {"preset": "superfast", "crf": "16"}, 0),
    ("h264 superfast 22", "libx264", ".mp4", {"preset": "superfast", "crf": "22"}, 0),
    ("h264 ultrafast 18", "libx264", ".mp4", {"preset": "ultrafast", "crf": "18"}, 0),
    ("h264 ultrafast 24", "libx264", ".mp4", {"preset": "ultrafast", "crf": "24"}, 0),
    ("h264 ultrafast 28", "libx264", ".mp4", {"preset": "ultrafast", "crf": "28"}, 0),
    ("hevc fast 20", "libx265", ".mp4", {"preset": "fast", "crf": "20"} | X265, 0),
    ("hevc medium 23", "libx265", ".mp4", {"preset": "medium", "crf": "23"} | X265, 0),
    ("hevc medium 28", "libx265", ".mp4", {"preset": "medium", "crf": "28"} | X265, 0),
    ("hevc ultrafast 24", "libx265", ".mp4", {"preset": "ultrafast", "crf": "24"} | X265, 0),
    ("vp9 good 20", "libvpx-vp9", ".mkv", {"crf": "20", "b": "0", "deadline": "good", "cpu-used": "5"}, 0),
    ("vp9 good 30", "libvpx-vp9", ".mkv", {"crf": "30", "b": "0", "deadline": "good", "cpu-used": "5"}, 0),
    ("mpeg4 q 3", "mpeg4", ".avi", {}, 3),
    ("mpeg4 q 6", "mpeg4", ".avi", {}, 6),
    ("mpeg4 4 Mb/s", "mpeg4", ".mp4", {"b": "4000000"}, 0),
    ("mpeg4 q 2", "mpeg4", ".avi", {}, 2),
    ("mpeg2 q 6", "mpeg2video", ".mkv", {}, 6),
    # Each image from the one before, often afresh, at a rate: as cameras write.
    ("h264 in line 20", "libx264", ".mp4", {"preset": "veryfast", "crf": "20", "bf": "0", "g": "30"}, 0),
    ("h264 in line 4 M", "libx264", ".mp4", {"preset": "veryfast", "b": "4000000", "g": "60"} | IN_LINE, 0),
    ("h264 in line 23", "libx264", ".mp4", {"preset": "medium", "crf": "23", "bf": "0", "g": "60"}, 0),
    ("hevc in line 23", "libx265", ".mp4", {"preset": "fast", "crf": "23", "g": "60"} | X265_IN_LINE, 0),
    ("vp8 4 Mb/s", "libvpx", ".mkv", {"b": "4000000", "deadline": "realtime", "cpu-used": "6"}, 0),
    ("av1 35", "libsvtav1", ".mkv", {"crf": "35", "preset": "9"}, 0),
)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--repeats", type=int, default=200)
    parser.add_argument("--frames", type=int, default=240)
    parser.add_argument("--sides", type=float, nargs="+", default=[20.0, 40.0, 60.0, 90.0])
    parser.add_argument("--films", type=int, default=1, help="of each codec and size")
    parser.add_argument("--only", default="", help="the codecs whose name contains this, and no raw images")
    options = parser.parse_args()
    if not options.only:
        compare_accuracy(options.repeats)
    for side in options.sides:
        compare_codecs(side, options.frames, options.films, options.only)


def places(time_s: float, side: float, seed: int) -> tuple[FloatArray, ...]:
    """Return the poses of the tags; those of other seeds are a fraction of a pixel and of a swing from the first."""
    right, down, later_s = np.random.default_rng(seed).uniform(0.0, 1.0, 3) if seed else (0.0, 0.0, 0.0)
    poses = draw_places(time_s, time_s + later_s, side)
    shift = np.array([[1, 0, right], [0, 1, down], [0, 0, 1.0]])
    return tuple(shift @ pose for pose in poses)


def draw_places(time_s: float, swinging_s: float, side: float) -> tuple[FloatArray, ...]:
    """Return the poses of the first film's tags; the first two at a time of their own."""
    tool = 320 + 120 * math.sin(2 * math.pi * 0.4 * swinging_s)
    swing = 0.25 * math.sin(2 * math.pi * 2.3 * swinging_s)
    product = (tool + 160 * math.sin(swing), 80 + 160 * math.cos(swing))
    left = 4 * math.exp(-2 * time_s) * math.sin(2 * math.pi * 2.1 * time_s)
    return (
        make_pose((tool, 70.0), side, 0.01),
        make_pose(product, side, swing, (0.01, 0.005)),
        make_pose((330.4 + left, 385.7 + 0.3 * left), side, 0.02),
        make_pose((575.4 + 3 * time_s, 75.8 + 18 * time_s), side, 0.02),
        *(make_pose(rest, side, 0.02) for rest in RESTS),
    )


def film(frames: int, side: float, seed: int) -> Iterator[GreyArray]:
    """Draw a clip before clutter, 2 ms of exposure; each image has noise of its own."""
    rng = np.random.default_rng(seed)
    wall = cv2.GaussianBlur(rng.normal(size=(HEIGHT, WIDTH)), (0, 0), 9)
    wall = 120 + 25 * wall / wall.std()
    for tag_id, pose in enumerate(places(0.0, side, seed)):
        if tag_id >= MOVING:
            wall = see_tag(pose, wall.shape, tag_id=tag_id, onto=wall)
    for k in range(frames):
        image = wall
        now, soon = places(k / FPS, side, seed), places(k / FPS + 0.002, side, seed)
        for tag_id in range(MOVING):
            motion = tuple(soon[tag_id][:2, 2] - now[tag_id][:2, 2])
            image = see_tag(now[tag_id], image.shape, tag_id=tag_id, motion_px=motion, onto=image)
        yield photograph(image, NOISE, rng)


os.environ.setdefault("SVT_LOG", "1")  # the coder of AV1 tells its errors alone


def encode(path: Path, images: list[GreyArray], encoder: str, options: dict[str, str], quantiser: int) -> None:
    """Write a video as FFmpeg's encoders do with these options."""
    form = {"rawvideo": "gray", "ffv1": "gray", "mjpeg": "yuvj420p"}.get(encoder, "yuv420p")
    with av.open(str(path), "w") as container:
        stream = container.add_stream(encoder, rate=round(FPS), options=options)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, form
        stream.codec_context.thread_count = 1
        if quantiser:
            stream.codec_context.qmin = stream.codec_context.qmax = quantiser
            stream.codec_context.options = {"flags": "+qscale", "global_quality": str(118 * quantiser)}
        for image in images:
            picture = av.VideoFrame(WIDTH, HEIGHT, form)
            for index, plane in enumerate(picture.planes):
                rows = np.frombuffer(plane, np.uint8).reshape(plane.height, plane.line_size)
                rows[:, : plane.width] = image if index == 0 else 128
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))


def compare_codecs(side: float, frames: int, films: int, only: str) -> None:
    """Print each tag's RMS over the bound of the raw images, and its normalised variance, codec by codec."""
    drawn = [list(film(frames, side, seed)) for seed in range(films)]
    bound = bound_centre(make_pose((150.3, 150.2), side, 0.1), (300, 300), NOISE)
    print(f"\nside {side:.0f} px: RMS / bound, normalised variance")
    print(f"{'':18s}" + "".join(f"{name:>16s}" for name in PLACES) + "  moving")
    moving: list[list[float]] = []
    with tempfile.TemporaryDirectory() as folder:
        for name, encoder, suffix, options, quantiser in CODECS:
            if only not in name:
                continue
            path, measured = Path(folder) / f"clip{suffix}", []
            for seed, images in enumerate(drawn):
                encode(path, images, encoder, options, quantiser)
                measured.append(measure_film(path, side, seed))
            means = np.mean(measured, axis=0)
            moving.append([float(two) for _, two in means[:MOVING]])
            columns = "".join(f"{math.sqrt(one) / bound:10.2f}{two:6.2f}" for one, two in means)
            print(f"{name:18s}{columns}{np.mean(moving[-1]):8.2f}", flush=True)
    if moving:
        print(f"codecs, all moving tags: {sum_up(np.mean(moving, axis=1))}")
        print(f"codecs, motion by motion: {sum_up(np.ravel(moving))}", flush=True)


def sum_up(variances: FloatArray) -> str:
    """Say how near normalised variances are to 1."""
    share = np.mean((variances >= 0.8) & (variances <= 1.2))
    return f"median {np.median(variances):.2f}, {variances.min():.2f} to {variances.max():.2f}, {share:.0%} within 20 %"


def measure_film(path: Path, side: float, seed: int) -> FloatArray:
    """Return the mean squared error in px² and the normalised variance of each of `PLACES`, shape (places, 2)."""
    with read_frames(path, read_clock(path), full_range=False) as video:
        tracks = follow_tags(video, family="tag36h11", tag_ids=list(range(MOVING + len(RESTS))))
    squares: dict[str, list[tuple[float, float]]] = {place: [] for place in PLACES}
    for tag in tracks.tags:
        truth = np.array([places(k / FPS, side, seed)[tag.tag_id][:2, 2] for k in tracks.frame])
        error = (tag.centre_px - truth)[SETTLED:] ** 2
        variance = np.diagonal(tag.covariance_px2, axis1=1, axis2=2)[SETTLED:]
        squares[PLACES[min(tag.tag_id, MOVING)]].append((np.nanmean(error), np.nanmean(error / variance)))
    return np.array([np.mean(squares[place], axis=0) for place in PLACES])


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
