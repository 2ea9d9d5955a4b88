"""`identify batch --cluster`: a real Dask scheduler and two worker processes on this machine."""

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from set_files import events, inline, tables, write_set
from tagsway.sets.batch import measure_set
from tagsway.sets.ledger import open_ledger

pytest.importorskip("distributed")

BATCH = [sys.executable, "-m", "tagsway", "batch"]
PATIENCE_S = 180


@pytest.fixture
def cluster(tmp_path) -> Iterator[tuple[str, list["subprocess.Popen[bytes]"]]]:
    """A scheduler's address and its two workers."""
    note = tmp_path / "scheduler.json"
    here = ["--scheduler-file", str(note)]
    log = (tmp_path / "dask.log").open("wb")
    with ExitStack() as stack:
        stack.enter_context(log)

        def start(*arguments: str) -> "subprocess.Popen[bytes]":
            process = subprocess.Popen([sys.executable, "-m", "dask", *arguments], stdout=log, stderr=log)
            stack.callback(process.wait)
            stack.callback(process.kill)
            return process

        start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", *here)
        wait_until(note.exists)
        one = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(tmp_path / "scratch"))
        workers = [start("worker", *here, *one) for _ in range(2)]
        yield json.loads(note.read_text())["address"], workers


def wait_until(condition) -> None:
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.slow
def test_a_cluster_gives_the_same_tables_also_when_a_worker_is_killed_in_the_middle(tmp_path, cluster) -> None:
    address, workers = cluster
    root = write_set(
        tmp_path / "set", {"a": [2.0 + 0.01 * n for n in range(8)], "b": [2.4 + 0.01 * n for n in range(8)]}
    )
    (root / "a" / "empty.mp4").touch()

    def arguments(out: Path, *options: str) -> list[str]:
        return [*BATCH, str(root), "--out", str(out), "--quiet", *options]

    with open_ledger(tmp_path / "here") as ledger:
        measure_set(root, ledger, inline, begin=lambda *_: None, report=lambda _: None)
    assert subprocess.run(arguments(tmp_path / "there", "--cluster", address), check=False).returncode == 4
    with subprocess.Popen(arguments(tmp_path / "killed", "--cluster", address)) as batch:
        log = tmp_path / "killed" / "attempts.jsonl"
        wait_until(lambda: log.exists() and len(events(log.parent, "finished")) >= 2)
        workers[0].kill()
        assert batch.wait(PATIENCE_S) == 4
    assert len(events(log.parent, "finished")) == 17
    assert tables(tmp_path / "here") == tables(tmp_path / "there") == tables(tmp_path / "killed")


@pytest.mark.slow
def test_an_address_where_no_scheduler_answers_is_refused(tmp_path) -> None:
    root = write_set(tmp_path / "set", {"a": [2.0]})
    command = [*BATCH, str(root), "--out", str(tmp_path / "out"), "--cluster", "nowhere:1"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "no Dask scheduler answers" in done.stderr
