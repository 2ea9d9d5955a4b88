"""`identify simulate`: what it prints and writes, and what it refuses."""

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

from example_result import example, not_determined
from tagsway.cli.app import run
from tagsway.store.documents import write_result

PAYLOAD = ["--length", "45.85", "--stiffness", "27.42", "--damping-ratio", "0.083"]
MOVE = str(Path(__file__).parents[1] / "sample_data" / "move.toml")


@pytest.fixture(autouse=True)
def inside(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def simulate(capsys, *arguments: str) -> str:
    assert run(["simulate", "--move", MOVE, *arguments]) == 0, capsys.readouterr().err
    return capsys.readouterr().out


def test_one_move_is_simulated_unshaped_and_shaped_and_written(capsys) -> None:
    said = simulate(capsys, *PAYLOAD, "--spread", "11.46", "--mass", "225", "--out", "out")
    assert "2.4727 Hz" in said
    assert "21 samples" in said
    names = sorted(str(path.relative_to("out")) for path in Path("out").rglob("*") if path.is_file())
    assert names == [
        "figures/simulation.png",
        "motion-unshaped.csv",
        "motion-x.csv",
        "rows.csv",
        "simulation.json",
    ]
    document = json.loads(Path("out/simulation.json").read_text())
    assert document["schema"] == "tagsway/simulation/1"
    assert [row["shaping"] for row in document["rows"]] == ["unshaped", "x"]
    assert document["payload"]["natural_frequency_hz"] == pytest.approx(2.4727, abs=1e-3)
    unshaped, shaped = document["rows"]
    assert shaped["overshoot_percent"] < unshaped["overshoot_percent"]
    assert shaped["box_error_mm"] < unshaped["box_error_mm"]
    motion = np.genfromtxt("out/motion-x.csv", delimiter=",", names=True)
    assert motion["pcp_x_mm"][-1] == pytest.approx(350, abs=1)
    assert motion["pcp_force_z_n"][0] == pytest.approx(0.225 * (9.81 + 4.0), rel=1e-6)  # identity: it lifts off at 4


def test_a_move_that_lets_nothing_be_shaped_says_so_where_a_shaper_is_given(capsys) -> None:
    text = Path(MOVE).read_text()
    assert 'shaped_axes = ["x"]' in text
    Path("move.toml").write_text(text.replace('shaped_axes = ["x"]', "shaped_axes = []"))
    command = ["simulate", "--move", "move.toml", *PAYLOAD]
    assert run([*command, "--shaper", "zvd", "--json"]) == 0
    (warning,) = json.loads(capsys.readouterr().out)["warnings"]
    assert warning["code"] == "nothing_shaped"
    assert "the zvd shaper takes no part" in warning["message"]
    assert run([*command, "--shaper", "none"]) == 0
    assert "shaped_axes" not in capsys.readouterr().out
    assert run(["shaper", "--frequency", "2.5", "--damping", "0.08"]) == 0
    Path("shaper.json").write_text(capsys.readouterr().out)
    assert run(["trajectory", "--move", "move.toml", "--shaper", "shaper.json"]) == 0
    assert "warning: the move's shaped_axes is []" in capsys.readouterr().out


def test_json_is_printed_instead_of_a_table_and_nothing_is_written(capsys, inside) -> None:
    document = json.loads(simulate(capsys, *PAYLOAD, "--shaper", "none", "--json"))
    assert [row["shaping"] for row in document["rows"]] == ["unshaped"]
    assert document["shaper"] is None
    assert list(inside.iterdir()) == []


def test_a_sweep_names_the_pairs(capsys) -> None:
    said = simulate(capsys, *PAYLOAD, "--accelerations", "2.5,5,8", "--reference", "350", "--out", "out")
    assert "no slower than unshaped at 8 m/s²" in said
    rows = list(csv.DictReader(io.StringIO(Path("out/rows.csv").read_text())))
    assert [row["max_acceleration_m_s2"] for row in rows] == 3 * ["2.5", "5", "8"]
    assert all(float(row["box_error_mm"]) > 0 for row in rows)
    pairs = list(csv.DictReader(io.StringIO(Path("out/pairs.csv").read_text())))
    quickest = min(
        (row for row in pairs if row["unshaped_max_acceleration_m_s2"] == "8"),
        key=lambda row: (float(row["shaped_motion_time_s"]), float(row["shaped_overshoot_percent"])),
    )
    assert f"{quickest['shaping']} shaped at {quickest['shaped_max_acceleration_m_s2']} m/s²" in said


def test_limits_are_scanned_to_both_ends(capsys) -> None:
    options = ["--accelerations", "4:5:0.5", "--max-overshoot", "2", "--box", "15", "--json", "--out", "out"]
    found = json.loads(simulate(capsys, *PAYLOAD, *options))
    table = list(csv.DictReader(io.StringIO(Path("out/limits.csv").read_text())))
    last = [row["last_feasible"] and row["last_feasible"]["max_acceleration_m_s2"] for row in found["limits"]]
    assert [row["last_feasible_max_acceleration_m_s2"] for row in table] == [f"{a:g}" if a else "" for a in last]
    assert len(found["limits"]) == 6
    assert found["limits"][0]["scan_m_s2"] == [4.0, 5.0]
    assert len(found["rows"]) == 9


def test_deviations_have_a_row_for_each_frequency(capsys) -> None:
    said = simulate(capsys, *PAYLOAD, "--study", "deviations", "--spread", "10", "--samples", "3", "--shaper", "zvd")
    assert said.count("unshaped ") >= 3
    assert "2.23" in said
    assert "2.72" in said


def test_a_result_gives_the_payload_and_its_errors(capsys) -> None:
    write_result(Path("result.json"), example()[0])
    one = json.loads(simulate(capsys, "--from", "result.json", "--json"))
    many = json.loads(simulate(capsys, "--from", "result.json", "--samples", "20", "--json"))
    again = json.loads(simulate(capsys, "--from", "result.json", "--samples", "20", "--json"))
    assert one["payload"]["samples"] == 1
    assert many["payload"]["samples"] == 20
    assert many["rows"] == again["rows"]  # seeded
    assert many["rows"][0]["overshoot_percent"] >= one["rows"][0]["overshoot_percent"]


def test_a_result_without_a_mode_gives_no_payload(capsys) -> None:
    write_result(Path("result.json"), not_determined()[0])
    assert run(["simulate", "--move", MOVE, "--from", "result.json"]) == 2
    assert "holds no mode to design for, nor to simulate" in capsys.readouterr().err


def test_measurements_are_each_a_sample(capsys) -> None:
    Path("measurements.csv").write_text(
        "file,natural_frequency_hz,damping_ratio\na,2.4,0.05\nb,2.5,0.06\nc,2.6,0.04\n", encoding="utf-8"
    )
    found = json.loads(simulate(capsys, "--from", "measurements.csv", "--json"))
    assert found["payload"]["samples"] == 4
    assert found["payload"]["natural_frequency_hz"] == pytest.approx(2.5)
    assert found["rows"][0]["frequency_hz"] == pytest.approx([2.4, 2.6])


def test_a_second_mode_is_said_to_be_assumed(capsys) -> None:
    said = simulate(capsys, "--frequency", "2", "--damping", "0.05", "--second-mode", "7:0.03")
    assert "7 Hz (gain 1)" in said
    assert "taken as 1" in said


MODE = ["--frequency", "2", "--damping", "0.05"]


def test_measurements_are_the_samples_and_no_other_number_of_them_is_taken(capsys) -> None:
    Path("measurements.csv").write_text("natural_frequency_hz,damping_ratio\n2.4,0.05\n2.5,0.05\n")
    assert run(["simulate", "--move", MOVE, "--from", "measurements.csv", "--samples", "5"]) == 2
    assert "the measurements are the samples" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ([], "needs a payload"),
        (["--frequency", "2"], "--damping"),
        ([*MODE, "--length", "40"], "one of them"),
        ([*MODE, "--from", "result.json"], "contradict"),
        (["--frequency", "nan", "--damping", "0.1"], "--frequency is nan"),
        (["--frequency", "2", "--damping", "1"], "--damping is 1"),
        ([*MODE, "--stiffness", "3"], "--stiffness goes with --length"),
        (["--length", "40", "--damping", "0.1", "--stiffness", "-500"], "not stable"),
        ([*MODE, "--spread", "0"], "--spread is 0"),
        ([*MODE, "--samples", "5"], "nothing varies"),
        ([*MODE, "--spread", "5", "--samples", "1"], "at least 2"),
        ([*MODE, "--samples", "0"], "--samples is 0"),
        ([*MODE, "--accelerations", "5:1:1"], "FROM:TO:STEP"),
        ([*MODE, "--accelerations", "fast"], "FROM:TO:STEP"),
        ([*MODE, "--accelerations", "1:20:0.0001"], "at most"),
        ([*MODE, "--accelerations", "3,2"], "rising"),
        ([*MODE, "--study", "deviations"], "--spread"),
        ([*MODE, "--study", "deviations", "--spread", "5", "--accelerations", "1,2"], "--accelerations"),
        ([*MODE, "--study", "limits"], "--max-overshoot"),
        ([*MODE, "--study", "accelerations", "--max-overshoot", "2"], "--study limits"),
        ([*MODE, "--max-overshoot", "-2"], "--max-overshoot is -2"),
        ([*MODE, "--reference", "0"], "--reference is 0"),
        ([*MODE, "--mass", "nan"], "--mass is nan"),
        ([*MODE, "--mass", "40", "--accelerations", "1,2"], "--mass"),
        ([*MODE, "--second-gain", "0.5"], "no second body"),
        ([*MODE, "--second-mode", "7:0.02", "--second-gain", "nan"], "--second-gain is nan"),
        ([*MODE, "--second-mode", "7"], "HZ:RATIO"),
        ([*MODE, "--second-mode", "7:2"], "damping"),
        ([*MODE, "--shaper", "zvq"], "zvq"),
        ([*MODE, "--shaper", "missing.json"], "missing.json"),
        (["--from", "missing.json"], "missing.json"),
    ],
)
def test_what_cannot_be_simulated_is_one_line_and_no_file(capsys, inside, arguments, word) -> None:
    assert run(["simulate", "--move", MOVE, "--out", "out", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.strip().splitlines()
    assert line.startswith("error: ")
    assert word in line
    assert list(inside.iterdir()) == []
