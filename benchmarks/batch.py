"""Sets: scaling over workers, deaths at random moments, and a hundred thousand rows.

    python benchmarks/batch.py scaling [--files N]
    python benchmarks/batch.py kills [--kills N]
    python benchmarks/batch.py rows [--rows N]

scaling  the same rendered videos with 1 and 2 workers: time ÷ time, and what the set costs beside its videos
kills    kill -9 of the main process and of workers in turn: are the tables those of an undisturbed run?
rows     summary and figures of generated rows: seconds, and the peak of memory
"""

import argparse
import ctypes
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

SAMPLE = Path(__file__).parents[1] / "sample_data" / "released.mp4"
BATCH = [sys.executable, "-m", "tagsway", "batch"]
LOGS = ("attempts.jsonl", "files.jsonl", ".lock", "steps")
"""In the folder of results: what tells how it came about, not what came out."""


def main() -> None:
    """Run the part that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", nargs="?", default="scaling", choices=["scaling", "kills", "rows"])
    parser.add_argument("--files", type=int, default=100)
    parser.add_argument("--kills", type=int, default=10)
    parser.add_argument("--rows", type=int, default=100_000)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        if options.part == "scaling":
            measure_scaling(root, options.files)
        elif options.part == "kills":
            kill_often(root, options.kills, options.files)
        else:
            tabulate_many(root, options.rows)


def make_copies(root: Path, files: int) -> Path:
    """Fill a set with copies of the sample, each of its own content: a box of free space behind the film."""
    for number in range(files):
        path = root / "set" / f"s{number % 2}" / f"r{number}.mp4"
        path.parent.mkdir(parents=True, exist_ok=True)
        box = number.to_bytes(8, "big")
        path.write_bytes(SAMPLE.read_bytes() + (8 + len(box)).to_bytes(4, "big") + b"free" + box)
    lines = [f"s{n % 2}/r{n}.mp4,{'AB'[n % 2]},{500 + 50 * (n // 2 % 2)}" for n in range(files)]
    (root / "set" / "set.csv").write_text("\n".join(["file,gripper,vacuum_mbar", *lines]) + "\n")
    return root / "set"


def read_results(out: Path) -> dict[str, bytes]:
    """Return all that a set's results come to, byte for byte: tables, figures, pages, shapers, results."""
    files = [path for path in sorted(out.rglob("*")) if path.is_file()]
    names = {path: path.relative_to(out) for path in files}
    return {str(name): path.read_bytes() for path, name in names.items() if name.parts[0] not in LOGS}


def measure_scaling(root: Path, files: int) -> None:
    """Print time with 1 worker ÷ 2 workers, and the overhead beside the videos' own time."""
    path = make_copies(root, files)
    adopt_orphans()
    costs = {workers: run_set(path, root / f"out{workers}", workers) for workers in (1, 2)}
    for workers, cost in costs.items():
        print(
            f"{workers} workers: {cost.clock_s:.1f} s, of which {cost.films_clock_s / workers:.1f} s in the videos; "
            f"processor time {cost.cpu_s:.1f} s, of which {cost.films_cpu_s:.1f} s in the videos"
        )
    one, two = costs[1], costs[2]
    print(f"time of 1 worker ÷ 2 workers, {files} videos: {one.clock_s / two.clock_s:.2f}")
    print(f"time beside the videos' own, 1 worker: {100 * (one.clock_s / one.films_clock_s - 1):.1f} %")
    print(f"processor time beside the videos' own, 1 worker: {100 * (one.cpu_s / one.films_cpu_s - 1):.1f} %")
    print(
        f"on free cores, by processor time, what is beside the videos one after the other: {one.path_s:.1f} s ÷ "
        f"{two.path_s:.1f} s = {one.path_s / two.path_s:.2f}"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """What a set took, in s: of the clock and of processor time, in all and in its videos.

    `path_s` is the processor time of the busiest worker's videos and of all that is beside videos.
    """

    clock_s: float
    cpu_s: float
    films_clock_s: float
    films_cpu_s: float
    path_s: float


def run_set(path: Path, out: Path, workers: int) -> Cost:
    """Measure a set and read what it took from the log of its attempts and from the system."""
    start, before = time.perf_counter(), children_cpu_s()
    subprocess.run([*BATCH, str(path), "--out", str(out), "--workers", str(workers), "--quiet"], check=True)
    clock_s, cpu_s = time.perf_counter() - start, children_cpu_s() - before
    lines = [json.loads(line) for line in (out / "attempts.jsonl").read_text().splitlines()]
    done = pd.DataFrame([line for line in lines if line["event"] == "finished"])
    films_cpu_s = done["cpu_seconds"].sum()
    longest = done.groupby("worker")["cpu_seconds"].sum().max()
    return Cost(
        clock_s=clock_s,
        cpu_s=cpu_s,
        films_clock_s=done["seconds"].sum(),
        films_cpu_s=films_cpu_s,
        path_s=cpu_s - films_cpu_s + longest,
    )


def adopt_orphans() -> None:
    """Become the parent of what its own parent leaves behind, so that its processor time is known; Linux can."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(36, 1, 0, 0, 0)  # PR_SET_CHILD_SUBREAPER


def children_cpu_s() -> float:
    """Return the processor time of all processes that were started from here and have ended."""
    with suppress(ChildProcessError):
        while True:
            os.waitpid(-1, 0)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def kill_often(root: Path, kills: int, files: int) -> None:
    """Kill the main process or a worker at random moments until it is done; compare the tables."""
    path = make_copies(root, files)
    subprocess.run([*BATCH, str(path), "--out", str(root / "whole"), "--quiet"], check=True)
    chance = random.Random(0)
    out, left, mains, workers = root / "killed", kills, 0, 0
    while True:
        with subprocess.Popen([*BATCH, str(path), "--out", str(out), "--quiet"]) as process:
            while left and process.poll() is None:
                begun = chance.random() < 0.1  # mostly wait until there are workers, however slowly they start
                while not begun and process.poll() is None and not list_workers(process.pid):
                    time.sleep(0.05)
                time.sleep(chance.uniform(0.0, 5.0))
                running = list_workers(process.pid)
                if process.poll() is not None:
                    break
                left -= 1
                if running and workers <= mains:
                    os.kill(chance.choice(running), signal.SIGKILL)
                    workers += 1
                else:
                    process.kill()
                    mains += 1
            process.wait()
        if process.returncode == 0:
            break
    whole, again = read_results(root / "whole"), read_results(out)
    differ = sorted(name for name in whole.keys() | again.keys() if whole.get(name) != again.get(name))
    lines = [json.loads(line) for line in (out / "attempts.jsonl").read_text().splitlines()]
    done = [line["file"] for line in lines if line["event"] == "finished"]
    print(f"killed: the main process {mains} times, workers {workers} times")
    print(f"files of results alike to the last byte: {len(whole) - len(differ)} of {len(whole)} {differ or ''}")
    print(f"videos finished ÷ videos finished once: {len(done)}/{len(set(done))} of {files}")


def list_children(pid: int) -> list[int]:
    """Return the processes that a process has started."""
    path = Path(f"/proc/{pid}/task/{pid}/children")
    return [int(child) for child in path.read_text().split()] if path.exists() else []


def list_workers(pid: int) -> list[int]:
    """Return the workers of a batch: copies of a child that has loaded what they need."""
    return [worker for child in list_children(pid) for worker in list_children(child)]


def tabulate_many(root: Path, rows: int) -> None:
    """Write the results of many generated measurements, and time what a batch does with them."""
    from tagsway.model import Settings
    from tagsway.sets.batch import write_batch
    from tagsway.sets.jobs import Outcome, result_key
    from tagsway.sets.ledger import open_ledger
    from tagsway.sets.manifest import Item, MeasurementSet

    rng, settings = np.random.default_rng(0), Settings()
    decay_time = np.linspace(0, 2.5, 200)
    items = []
    with open_ledger(root / "out") as ledger:
        for number in range(rows):
            name = f"s{number % 12}/r{number}.mp4"
            factors = (("direction", "x" if number % 2 else "z"), ("vacuum_mbar", 500 + number % 3))
            item = Item(name=name, path=name, subset=f"s{number % 12}", factors=factors, settings=settings, picks=False)
            frequency = 2.4 + 0.03 * rng.normal()
            row = {
                "status": "ok",
                "error": None,
                "natural_frequency_hz": frequency,
                "natural_frequency_std_hz": 1e-3,
                "damping_ratio": 0.01 * np.exp(0.2 * rng.normal()),
                "damping_ratio_std": 1e-4,
            }
            sway = 20 * np.exp(-0.2 * decay_time) * np.cos(2 * np.pi * frequency * decay_time)
            decay = {"time_s": decay_time.round(4).tolist(), "sway": sway.round(4).tolist(), "unit": "mm"}
            lines = (json.dumps({"rows": [row]}), json.dumps({"result": {}, "decay": decay}))
            sha256 = f"{number:064x}"
            key = result_key(sha256, ledger.settings_digest(item))
            ledger.enter(item, Outcome(key=key, sha256=sha256, lines=lines), stamp=None)
            items.append(item)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        start, processor = time.perf_counter(), time.process_time()
        write_batch(MeasurementSet(name="many", root=root, items=tuple(items)), ledger)
        seconds, processor = time.perf_counter() - start, time.process_time() - processor
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    written = len(pd.read_csv(root / "out" / "measurements.csv", usecols=["file"]))
    print(
        f"{written} rows: tables and figures in {seconds:.1f} s ({processor:.1f} s of processor time), peak of memory "
        f"{peak / 1024:.0f} MB ({before / 1024:.0f} MB before)"
    )
    shutil.rmtree(root / "out")


if __name__ == "__main__":
    main()
