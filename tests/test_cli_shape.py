"""`identify shaper` and `identify trajectory`: what they print and write, and what they refuse."""

import csv
import io
import json
import math
from pathlib import Path

import numpy as np
import pytest

from tagsway.cli.app import run
from tagsway.cli.modes import read_target
from tagsway.model import DesignMode, Mode
from tagsway.shapers import design_shaper, residual_percentile

MODE = ["--frequency", "2.4727", "--damping", "0.00035146"]
MOVE = """
schema = "tagsway/move/1"
from_m = [-0.35, 0, -0.767]
to_m = [0.35, 0, -0.767]
pick_height_m = 0.05
place_height_m = 0.05
max_acceleration_m_s2 = 5
"""
DELTA = """
[robot]
kind = "delta"
joint_limits_deg = [[-40, 90]]
[robot.lengths_m]
base = 0.2
platform = 0.045
upper = 0.348087991749213
lower = 0.8
"""


@pytest.fixture(autouse=True)
def inside(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(name: str, text: str) -> str:
    Path(name).write_text(text, encoding="utf-8")
    return name


def refuse(capsys, arguments: list[str], *words: str) -> None:
    """Check that arguments end with exit code 2, one line that holds the words, and no file."""
    before = set(Path().iterdir())
    assert run(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.strip().splitlines()
    assert line.startswith("error: ")
    for word in words:
        assert word in line
    assert set(Path().iterdir()) == before


def printed(capsys, arguments: list[str]) -> str:
    assert run(arguments) == 0
    return capsys.readouterr().out


MEASUREMENTS = """file,natural_frequency_hz,natural_frequency_std_hz,damping_ratio,rejected_by
a.mp4,2.40,0.001,0.0030,
b.mp4,2.50,0.001,0.0040,
c.mp4,2.44,0.001,0.0050,
d.mp4,,,,
e.mp4,9.90,0.001,0.0900,looked at
"""


def test_measurements_give_their_median_as_the_mode_and_their_scatter_as_the_spread(capsys) -> None:
    name = write("measurements.csv", MEASUREMENTS)
    document = json.loads(printed(capsys, ["shaper", "--from", name]))
    assert document["modes"] == [{"frequency_hz": 2.44, "damping_ratio": 0.004, "amplitude_mm": None}]
    spread = document["residual"]["spread"]
    assert spread["n"] == 3
    assert spread["source"] == "measurements.csv"
    measured = [2.4, 2.5, 2.44]  # identity: with equal errors the variance between repeats is s² less theirs
    between = np.sqrt(np.var(measured, ddof=1) - 0.001**2)
    assert spread["natural_frequency_std_percent"] == pytest.approx(100 * between / np.mean(measured), rel=1e-6)
    assert document["residual"]["p95"] > 0
    assert document["source"] == "measurements.csv: median of 3"


def test_a_set_s_shaper_is_for_the_operating_amplitude_and_its_payload_for_a_small_swing() -> None:
    head = "natural_frequency_hz,damping_ratio,operating_frequency_hz,amplitude_mm\n"
    name = write("measurements.csv", f"{head}2.4,0.01,2.3,20\n2.5,0.01,2.4,22\n2.6,0.01,,\n")
    target = read_target(Path(name), [], [], None)
    assert target.mode == DesignMode(frequency_hz=2.4, damping_ratio=0.01, amplitude_m=0.021)
    assert target.swings == (Mode(natural_frequency_hz=2.5, damping_ratio=0.01),)


def test_a_set_s_row_that_tells_no_damping_is_left_out_as_in_the_set_s_own_shaper(capsys) -> None:
    text = "status,natural_frequency_hz,damping_ratio\nok,2.4,0.003\ndegraded,2.6,\nok,2.5,0.004\n"
    document = json.loads(printed(capsys, ["shaper", "--from", write("measurements.csv", text)]))
    assert document["modes"][0]["frequency_hz"] == 2.45
    assert document["residual"]["spread"]["n"] == 2


def test_one_measurement_gives_no_spread(capsys) -> None:
    name = write("measurements.csv", "natural_frequency_hz;damping_ratio\n2.4;0.003\n")
    assert json.loads(printed(capsys, ["shaper", "--from", name]))["residual"]["spread"] is None


def test_a_stated_spread_goes_before_the_measured_one(capsys) -> None:
    name = write("measurements.csv", MEASUREMENTS)
    document = json.loads(printed(capsys, ["shaper", "--from", name, "--frequency-spread", "7"]))
    assert document["residual"]["spread"]["natural_frequency_std_percent"] == 7


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("natural_frequency_hz\n2.4\n", ("no column 'damping_ratio'",)),
        ("natural_frequency_hz,damping_ratio\n", ("no measurement that can be used",)),
        ("", ("is empty",)),
        ("natural_frequency_hz,damping_ratio\n2.4,0.003\n0,0.003\n", ("line 3", "natural_frequency_hz is 0")),
        ("natural_frequency_hz,damping_ratio\n2.4,0.003\ntwo,0.003\n", ("line 3", "natural_frequency_hz is two")),
        ("natural_frequency_hz,damping_ratio\n2.4,1.2\n", ("line 2", "damping_ratio is 1.2")),
        ("natural_frequency_hz,damping_ratio\n2.4,\n", ("line 2", "damping_ratio is nan")),
    ],
)
def test_measurements_that_cannot_be_used_are_refused(capsys, text, words) -> None:
    refuse(capsys, ["shaper", "--from", write("m.csv", text)], "m.csv", *words)


def test_a_missing_table_is_refused(capsys) -> None:
    refuse(capsys, ["shaper", "--from", "none.csv"], "none.csv", "no such file")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--frequency", "0", "--damping", "0.1"], ("frequency", "0")),
        (["--frequency", "-2", "--damping", "0.1"], ("frequency", "-2")),
        (["--frequency", "nan", "--damping", "0.1"], ("frequency", "nan")),
        (["--frequency", "inf", "--damping", "0.1"], ("frequency", "inf")),
        (["--frequency", "2", "--damping", "1"], ("damping", "1")),
        (["--frequency", "2", "--damping", "-0.1"], ("damping", "-0.1")),
        (["--frequency", "2", "--damping", "nan"], ("damping", "nan")),
        (["--frequency", "2"], ("--damping",)),
        ([*MODE, "--frequency", "4"], ("--damping", "2 and 1")),
        ([*MODE, *MODE, "--type", "zv-zv-zv"], ("2 modes", "3")),
        ([*MODE, *MODE, "--type", "auto"], ("--type auto", "--band")),
        ([*MODE, *MODE, "--type", "all"], ("one mode, not 2",)),
        ([*MODE, *MODE, "--type", "zv", "--format", "klipper"], ("zv-zv",)),
        ([*MODE, *MODE, "--type", "zv", "--band", "10"], ("--band", "2 modes")),
        ([*MODE, "--type", "si", "--band", "100"], ("--band", "100")),
        ([*MODE, "--type", "si", "--band", "0"], ("--band", "0")),
        ([*MODE, "--type", "si", "--band", "nan"], ("--band", "nan")),
        ([*MODE, "--type", "ztd-zvd"], ("ztd-zvd", "duration")),
        ([*MODE, "--type", "ztd-zvd", "--move-duration", "0.4"], ("longer than its shaper", "0.4 s")),
        ([*MODE, "--type", "ztd-zvd", "--move-duration", "0"], ("--move-duration", "0")),
        ([*MODE, "--type", "mztd", "--move-duration", "nan"], ("--move-duration", "nan")),
        (["--impulses", "0:0.5;0.2:0.5"], ("--impulses", "0:0.5;0.2:0.5")),
        (["--impulses", "0.1:0.5,0.2:0.5"], ("0.1",)),
        (["--impulses", "0:nan,0.2:0.5"], ("finite",)),
        (["--impulses", "0:1,0.2:-1"], ("sum",)),
        ([*MODE, "--sample-time", "0"], ("--sample-time", "0")),
        ([*MODE, "--type", "fir", "--format", "csv"], ("fir", "prefilter")),
        ([*MODE, "--type", "fir", "--format", "klipper"], ("fir", "mzv")),
        ([], ("--from",)),
        ([*MODE, "--type", "zzz"], ("zzz", "zvd")),
        ([*MODE, "--tolerance", "0"], ("--tolerance", "0", "between 0 and 1")),
        ([*MODE, "--tolerance", "1"], ("--tolerance", "1")),
        ([*MODE, "--tolerance", "nan"], ("--tolerance", "nan")),
        ([*MODE, "--frequency-spread", "0"], ("--frequency-spread", "0")),
        ([*MODE, "--frequency-spread", "nan"], ("--frequency-spread", "nan")),
        ([*MODE, "--frequency-spread", "80"], ("80 %", "0 to 30")),
        ([*MODE, "--from", "result.json"], ("--from", "contradict")),
        ([*MODE, "--type", "auto"], ("--type auto", "--frequency-spread")),
        ([*MODE, "--type", "all", "--format", "klipper"], ("klipper", "one shaper")),
        ([*MODE, "--type", "all", "--out", "shapers.gif"], ("--out", "shapers.gif", ".png")),
        ([*MODE, "--type", "zvdd", "--format", "klipper"], ("zvdd", "mzv")),
        ([*MODE, "--format", "xml"], ("--format", "xml")),
    ],
    ids=" ".join,
)
def test_a_shaper_that_cannot_be_designed_is_refused_in_one_line(capsys, options, words) -> None:
    refuse(capsys, ["shaper", *options], *words)


def test_auto_without_a_spread_says_what_would_help_even_after_one_measurement(capsys) -> None:
    name = write("measurements.csv", "natural_frequency_hz,damping_ratio\n2.4,0.003\n")
    refuse(capsys, ["shaper", "--from", name, "--type", "auto"], "--frequency-spread", "one measurement")


@pytest.mark.parametrize("spread", [1.0, 5.0, 10.0])
def test_auto_takes_the_shortest_that_keeps_the_tolerance_over_the_spread(capsys, spread) -> None:
    document = json.loads(printed(capsys, ["shaper", *MODE, "--type", "auto", "--frequency-spread", str(spread)]))
    assert document["residual"]["p95"] <= 0.05 + 1e-9
    mode = DesignMode(frequency_hz=2.4727, damping_ratio=0.00035146)
    for kind in ("zv", "zvd", "ei", "mzv", "zvdd"):
        shaper = design_shaper(kind, mode)
        if shaper.duration_s < document["duration_s"] - 1e-9:
            assert residual_percentile(shaper, spread) > 0.05


def test_all_gives_a_row_and_a_picture_of_every_candidate_with_its_price(capsys) -> None:
    table = printed(capsys, ["shaper", *MODE, "--type", "all", "--frequency-spread", "5"])
    lines = table.splitlines()
    assert "adds (ms)" in lines[0]
    assert len({len(line) for line in lines}) == 1
    rows = {line.split()[0]: line.split()[1:] for line in lines[1:]}
    assert {"zv", "zvd", "ei", "mzv", "2hump_ei", "3hump_ei"} <= rows.keys()
    assert rows["zv"][:2] == ["2", "202.2"]
    assert [float(row[1]) for row in rows.values()] == sorted(float(row[1]) for row in rows.values())
    assert Path("shapers.png").read_bytes().startswith(b"\x89PNG")


def test_all_as_csv_and_json_hold_the_same_numbers(capsys) -> None:
    text = printed(capsys, ["shaper", *MODE, "--type", "all", "--format", "csv", "--out", "one.png"])
    rows = list(csv.DictReader(io.StringIO(text)))
    documents = json.loads(printed(capsys, ["shaper", *MODE, "--type", "all", "--format", "json", "--out", "two.png"]))
    assert [row["type"] for row in rows] == [document["type"] for document in documents]
    assert len(rows) > 10
    for row, document in zip(rows, documents, strict=True):
        assert float(row["adds_ms"]) == pytest.approx(1e3 * document["duration_s"], abs=0.051)
        assert row["p95_percent"] == ""
    assert Path("one.png").read_bytes() == Path("two.png").read_bytes()


def test_two_modes_take_a_shaper_each_or_one_for_both(capsys) -> None:
    modes = ["--frequency", "5.638", "--damping", "0.05", "--frequency", "9.1", "--damping", "0.05"]
    zv_ei = json.loads(printed(capsys, ["shaper", *modes, "--type", "zv-ei"]))
    assert zv_ei["type"] == "zv-ei"
    assert len(zv_ei["impulses"]) == 6
    both = json.loads(printed(capsys, ["shaper", *modes, "--type", "zv"]))
    assert len(both["modes"]) == 2
    assert both["residual"]["at_mode"] < 1e-9
    quick = json.loads(printed(capsys, ["shaper", *modes, "--type", "simultaneous"]))
    assert quick["duration_s"] < both["duration_s"]
    auto = json.loads(printed(capsys, ["shaper", *modes, "--type", "auto", "--band", "2", "--band", "19"]))
    assert auto["type"] == "zv-ei"


def test_a_hastened_shaper_and_a_band_are_told_by_options(capsys) -> None:
    ztd = json.loads(printed(capsys, ["shaper", *MODE, "--type", "ztd-zvd", "--move-duration", "1"]))
    assert ztd["time_scale"] == pytest.approx(1 - 2 * 0.202208125, abs=1e-6)
    narrow, wide = (
        json.loads(printed(capsys, ["shaper", *MODE, "--type", "si", "--band", band]))["duration_s"]
        for band in ("5", "25")
    )
    assert narrow < wide


def test_a_shaper_by_hand_is_scaled_and_judged_where_a_mode_is_given(capsys) -> None:
    bare = json.loads(printed(capsys, ["shaper", "--impulses", "0:1,0.202208125:1"]))
    assert [impulse["amplitude"] for impulse in bare["impulses"]] == [0.5, 0.5]
    assert bare["residual"] is None
    judged = json.loads(printed(capsys, ["shaper", *MODE, "--impulses", "0:1,0.202208125:1"]))
    assert 1e-5 < judged["residual"]["at_mode"] < 1e-3


def test_impulses_on_the_controller_s_samples_leave_nothing_at_the_mode(capsys) -> None:
    document = json.loads(printed(capsys, ["shaper", *MODE, "--sample-time", "4"]))
    cycles = np.array([impulse["time_s"] for impulse in document["impulses"]]) / 4e-3
    assert cycles == pytest.approx(np.round(cycles), abs=1e-9)
    assert document["residual"]["at_mode"] < 1e-9


@pytest.mark.parametrize("kind", ["zv", "mzv", "zvd", "ei", "2hump_ei", "3hump_ei"])
def test_klipper_gets_its_own_names_and_a_warning_below_its_tuner_s_least_frequency(capsys, kind) -> None:
    low = printed(capsys, ["shaper", *MODE, "--type", kind, "--format", "klipper"])
    assert f"[input_shaper]\nshaper_type_x: {kind}\nshaper_freq_x: 2.4727\ndamping_ratio_x: 0.00035146\n" in low
    assert "# warning: its tuner proposes" in low
    high = printed(
        capsys,
        ["shaper", "--frequency", "48", "--damping", "0.1", "--type", kind, "--format", "klipper", "--axis", "xy"],
    )
    assert "warning" not in high
    assert high.count("48\n") == 2
    assert "shaper_freq_y: 48" in high
    # every line that is no comment is the section or `key: value`
    for line in (low + high).splitlines():
        assert line.startswith("#") or line == "[input_shaper]" or len(line.split(": ")) == 2


def test_klipper_s_warning_follows_the_least_frequency_of_the_type(capsys) -> None:
    for kind, frequency in {"zv": 21, "mzv": 23, "zvd": 29, "ei": 29, "2hump_ei": 39, "3hump_ei": 48}.items():
        for below in (0.01, 0.0):
            arguments = ["--frequency", str(frequency - below), "--damping", "0.1", "--type", kind]
            text = printed(capsys, ["shaper", *arguments, "--format", "klipper"])
            assert ("warning" in text) == (below > 0)


def test_joints_are_written_in_degrees(capsys) -> None:
    move = write("move.toml", MOVE + DELTA)
    out = printed(
        capsys, ["trajectory", "--move", move, "--shaper", "none", "--format", "joints", "--out", "joints.csv"]
    )
    assert "singularity" in out
    header, first, *_ = Path("joints.csv").read_text().splitlines()
    assert header.startswith("index,time_s,joint_1_deg,joint_2_deg,joint_3_deg,v_joint_1_deg_s")
    # published value: the thesis' angles at (-350, 0, -767)
    assert [float(cell) for cell in first.split(",")[2:5]] == pytest.approx([34.782244, 60.738544, 2.036028], abs=1e-6)
    described = json.loads(Path("joints.json").read_text())
    assert described["format"] == "joints"
    assert described["joints"]["units"] == ["deg", "deg", "deg"]
    assert described["joints"]["end"] == pytest.approx([34.782244, 2.036028, 60.738544], abs=1e-6)
    assert 0.3 < described["joints"]["singularity_margin"] < 1


def test_joints_at_8_khz_pass_through_those_at_1_khz(capsys) -> None:
    move = write("move.toml", MOVE + DELTA)
    for rate, name in ((["--joint-rate", "8000"], "fast.csv"), ([], "slow.csv")):
        command = ["trajectory", "--move", move, "--shaper", "none", "--format", "joints", "--out", name]
        printed(capsys, [*command, *rate])
    fast, slow = (np.loadtxt(name, delimiter=",", skiprows=1) for name in ("fast.csv", "slow.csv"))
    assert fast[8:, 1][0] == pytest.approx(0.001, abs=1e-9)
    # identity: both are rounded to 1e-9 degrees
    assert np.abs(fast[::8, 2:5] - slow[: len(fast[::8]), 2:5]).max() <= 1.1e-9
    assert json.loads(Path("fast.json").read_text())["sample_time_s"] == 1 / 8000
    assert json.loads(Path("fast.json").read_text())["samples"] == len(fast)


def read_yaml(text: str) -> dict:
    """Return what the ROS file says, by a reader of just the YAML that it uses."""
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    names = json.loads(next(line for line in lines if line.startswith("joint_names: ")).removeprefix("joint_names: "))
    points: list[dict] = []
    for line in lines[lines.index("points:") + 1 :]:
        assert line[:2] in ("- ", "  ")
        if line.startswith("- "):
            points.append({})
        key, value = line[2:].split(": ", 1)
        if key == "time_from_start":
            value = value.replace("sec:", '"sec":', 1).replace(" nanosec:", ' "nanosec":')
        points[-1][key] = json.loads(value)
    return {"joint_names": names, "points": points}


def test_ros_gets_radians_and_whole_nanoseconds(capsys) -> None:
    names = 'joint_names = ["left: arm", "it\\"s", "yes"]\n'
    move = write("move.toml", MOVE + DELTA.replace("[robot.lengths_m]", names + "[robot.lengths_m]"))
    printed(capsys, ["trajectory", "--move", move, "--shaper", "none", "--format", "ros"])
    message = read_yaml(Path("trajectory.yaml").read_text())
    assert message["joint_names"] == ["left: arm", 'it"s', "yes"]
    first, second, *_, last = message["points"]
    assert first["positions"] == pytest.approx(np.radians([34.782244, 60.738544, 2.036028]), abs=2e-8)
    assert first["velocities"] == last["velocities"] == [0, 0, 0]
    assert first["time_from_start"] == {"sec": 0, "nanosec": 0}
    assert second["time_from_start"] == {"sec": 0, "nanosec": 1_000_000}
    assert last["time_from_start"] == {"sec": 1, "nanosec": 126_000_000}
    assert {len(point["accelerations"]) for point in message["points"]} == {3}


def test_ros_takes_a_cartesian_robot_s_axes_in_metres(capsys) -> None:
    printed(capsys, ["trajectory", "--move", write("move.toml", MOVE), "--shaper", "none", "--format", "ros"])
    message = read_yaml(Path("trajectory.yaml").read_text())
    assert message["joint_names"] == ["x", "y", "z"]
    assert message["points"][-1]["positions"] == [0.35, 0, -0.767]


@pytest.mark.parametrize("form", ["beckhoff", "beckhoff-pva", "csv", "joints"])
def test_every_other_format_is_a_table_with_one_row_a_sample(capsys, form) -> None:
    shaper = printed(capsys, ["shaper", *MODE])
    move = write("move.toml", MOVE + DELTA)
    printed(capsys, ["trajectory", "--move", move, "--shaper", write("shaper.json", shaper), "--format", form])
    delimiter, header = (";", 0) if form.startswith("beckhoff") else (",", 1)
    rows = np.loadtxt("trajectory.csv", delimiter=delimiter, skiprows=header)
    described = json.loads(Path("trajectory.json").read_text())
    assert len(rows) == described["samples"] == round(described["run_time_s"] / 1e-3) + 1
    assert rows[:, 0].tolist() == list(range(len(rows)))
    assert np.isfinite(rows).all()


@pytest.mark.parametrize(
    ("old", "new", "options", "words"),
    [
        ("[-40, 90]", "[-40, 60]", [], ("joint 2 is at 60", "(-0.35, 0, -0.767) m, t = 0 s", "60°")),
        ("to_m = [0.35", "to_m = [1.35", [], ("cannot reach", "t = 0.", "lengths_m")),
        ("upper = 0.348087991749213", "upper = 348.088", [], ("upper is 348.088 m", "metres, not mm")),
        ("upper = 0.348087991749213\n", "", [], ("all of base, platform, upper, lower",)),
        ('kind = "delta"', 'kind = "hexapod"', [], ("robot.kind",)),
        (DELTA, "", ["--format", "joints"], ("no joints", "[robot]")),
        (DELTA, '[robot]\nkind = "delta"', ["--format", "joints"], ("needs the robot's joints", "lengths_m")),
        ("", "", ["--joint-rate", "8000"], ("--joint-rate", "beckhoff")),
        ("", "", ["--joint-rate", "0", "--format", "joints"], ("rate", "0")),
        ("", "", ["--joint-rate", "1e10", "--format", "ros"], ("1e+10 Hz", "samples")),
        ("", "", ["--out", "x.json"], ("--out", "x.json")),
        ("", "", ["--speed", "0"], ("--speed", "0")),
        ("", "", ["--speed", "nan"], ("--speed", "nan")),
        ("", "", ["--format", "xml"], ("--format", "xml")),
        ("[0.35, 0, -0.767]", "[-0.35, 0, -0.767]", [], ("must lead somewhere",)),
        ("[0.35, 0, -0.767]", "[350, 0, -767]", [], ("metres, not mm",)),
        ("[0.35, 0, -0.767]", "[nan, 0, -0.767]", [], ("finite", "nan")),
        ("max_acceleration_m_s2 = 5", "max_acceleration_m_s2 = 0", [], ("max_acceleration_m_s2", "0")),
        ("max_acceleration_m_s2 = 5", "max_acceleration_m_s2 = 5\nsample_time_ms = 1e-4", [], ("samples", "ms")),
        ("max_acceleration_m_s2 = 5", "max_acceleration_m_s2 = 5\nmax_velocity_m_s = 0", [], ("max_velocity_m_s",)),
    ],
)
def test_a_move_that_cannot_be_run_is_refused_in_one_line(capsys, old, new, options, words) -> None:
    move = write("move.toml", (MOVE + DELTA).replace(old, new, 1))
    refuse(capsys, ["trajectory", "--move", move, "--shaper", "none", *options], *words)


def test_a_shaped_scara_move_is_written_in_degrees_and_metres(capsys) -> None:
    robot = '[robot]\nkind = "scara"\nelbow = "left"\n[robot.lengths_m]\ninner = 0.4\nouter = 0.35\n'
    text = MOVE.replace("-0.35, 0, -0.767", "-0.35, 0.3, 0").replace("0.35, 0, -0.767", "0.35, 0.3, 0")
    write("shaper.json", printed(capsys, ["shaper", *MODE, "--type", "zvd"]))
    command = ["trajectory", "--move", write("move.toml", text + robot), "--shaper", "shaper.json"]
    printed(capsys, [*command, "--format", "joints"])
    header = Path("trajectory.csv").read_text().splitlines()[0].split(",")
    assert header[2:5] == ["joint_1_deg", "joint_2_deg", "z_m"]
    rows = np.loadtxt("trajectory.csv", delimiter=",", skiprows=1)
    assert np.all(rows[:, 3] < 0)
    first, both = np.radians(rows[-1, 2]), np.radians(rows[-1, 2] + rows[-1, 3])
    # identity: angles are rounded to 1e-9 degrees
    assert 0.4 * math.cos(first) + 0.35 * math.cos(both) == pytest.approx(0.35, abs=1e-10)
    assert 0.4 * math.sin(first) + 0.35 * math.sin(both) == pytest.approx(0.3, abs=1e-10)
    assert np.abs(rows[-1, 5:]).max() == 0


PROFILES = ["bang-bang", "trapezoid", "s-curve", "quintic", "b-spline", "pick-and-place"]


@pytest.mark.parametrize(("profile", "kind"), [*((profile, "fir-zv") for profile in PROFILES), ("quintic", "notch")])
def test_every_profile_ends_at_its_place_at_rest(capsys, profile, kind) -> None:
    limits = "max_velocity_m_s = 2\n" + ("max_jerk_m_s3 = 200\n" if profile == "s-curve" else "")
    text = MOVE if profile == "pick-and-place" else MOVE.replace("pick_height_m = 0.05\nplace_height_m = 0.05\n", "")
    move = write("move.toml", f'{text}{limits}profile = "{profile}"\n{DELTA}')
    shaper = write("shaper.json", printed(capsys, ["shaper", *MODE, "--type", kind]))
    printed(capsys, ["trajectory", "--move", move, "--shaper", shaper, "--format", "csv"])
    rows = np.loadtxt("trajectory.csv", delimiter=",", skiprows=1)
    # identity: rounded to a nanometre; a filter's tail is taken off at a micrometre
    assert rows[-1, 2:5] == pytest.approx([0.35, 0, -0.767], abs=1e-9)
    assert np.abs(rows[-1, 5:]).max() == 0


def test_a_path_s_feed_rate_is_shaped_before_its_corners(capsys) -> None:
    text = """
schema = "tagsway/move/1"
profile = "path"
from_m = [0.2, 0, 0]
waypoints_m = [[0.3, 0, 0]]
to_m = [0.3, 0.1, 0]
feed_rate_m_s = 0.16
corner_error_mm = 0.5
max_acceleration_m_s2 = 5
shaped_axes = ["path"]
[limits]
path_deviation_mm = 0.6
[robot]
kind = "scara"
[robot.lengths_m]
inner = 0.225
outer = 0.175
"""
    shaper = printed(capsys, ["shaper", "--frequency", "6.34", "--damping", "0.022", "--type", "fir-zv"])
    move = write("move.toml", text)
    out = printed(
        capsys, ["trajectory", "--move", move, "--shaper", write("shaper.json", shaper), "--format", "joints"]
    )
    assert "singularity" in out
    described = json.loads(Path("trajectory.json").read_text())
    assert described["path_deviation_mm"] <= 0.6
    assert described["end"] == [0.3, 0.1, 0]
