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

SAMPLE = Path(__file__).parents[1] / "sample_data" / "released.mp4"


def main() -> None:
    """Print the share of runs that did not end well."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=200)
    runs = parser.parse_args().runs
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
    for run, code, words in bad:
        print(f"run {run} ended with {code}: {words}")
    print(f"{SAMPLE.name}: runs that ended otherwise than with 0 ÷ runs: {len(bad)}/{runs}")


if __name__ == "__main__":
    main()
