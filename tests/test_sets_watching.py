"""A folder that is being filled: each file once, when it is complete, and nothing read twice."""

from collections import Counter
from pathlib import Path

import pytest

from set_files import events, inline, tables, write_decay, write_set
from tagsway.sets import ledger as ledgers
from tagsway.sets.batch import measure_set
from tagsway.sets.ledger import open_ledger
from tagsway.sets.watching import watch_set
from tagsway.store.measurements import read_measurements


def watch(root: Path, out: Path, camera) -> None:
    with open_ledger(out, remembers=True) as ledger:
        watch_set(root, ledger, inline, begin=lambda *_: None, report=lambda _: None, go_on=camera, poll_s=0.01)


def test_a_watched_folder_s_new_files_are_measured_once_and_not_while_they_grow(tmp_path) -> None:
    root, out = tmp_path / "set", tmp_path / "out"
    root.mkdir()
    whole = write_decay(tmp_path / "whole.csv", frequency_hz=2.0).read_text()
    looks = iter(range(8))

    def camera() -> bool:
        look = next(looks, None)
        if look in (1, 2, 3):  # the file grows while it is watched
            (root / "new.csv").write_text(whole[: len(whole) * look // 3])
        return look is not None

    watch(root, out, camera)
    assert events(out, "started") == ["new.csv"]
    assert read_measurements(out / "measurements.csv").frequency_hz == pytest.approx([2.0], rel=1e-3)


def test_each_result_is_read_once_however_often_the_tables_are_written(tmp_path, monkeypatch) -> None:
    root, out = write_set(tmp_path / "set", {"a": [2.0, 2.1], "b": [2.2]}), tmp_path / "out"
    read, first_line, looks = Counter(), ledgers._first_line, iter(range(14))

    def count(path: Path) -> object:
        read[path.name] += 1
        return first_line(path)

    def camera() -> bool:
        look = next(looks, None)
        if look in (3, 6, 9):
            write_decay(root / "b" / f"new{look}.csv", frequency_hz=2.2 + 0.01 * look)
        return look is not None

    monkeypatch.setattr(ledgers, "_first_line", count)
    watch(root, out, camera)
    assert sorted(events(out, "finished")) == [
        *("a/r0.csv", "a/r1.csv"),
        *(f"b/new{n}.csv" for n in (3, 6, 9)),
        "b/r0.csv",
    ]
    assert set(read.values()) == {1}
    assert len(read) == 6
    with open_ledger(tmp_path / "whole") as ledger:
        measure_set(root, ledger, inline, begin=lambda *_: None, report=lambda _: None)
    assert tables(out) == tables(tmp_path / "whole")


def test_a_file_that_is_written_over_is_measured_again(tmp_path) -> None:
    root, out, looks = write_set(tmp_path / "set", {"a": [2.0]}), tmp_path / "out", iter(range(8))

    def camera() -> bool:
        look = next(looks, None)
        if look == 4:
            write_decay(root / "a" / "r0.csv", frequency_hz=2.5, seconds=3)
        return look is not None

    watch(root, out, camera)
    assert events(out, "finished") == ["a/r0.csv", "a/r0.csv"]
    assert read_measurements(out / "measurements.csv").frequency_hz == pytest.approx([2.5], rel=1e-3)
