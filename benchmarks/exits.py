"""Whether `identify` ever crashes as it ends: many runs in a row, each a process of its own.

A detector in C, a decoder with threads and an interpreter that shuts down are a place where a run may die after writing
its result. Prints runs that ended otherwise than they should ÷ runs.

    python benchmarks/exits.py [--runs N]
    python benchmarks/exits.py --starts N

With `--starts` each process only starts what may crash it: a decoder with threads and two detectors, for a few frames.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

SAMPLE = Path(__file__).parents[1] / "sample_data" / "released.mp4"
START = """
import sys
from itertools import islice
from tagsway.tags.find import find_tags
from tagsway.tags.follow import follow_tags
from tagsway.video.reading import read_clock, read_frames
with read_frames(sys.argv[1], read_clock(sys.argv[1]), decoder_threads=2) as frames:
    few = list(islice(frames, 6))
tracks = follow_tags(few, family="tag36h11", tag_ids=[0, 1])
find_tags(few[0].grey, family="tag25h9")
sys.exit(0 if all(tag.seen.all() for tag in tracks.tags) and len(tracks.tags) == 2 else 7)
"""


def main() -> None:
    """Print the share of runs that did not end well."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--starts", type=int, default=0)
    options = parser.parse_args()
    if options.starts > 0:
        start_often(options.starts)
    else:
        run_often(options.runs)


def start_often(starts: int) -> None:
    """Start decoder and detectors, and nothing else."""
    bad = []
    for start in range(starts):
        done = subprocess.run([sys.executable, "-c", START, str(SAMPLE)], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            bad.append((start, done.returncode, done.stderr.strip()))
    tell(bad, starts, "starts of decoder and detectors")


def run_often(runs: int) -> None:
    """Run the whole of `identify`."""
    bad = []
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        command = [sys.executable, "-m", "tagsway", str(SAMPLE), "--tag-size", "30", "--out", str(out), "--quiet"]
        for run in range(runs):
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                bad.append((run, done.returncode, done.stderr.strip()))
            for kept in (out / ".steps").glob("*"):
                kept.unlink()  # each run tracks anew
    tell(bad, runs, "runs")


def tell(bad: list[tuple[int, int, str]], count: int, what: str) -> None:
    """Print how many did not end well."""
    for number, code, words in bad:
        print(f"number {number} ended with {code}: {words}")
    print(f"{SAMPLE.name}: {what} that ended otherwise than with 0 ÷ all: {len(bad)}/{count}")


if __name__ == "__main__":
    main()
