"""The whole of `identify` on flexible.mp4: against decoding alone, and against the plain loop.

Every line is a ratio from this one run, each side with the same number of decoder threads. The plain loop is what a
script does: cv2.VideoCapture, and pupil-apriltags with its defaults on every whole frame.

    python benchmarks/identify.py [--threads N] [--repeats N]
"""

import argparse
import multiprocessing
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

SAMPLE = Path(__file__).parents[1] / "sample_data" / "flexible.mp4"
TIMES_LONGER = 10


def decode(threads: int) -> int:
    """Decode the sample with PyAV and look at nothing; return how many frames it has."""
    import av

    with av.open(str(SAMPLE)) as container:
        stream = container.streams.video[0]
        stream.codec_context.thread_count = threads
        return sum(1 for _ in container.decode(stream))


def detect_every_frame(threads: int) -> None:
    """Run the plain loop."""
    import cv2
    import pupil_apriltags

    detector = pupil_apriltags.Detector(nthreads=1)  # more than one crashes at exit beside PyAV
    capture = cv2.VideoCapture(str(SAMPLE), cv2.CAP_FFMPEG, [cv2.CAP_PROP_N_THREADS, threads])
    while True:
        read, frame = capture.read()
        if not read:
            return
        detector.detect(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY))


def track(threads: int) -> None:
    """Track the sample, decoding beside it."""
    from tagsway.model import Settings
    from tagsway.pipeline.recording import track_video

    track_video(SAMPLE, Settings(), decoder_threads=threads)


def run_whole(threads: int) -> None:
    """Run `identify`, page and figures included, without keeping steps."""
    from tagsway.model import Settings
    from tagsway.pipeline import identify, write_measurement

    settings = Settings(tcp_tag_size_m=0.03, pcp_tag_size_m=0.03, mass_kg=0.225)
    with tempfile.TemporaryDirectory() as folder:
        write_measurement(identify(SAMPLE, settings, decoder_threads=threads), Path(folder))


def seconds(call: Callable[[int], object], threads: int) -> float:
    """Return how long one call takes."""
    start = time.perf_counter()
    call(threads)
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


def main() -> None:
    """Print the ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--threads", type=int, default=2, help="decoder threads, the same on all sides")
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()

    frames = decode(options.threads)
    calls = {"decode": decode, "track": track, "whole": run_whole}
    taken: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(options.repeats):
        for name, call in calls.items():
            taken[name].append(seconds(call, options.threads))
    with multiprocessing.get_context("spawn").Pool(1) as alone:  # the two AprilTag packages do not share a process
        plain = alone.apply(seconds, (detect_every_frame, options.threads))

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


if __name__ == "__main__":
    main()
