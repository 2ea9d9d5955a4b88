"""How fast a video is tracked, against decoding alone and the plain loop.

    python benchmarks/tracking.py [--frames 1000] [--threads 1 2] [--rounds 7]

Every ratio is of two measurements of one round, taken one after the other, and the median of the rounds; the quartiles
of tracking ÷ decoding say how much the machine's other work leaves of it. Decoding alone is FFmpeg's,
with as many threads of its own as tagsway has decoders or threads of one (see docs/design/decoding.md). The ratio of
processor times beside it does not depend on what else the machine does. What the machine lets anyone have is the ratio
of a thread that takes tagsway's images and hashes for 0.3 ms each, without the interpreter's lock and without a look at
them. Set OPENBLAS_NUM_THREADS=1: the decoders need the cores.
"""

import argparse
import hashlib
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
from tagsway.tags.find import load_detector
from tagsway.tags.follow import follow_tags
from tagsway.video.reading import read_clock, read_frames
from tagsway.video.writing import write_video

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from tag_images import make_pose, see_tag

WIDTH, HEIGHT, SIDE_PX, FPS = 1280, 1024, 60.0, 200.0
HASHED_S = 3e-4


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--frames", type=int, default=1000)
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for codec, suffix in (("h264", ".mp4"), ("mjpeg", ".avi")):
            path = Path(folder) / f"clip{suffix}"
            write_video(path, film(options.frames), fps_hz=FPS, codec=codec, quality=18.0)
            for threads in options.threads:
                compare_speed(path, codec, threads, options.frames, options.rounds)


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


def compare_speed(path: Path, codec: str, threads: int, frames: int, rounds: int) -> None:
    """Print the frames per second of tracking over those of decoding, and of the plain loop."""
    hashed = bytes(round(HASHED_S / measure(lambda: hashlib.sha256(bytes(10**7)))[0] * 10**7))
    plain_frames = min(frames, 60)
    track(path, threads)  # what is compiled is loaded once for a process
    taken = []
    for _ in range(rounds):
        works = (
            lambda: hash_beside(path, threads, hashed),
            lambda: decode(path, threads),
            lambda: track(path, threads),
            lambda: detect_plainly(path, plain_frames),
        )
        taken.append([measure(work) for work in works])
    seconds, busy = np.moveaxis(np.array(taken), 2, 0)
    seconds = seconds / np.array([frames, frames, frames, plain_frames])
    hashing, decoding, tracking, plain = seconds.T
    quarter, half, most = np.percentile(decoding / tracking, [25, 50, 75])
    calls, rms_px = track(path, threads)
    print(
        f"{codec}, {threads} decoder thread(s): tracking / decoding {half:.2f} ({quarter:.2f} to {most:.2f}), "
        f"tracking / plain loop {np.median(plain / tracking):.1f} of {np.median(plain / decoding):.1f} "
        f"({', '.join(f'{1 / np.median(one):.0f}' for one in (tracking, decoding, plain))} fps); "
        f"hashing for {1e3 * HASHED_S:.1f} ms a frame / decoding {np.median(decoding / hashing):.2f}; "
        f"processor time tracking / decoding {np.median(busy[:, 2] / busy[:, 1]):.2f}; "
        f"detector calls {calls} in {frames} frames; RMS of the centres {rms_px:.4f} px",
        flush=True,
    )


def measure(work: Callable[[], object]) -> tuple[float, float]:
    """Return the seconds that a piece of work takes, on the clock and of the processors."""
    start, busy = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - start, time.process_time() - busy


def decode(path: Path, threads: int) -> None:
    """Decode a video, and nothing else."""
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        stream.codec_context.thread_count = threads
        stream.codec_context.thread_type = "AUTO" if threads > 1 else "NONE"
        for _ in container.decode(stream):
            pass


def hash_beside(path: Path, threads: int, hashed: bytes) -> None:
    """Decode as the tracker does, and hash some bytes for each image."""
    with read_frames(path, read_clock(path), decoder_threads=threads, full_range=False) as frames:
        for _ in frames:
            hashlib.sha256(hashed)


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


if __name__ == "__main__":
    main()
