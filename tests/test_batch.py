"""`identify batch`: options, exit codes, and a main process that is killed."""

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from set_files import events, tables, write_set
from tagsway.cli.app import run
from tagsway.sets.ledger import open_ledger

BATCH = [sys.executable, "-m", "tagsway", "batch"]
PATIENCE_S = 120


@pytest.fixture
def inside(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def ends_itself(how: str, *options: str) -> list[str]:
    """Return the command of a batch that is ended in the moment in which its first file is done, however slow it is."""
    script = (
        "import os, signal, sys, threading\n"
        "from tagsway.cli.app import run\n"
        "from tagsway.sets.ledger import Ledger\n"
        "note = Ledger.note\n"
        "def note_and_end(self, item, event, **details):\n"
        "    note(self, item, event, **details)\n"
        f"    if event == 'finished': {how}\n"
        "Ledger.note = note_and_end\n"
        "sys.exit(run(sys.argv[1:]))\n"
    )
    return [sys.executable, "-c", script, "batch", "set", "--out", "out", *options]


def until(condition, process: "subprocess.Popen[bytes]") -> None:
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert process.poll() is None, "the batch ended too early"
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["none"], "none"),
        (["set", "--workers", "0"], "--workers"),
        (["set", "--workers", "1", "--cluster", "tcp://127.0.0.1:1"], "--cluster"),
        (["empty"], "empty"),
        (["set", "--out", ""], "--out is empty"),
    ],
)
def test_a_set_that_cannot_be_used_ends_with_2_and_leaves_nothing(inside, capsys, arguments, word) -> None:
    write_set(inside / "set", {"a": [2.0]})
    (inside / "empty").mkdir()
    before = sorted(inside.rglob("*"))
    assert run(["batch", *arguments]) == 2
    assert word in capsys.readouterr().err
    assert sorted(inside.rglob("*")) == before


def test_a_batch_ends_with_0_or_with_4_and_names_what_failed(inside, capsys) -> None:
    write_set(inside / "set", {"a": [2.0, 2.1]})
    assert run(["batch", "set", "--workers", "1"]) == 0
    printed = capsys.readouterr()
    assert "2.0500" in printed.out
    (inside / "set" / "a" / "empty.mp4").touch()
    assert run(["batch", "set", "--workers", "1", "--quiet"]) == 4
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err == "failed: a/empty.mp4 is empty; give a video or a track as CSV\n"
    assert run(["shaper", "--from", "set-identify/measurements.csv", "--type", "auto"]) == 0


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="a process is killed in another way there")
def test_a_main_process_that_is_killed_takes_its_workers_along_and_the_next_run_goes_on(inside) -> None:
    write_set(inside / "set", {"a": [2.0 + 0.01 * n for n in range(6)]})
    ends = subprocess.run(ends_itself("os.kill(os.getpid(), signal.SIGKILL)", "--workers", "2", "--quiet"), check=False)
    assert ends.returncode == -signal.SIGKILL
    assert len(events(inside / "out", "finished")) == 1
    for folder in ("out", "whole"):
        assert run(["batch", "set", "--out", folder, "--quiet"]) == 0
    assert tables(inside / "out") == tables(inside / "whole")
    done = events(inside / "out", "finished")
    assert len(done) == len(set(done)) == 6


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="a terminal is opened in another way there")
def test_a_terminal_shows_what_is_done_failed_and_left_and_how_fast(inside) -> None:
    import pty

    write_set(inside / "set", {"a": [2.0, 2.1, 2.2]})
    (inside / "set" / "a" / "empty.mp4").touch()
    ours, theirs = pty.openpty()
    with subprocess.Popen([*BATCH, "set", "--workers", "1"], stderr=theirs, stdout=subprocess.DEVNULL) as process:
        os.close(theirs)
        shown = b""
        with suppress(OSError):  # the end of a terminal is an error
            while part := os.read(ours, 4096):
                shown += part
        os.close(ours)
    assert process.returncode == 4
    words = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", shown.decode())
    assert "0 done, 0 failed, 4 left" in words
    assert re.search(r"2 done, 1 failed, 1 left +[1-9]\d* fps", words)
    assert "failed: a/empty.mp4 is empty" in words


def test_a_second_batch_in_the_same_folder_says_so(inside, capsys) -> None:
    write_set(inside / "set", {"a": [2.0]})
    with open_ledger(inside / "out"):
        assert run(["batch", "set", "--out", "out"]) == 2
    assert "in use by another batch (process" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Ctrl-C is sent in another way there")
def test_ctrl_c_while_the_first_worker_starts_is_answered_in_two_lines(inside) -> None:
    write_set(inside / "set", {"a": [2.0, 2.1]})
    process = subprocess.Popen(
        [*BATCH, "set", "--out", "out", "--workers", "1"], stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    until((inside / "out" / ".lock").exists, process)
    time.sleep(0.3)
    os.killpg(process.pid, signal.SIGINT)
    _, words = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1
    assert len(words.splitlines()) == 2


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="a size of files is not limited there")
def test_a_disk_that_is_full_is_said_in_one_line_and_the_next_run_goes_on(inside) -> None:
    import resource

    write_set(inside / "set", {"a": [2.0, 2.1]})
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    command = [*BATCH, "set", "--out", "out", "--workers", "1", "--quiet"]

    def allow_little() -> None:  # a file that grows beyond it is refused, as on a full disk
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, limits[1]))

    done = subprocess.run(command, stderr=subprocess.PIPE, text=True, check=False, preexec_fn=allow_little)
    assert done.returncode == 1
    assert done.stderr == "error: out/: file too large; what is done is kept: the same command goes on\n"
    assert run(["batch", "set", "--out", "out", "--workers", "1", "--quiet"]) == 0


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Ctrl-C is sent in another way there")
def test_ctrl_c_ends_in_one_line_and_keeps_what_is_done(inside) -> None:
    write_set(inside / "set", {"a": [2.0 + 0.01 * n for n in range(4)]})
    done = subprocess.run(
        ends_itself("threading.Timer(0.02, os.killpg, (0, signal.SIGINT)).start()", "--workers", "1"),
        capture_output=True,
        text=True,
        check=False,
        start_new_session=True,
        timeout=PATIENCE_S,
    )
    words = done.stderr
    assert done.returncode == 1
    assert events(inside / "out", "finished")
    assert words.splitlines() == [
        "what is done is kept in out/: the same command goes on from there",
        "error: interrupted",
    ]
    assert list((inside / "out" / "results").glob("*/*.jsonl"))
