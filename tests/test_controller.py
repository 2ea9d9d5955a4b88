"""What a user writes about a move, and what the controller gets."""

import hashlib
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from tagsway.errors import InputError
from tagsway.model import DesignMode, Limits, Move
from tagsway.pipeline.shaping import plan_shaped_move
from tagsway.shapers import design_shaper
from tagsway.store.controller import controller_text, describe_trajectory
from tagsway.store.moves import read_move
from tagsway.trajectories import apply_shaper, check_limits, plan_move, sample_trajectory, slow_down

MOVE = """
schema = "tagsway/move/1"
from_m = [-0.35, 0, -0.767]
to_m = [0.35, 0, -0.767]
profile = "pick-and-place"
pick_height_m = 0.05
place_height_m = 0.05
max_acceleration_m_s2 = 5
shaped_axes = ["x", "z"]
sample_time_ms = 2
run_time_s = 2.5
[limits]
acceleration_m_s2 = 20
box_m = [[-1, -1, -1], [1, 1, 0]]
[robot]
kind = "delta"
leg_azimuth_deg = -90
joint_limits_deg = [[-40, 90]]
[robot.lengths_m]
base = 0.2
platform = 0.045
upper = 0.348088
lower = 0.8
"""
ZV = design_shaper("zv", DesignMode(frequency_hz=2.4727, damping_ratio=3.5146e-4))


@pytest.fixture
def move(tmp_path) -> Move:
    (tmp_path / "move.toml").write_text(MOVE, encoding="utf-8")
    return read_move(tmp_path / "move.toml")


@pytest.fixture
def shaped(move):
    return apply_shaper(plan_move(move), ZV, move.shaped_axes)


@pytest.fixture
def sampled(move, shaped):
    return sample_trajectory(shaped, move.sample_time_ms / 1e3, run_time_s=move.run_time_s)


def read_rows(text: str, delimiter: str = ";", skip: int = 0) -> np.ndarray:
    return np.loadtxt(text.splitlines(), delimiter=delimiter, skiprows=skip)


def test_a_move_file_is_read_as_it_stands(move):
    assert move.from_m == (-0.35, 0.0, -0.767)
    assert move.max_acceleration_m_s2 == 5
    assert move.shaped_axes == ("x", "z")
    assert move.limits == Limits(acceleration_m_s2=20, box_m=((-1, -1, -1), (1, 1, 0)))
    assert move.robot.kind == "delta"
    assert move.max_jerk_m_s3 is None


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('schema = "tagsway/move/1"', "", "expected schema = 'tagsway/move/1', found None"),
        ("move/1", "move/2", "found 'tagsway/move/2'"),
        ("max_acceleration_m_s2 = 5", "", "max_acceleration_m_s2"),
        ("max_acceleration_m_s2 = 5", "max_acceleration_m_s2 = 0", "max_acceleration_m_s2 must be positive, not 0"),
        ("max_acceleration_m_s2 = 5", "max_acceleration_m_s2 = nan", "max_acceleration_m_s2 must be positive, not nan"),
        ("max_acceleration_m_s2 = 5", 'max_acceleration_m_s2 = "fast"', "max_acceleration_m_s2"),
        ("max_acceleration_m_s2 = 5", "max_acceleration_m_s2 = 5\ncolour = 1", "colour"),
        ("acceleration_m_s2 = 20", "acceleration_m_s2 = 20\nspeed = 1", "limits.speed"),
        ("acceleration_m_s2 = 20", "acceleration_m_s2 = -1", "acceleration_m_s2 must be positive"),
        ("pick-and-place", "loop", "profile"),
        ("to_m = [0.35, 0, -0.767]", "to_m = [0.35, 0]", "to_m"),
        ("to_m = [0.35, 0, -0.767]", "to_m = [-0.35, 0, -0.767]", "must lead somewhere"),
        ("to_m = [0.35, 0, -0.767]", "to_m = [350, 0, -767]", "too long for a robot"),
        ("to_m = [0.35, 0, -0.767]", "to_m = [", "is not TOML"),
    ],
)
def test_a_faulty_move_file_is_refused_in_one_line_with_its_name(tmp_path, old, new, words):
    path = tmp_path / "faulty.toml"
    path.write_text(MOVE.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError) as refusal:
        read_move(path)
    message = str(refusal.value)
    assert words in message
    assert "faulty.toml" in message
    assert "\n" not in message
    assert "pydantic" not in message


def test_a_missing_folder_or_binary_move_file_is_refused(tmp_path):
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    for name, words in [("none.toml", "no such file"), (".", "directory"), ("binary.toml", "not TOML")]:
        with pytest.raises(InputError, match=words):
            read_move(tmp_path / name)


def test_beckhoff_rows_are_index_and_metres_with_nine_decimals(sampled, move):
    lines = controller_text(sampled).splitlines()
    assert lines[0] == "0;-0.350000000;0.000000000;-0.767000000"
    assert lines[-1] == "1250;0.350000000;0.000000000;-0.767000000"
    assert len(lines) == 1251
    assert not any("-0.000000000" in line for line in lines)


def test_beckhoff_rows_keep_the_acceleration_through_two_differences(shaped):
    sample_time_s = 0.001
    rows = read_rows(controller_text(sample_trajectory(shaped, sample_time_s)))
    difference = np.diff(rows[:, 1:], 2, axis=0) / sample_time_s**2
    time = (np.arange(len(difference)) + 1) * sample_time_s
    # away from the steps, where the difference is an average over both sides
    clear = np.min(np.abs(time[:, None] - shaped.breaks_s), axis=1) > sample_time_s
    assert np.count_nonzero(clear) > 1200
    # identity: three roundings of half a nanometre, weighted 1, 2, 1
    assert np.max(np.abs(difference - shaped(time, 2))[clear]) <= 2e-3 + 1e-6


def test_pva_rows_add_velocity_acceleration_and_direction(sampled):
    rows = read_rows(controller_text(sampled, format="beckhoff-pva"))
    assert rows.shape == (1251, 13)
    assert rows[:, 4:7] == pytest.approx(sampled.velocity_m_s, abs=5.1e-10)
    assert rows[:, 7:10] == pytest.approx(sampled.acceleration_m_s2, abs=5.1e-10)
    assert set(np.unique(rows[:, 10:])) == {-1.0, 0.0, 1.0}
    assert rows[-1, 4:].tolist() == [0.0] * 9
    moving = np.abs(rows[:, 4:7]) > 0
    assert np.all(rows[:, 10:][moving] == np.sign(rows[:, 4:7][moving]))


def test_plain_csv_has_a_header_with_units(sampled):
    text = controller_text(sampled, format="csv")
    assert text.startswith("index,time_s,x_m,y_m,z_m,vx_m_s,")
    rows = read_rows(text, ",", 1)
    assert rows[-1, 1] == pytest.approx(2.5, abs=1e-9)
    assert rows.shape == (1251, 11)


def test_an_unknown_format_is_refused(sampled):
    with pytest.raises(InputError, match="expected one of beckhoff, beckhoff-pva, csv, joints, ros"):
        controller_text(sampled, format="xml")


def test_the_description_says_what_the_csv_holds(sampled, shaped, move):
    text = controller_text(sampled)
    described = describe_trajectory(sampled, check_limits(shaped, plan_move(move), move), text)
    assert json.loads(json.dumps(described, allow_nan=False)) == json.loads(json.dumps(described))
    assert described["schema"] == "tagsway/trajectory/1"
    assert described["unit"] == "m"
    assert described["start"] == pytest.approx(list(move.from_m), abs=1e-12)
    assert described["end"] == pytest.approx(list(move.to_m), abs=1e-12)
    assert described["duration_s"] == pytest.approx(2.517484360372197 / math.sqrt(5) + ZV.duration_s, rel=1e-12)
    assert described["run_time_s"] == pytest.approx(2.5)
    assert described["peak_jerk_m_s3"] == [None, 0.0, None]
    assert described["lost_vertical_mm"]["pick"] == pytest.approx(24.986, abs=1e-3)
    assert [check["name"] for check in described["limits"]] == ["acceleration_m_s2", "box_m"]
    assert described["sha256"] == hashlib.sha256(text.encode()).hexdigest()
    assert described["dry_run"] is False


def test_a_dry_run_is_marked_and_slow(shaped, move):
    slow = slow_down(shaped, 0.1)
    sampled = sample_trajectory(slow, 0.002)
    quick = check_limits(shaped, plan_move(move), move)
    report = check_limits(slow, plan_move(move), replace(move, run_time_s=None))
    described = describe_trajectory(sampled, report, controller_text(sampled), speed=0.1)
    assert described["dry_run"] is True
    assert described["speed"] == 0.1
    assert described["peak_velocity_m_s"][0] == pytest.approx(0.1 * quick.peak_velocity_m_s[0], rel=1e-9)
    assert described["end"] == pytest.approx(list(move.to_m), abs=1e-12)


def test_tau_is_reported_by_both_definitions(tmp_path) -> None:
    move = Move(
        from_m=(-0.35, 0.0, -0.767),
        to_m=(0.35, 0.0, -0.767),
        pick_height_m=0.05,
        place_height_m=0.05,
        max_acceleration_m_s2=5.0,
    )
    zv = design_shaper("zv", DesignMode(frequency_hz=2.4727, damping_ratio=3.5146e-4))
    ratio = plan_shaped_move(move, zv).files()[1]["shaper_ratio"]
    # Published values: .4215 s with the blend, .2215 s without.
    assert ratio["acceleration_s"] == pytest.approx(0.4215, abs=5e-5)
    assert ratio["level_acceleration_s"] == pytest.approx(0.2215, abs=5e-5)
    assert ratio["with_blend"] == pytest.approx(0.202208 / 0.42151, rel=1e-4)
    assert plan_shaped_move(move, None).files()[1]["shaper_ratio"] is None
