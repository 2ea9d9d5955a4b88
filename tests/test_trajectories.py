"""Moves, shaped moves and their samples: durations that are published, ends that are exact, limits that are kept."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tagsway.errors import InputError
from tagsway.model import DesignMode, Impulse, Limits, Move, Shaper, Trajectory
from tagsway.shapers import design_shaper
from tagsway.trajectories import apply_shaper, check_limits, plan_move, sample_trajectory, slow_down

NOTES = Path(__file__).parents[2] / "shared" / "notes"
REFERENCE = Move(
    from_m=(-0.35, 0.0, -0.767),
    to_m=(0.35, 0.0, -0.767),
    max_acceleration_m_s2=5.0,
    pick_height_m=0.05,
    place_height_m=0.05,
)
ZV = design_shaper("zv", DesignMode(frequency_hz=2.4727, damping_ratio=3.5146e-4))
ZVD = design_shaper("zvd", DesignMode(frequency_hz=2.4727, damping_ratio=3.5146e-4))
BOX = Shaper(type="fir", modes=(), impulses=(Impulse(time_s=0, amplitude=1),), box_s=0.1)

coordinates = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-0.9, -0.5))
heights = st.sampled_from([0.0, 0.005, 0.05, 0.1])


@st.composite
def moves(draw) -> Move:
    start, end = draw(coordinates), draw(coordinates)
    if math.dist(start[:2], end[:2]) < 1e-3:
        end = (end[0] + 0.05, end[1], end[2])
    profile = draw(st.sampled_from(["pick-and-place", "bang-bang", "s-curve", "quintic", "b-spline"]))
    level = profile != "pick-and-place"
    return Move(
        from_m=start,
        to_m=end,
        profile=profile,
        max_acceleration_m_s2=draw(st.floats(0.1, 100)),
        max_velocity_m_s=draw(st.none() | st.floats(0.05, 5)),
        max_jerk_m_s3=draw(st.floats(1, 1e5)) if profile in ("s-curve", "b-spline") else None,
        pick_height_m=0.0 if level else draw(heights),
        place_height_m=0.0 if level else draw(heights),
    )


def norms(values: np.ndarray) -> np.ndarray:
    return np.linalg.norm(values, axis=-1)


@pytest.mark.parametrize("acceleration", [1.14, 5.0, 30.0])
def test_the_reference_takes_its_published_time_over_its_published_apex(acceleration):
    trajectory = plan_move(replace(REFERENCE, max_acceleration_m_s2=acceleration))
    # identity
    assert trajectory.duration_s * math.sqrt(acceleration) == pytest.approx(2.517484360372197, rel=1e-12)
    apex = trajectory(trajectory.duration_s / 2)[2] - REFERENCE.from_m[2]
    assert apex == pytest.approx(0.1207106781, abs=5e-11)  # published value


@pytest.mark.parametrize(
    ("conditions", "shaper_mode"),
    [
        ("flex_unshaped", None),
        ("flex_shaped(+.2022)", DesignMode(frequency_hz=2.4727, damping_ratio=3.5146e-4)),
        ("stiff_unshaped", None),
        ("stiff_shaped(+.1393)", DesignMode(frequency_hz=3.5906, damping_ratio=0.0012)),
    ],
)
def test_trajectory_times_are_the_thesis_motion_times(conditions, shaper_mode):
    if not NOTES.exists():
        pytest.skip("the published values are not beside this clone")
    group = json.loads((NOTES / "acceptance.json").read_text(encoding="utf-8"))["6_trajectory"]
    for acceleration, time_s in group["published_motion_times"][conditions].items():
        trajectory = plan_move(replace(REFERENCE, max_acceleration_m_s2=float(acceleration)))
        if shaper_mode is not None:
            trajectory = apply_shaper(trajectory, design_shaper("zv", shaper_mode), ("x",))
        assert trajectory.duration_s == pytest.approx(time_s, abs=group["tol_s"])  # published value


def test_the_ends_of_the_reference_are_strictly_vertical():
    trajectory = plan_move(REFERENCE)
    time = np.linspace(0, trajectory.duration_s, 20_001)
    position = trajectory(time)
    low = position[:, 2] < REFERENCE.from_m[2] + 0.05 - 1e-12
    left = np.minimum(np.abs(position[:, 0] + 0.35), np.abs(position[:, 0] - 0.35))
    assert np.max(left[low]) < 1e-15  # identity


@settings(deadline=None, derandomize=True, max_examples=60)
@given(move=moves())
def test_any_move_starts_and_ends_exactly_at_rest_and_within_its_limits(move):
    trajectory = plan_move(move)
    end = trajectory.duration_s
    assert np.max(np.abs(trajectory(0.0) - move.from_m)) <= 1e-12  # identity
    assert np.max(np.abs(trajectory(end) - move.to_m)) <= 1e-12  # identity
    assert trajectory(end, 1) == pytest.approx([0, 0, 0], abs=0)
    before = trajectory(np.nextafter(end, 0), 1)
    assert np.max(np.abs(before)) <= 1e-9  # identity
    for order in (0, 1):
        for at in trajectory.breaks_s[1:-1]:
            jump = trajectory(at, order) - trajectory(np.nextafter(at, 0), order)
            assert np.max(np.abs(jump)) <= 1e-9  # identity: no jump of position or velocity
    time = np.linspace(0, end, 2001)
    limit = math.inf if move.max_velocity_m_s is None else move.max_velocity_m_s
    assert np.max(norms(trajectory(time, 1))) <= limit * (1 + 1e-9)
    assert np.max(norms(trajectory(time, 2))) <= move.max_acceleration_m_s2 * (1 + 1e-9)
    if move.max_jerk_m_s3 is not None:
        assert np.max(norms(trajectory(time, 3))) <= move.max_jerk_m_s3 * (1 + 1e-9)
    assert check_limits(trajectory, trajectory, move).lost_vertical_m == (0.0, 0.0)


@settings(deadline=None, derandomize=True, max_examples=60)
@given(
    move=moves(),
    shaper=st.sampled_from([ZV, ZVD, BOX, replace(ZV, box_s=0.05), replace(ZVD, time_scale=1.3)]),
    axes=st.sampled_from([("x",), ("x", "z"), ("path",), ()]),
    sample_time_s=st.floats(1e-3, 8e-3),
)
def test_any_shaped_move_ends_exactly_on_any_grid(move, shaper, axes, sample_time_s):
    trajectory = plan_move(move)
    try:
        shaped = apply_shaper(trajectory, shaper, axes)
    except InputError as refusal:
        assert "hold would drift" in str(refusal)  # noqa: PT017 - nothing else may stop it
        return
    longer = shaper.duration_s if axes else 0.0
    stretched = trajectory.duration_s * (shaper.time_scale if axes else 1.0)
    assert shaped.duration_s == pytest.approx(stretched + longer, abs=1e-12)  # identity
    if not 10 * sample_time_s <= shaped.duration_s:
        return
    sampled = sample_trajectory(shaped, sample_time_s)
    assert np.max(np.abs(sampled.position_m[0] - move.from_m)) <= 1e-9
    assert np.max(np.abs(sampled.position_m[-1] - move.to_m)) <= 1e-9
    assert np.max(np.abs(sampled.velocity_m_s[-1])) <= 1e-9
    assert np.max(np.abs(shaped(np.nextafter(shaped.duration_s, 0), 1))) <= 1e-9


def test_shaping_is_the_sum_of_delayed_moves():
    trajectory = plan_move(REFERENCE)
    shaped = apply_shaper(trajectory, ZVD, ("x", "z"))
    time = np.linspace(-0.1, shaped.duration_s + 0.1, 3001)
    for order in (0, 1):
        expected = sum(i.amplitude * trajectory(time - i.time_s, order) for i in ZVD.impulses)
        assert np.max(np.abs(shaped(time, order) - expected)) < 1e-12  # identity


def test_a_box_is_the_moving_average():
    trajectory = plan_move(REFERENCE)
    averaged = apply_shaper(trajectory, BOX, ("x", "z"))
    for at in (0.05, 0.3, 0.61, 1.2):
        node, weight = np.polynomial.legendre.leggauss(400)
        times = at - 0.05 + 0.05 * node
        assert averaged(at) == pytest.approx(weight @ trajectory(times) / 2, abs=1e-6)  # discretisation


def test_shaping_x_holds_z_at_mid_move_for_the_shapers_length():
    trajectory = plan_move(REFERENCE)
    shaped = apply_shaper(trajectory, ZV, ("x",))
    half, longer = trajectory.duration_s / 2, ZV.duration_s
    before, after = np.linspace(0, half, 500), np.linspace(half + longer, shaped.duration_s, 500)
    assert np.max(np.abs(shaped(before)[:, 2] - trajectory(before)[:, 2])) < 1e-14  # identity
    assert np.max(np.abs(shaped(after)[:, 2] - trajectory(after - longer)[:, 2])) < 1e-12  # identity
    assert np.ptp(shaped(np.linspace(half, half + longer, 99))[:, 2]) < 1e-14


def test_shaping_x_keeps_the_vertical_ends_and_shaping_x_and_z_does_not():
    trajectory = plan_move(REFERENCE)
    only_x = check_limits(apply_shaper(trajectory, ZV, ("x",)), trajectory, REFERENCE)
    both = check_limits(apply_shaper(trajectory, ZV, ("x", "z")), trajectory, REFERENCE)
    assert only_x.lost_vertical_m == (0.0, 0.0)
    # identity: by the time x starts, z has gone the first impulse's share of 50 mm; at the place the last one's is left
    first, last = ZV.impulses[0].amplitude, ZV.impulses[1].amplitude
    assert both.lost_vertical_m == pytest.approx((0.05 * (1 - first), 0.05 * (1 - last)), abs=1e-9)


def test_a_hold_finds_the_level_part_where_the_ends_differ():
    move = replace(REFERENCE, to_m=(0.35, 0.0, -0.85), place_height_m=0.02)
    trajectory = plan_move(move)
    shaped = apply_shaper(trajectory, ZV, ("x",))
    assert check_limits(shaped, trajectory, move).lost_vertical_m == (0.0, 0.0)


def test_a_hold_that_would_drift_is_refused():
    climbing = Move(from_m=(0, 0, 0), to_m=(0.5, 0, 0.2), max_acceleration_m_s2=5, profile="bang-bang")
    with pytest.raises(InputError, match="the hold would drift"):
        apply_shaper(plan_move(climbing), ZV, ("x",))


@pytest.mark.parametrize("axes", [("z",), ("y",), ("x", "path"), ("w",)])
def test_axes_that_mean_nothing_are_refused(axes):
    with pytest.raises(InputError, match="shaped_axes"):
        apply_shaper(plan_move(REFERENCE), ZV, axes)


def test_a_box_too_short_to_average_over_is_refused():
    with pytest.raises(InputError, match="too short"):
        apply_shaper(plan_move(REFERENCE), replace(ZV, box_s=1e-9), ("x", "z"))


@pytest.mark.parametrize(
    "changes",
    [{"time_scale": math.nan}, {"box_s": math.inf}, {"impulses": (Impulse(time_s=0, amplitude=math.nan),)}],
    ids=str,
)
def test_a_shaper_that_is_not_finite_cannot_be_made(changes):
    with pytest.raises(InputError):
        replace(ZV, **changes)


def test_quintic_has_the_peaks_of_its_paper():
    move = Move(from_m=(0, 0, 0), to_m=(0.6048, 0, 0), max_acceleration_m_s2=55.87, profile="quintic")
    trajectory = plan_move(move)
    report = check_limits(trajectory, trajectory, move)
    assert trajectory.duration_s == pytest.approx(0.25, abs=2e-5)  # published value
    assert report.peak_velocity_m_s[0] == pytest.approx(4.536, abs=5e-4)  # published value
    assert report.peak_acceleration_m_s2[0] == pytest.approx(55.87, rel=1e-9)  # identity
    # identity: the jerk 60 L/T³ of both ends; at each the acceleration starts from 0 without a step
    assert report.peak_jerk_m_s3[0] == pytest.approx(60 * 0.6048 / trajectory.duration_s**3, rel=1e-9)
    assert report.checks[0].kept


def test_a_quintic_keeps_whichever_limit_binds():
    move = Move(from_m=(0, 0, 0), to_m=(1, 0, 0), max_acceleration_m_s2=100, profile="quintic")
    slow = plan_move(replace(move, max_velocity_m_s=0.5))
    smooth = plan_move(replace(move, max_jerk_m_s3=50))
    assert check_limits(slow, slow, move).peak_velocity_m_s[0] == pytest.approx(0.5, rel=1e-9)
    assert check_limits(smooth, smooth, move).peak_jerk_m_s3[0] == pytest.approx(50, rel=1e-9)


def test_a_cruise_at_the_velocity_limit_takes_the_textbook_time():
    move = Move(from_m=(0, 0, 0), to_m=(1, 0, 0), max_acceleration_m_s2=4, max_velocity_m_s=0.8, profile="trapezoid")
    assert plan_move(move).duration_s == pytest.approx(1 / 0.8 + 0.8 / 4, rel=1e-12)  # identity
    with pytest.raises(InputError, match="max_velocity_m_s"):
        plan_move(replace(move, max_velocity_m_s=None))


@pytest.mark.parametrize("way_m", [1e-6, 1e-3, 0.03, 0.1, 0.15])
def test_a_way_too_short_for_its_blends_enters_them_slowly(way_m):
    move = replace(REFERENCE, to_m=(-0.35 + way_m, 0.0, -0.767))
    trajectory = plan_move(move)
    report = check_limits(trajectory, trajectory, move)
    assert report.lost_vertical_m == (0.0, 0.0)
    assert not report.notices
    # never slower than stopping at both corners would be
    stopping = 2 * 2 * math.sqrt(0.0501 / 5) + 2 * math.sqrt(way_m / 5)
    assert trajectory.duration_s < stopping
    apply_shaper(trajectory, ZV, ("x",))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"profile": "b-spline"}, "vertical ends"),
        ({"profile": "path"}, "vertical ends"),
        ({"profile": "s-curve"}, "max_jerk_m_s3"),
        ({"to_m": (-0.35, 0.0, -0.5)}, "above one another"),
        ({"max_jerk_m_s3": 100.0}, "max_jerk_m_s3"),
        ({"profile": "bang-bang"}, "vertical ends"),
        ({"max_velocity_m_s": 1e-9}, "cannot be planned"),
        ({"max_acceleration_m_s2": 1e300}, "cannot be planned"),
        ({"run_time_s": 1.0}, "run_time_s is 1 s, but the move takes 1.12585"),
    ],
)
def test_a_move_that_cannot_be_planned_is_refused(changes, words):
    with pytest.raises(InputError, match=words):
        plan_move(replace(REFERENCE, **changes))


def test_samples_lie_on_the_polynomial_and_rest_up_to_the_run_time():
    shaped = apply_shaper(plan_move(REFERENCE), ZV, ("x",))
    sampled = sample_trajectory(shaped, 0.002, run_time_s=2.0)
    time = np.arange(1001) * 0.002
    assert sampled.position_m.shape == (1001, 3)
    assert np.max(np.abs(sampled.position_m - shaped(time))) < 1e-12  # identity
    resting = time > sampled.moving_s
    assert np.all(sampled.velocity_m_s[resting] == 0)
    assert np.max(np.abs(sampled.position_m[resting] - REFERENCE.to_m)) < 1e-12


def test_a_duration_of_whole_cycles_needs_no_cycle_more():
    move = Move(from_m=(0, 0, 0), to_m=(0.25, 0, 0), max_acceleration_m_s2=1, profile="bang-bang")
    assert len(sample_trajectory(plan_move(move), 0.001).position_m) == 1001
    assert len(sample_trajectory(plan_move(move), 0.001, run_time_s=1.0).position_m) == 1001


def test_second_differences_of_the_samples_are_the_acceleration():
    move = Move(from_m=(0, 0, 0), to_m=(0.5, 0, 0), max_acceleration_m_s2=5, profile="quintic")
    trajectory = plan_move(move)

    def worst(sample_time_s: float) -> float:
        sampled = sample_trajectory(trajectory, sample_time_s)
        difference = np.diff(sampled.position_m[:, 0], 2) / sample_time_s**2
        return float(np.max(np.abs(difference - sampled.acceleration_m_s2[1:-1, 0])[2:-2]))

    assert worst(0.008) / worst(0.004) == pytest.approx(4, rel=0.05)  # discretisation: second order


@pytest.mark.parametrize("sample_time_s", [0.0, -0.001, math.nan, 1e-7, 0.2, 5.0])
def test_a_mistyped_sample_time_is_refused(sample_time_s):
    with pytest.raises(InputError, match="sample time"):
        sample_trajectory(plan_move(REFERENCE), sample_time_s)


@pytest.mark.parametrize("run_time_s", [1.0, math.nan])
def test_a_run_time_that_ends_before_the_shaped_move_is_refused(run_time_s):
    with pytest.raises(InputError, match="run_time_s"):
        sample_trajectory(plan_move(REFERENCE), 0.001, run_time_s=run_time_s)


def test_a_dry_run_follows_the_same_path_ten_times_as_slowly():
    shaped = apply_shaper(plan_move(REFERENCE), ZV, ("x",))
    slow = slow_down(shaped, 0.1)
    time = np.linspace(0, shaped.duration_s, 777)
    assert np.max(np.abs(slow(10 * time) - shaped(time))) < 1e-12  # identity
    assert np.max(np.abs(10 * slow(10 * time[1:-1], 1) - shaped(time[1:-1], 1))) < 1e-9
    for speed in (0.0, -1.0, 1.5, math.nan):
        with pytest.raises(InputError, match="speed"):
            slow_down(shaped, speed)


def test_each_broken_limit_is_named_with_its_value():
    limits = Limits(
        velocity_m_s=1.0,
        acceleration_m_s2=4.0,
        jerk_m_s3=1000.0,
        box_m=((-0.3, -1, -1), (1, 1, -0.7)),
        path_deviation_mm=5.0,
        vertical_mm=40.0,
    )
    move = replace(REFERENCE, limits=limits)
    trajectory = plan_move(move)
    report = check_limits(apply_shaper(trajectory, ZV, ("x", "z")), trajectory, move)
    broken = {notice.code: notice.message for notice in report.notices}
    assert set(broken) == {
        "limit_velocity_m_s",
        "limit_acceleration_m_s2",
        "limit_jerk_m_s3",
        "limit_box_m",
        "limit_path_deviation_mm",
        "limit_vertical_mm",
    }
    assert "without bound" in broken["limit_jerk_m_s3"]
    assert "x runs from -0.35" in broken["limit_box_m"]
    assert "z runs from -0.767 to -0.646289" in broken["limit_box_m"]
    assert "24.98" in broken["limit_vertical_mm"]


def test_limits_that_are_kept_bring_no_notice():
    limits = Limits(velocity_m_s=2.0, box_m=((-0.35, 0, -0.767), (0.35, 0.1, -0.6)), vertical_mm=50.0)
    move = replace(REFERENCE, limits=limits)
    trajectory = plan_move(move)
    report = check_limits(apply_shaper(trajectory, ZV, ("x",)), trajectory, move)
    assert not report.notices
    assert {check.name for check in report.checks} == {"velocity_m_s", "acceleration_m_s2", "box_m", "vertical_mm"}


def test_a_box_without_inside_is_refused():
    with pytest.raises(InputError, match="lower and an upper corner"):
        Limits(box_m=((1, 1, 1), (0, 2, 2)))


def test_peaks_are_those_of_the_polynomial_between_its_breaks():
    coefficients = np.zeros((1, 4, 3))
    coefficients[0, :, 0] = [0, 0, 3, -2]  # x = 3 t² - 2 t³: fastest at 1/2, at 3/2 m/s
    trajectory = Trajectory(breaks_s=np.array([0.0, 1.0]), coefficients=coefficients)
    move = Move(from_m=(0, 0, 0), to_m=(1, 0, 0), max_acceleration_m_s2=6)
    report = check_limits(trajectory, trajectory, move)
    assert report.peak_velocity_m_s[0] == pytest.approx(1.5, rel=1e-12)  # identity
    assert report.peak_acceleration_m_s2[0] == pytest.approx(6, rel=1e-12)
    assert report.peak_jerk_m_s3 == (None, 0.0, 0.0)  # it starts with a step of 6 m/s²
