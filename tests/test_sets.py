"""What a set consists of, what is done once, and what its measurements say together."""

import json
import os
import shutil
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from set_files import events, inline, tables, write_decay, write_set
from tagsway.errors import InputError
from tagsway.model import Settings
from tagsway.sets.batch import Batch, measure_set
from tagsway.sets.ledger import open_ledger
from tagsway.sets.manifest import find_set
from tagsway.sets.picks import settings_of_track
from tagsway.sets.subsets import name_files
from tagsway.sets.tables import make_tables, share_picks
from tagsway.store.measurements import read_measurements


def names(path: Path) -> list[str]:
    return [item.name for item in find_set(path).items]


def run(path: Path, out: Path) -> Batch:
    with open_ledger(out) as ledger:
        return measure_set(path, ledger, inline, begin=lambda *_: None, report=lambda _: None)


def manifest(root: Path, text: str) -> Path:
    root.mkdir(exist_ok=True)
    (root / "set.toml").write_text(f'schema = "tagsway/set/1"\n{text}')
    return root


def test_a_folder_of_folders_is_a_set_and_each_folder_a_subset(tmp_path) -> None:
    for name in ("b/2.mp4", "a/1.MOV", "a/deep/3.csv", "top.avi", "a/notes.md", ".hidden/4.mp4", "a/x-identify/t.csv"):
        (tmp_path / "set" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "set" / name).touch()
    found = find_set(tmp_path / "set")
    assert [(item.subset, item.name) for item in found.items] == [
        ("a", "a/1.MOV"),
        ("a/deep", "a/deep/3.csv"),
        ("b", "b/2.mp4"),
        ("set", "top.avi"),
    ]


def test_a_manifest_gives_globs_factors_and_options_and_inherits_the_rest(tmp_path) -> None:
    root = tmp_path / "set"
    write_set(root, {"x": [2.0, 2.1], "xz": [2.2]})
    (root / "identify.toml").write_text("tag-size = 30\nmass = 40\n")
    (root / "xz" / "identify.toml").write_text("[settings]\nmass = 50\n")
    manifest(
        root,
        '[settings]\ntcp_id = 3\n[[measurement]]\nfile = "x/*.csv"\nsubset = "stiff"\nvacuum_mbar = 600\n'
        'shaped_axes = ["x", "z"]\nfactor_batch = "A"\n[measurement.settings]\ntag_size = 20\n'
        '[[measurement]]\nfile = "xz/r0.csv"\ntcp_id = 4\n',
    )
    x, _, xz = find_set(root).items
    assert (x.name, x.subset) == ("x/r0.csv", "stiff")
    assert dict(x.factors) == {"vacuum_mbar": 600, "shaped_axes": "x-z", "batch": "A"}
    assert (x.settings.tcp_tag_size_m, x.settings.mass_kg, x.settings.tcp_id) == (0.02, 0.04, 3)
    assert (xz.subset, xz.settings.tcp_tag_size_m, xz.settings.mass_kg, xz.settings.tcp_id) == ("xz", 0.03, 0.05, 4)


@pytest.mark.parametrize(
    ("common", "own", "asked"),
    [
        ("with = 'x/r0.csv'", "mass = 45", {"mass_kg": 0.045}),
        ("mass = 45", "with = 'x/r0.csv'", {"mass_kg": 0.045}),
        ("reference_id = 5", "up = 'reference'", {"reference_id": 5, "up": "reference"}),
        ("pcp_id = 2", "tcp_id = 1", {"tcp_id": 1, "pcp_id": 2}),
    ],
)
def test_options_that_need_each_other_may_stand_in_two_tables(tmp_path, common, own, asked) -> None:
    root = write_set(tmp_path / "set", {"x": [2.0]})
    manifest(root, f"[settings]\n{common}\n[[measurement]]\nfile = 'x/r0.csv'\n{own}\n")
    settings = find_set(root).items[0].settings
    assert {name: getattr(settings, name) for name in asked} == asked


def test_a_pattern_means_nothing_hidden_and_no_results_unless_it_says_so(tmp_path) -> None:
    root = tmp_path / "set"
    for name in ("a/1.csv", "a/._1.csv", "a/1-identify/track.csv", "out/attempts.jsonl", "out/measurements.csv"):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).touch()
    manifest(root, '[[measurement]]\nfile = "**/*.csv"\n')
    assert names(root) == ["a/1.csv"]
    manifest(root, '[[measurement]]\nfile = ["*/*-identify/track.csv", "a/._*.csv"]\n')
    assert names(root) == ["a/._1.csv", "a/1-identify/track.csv"]


def test_samples_that_are_called_by_two_numbers_keep_their_names(tmp_path) -> None:
    write_set(tmp_path, {"x": [2.0, 2.1]})
    (tmp_path / "set.csv").write_text("file,sample\nx/r0.csv,1_1\nx/r1.csv,11\n")
    assert [dict(item.factors)["sample"] for item in find_set(tmp_path).items] == ["1_1", 11]


def test_a_table_of_files_is_a_manifest_too(tmp_path) -> None:
    write_set(tmp_path, {"x": [2.0, 2.1]})
    (tmp_path / "all.csv").write_text("file; subset; gripper; tag_size\nx/r0.csv; 25; A; 30\nx/r1.csv; 25; B;\n")
    first, second = find_set(tmp_path / "all.csv").items
    assert (first.subset, dict(first.factors), first.settings.pcp_tag_size_m) == ("25", {"gripper": "A"}, 0.03)
    assert (dict(second.factors), second.settings.pcp_tag_size_m) == ({"gripper": "B"}, None)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ('[[measurement]]\nfile = "x/*.csv"\nsubste = "a"', "did you mean 'subset'"),
        ('[[measurement]]\nfile = "x/*.csv"\n[measurement.settings]\ntag_sice = 3', "tag_size"),
        ('colour = 1\n[[measurement]]\nfile = "x/*.csv"', "colour"),
        ('[measurement]\nfile = "x/*.csv"', "[[measurement]]"),
        ('[[measurement]]\nfile = "../*.csv"', "out of the set"),
        ('[[measurement]]\nfile = "/etc/hosts"', "out of the set"),
        ('[[measurement]]\nfile = "x/link.csv"', "out of the set"),
        ('[[measurement]]\nfile = "file:///etc/hosts"', "URL"),
        ('[[measurement]]\nfile = "simplecache::file:///etc/hosts"', "URL"),
        ('[[measurement]]\nfile = "y/*.csv"', "nothing"),
        ('[[measurement]]\nfile = "x/*.csv"\n[[measurement]]\nfile = "x/r0.csv"', "twice"),
        ('[[measurement]]\nfile = "x/*.csv"\ncamera = "../camera.json"', "out of the set"),
        ('[[measurement]]\nfile = "x/*.csv"\nmass = -1', "--mass"),
        ('[[measurement]]\nfile = "x/*.csv"\nmass = "heavy"', "mass"),
        ('[[measurement]]\nfile = "x/*.csv"\n[measurement.settings]\nshaper = "zvv"', "measurement 1: shaper is 'zvv'"),
        ('[settings]\nfamily = "tag36"\n[[measurement]]\nfile = "x/*.csv"', "settings: family is 'tag36'"),
        ("[[measurement]]\nsubset = 'a'", "file"),
        ('[[measurement]]\nfile = "**x/*.csv"', "pattern"),
        ('[[measurement]]\nfile = "."', "pattern"),
        ('[[measurement]]\nfile = "x/*.csv"\nvacuum_mbar = inf', "vacuum_mbar"),
        ('[[measurement]]\nfile = "x/*.csv"\nvacuum_mbar = nan', "vacuum_mbar"),
        ('[[measurement]]\nfile = "x/*.csv"\nfactor_status = "new"', "column"),
        ('[[measurement]]\nfile = "x/*.csv"\nfactor_subset = "new"', "column"),
        ('[[measurement]]\nfile = "x/*.csv"\nsubset = "(all)"', "whole"),
        ('[[measurement]]\nfile = "x/*.csv"\ngripper = "A"\nfactor_gripper = "B"', "twice"),
        ('[[measurement]]\nfile = "x/*.csv"\ncolumns = "t"', "T,X,Z"),
        ('[settings]\nwindow = "1:2"\n[[measurement]]\nfile = "x/*.csv"\npicks = true', "leave window out"),
        ('[settings]\nwith = "x/r0.csv"\n[[measurement]]\nfile = "x/*.csv"', "measurement 1: --with needs --mass"),
    ],
)
def test_a_manifest_that_cannot_be_used_is_refused_with_the_key(tmp_path, text, word) -> None:
    root = tmp_path / "set"
    write_decay(root / "x" / "r0.csv", frequency_hz=2.0)
    if "link" in text:
        write_decay(tmp_path / "elsewhere.csv", frequency_hz=2.0)
        (root / "x" / "link.csv").symlink_to(tmp_path / "elsewhere.csv")
    manifest(root, text)
    with pytest.raises(InputError) as fault:
        find_set(root)
    assert word in str(fault.value)
    assert "set" in str(fault.value)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems know no such names")
def test_names_of_any_kind_cost_nothing(tmp_path) -> None:
    root = write_set(tmp_path / "set", {"$a_{$ 日本 'q' \"#?%20": [2.0, 2.1]})
    (root / os.fsdecode(b"no text \xff.csv")).write_text("t,x\n1,2\n")
    (root / "gone.csv").symlink_to(tmp_path / "nowhere.csv")
    (root / "loop").symlink_to(root)
    table = run(root, tmp_path / "out").tables.measurements
    assert list(table["file"]) == [*(f"$a_{{$ 日本 'q' \"#?%20/r{n}.csv" for n in (0, 1)), "no text \\xff.csv"]
    assert list(table["status"]) == ["ok", "ok", "failed"]
    assert len(list((tmp_path / "out" / "figures").glob("*.png"))) == 3


def test_an_empty_folder_is_no_set_unless_it_is_being_filled(tmp_path) -> None:
    with pytest.raises(InputError, match="holds no videos"):
        find_set(tmp_path)
    assert find_set(tmp_path, may_be_empty=True).items == ()
    with pytest.raises(InputError, match="no such set"):
        find_set(tmp_path / "none")


def test_each_file_is_measured_once_and_again_only_when_it_or_its_settings_change(tmp_path) -> None:
    root, out = write_set(tmp_path / "set", {"a": [2.0, 2.1], "b": [2.2]}), tmp_path / "out"
    run(root, out)
    before = tables(out)
    run(root, out)
    assert events(out, "started") == events(out, "finished") == ["a/r0.csv", "a/r1.csv", "b/r0.csv"]
    assert tables(out) == before
    (root / "a" / "r0.csv").touch()  # a new time, the same content
    write_decay(root / "b" / "r0.csv", frequency_hz=2.5)
    (out / "attempts.jsonl").unlink()
    done = run(root, out)
    assert events(out, "known") == ["a/r0.csv"]
    assert events(out, "finished") == ["b/r0.csv"]
    assert done.tables.measurements["natural_frequency_hz"].iloc[2] == pytest.approx(2.5, rel=1e-3)
    (root / "a" / "identify.toml").write_text("window = '0.5:2'")
    (out / "attempts.jsonl").unlink()
    run(root, out)
    assert events(out, "finished") == ["a/r0.csv", "a/r1.csv"]
    (root / "a" / "identify.toml").unlink()
    (out / "attempts.jsonl").unlink()
    run(root, out)  # what was once done is known again
    assert not (out / "attempts.jsonl").exists()


def test_another_label_changes_the_table_and_measures_nothing(tmp_path) -> None:
    root, out = write_set(tmp_path / "set", {"a": [2.0]}), tmp_path / "out"
    run(root, out)
    manifest(root, '[[measurement]]\nfile = "a/*.csv"\nsubset = "new"\ngripper = "A"')
    done = run(root, out)
    assert events(out, "started") == ["a/r0.csv"]
    assert list(done.tables.measurements[["subset", "gripper"]].iloc[0]) == ["new", "A"]
    assert [path.name for path in (out / "figures").glob("*-frequency.png")] == ["new-frequency.png"]


def test_the_same_results_come_from_any_order_and_from_a_folder_that_was_moved(tmp_path) -> None:
    root = write_set(tmp_path / "set", {"a": [2.0, 2.1], "b": [2.2]})
    (root / "a" / "bad.csv").write_text("nothing here")
    run(root, tmp_path / "one")
    shutil.copytree(root, tmp_path / "else" / "set")
    (tmp_path / "else" / "set" / "b").rename(tmp_path / "b")
    run(tmp_path / "else" / "set", tmp_path / "two")
    (tmp_path / "b").rename(tmp_path / "else" / "set" / "b")
    run(tmp_path / "else" / "set", tmp_path / "two")
    assert tables(tmp_path / "one") == tables(tmp_path / "two")


def test_a_killed_run_s_half_written_line_and_file_do_no_harm(tmp_path) -> None:
    root, out = write_set(tmp_path / "set", {"a": [2.0, 2.1]}), tmp_path / "out"
    run(root, out)
    before = tables(out)
    with (out / "files.jsonl").open("a") as log:
        log.write('{"file": "a/r0.c')
    result = next((out / "results").glob("*/*.jsonl"))
    stray = result.with_name(f".{result.stem}-x.jsonl")
    stray.write_text("{")
    run(root, out)
    assert not stray.exists()
    assert tables(out) == before


def test_a_run_that_was_killed_in_its_first_entry_spoils_no_other(tmp_path) -> None:
    root, out = write_set(tmp_path / "set", {"a": [2.0, 2.1]}), tmp_path / "out"
    out.mkdir()
    (out / "files.jsonl").write_text('{"file": "a/r0.c')
    run(root, out)
    run(root, out)
    assert len(events(out, "started")) == 2
    assert [json.loads(line)["file"] for line in (out / "files.jsonl").read_text().splitlines()] == names(root)


@pytest.mark.parametrize("left", [b"", b'{"schema": "tagswa'])
def test_a_result_that_the_disk_lost_is_measured_again(tmp_path, left) -> None:
    root, out = write_set(tmp_path / "set", {"a": [2.0, 2.1]}), tmp_path / "out"
    run(root, out)
    before = tables(out)
    next((out / "results").glob("*/*.jsonl")).write_bytes(left)
    run(root, out)
    assert tables(out) == before


def test_one_batch_at_a_time_has_the_folder(tmp_path) -> None:
    root = write_set(tmp_path / "set", {"a": [2.0]})
    with open_ledger(tmp_path / "out"), pytest.raises(InputError, match=r"in use by another batch \(process \d+"):
        run(root, tmp_path / "out")
    run(root, tmp_path / "out")


def test_bad_files_cost_a_row_each_that_names_them(tmp_path) -> None:
    root = write_set(tmp_path / "set", {"a": [2.0, 2.02, 2.04]})
    (root / "a" / "empty.mp4").touch()
    (root / "a" / "noise.mp4").write_bytes(np.random.default_rng(0).bytes(5000))
    rest = [f"{n / 200:.3f},{0.01 * (-1) ** n}" for n in range(400)]
    (root / "a" / "still.csv").write_text("\n".join(["t,x", *rest]) + "\n")
    table = run(root, tmp_path / "out").tables.measurements.set_index("file")
    assert table["status"].to_dict() == {
        "a/empty.mp4": "failed",
        "a/noise.mp4": "failed",
        "a/still.csv": "not_determined",
        **{f"a/r{n}.csv": "ok" for n in range(3)},
    }
    for name in ("a/empty.mp4", "a/noise.mp4", "a/still.csv"):
        assert table.loc[name, "error"].startswith(name)
    assert read_measurements(tmp_path / "out" / "measurements.csv").frequency_hz == pytest.approx(
        [2, 2.02, 2.04], rel=1e-3
    )


def test_the_summary_gives_median_deviation_and_s_without_the_outlier() -> None:
    good = 2.47 + 0.02 * np.linspace(-1.5, 1.5, 25)
    rows = [
        {"file": f"{n}", "subset": "s", "status": "ok", "natural_frequency_hz": value, "natural_frequency_std_hz": 1e-3,
         "damping_ratio": 0.01}
        for n, value in enumerate([*good, 3.3])
    ]  # fmt: skip
    rows += [{"file": "x", "subset": "s", "status": "failed", "error": "x is empty"}]
    tables = make_tables(rows)
    rejected = tables.measurements.set_index("file").loc["25", "rejected_by"]
    assert rejected == "3-sigma natural_frequency_hz; esd natural_frequency_hz"
    row = tables.summary.iloc[0]
    assert (row["n"], row["failed"], row["rejected"], row["used"]) == (27, 1, 1, 25)
    assert row["natural_frequency_median_hz"] == pytest.approx(np.median(good))  # identity
    assert row["natural_frequency_s_hz"] == pytest.approx(np.std(good, ddof=1))
    spread = 100 * (good.max() - good.min()) / (good.max() + good.min())
    assert row["natural_frequency_deviation_percent"] == pytest.approx(spread)
    assert row["between_s_hz"] == pytest.approx(np.sqrt(np.var(good, ddof=1) - 1e-6), rel=1e-4)


def test_the_pick_position_s_share_is_by_variances_and_with_its_error() -> None:
    varied, held = np.linspace(2.3, 2.5, 9), np.linspace(2.35, 2.45, 9)
    rows = [
        {"file": f"{level}{n}", "subset": level, "status": "ok", "natural_frequency_hz": value, "damping_ratio": 0.01,
         "pick_position": level, "gripper": "A", "set": level}
        for level, values in (("varied", varied), ("held", held))
        for n, value in enumerate(values)
    ]  # fmt: skip
    (share,) = share_picks(make_tables(rows).kept()).to_dict("records")
    assert (share["factors"], share["quantity"], share["n_varied"]) == ("A", "natural_frequency_hz", 9)
    assert share["share"] == pytest.approx(0.75)  # identity: half the deviation is a quarter of the variance
    assert 0 <= share["low"] < 0.75 < share["high"] <= 1
    assert not len(share_picks(make_tables(rows[:9]).kept()))


def test_results_are_not_written_over_their_set_nor_taken_for_measurements(tmp_path) -> None:
    root = write_set(tmp_path / "set", {"a": [2.0]})
    with pytest.raises(InputError, match="folder of its own"):
        find_set(root, leave_out=root)
    run(root, root / "results")
    assert names(root) == ["a/r0.csv"]


def test_the_parquet_table_holds_what_the_csv_does(tmp_path) -> None:
    root = write_set(tmp_path / "set", {"a": [2.0, 2.1]})
    (root / "a" / "empty.mp4").touch()
    run(root, tmp_path / "out")
    text = pd.read_csv(tmp_path / "out" / "measurements.csv", keep_default_na=False, na_values=[""])
    binary = pd.read_parquet(tmp_path / "out" / "measurements.parquet")
    assert list(text.columns) == list(binary.columns)
    np.testing.assert_array_equal(text["natural_frequency_hz"], binary["natural_frequency_hz"])


@pytest.mark.slow
def test_every_move_of_a_clip_is_a_row(tmp_path) -> None:
    # Three picks of a payload of 2.2 Hz: the tool goes some 300 mm in 0.4 s and rests for 2.5 s.
    rate, frequency = 200, 2.2
    time = np.arange(int(9.5 * rate)) / rate
    tool = np.zeros_like(time)
    for way, start in ((300, 0.5), (-250, 3.5), (280, 6.5)):
        share = np.clip((time - start) / 0.4, 0, 1)
        tool += way * (10 * share**3 - 15 * share**4 + 6 * share**5)
    omega, zeta = 2 * np.pi * frequency, 0.05
    acceleration = np.gradient(np.gradient(tool, time), time)
    sway, speed = np.zeros_like(time), 0.0
    for n in range(1, len(time)):  # semi-implicit Euler at 200 Hz: some 0.1 % of the frequency
        speed += (-acceleration[n] - omega**2 * sway[n - 1] - 2 * zeta * omega * speed) / rate
        sway[n] = sway[n - 1] + speed / rate
    rng = np.random.default_rng(0)
    noise = 0.02 * rng.normal(size=(2, len(time)))
    rows = zip(time, tool + noise[0], 0 * time, tool + sway + noise[1], -300 + 0 * time, strict=True)
    lines = [",".join(f"{value:.4f}" for value in row) for row in rows]
    header = "time_s,tcp_x_mm,tcp_z_mm,pcp_x_mm,pcp_z_mm"
    (tmp_path / "clip.csv").write_text("\n".join([header, *lines]) + "\n")
    log = [f"{t:.4f},{x / 1e3:.7f},0,-0.3" for t, x in zip(time + 7, tool, strict=True)]
    (tmp_path / "log.csv").write_text("\n".join(["time_s,x_m,y_m,z_m", *log]) + "\n")
    (tmp_path / "identify.toml").write_text('log = "log.csv"\n')
    table = run(tmp_path / "clip.csv", tmp_path / "out").tables.measurements
    assert list(table["pick"]) == [1, 2, 3]
    assert table["warnings"].str.contains("tool_from_log").all()
    # discretisation: of the integration above
    np.testing.assert_allclose(table["natural_frequency_hz"], frequency, rtol=5e-3)
    assert table["window_start_s"].is_monotonic_increasing
    assert np.all(np.diff(table["window_start_s"]) == pytest.approx(3.0, abs=0.3))


def test_a_pick_s_track_has_what_the_film_s_settings_said() -> None:
    film = Settings(reference_id=5, up="reference", camera="camera.json", fps_hz=200.0, mass_kg=0.04, shaper="zvd")
    assert settings_of_track(film) == Settings(mass_kg=0.04, shaper="zvd")


@pytest.mark.parametrize(
    ("rows", "word"),
    [("x/r0.csv,B,C", "line 2: expected as many fields"), (f'x/r0.csv,"{"B" * 200_000}"', "not a text")],
)
def test_a_table_of_files_that_cannot_be_read_is_refused(tmp_path, rows, word) -> None:
    root = write_set(tmp_path / "set", {"x": [2.0]})
    (root / "set.csv").write_text(f"file,gripper\n{rows}\n")
    with pytest.raises(InputError, match=word):
        find_set(root)


def test_a_pattern_takes_no_manifest_for_a_track(tmp_path) -> None:
    root = write_set(tmp_path / "set", {".": [2.0]})
    assert names(manifest(root, '[[measurement]]\nfile = "*"\n')) == ["r0.csv"]


def test_a_subset_s_name_becomes_a_file_s_on_any_system() -> None:
    names = ["stiff", "Soft", "soft", "a/b: c", "a/b? c", "A/B? C", 'a/b: *c"<>|']
    files = name_files(names)
    assert files["stiff"] == "stiff"
    assert len({file.lower() for file in files.values()}) == len(names)
    assert not set("".join(files.values())) & set('/:*?"<>| ')
