"""Workers that die: nothing is lost, nothing is done twice, and only the culprit pays."""

import multiprocessing
import os
import signal
from multiprocessing import forkserver
from pathlib import Path

import pytest

from set_files import events, inline, tables, write_set
from tagsway.sets.batch import measure_set, missing_jobs, write_batch
from tagsway.sets.jobs import Job, Outcome, measure
from tagsway.sets.ledger import open_ledger
from tagsway.sets.manifest import find_set
from tagsway.sets.running import WORKER_DIED, Runner
from tagsway.sets.workers import FORKED, local_crew


def crash_on_r2(job: Job) -> Outcome:
    """Die without a word, as a decoder does."""
    if job.item.name.endswith("r2.csv"):
        os._exit(11)
    return measure(job)


@pytest.fixture
def root(tmp_path) -> Path:
    return write_set(tmp_path / "set", {"a": [2.0, 2.1, 2.05, 2.2, 2.15, 2.3]})


@pytest.fixture
def undisturbed(root, tmp_path) -> dict[str, bytes]:
    with open_ledger(tmp_path / "undisturbed") as ledger:
        measure_set(root, ledger, inline, begin=lambda *_: None, report=lambda _: None)
    return tables(tmp_path / "undisturbed")


@pytest.mark.slow
def test_a_worker_that_is_killed_costs_nothing(root, tmp_path, undisturbed) -> None:
    out, killed = tmp_path / "out", []

    def kill_one(_: Outcome) -> None:
        if not killed:
            killed.append(multiprocessing.active_children()[0])
            killed[0].kill()

    with open_ledger(out) as ledger:
        measure_set(root, ledger, lambda: local_crew(2), begin=lambda *_: None, report=kill_one)
    assert tables(out) == undisturbed
    assert sorted(events(out, "finished")) == sorted(set(events(out, "started")))
    assert events(out, "lost"), "a worker was killed while it had a file"


@pytest.mark.slow
@pytest.mark.skipif(not FORKED, reason="each worker loads for itself there")
def test_the_process_that_workers_are_copied_from_may_be_killed_too(root, tmp_path, undisturbed) -> None:
    out, killed = tmp_path / "out", []

    def kill_it(_: Outcome) -> None:
        if not killed:
            worker = multiprocessing.active_children()[0].pid
            killed.append(int(Path(f"/proc/{worker}/stat").read_text().rpartition(")")[2].split()[1]))
            assert killed[0] != os.getpid()
            os.kill(killed[0], signal.SIGKILL)

    with open_ledger(out) as ledger:
        measure_set(root, ledger, lambda: local_crew(2), begin=lambda *_: None, report=kill_it)
    assert tables(out) == undisturbed
    assert len(events(out, "finished")) == len(set(events(out, "finished"))) == 6


@pytest.mark.slow
@pytest.mark.skipif(not FORKED, reason="each worker loads for itself there")
def test_one_that_is_dying_and_refuses_is_waited_for(root, tmp_path, undisturbed, monkeypatch) -> None:
    start, refusals = forkserver.connect_to_new_process, iter([ConnectionRefusedError(), EOFError(), BrokenPipeError()])

    def refuse_thrice(fds):  # what is there for some milliseconds after a kill, held open
        for refusal in refusals:
            raise refusal
        return start(fds)

    monkeypatch.setattr(forkserver, "connect_to_new_process", refuse_thrice)
    out = tmp_path / "out"
    with open_ledger(out) as ledger:
        measure_set(root, ledger, lambda: local_crew(2), begin=lambda *_: None, report=lambda _: None)
    assert tables(out) == undisturbed
    assert len(events(out, "finished")) == len(set(events(out, "finished"))) == 6
    assert next(refusals, None) is None


@pytest.mark.slow
def test_a_file_that_crashes_its_worker_is_tried_again_and_pays_alone(root, tmp_path) -> None:
    out = tmp_path / "out"
    found = find_set(root)
    with open_ledger(out) as ledger:
        with local_crew(2) as crew:
            Runner(crew, ledger, lambda _: None, work=crash_on_r2).run(missing_jobs(found.items, ledger))
        table = write_batch(found, ledger).tables.measurements.set_index("file")
    assert table.loc["a/r2.csv", "error"] == WORKER_DIED
    assert (table["status"] == "failed").sum() == 1
    assert sorted(events(out, "finished")) == [f"a/r{n}.csv" for n in (0, 1, 3, 4, 5)]
    with open_ledger(out) as ledger:  # another run, on a sound machine, does what is missing
        measure_set(root, ledger, inline, begin=lambda *_: None, report=lambda _: None)
    assert events(out, "finished")[-1] == "a/r2.csv"
    assert len(events(out, "finished")) == 6
