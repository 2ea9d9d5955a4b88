"""Filters and feed rates over a move, and the ratio of the shaper's length to the acceleration's."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lsim

from tagsway.errors import InputError
from tagsway.model import DesignMode, DigitalFilter, Impulse, Limits, Move, Shaper
from tagsway.shapers import design_shaper
from tagsway.trajectories import (
    apply_shaper,
    check_limits,
    find_ratio_curves,
    find_shaper_ratio,
    plan_move,
    sample_trajectory,
)

NOTES = Path(__file__).parents[2] / "shared" / "notes"
REFERENCE = Move(
    from_m=(-0.35, 0.0, -0.767),
    to_m=(0.35, 0.0, -0.767),
    max_acceleration_m_s2=5.0,
    pick_height_m=0.05,
    place_height_m=0.05,
)
ZV = design_shaper("zv", DesignMode(frequency_hz=2.4727, damping_ratio=3.5146e-4))
ALONE = Shaper(type="given", modes=(), impulses=(Impulse(time_s=0, amplitude=1),))


def low_pass(corner_hz: float, damping: float = 1.0) -> Shaper:
    w = 2 * math.pi * corner_hz
    return replace(ALONE, filter=DigitalFilter(numerator=(w**2,), denominator=(1.0, 2 * damping * w, w**2)))


def notch(frequency_hz: float, damping: float) -> Shaper:
    w = 2 * math.pi * frequency_hz
    return replace(ALONE, filter=DigitalFilter(numerator=(1.0, 2 * damping * w, w**2), denominator=(1.0, 2 * w, w**2)))


@pytest.mark.parametrize("shaper", [low_pass(3.0), low_pass(8.0, 0.4), notch(2.4727, 0.02)], ids=["lp", "lp2", "notch"])
def test_a_filter_over_a_move_is_the_linear_systems_response(shaper):
    trajectory = plan_move(REFERENCE)
    filtered = apply_shaper(trajectory, shaper, ("x", "z"))
    time = np.linspace(0, trajectory.duration_s, 20_001)
    for axis in (0, 2):
        command = trajectory(time)[:, axis] - trajectory(0.0)[axis]
        _, response, _ = lsim((shaper.filter.numerator, shaper.filter.denominator), command, time)
        off = filtered(time)[:, axis] - trajectory(0.0)[axis] - response
        assert np.max(np.abs(off)) < 1e-8  # discretisation of the reference: first order hold on 60 µs


def test_impulses_box_and_filter_come_one_after_another():
    shaper = replace(low_pass(4.0), impulses=ZV.impulses, box_s=0.1)
    trajectory = plan_move(REFERENCE)
    in_turn = apply_shaper(apply_shaper(trajectory, replace(ZV, box_s=0.1), ("x", "z")), low_pass(4.0), ("x", "z"))
    time = np.linspace(0, in_turn.duration_s, 2001)
    assert np.max(np.abs(apply_shaper(trajectory, shaper, ("x", "z"))(time) - in_turn(time))) < 1e-12  # identity


@settings(deadline=None, derandomize=True, max_examples=25)
@given(
    profile=st.sampled_from(["pick-and-place", "bang-bang", "s-curve", "quintic", "b-spline"]),
    acceleration=st.floats(1, 50),
    corner_hz=st.floats(1, 50),
    damping=st.floats(0.3, 1.5),
    axes=st.sampled_from([("x",), ("x", "z"), ("path",)]),
    sample_time_s=st.floats(1e-3, 8e-3),
)
def test_a_filtered_move_ends_exactly_on_any_grid(profile, acceleration, corner_hz, damping, axes, sample_time_s):
    level = profile != "pick-and-place"
    move = replace(
        REFERENCE,
        profile=profile,
        max_acceleration_m_s2=acceleration,
        max_jerk_m_s3=500.0 if profile == "s-curve" else None,
        pick_height_m=0.0 if level else 0.05,
        place_height_m=0.0 if level else 0.05,
    )
    trajectory = plan_move(move)
    try:
        shaped = apply_shaper(trajectory, low_pass(corner_hz, damping), axes)
    except InputError as refusal:
        assert "runs backwards" in str(refusal)  # noqa: PT017 - an overshoot has no path to run on
        assert (axes, level) == (("path",), False)
        return
    sampled = sample_trajectory(shaped, sample_time_s)
    assert np.max(np.abs(sampled.position_m[-1] - move.to_m)) <= 1e-9
    assert np.max(np.abs(sampled.velocity_m_s[-1])) <= 1e-9
    assert np.max(np.abs(shaped(np.nextafter(shaped.duration_s, 0), 1))) <= 1e-9
    for order, tolerance in ((0, 1e-10), (1, 1e-8)):
        before = shaped(np.nextafter(shaped.breaks_s[1:-1], 0), order)
        assert np.max(np.abs(shaped(shaped.breaks_s[1:-1], order) - before)) <= tolerance


def test_a_tail_is_over_when_a_micrometre_is_left_and_not_before_the_shapers_own():
    trajectory = plan_move(REFERENCE)
    own = apply_shaper(trajectory, low_pass(3.0), ("x", "z")).duration_s - trajectory.duration_s
    longer = apply_shaper(trajectory, replace(low_pass(3.0), tail_s=2.0), ("x", "z"))
    assert longer.duration_s == pytest.approx(trajectory.duration_s + 2.0, rel=1e-12)
    assert np.max(np.abs(longer(trajectory.duration_s + own)[:2] - REFERENCE.to_m[:2])) < 1.1e-6


def test_a_filter_that_rings_on_for_ever_is_refused():
    with pytest.raises(InputError, match="rings on"):
        apply_shaper(plan_move(REFERENCE), low_pass(1.0, 1e-3), ("x", "z"))


def test_a_shaped_feed_rate_keeps_the_path_of_a_pick_and_place():
    trajectory = plan_move(REFERENCE)
    shaped = apply_shaper(trajectory, ZV, ("path",))
    assert shaped.duration_s == pytest.approx(trajectory.duration_s + ZV.duration_s, rel=1e-12)
    report = check_limits(shaped, trajectory, REFERENCE)
    assert report.path_deviation_m < 1e-6  # the polyline that it is compared with
    assert report.lost_vertical_m == pytest.approx((0, 0), abs=1e-9)
    # the distance along the path is the shaped one: at the same place both have gone as far
    time = np.linspace(0, shaped.duration_s, 40_001)
    gone = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(shaped(time), axis=0), axis=1))])
    fine = np.linspace(0, trajectory.duration_s, 40_001)
    before = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(trajectory(fine), axis=0), axis=1))])
    expected = sum(i.amplitude * np.interp(time - i.time_s, fine, before) for i in ZV.impulses)
    assert np.max(np.abs(gone - expected)) < 2e-7  # discretisation


def test_a_straight_feed_rate_is_shaped_as_its_axes_are():
    move = Move(from_m=(0, 0, 0), to_m=(0.5, 0.1, 0.2), max_acceleration_m_s2=5, profile="quintic")
    trajectory = plan_move(move)
    along, both = (apply_shaper(trajectory, ZV, axes) for axes in (("path",), ("x", "z")))
    time = np.linspace(0, along.duration_s, 999)
    assert np.max(np.abs(along(time) - both(time))) < 1e-12  # identity


def test_a_path_that_turns_where_it_stops_has_no_feed_rate_to_shape():
    move = Move(
        from_m=(0, 0, 0), to_m=(0.1, 0.1, 0), waypoints_m=((0.1, 0, 0),), profile="path", max_acceleration_m_s2=5
    )
    with pytest.raises(InputError, match="turns where it stops"):
        apply_shaper(plan_move(move), ZV, ("path",))


def test_limits_are_checked_again_after_shaping():
    move = replace(REFERENCE, profile="quintic", pick_height_m=0, place_height_m=0, limits=Limits(jerk_m_s3=50.0))
    trajectory = plan_move(move)
    unshaped, shaped = (
        check_limits(each, trajectory, move) for each in (trajectory, apply_shaper(trajectory, ZV, ("x", "z")))
    )
    assert [notice.code for notice in unshaped.notices] == ["limit_jerk_m_s3"]
    assert not shaped.notices
    assert shaped.peak_jerk_m_s3[0] == pytest.approx(0.500276 * unshaped.peak_jerk_m_s3[0], rel=1e-5)


def test_the_acceleration_time_of_the_reference_counts_with_and_without_its_blend():
    ratio = find_shaper_ratio(plan_move(REFERENCE), ZV)
    # published value
    assert (ratio.acceleration_s, ratio.level_acceleration_s) == pytest.approx((0.4215, 0.2215), abs=5e-5)
    assert ratio.ratio == pytest.approx(ZV.duration_s / ratio.acceleration_s, rel=1e-12)
    assert ratio.level_ratio == pytest.approx(ZV.duration_s / ratio.level_acceleration_s, rel=1e-12)


@pytest.mark.parametrize(
    ("changes", "acceleration_s"),
    [
        ({"profile": "bang-bang"}, math.sqrt(0.7 / 5)),
        ({"profile": "trapezoid", "max_velocity_m_s": 1.0}, 0.2),
        ({"profile": "s-curve", "max_velocity_m_s": 1.0, "max_jerk_m_s3": 50.0}, 0.3),
        ({"profile": "quintic"}, math.sqrt(10 / math.sqrt(3) * 0.7 / 5) / 2),
    ],
)
def test_the_acceleration_time_of_a_straight_move_is_that_to_its_full_speed(changes, acceleration_s):
    ratio = find_shaper_ratio(plan_move(replace(REFERENCE, pick_height_m=0, place_height_m=0, **changes)), ZV)
    assert ratio.acceleration_s == pytest.approx(acceleration_s, rel=1e-9)  # identity
    assert ratio.level_acceleration_s == ratio.acceleration_s


def test_below_a_ratio_of_1_the_full_acceleration_is_still_reached_and_above_it_is_not():
    curves = find_ratio_curves(REFERENCE, ZV, ratios=(0.5, 1.0, 2.0))
    assert [curve.ratio.ratio for curve in curves] == pytest.approx([0.5, 1.0, 2.0], rel=1e-9)
    reached = [float(np.max(curve.shaped_x[2, :, 0]) / np.max(curve.unshaped[2, :, 0])) for curve in curves]
    assert reached[0] == pytest.approx(1, abs=1e-9)
    assert reached[2] < 0.9
    for curve in curves:
        for moved in (curve.unshaped, curve.shaped_x, curve.shaped_xz):
            assert np.max(np.abs(moved[0, -1] - REFERENCE.to_m)) < 1e-9
        assert np.max(np.abs(curve.shaped_x[0, :, 0] - curve.shaped_xz[0, :, 0])) < 1e-12


@pytest.mark.parametrize("ratios", [(0.0,), (math.nan,), (-1.0,)])
def test_a_ratio_that_cannot_be_is_refused(ratios):
    with pytest.raises(InputError, match="must be positive"):
        find_ratio_curves(REFERENCE, ZV, ratios=ratios)


def test_a_ratio_needs_a_way_across_and_no_limit_but_the_acceleration():
    upwards = Move(from_m=(0, 0, 0), to_m=(0, 0, 0.3), profile="bang-bang", max_acceleration_m_s2=5)
    with pytest.raises(InputError, match="way across"):
        find_shaper_ratio(plan_move(upwards), ZV)
    with pytest.raises(InputError, match="acceleration alone"):
        find_ratio_curves(replace(REFERENCE, max_velocity_m_s=1.0), ZV)


def test_trajectory_times_and_the_apex_are_the_recomputed_ones():
    if not NOTES.exists():
        pytest.skip("the published values are not beside this clone")
    group = json.loads((NOTES / "acceptance.json").read_text(encoding="utf-8"))["6_trajectory"]
    for acceleration, time_s in group["T_unshaped_s"].items():
        trajectory = plan_move(replace(REFERENCE, max_acceleration_m_s2=float(acceleration)))
        assert trajectory.duration_s == pytest.approx(time_s, abs=5.1e-5)  # published value
        assert trajectory.duration_s * math.sqrt(float(acceleration)) == pytest.approx(group["C=T*sqrt(a)"], rel=1e-12)
        apex = trajectory(trajectory.duration_s / 2)[2] - REFERENCE.from_m[2]
        assert apex == pytest.approx(group["apex_height_m"], abs=5.1e-11)  # published value
