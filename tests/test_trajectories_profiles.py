"""Straight profiles of limited jerk, and the B-spline."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tagsway.errors import InputError
from tagsway.model import Move
from tagsway.trajectories import check_limits, plan_move

S_CURVE = Move(
    from_m=(0.0, 0.0, 0.0),
    to_m=(0.6, 0.0, 0.0),
    profile="s-curve",
    max_velocity_m_s=1.0,
    max_acceleration_m_s2=5.0,
    max_jerk_m_s3=50.0,
)


def peaks(move: Move) -> tuple[float, float, float]:
    trajectory = plan_move(move)
    report = check_limits(trajectory, trajectory, move)
    assert report.peak_jerk_m_s3[0] is not None
    return report.peak_velocity_m_s[0], report.peak_acceleration_m_s2[0], report.peak_jerk_m_s3[0]


def test_an_s_curve_reaches_all_three_limits_in_the_textbook_time():
    assert plan_move(S_CURVE).duration_s == pytest.approx(0.6 / 1 + 1 / 5 + 5 / 50, rel=1e-12)  # identity
    assert peaks(S_CURVE) == pytest.approx((1, 5, 50), rel=1e-9)


@pytest.mark.parametrize(
    ("changes", "duration_s", "reached"),
    [
        # no cruise: v (v/a + a/j) = L
        ({"max_velocity_m_s": 100.0}, 2 * (1.5 / 5 + 0.1), (1.5, 5, 50)),
        # full acceleration is not reached: 2 v √(v/j) = L
        ({"max_acceleration_m_s2": 500.0, "max_velocity_m_s": 9.0}, 4 * (0.6 / 2 / 50) ** (1 / 3), (None, None, 50)),
        # nor is it at the cruise: √(v/j) < a/j
        ({"max_velocity_m_s": 0.02}, 0.6 / 0.02 + 2 * math.sqrt(0.02 / 50), (0.02, 1, 50)),
    ],
    ids=["no cruise", "jerk alone", "slow cruise"],
)
def test_an_s_curve_leaves_out_the_phases_that_it_has_no_room_for(changes, duration_s, reached):
    move = replace(S_CURVE, **changes)
    assert plan_move(move).duration_s == pytest.approx(duration_s, rel=1e-6)  # identity
    for value, expected in zip(peaks(move), reached, strict=True):
        assert expected is None or value == pytest.approx(expected, rel=1e-6)


@settings(deadline=None, derandomize=True, max_examples=60)
@given(
    length=st.floats(1e-3, 3),
    v=st.floats(0.01, 10),
    a=st.floats(0.1, 100),
    j=st.floats(1, 1e5),
    grow=st.floats(1.01, 2),
)
def test_an_s_curve_is_quicker_whenever_a_limit_is_raised(length, v, a, j, grow):
    move = replace(S_CURVE, to_m=(length, 0.0, 0.0), max_velocity_m_s=v, max_acceleration_m_s2=a, max_jerk_m_s3=j)
    duration = plan_move(move).duration_s
    for name in ("max_velocity_m_s", "max_acceleration_m_s2", "max_jerk_m_s3"):
        looser = plan_move(replace(move, **{name: grow * getattr(move, name)})).duration_s
        assert looser <= duration * (1 + 1e-9)
    unlimited = replace(move, profile="trapezoid", max_jerk_m_s3=None)
    assert plan_move(unlimited).duration_s <= duration * (1 + 1e-9)


def test_a_trapezoid_with_a_jerk_limit_is_the_s_curve():
    time = np.linspace(0, 0.9, 501)
    trapezoid = plan_move(replace(S_CURVE, profile="trapezoid"))
    assert np.max(np.abs(trapezoid(time) - plan_move(S_CURVE)(time))) == 0


def test_limits_that_leave_no_time_are_refused():
    with pytest.raises(InputError, match="cannot be planned"):
        plan_move(replace(S_CURVE, max_jerk_m_s3=1e300, max_acceleration_m_s2=1e300, max_velocity_m_s=None))


def test_a_b_spline_is_at_rest_to_its_fourth_derivative_and_keeps_the_limit_that_binds():
    move = replace(S_CURVE, profile="b-spline")
    trajectory = plan_move(move)
    assert trajectory.coefficients.shape == (5, 6, 3)
    velocity, acceleration, jerk = peaks(move)
    assert max(velocity / 1, acceleration / 5, jerk / 50) == pytest.approx(1, rel=1e-9)
    assert np.max(np.abs(trajectory.coefficients[0, 1:5])) < 1e-12  # identity
    assert np.max(np.abs(trajectory(np.nextafter(trajectory.duration_s, 0), 4))) < 1e-9  # identity
    for order in range(5):
        for at in trajectory.breaks_s[1:-1]:
            jump = trajectory(at, order) - trajectory(np.nextafter(at, 0), order)
            assert np.max(np.abs(jump)) < 1e-9 * 10**order  # identity


def test_a_straight_b_spline_is_a_step_averaged_five_times():
    trajectory = plan_move(replace(S_CURVE, profile="b-spline"))
    # the step response of five boxes of unit length: sum of the cardinal spline's truncated powers
    u = np.linspace(0, 5, 301)
    step = sum((-1) ** i * math.comb(5, i) * np.maximum(u - i, 0) ** 5 for i in range(6)) / 120
    assert np.max(np.abs(trajectory(u / 5 * trajectory.duration_s)[:, 0] - 0.6 * step)) < 1e-12  # identity


def test_a_b_spline_passes_its_waypoints_one_interval_after_another():
    waypoints = ((0.2, 0.2, 0.1), (0.3, -0.1, 0.1), (0.6, 0.2, 0.3))
    move = replace(S_CURVE, profile="b-spline", waypoints_m=waypoints)
    trajectory = plan_move(move)
    times = (3 + np.arange(3)) * trajectory.duration_s / 8
    assert np.max(np.abs(trajectory(times) - np.array(waypoints))) < 1e-12  # identity
    time = np.linspace(0, trajectory.duration_s, 5001)
    for order, limit in ((1, 1.0), (2, 5.0), (3, 50.0)):
        assert np.max(np.linalg.norm(trajectory(time, order), axis=1)) <= limit * (1 + 1e-9)


@pytest.mark.parametrize("profile", ["quintic", "b-spline"])
@pytest.mark.parametrize("acceleration", [1e300, 1e-300])
def test_an_acceleration_that_no_robot_has_is_refused(profile, acceleration):
    move = replace(S_CURVE, profile=profile, max_acceleration_m_s2=acceleration, max_velocity_m_s=None)
    with pytest.raises(InputError, match="cannot be planned"):
        plan_move(replace(move, max_jerk_m_s3=None))
