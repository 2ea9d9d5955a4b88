"""The whole of `identify`, page and figures included: against decoding alone, and against the plain loop.

Every line is a ratio from this one run, each side with the same number of decoder threads. The plain loop is what a
script does: cv2.VideoCapture, and pupil-apriltags with its defaults on every whole frame. Beside the short sample there
is a clip of a minute, 1280 × 1024 in H.264 with crf 18, which is drawn and encoded first (some minutes; --clip keeps
it), and a table of what its time is spent on.

    python benchmarks/identify.py [--threads N] [--repeats N] [--seconds S] [--clip FILE]
"""

import argparse
import multiprocessing
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does: the decoder needs the cores

import cv2
import numpy as np

import tagsway.pipeline.assembling as assembling
import tagsway.pipeline.measurement as stages
import tagsway.pipeline.output as outputs
import tagsway.report.figures as figures
from tagsway.model import GRAVITY_M_S2, FloatArray, GreyArray, Settings
from tagsway.pipeline import identify, write_measurement
from tagsway.pipeline.recording import track_video
from tagsway.video.writing import write_video

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from tag_images import make_pose, see_tag

SAMPLE = Path(__file__).parents[1] / "sample_data" / "flexible.mp4"
TIMES_LONGER = 10
WIDTH, HEIGHT, SIDE_PX, PENDULUM_PX, FPS = 1280, 1024, 60.0, 330.0, 200.0
SETTINGS = Settings(tcp_tag_size_m=0.03, pcp_tag_size_m=0.03, mass_kg=0.225)
STAGES = {
    "track": (stages, "read_recording"),
    "clean": (stages, "clean_track"),
    "events": (stages, "find_events"),
    "window": (stages, "find_free_vibration"),
    "mode": (stages, "identify_modes"),
    "pendulum": (stages, "fit_pendulum"),
    "indicators": (assembling, "measure_indicators"),
    "write everything": (outputs, "_write_all"),
    "  of this, figures": (figures, "write_figures"),
    "  of this, page": (outputs, "render_page"),
}


def decode(video: Path, threads: int) -> int:
    """Decode a video with PyAV and look at nothing; return how many frames it has."""
    import av

    with av.open(str(video)) as container:
        stream = container.streams.video[0]
        stream.codec_context.thread_count = threads
        return sum(1 for _ in container.decode(stream))


def detect_every_frame(video: Path, threads: int) -> None:
    """Run the plain loop."""
    import pupil_apriltags

    detector = pupil_apriltags.Detector(nthreads=1)  # more than one crashes at exit beside PyAV
    capture = cv2.VideoCapture(str(video), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, threads])
    while True:
        read, frame = capture.read()
        if not read:
            return
        detector.detect(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY))


def track(video: Path, threads: int) -> None:
    """Track a video, decoding beside it."""
    track_video(video, Settings(), decoder_threads=threads)


def run_whole(video: Path, threads: int) -> None:
    """Run `identify`, page and figures included, without keeping steps."""
    with tempfile.TemporaryDirectory() as folder:
        write_measurement(identify(video, SETTINGS, decoder_threads=threads), Path(folder))


def film(seconds: float) -> Iterator[GreyArray]:
    """Draw a move and a long free decay: two tags before a mottled wall, noise of three grey levels."""
    rng = np.random.default_rng(0)
    wall = cv2.GaussianBlur(rng.normal(size=(HEIGHT, WIDTH)), (0, 0), 9)
    wall = 120 + 35 * wall / wall.std()
    flat = np.rint(wall).astype(np.uint8)
    noise = np.rint(rng.normal(scale=3.0, size=(8, HEIGHT, WIDTH))).astype(np.int16)
    for x, angle in zip(*move_and_sway(np.arange(round(seconds * FPS)) / FPS), strict=True):
        image = flat.copy()
        product = (x + PENDULUM_PX * np.sin(angle), 300 + PENDULUM_PX * np.cos(angle))
        for tag_id, (centre, turn) in enumerate((((x, 300.0), 0.0), (product, angle))):
            left, top = (int(place - 1.2 * SIDE_PX) for place in centre)
            place = (slice(top, top + int(2.4 * SIDE_PX)), slice(left, left + int(2.4 * SIDE_PX)))
            pose = make_pose((centre[0] - left, centre[1] - top), SIDE_PX, turn)
            patch = see_tag(pose, wall[place].shape, tag_id=tag_id, onto=wall[place])
            image[place] = np.clip(np.rint(patch), 0, 255)
        yield cv2.add(image, noise[rng.integers(8)], dtype=cv2.CV_8U)


def move_and_sway(time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the tool's place in pixels and the payload's angle: half a second's move, then a decay with ζ = 0.004.

    A point mass on a spring, so that the pendulum's fit has to do what it does for a payload.
    """
    share = np.clip((time_s - 0.5) / 0.5, 0, 1)
    x = 400 + 480 * share**3 * (10 - 15 * share + 6 * share**2)
    push = np.gradient(np.gradient(x, time_s), time_s) / PENDULUM_PX
    length = PENDULUM_PX * SETTINGS.pcp_tag_size_m / SIDE_PX
    gravity, wn, parts = GRAVITY_M_S2 / length, 2 * np.pi * 2.3, 16
    angles, angle, rate = np.zeros(len(time_s)), 0.0, 0.0
    for k in range(1, len(time_s)):
        for _ in range(parts):
            spring = gravity * np.sin(angle) + (wn**2 - gravity) * angle
            rate -= (push[k] * np.cos(angle) + spring + 2 * 0.004 * wn * rate) / (parts * FPS)
            angle += rate / (parts * FPS)
        angles[k] = angle
    return x, angles


def print_spent(video: Path, threads: int) -> None:
    """Print what the time of one run is spent on: seconds, and CPU seconds of all threads."""
    spent: dict[str, tuple[float, float]] = {}

    def timed(label: str, call: Callable[..., object]) -> Callable[..., object]:
        def run(*args: object, **options: object) -> object:
            wall, cpu = time.perf_counter(), time.process_time()
            try:
                return call(*args, **options)
            finally:
                spent[label] = (time.perf_counter() - wall, time.process_time() - cpu)

        return run

    kept = {label: getattr(module, name) for label, (module, name) in STAGES.items()}
    for label, (module, name) in STAGES.items():
        setattr(module, name, timed(label, kept[label]))
    try:
        timed("all", run_whole)(video, threads)
    finally:
        for label, (module, name) in STAGES.items():
            setattr(module, name, kept[label])
    for label, (wall, cpu) in spent.items():
        print(f"    {label:20s}{wall:8.2f} s{cpu:8.2f} s of CPU")


def compare_minute(video: Path, threads: int, repeats: int) -> None:
    """Print the ratio for a long clip, and what the time is spent on."""
    frames = decode(video, threads)
    taken = [(seconds(decode, video, threads), seconds(run_whole, video, threads)) for _ in range(repeats)]
    ratio = statistics.median(alone / whole for alone, whole in taken)
    print(f"{video.name}: {frames} frames of {WIDTH} × {HEIGHT}, {threads} decoder threads, median of {repeats} runs")
    print(f"whole identify, frames per second ÷ decoding alone: {ratio:.2f}")
    print(f"  decoding alone {min(alone for alone, _ in taken):.2f} s; one run of the whole:")
    print_spent(video, threads)


def seconds(call: Callable[[Path, int], object], video: Path, threads: int) -> float:
    """Return how long one call takes."""
    start = time.perf_counter()
    call(video, threads)
    return time.perf_counter() - start


def peak_memory_mb(video: Path) -> float:
    """Return the peak memory of a run of its own over a video."""
    code = "import sys; from tagsway.cli.app import run; run(sys.argv[1:])"
    with tempfile.TemporaryDirectory() as folder:
        child = subprocess.Popen([sys.executable, "-c", code, str(video), "--quiet", "--out", folder])
        _, status, used = os.wait4(child.pid, 0)
    if status != 0:
        raise SystemExit(f"identify ended with status {status} on {video}")
    return used.ru_maxrss / 1024


def longer(video: Path, folder: Path) -> Path:
    """Return a copy of a video that shows it several times over, forwards only, without encoding it again."""
    import av

    target = folder / "longer.mp4"
    with av.open(str(target), "w") as sink:
        copy, offset = None, 0
        for _ in range(TIMES_LONGER):
            with av.open(str(video)) as source:
                stream = source.streams.video[0]
                copy = copy or sink.add_stream_from_template(stream)
                last = 0
                for packet in source.demux(stream):
                    if packet.dts is None:
                        continue
                    last = max(last, packet.pts + packet.duration)
                    packet.pts, packet.dts, packet.stream = packet.pts + offset, packet.dts + offset, copy
                    sink.mux(packet)
                offset += last
    return target


def compare_sample(options: argparse.Namespace) -> None:
    """Print the ratios for the sample, and its peak memory beside a longer one's."""
    frames = decode(SAMPLE, options.threads)
    calls = {"decode": decode, "track": track, "whole": run_whole}
    taken: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(options.repeats):
        for name, call in calls.items():
            taken[name].append(seconds(call, SAMPLE, options.threads))
    with multiprocessing.get_context("spawn").Pool(1) as alone:  # the two AprilTag packages do not share a process
        plain = alone.apply(seconds, (detect_every_frame, SAMPLE, options.threads))

    def ratio(a: str, b: str) -> float:
        return statistics.median(x / y for x, y in zip(taken[a], taken[b], strict=True))

    print(f"{SAMPLE.name}: {frames} frames, {options.threads} decoder threads, median of {options.repeats} runs")
    print(f"tracking, frames per second ÷ decoding alone: {ratio('decode', 'track'):.2f}")
    print(f"tracking, frames per second ÷ plain loop: {plain / statistics.median(taken['track']):.1f}")
    print(f"whole identify, frames per second ÷ decoding alone: {ratio('decode', 'whole'):.2f}")
    print(f"whole identify, frames per second ÷ plain loop: {plain / statistics.median(taken['whole']):.1f}")
    with tempfile.TemporaryDirectory() as folder:
        short = peak_memory_mb(SAMPLE)
        long = peak_memory_mb(longer(SAMPLE, Path(folder)))
    print(f"peak memory, {TIMES_LONGER} times the length ÷ the sample: {long / short:.2f} ({short:.0f} MB)")


def main() -> None:
    """Print the ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--threads", type=int, default=2, help="decoder threads, the same on all sides")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=60.0, help="length of the long clip")
    parser.add_argument("--clip", type=Path, help="where the long clip is, or is to be kept")
    options = parser.parse_args()

    with tempfile.TemporaryDirectory() as folder:
        clip = options.clip or Path(folder) / "minute.mp4"
        if not clip.exists():
            write_video(clip, film(options.seconds), fps_hz=FPS, codec="h264", quality=18.0)
        compare_minute(clip, options.threads, min(options.repeats, 3))
    compare_sample(options)


if __name__ == "__main__":
    main()
