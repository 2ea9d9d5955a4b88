"""The set of 300: two sets of six subsets of 25 rendered videos, with known spread, outliers and five broken files.

    python benchmarks/sets.py [--repeats N] [--keep FOLDER]

Renders the videos, runs `identify batch` on them once, and holds the summary against what was rendered: medians and
deviations of each subset, outliers rejected, broken files named, exit code, the share of the pick position, and the
effects of the factors. In the first set the pick position varies and widens the spread of f_n, in the second it is
held.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from set_films import OUTLIERS, Film, plan_films, render_set

BATCH = [sys.executable, "-m", "tagsway", "batch"]


def judge(films: list[Film], out: Path, returncode: int, stderr: str) -> list[str]:
    """Return what is not as it was rendered; print what is."""
    faults = []
    table = pd.read_csv(out / "measurements.csv", keep_default_na=False, na_values=[""]).set_index("file")
    summary = pd.read_csv(out / "summary.csv")
    broken = {film.name: film.fault for film in films if film.fault}
    failed = table[table["status"].isin(["failed", "not_determined"])]
    print(f"exit code {returncode}; {len(table)} rows, {len(failed)} without a number:")
    for name, row in failed.iterrows():
        print(f"  {name} ({broken.get(str(name), 'SOUND')}): {row['status']}: {row['error']}")
    if set(failed.index) != set(broken) or returncode != 4 or not all(name in stderr for name in broken):
        faults.append("the broken files, and they alone, are to be named")
    outliers = {film.name for film in films} & set(OUTLIERS)
    rejected = set(table.index[table["rejected_by"].notna()])
    print(
        f"outliers rejected: {len(rejected & outliers)} of {len(outliers)}; others rejected: {len(rejected - outliers)}"
    )
    if not outliers <= rejected:
        faults.append(f"kept: {outliers - rejected}")
    truth = pd.DataFrame({"file": film.name, "f": film.frequency_hz, "zeta": film.damping_ratio} for film in films)
    both = table.join(truth.set_index("file"))
    used = both[both["rejected_by"].isna() & both["natural_frequency_hz"].notna()]
    pulls = (used["natural_frequency_hz"] - used["f"]) / used["natural_frequency_std_hz"]
    print(f"f_n: rms error {np.sqrt(np.mean((used['natural_frequency_hz'] - used['f']) ** 2)):.1e} Hz, ", end="")
    print(f"{np.mean(np.abs(pulls) < 1.96):.3f} within their 95 % intervals")
    print(f"{'subset':<18} {'n':>3} {'f_n':>8} {'truth':>8} {'± %':>6} {'truth':>6} {'s':>7} {'truth':>7}   ζ, truth")
    for row in summary.to_dict("records"):
        if row["subset"] == "(all)":
            continue
        own = used[used["subset"] == row["subset"]]
        true = own["f"]
        deviation = 100 * (true.max() - true.min()) / (true.max() + true.min())
        told = [row[f"natural_frequency_{name}"] for name in ("median_hz", "deviation_percent", "s_hz")]
        expected = [true.median(), deviation, true.std()]
        line = (
            f"{row['subset']:<18} {row['used']:>3} {told[0]:8.4f} {expected[0]:8.4f} {told[1]:6.2f} {expected[1]:6.2f} "
        )
        print(
            f"{line}{told[2]:7.4f} {expected[2]:7.4f}   {row['damping_ratio_median']:.5f}, {own['zeta'].median():.5f}"
        )
        if not np.allclose(told, expected, rtol=[1e-3, 0.02, 0.02]):
            faults.append(f"{row['subset']}: {told} for {expected}")
    for name in ("shares.csv", "effects.csv"):
        if (out / name).exists():
            columns = [] if name == "shares.csv" else ["n", "unit"]
            print(f"{name}\n{pd.read_csv(out / name).drop(columns=columns).to_string(index=False)}")
    return faults


def main() -> None:
    """Render, measure, judge."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=25, help="of each of the 12 subsets")
    parser.add_argument("--keep", type=Path, help="folder for videos and results, which are kept there")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        root = options.keep or Path(scratch)
        start = time.perf_counter()
        films = plan_films(options.repeats)
        render_set(root / "set", films)
        print(f"{len(films)} videos rendered in {time.perf_counter() - start:.0f} s")
        start, out = time.perf_counter(), root / "out"
        command = [*BATCH, str(root / "set"), "--out", str(out)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        seconds = time.perf_counter() - start
        entries = [json.loads(line) for line in (out / "attempts.jsonl").read_text().splitlines()]
        own = sum(entry.get("cpu_seconds", 0.0) for entry in entries)
        print(f"measured in {seconds:.0f} s; processor time in the videos {own:.0f} s\n{done.stdout}")
        faults = judge(films, out, done.returncode, done.stderr)
    print("as it was rendered" if not faults else "NOT AS RENDERED: " + "; ".join(faults))
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
