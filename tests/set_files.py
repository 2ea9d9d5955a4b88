"""Sets of small tracks with known frequencies, and a crew that works in this process."""

import json
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import numpy as np

RATE_HZ = 200


def write_decay(
    path: Path, *, frequency_hz: float, damping_ratio: float = 0.02, seed: int = 0, seconds: float = 2.5
) -> Path:
    """Write a free decay as a table: 20 mm at first, noise of 0.05 mm."""
    rng, time = np.random.default_rng(seed), np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    omega = 2 * np.pi * frequency_hz
    swing = np.cos(omega * np.sqrt(1 - damping_ratio**2) * time)
    x = 20 * np.exp(-damping_ratio * omega * time) * swing + 0.05 * rng.normal(size=len(time))
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [f"{t:.4f},{value:.4f}" for t, value in zip(time, x, strict=True)]
    path.write_text("\n".join(["t,x", *rows]) + "\n")
    return path


def write_set(root: Path, frequencies: dict[str, list[float]]) -> Path:
    """Write a folder of subsets, a decay for each frequency."""
    for subset, values in frequencies.items():
        for number, value in enumerate(values):
            write_decay(root / subset / f"r{number}.csv", frequency_hz=value, seed=number)
    return root


class InlineCrew:
    """One thread of this process."""

    def __init__(self, executor: Executor) -> None:
        self.executor, self.slots = executor, 1

    def renew(self) -> None:
        raise AssertionError("a thread does not die")

    def take_back(self, future: Future) -> bool:
        return future.cancel()

    def died(self, fault: BaseException) -> bool:
        return isinstance(fault, BrokenExecutor)


@contextmanager
def inline() -> Iterator[InlineCrew]:
    with ThreadPoolExecutor(1) as executor:
        yield InlineCrew(executor)


def events(out: Path, *names: str) -> list[str]:
    """Return the files of which the log of attempts tells these events."""
    lines = [json.loads(line) for line in (out / "attempts.jsonl").read_text().splitlines()]
    return [line["file"] for line in lines if line["event"] in names]


def tables(out: Path) -> dict[str, bytes]:
    """Return everything that a set's results come to, byte for byte: all but the logs and the kept steps."""
    logs = ("attempts.jsonl", "files.jsonl", ".lock", "steps", "results")
    files = {path.relative_to(out): path for path in sorted(out.rglob("*")) if path.is_file()}
    return {str(name): path.read_bytes() for name, path in files.items() if name.parts[0] not in logs}
