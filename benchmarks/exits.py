"""Whether `identify` ever crashes as it ends: many runs in a row, each a process of its own.

A detector in C, a decoder with threads and an interpreter that shuts down are a place where a run may die after writing
its result. Prints runs that ended otherwise than they should ÷ runs.

    python benchmarks/exits.py [--runs N]
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import av

SAMPLE = Path(__file__).parents[1] / "sample_data" / "released.mp4"
FRAMES = 320


def shorten(video: Path, target: Path) -> None:
    """Copy the first frames of a video without encoding them again."""
    with av.open(str(video)) as source, av.open(str(target), "w") as sink:
        stream = source.streams.video[0]
        copy = sink.add_stream_from_template(stream)
        for count, packet in enumerate(source.demux(stream)):
            if packet.dts is None or count >= FRAMES:
                break
            packet.stream = copy
            sink.mux(packet)


def main() -> None:
    """Print the share of runs that did not end well."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=200)
    runs = parser.parse_args().runs
    bad = []
    with tempfile.TemporaryDirectory() as folder:
        clip, out = Path(folder) / "clip.mp4", Path(folder) / "out"
        shorten(SAMPLE, clip)
        command = [sys.executable, "-m", "tagsway", str(clip), "--tag-size", "30", "--out", str(out), "--quiet"]
        for run in range(runs):
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                bad.append((run, done.returncode, done.stderr.strip()))
            for kept in (out / ".steps").glob("*"):
                kept.unlink()  # each run tracks anew
    for run, code, words in bad:
        print(f"run {run} ended with {code}: {words}")
    print(f"{SAMPLE.name}, first {FRAMES} frames: runs that ended otherwise than with 0 ÷ runs: {len(bad)}/{runs}")


if __name__ == "__main__":
    main()
