"""What is drawn of a set: nothing twice, and no page that nobody asked for."""

import shutil
from pathlib import Path

from set_files import events, inline, tables, write_decay, write_set
from tagsway.cli.app import run as run_command
from tagsway.sets import batch as batches
from tagsway.sets.ahead import Ahead
from tagsway.sets.batch import measure_set
from tagsway.sets.jobs import Job
from tagsway.sets.ledger import open_ledger
from tagsway.sets.manifest import find_set
from tagsway.sets.subsets import plan_subsets
from tagsway.sets.tables import tabulate


def run(path: Path, out: Path, *, pages: bool | None = None) -> None:
    with open_ledger(out) as ledger:
        measure_set(path, ledger, inline, begin=lambda *_: None, report=lambda _: None, pages=pages)


def dates(out: Path, subset: str) -> list[int]:
    files = [*(out / "figures").glob(f"{subset}-*.png"), *(out / "shapers").glob(f"{subset}.json")]
    assert len(files) >= 3
    return [path.stat().st_mtime_ns for path in sorted(files)]


def test_only_the_subset_that_changed_is_drawn_again(tmp_path) -> None:
    root, out = write_set(tmp_path / "set", {"a": [2.0, 2.1], "b": [2.2, 2.3]}), tmp_path / "out"
    run(root, out)
    before = dates(out, "a"), dates(out, "b")
    write_decay(root / "b" / "r2.csv", frequency_hz=2.25)
    run(root, out)
    assert dates(out, "a") == before[0]
    assert min(dates(out, "b")) > max(before[1])
    run(root, tmp_path / "whole")
    assert tables(out) == tables(tmp_path / "whole")


def test_figures_that_were_lost_or_written_over_are_drawn_again(tmp_path) -> None:
    root, out = write_set(tmp_path / "set", {"a": [2.0, 2.1], "b": [2.2, 2.3]}), tmp_path / "out"
    run(root, out)
    before = tables(out)
    (out / "figures" / "a-decays.png").unlink()
    (out / "shapers" / "b.json").write_text("{}")
    run(root, out)
    assert tables(out) == before
    (out / "steps" / "drawn.json").write_text('["nothing"]')
    run(root, out)
    assert tables(out) == before


def test_subsets_that_differ_in_case_alone_have_files_of_their_own_whichever_came_first(tmp_path) -> None:
    root, out = tmp_path / "set", tmp_path / "out"
    write_decay(root / "first.csv", frequency_hz=2.0)
    write_decay(root / "second.csv", frequency_hz=2.2)
    one, two = (
        f'[[measurement]]\nfile = "{file}.csv"\nsubset = "{name}"\n'
        for file, name in (("first", "Soft"), ("second", "soft"))
    )
    (root / "set.toml").write_text(f'schema = "tagsway/set/1"\n{one}')
    run(root, out)
    assert (out / "figures" / "Soft-frequency.png").exists()
    (root / "set.toml").write_text(f'schema = "tagsway/set/1"\n{one}{two}')
    run(root, out)
    assert len({path.name.lower() for path in (out / "shapers").glob("*.json")}) == 2
    run(root, tmp_path / "whole")
    assert tables(out) == tables(tmp_path / "whole")


def test_a_subset_is_drawn_as_soon_as_its_last_file_is_done(tmp_path) -> None:
    root, out = write_set(tmp_path / "set", {"a": [2.0, 2.1], "b": [2.2]}), tmp_path / "out"
    run(root, out)
    items = find_set(root).items
    with open_ledger(out) as ledger:
        jobs = [Job(item=item, settings_digest="", out="", pages=False) for item in items]
        key = plan_subsets(tabulate(items, ledger), items, ledger)[0].key
        with Ahead(items, jobs, ledger) as ahead:
            ahead.over(items[0])
            assert not ahead.has("a")
            ahead.over(items[1])
            assert ahead.take("a", "of other measurements") is None
            drawn = ahead.take("a", key)
            assert not ahead.has("b")
    assert drawn is not None
    assert dict(drawn.pictures)["frequency"] == (out / "figures" / "a-frequency.png").read_bytes()


def test_what_was_drawn_before_a_copy_turned_up_is_drawn_again(tmp_path) -> None:
    root, out = write_set(tmp_path / "set", {"a": [2.0, 2.1], "b": [2.2, 2.3]}), tmp_path / "out"
    shutil.copy(root / "a" / "r0.csv", root / "b" / "r9.csv")
    run(root, out)
    before = tables(out)
    (out / "steps" / "drawn.json").unlink()
    run(root, out)
    assert tables(out) == before


def test_pages_are_left_out_on_request_and_drawn_later_without_a_measurement_done_twice(tmp_path) -> None:
    root = write_set(tmp_path / "set", {"a": [2.0, 2.1]})
    (root / "a" / "empty.mp4").touch()
    run(root, tmp_path / "whole")
    out = tmp_path / "out"
    run(root, out, pages=False)
    assert not list((out / "pages").glob("*/*.html"))
    run(root, out, pages=True)
    assert sorted(events(out, "finished")) == ["a/empty.mp4", "a/r0.csv", "a/r1.csv"]
    assert events(out, "known") == ["a/r0.csv", "a/r1.csv"]
    assert tables(out) == tables(tmp_path / "whole")
    run(root, out)
    assert len(events(out, "known")) == 2, "there is nothing left to draw"


def test_a_large_set_has_no_page_for_each_measurement_unless_asked(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(batches, "MOST_PAGES", 1)
    root, out = write_set(tmp_path / "set", {"a": [2.0, 2.1]}), tmp_path / "out"
    run(root, out)
    assert not list((out / "pages").glob("*/*.html"))
    run(root, out, pages=True)
    assert len(list((out / "pages").glob("*/*.html"))) == 2


def test_the_terminal_tells_what_the_factors_do_in_the_words_of_the_page(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    root = write_set(tmp_path / "set", {"a": [2.0, 2.01, 2.02], "b": [2.4, 2.41, 2.42]})
    entries = "".join(f'[[measurement]]\nfile = "{name}/*.csv"\ngripper = "{name}"\n' for name in "ab")
    (root / "set.toml").write_text(f'schema = "tagsway/set/1"\n{entries}')
    assert run_command(["batch", "set", "--workers", "1"]) == 0
    told = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("Natural frequency, gripper"))
    assert told.startswith("Natural frequency, gripper: b against a: 0.4")
    page = (tmp_path / "set-identify" / "report.html").read_text("utf-8")
    assert told.replace("&", "&amp;") in page
