"""Paths of lines and arcs: what they pass, how near, and how exactly."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tagsway.errors import InputError
from tagsway.model import ArcThrough, DesignMode, DigitalFilter, Impulse, Move, Shaper
from tagsway.shapers import design_shaper
from tagsway.store.moves import read_move
from tagsway.trajectories import (
    check_limits,
    corner_test_move,
    dual_mode_move,
    plan_move,
    plan_path,
    plan_shaped,
    sample_trajectory,
)

MODE = DesignMode(frequency_hz=6.34, damping_ratio=0.022)
ZV, ZVD = design_shaper("zv", MODE), design_shaper("zvd", MODE)
FIR_ZVD = replace(ZVD, box_s=1 / 6.34)
CIRCLE = Move(
    from_m=(0.0, 0.0, 0.0),
    to_m=(0.2, 0.0, 0.0),
    profile="path",
    arcs=(ArcThrough(segment=0, through_m=(0.1, 0.1, 0.0)),),
    feed_rate_m_s=0.5,
    max_acceleration_m_s2=5.0,
    shaped_axes=("path",),
)
SQUARE = Move(
    from_m=(0.0, 0.0, 0.0),
    to_m=(0.0, 0.0, 0.0),
    waypoints_m=((0.1, 0.0, 0.0), (0.1, 0.1, 0.0), (0.0, 0.1, 0.0)),
    profile="path",
    feed_rate_m_s=0.2,
    max_acceleration_m_s2=4.0,
)

points = st.tuples(*(st.floats(-0.3, 0.3) for _ in range(3)))


@st.composite
def paths(draw) -> Move:
    way = draw(st.lists(points, min_size=2, max_size=5))
    assume(all(math.dist(a, b) > 1e-3 for a, b in itertools.pairwise(way)))
    arcs = []
    for index, (start, end) in enumerate(itertools.pairwise(way)):
        if not draw(st.booleans()):
            continue
        middle = (np.array(start) + end) / 2
        side = np.cross(np.array(end) - start, draw(st.sampled_from([(1, 0, 0.3), (0, 1, 0.2), (0.1, 0.2, 1)])))
        assume(np.linalg.norm(side) > 1e-4)
        through = middle + side * draw(st.floats(0.2, 1.0))
        arcs.append(ArcThrough(segment=index, through_m=tuple(float(value) for value in through)))
    return Move(
        from_m=way[0],
        to_m=way[-1],
        waypoints_m=tuple(way[1:-1]),
        arcs=tuple(arcs),
        profile="path",
        feed_rate_m_s=draw(st.floats(0.05, 2)),
        corner_error_mm=draw(st.sampled_from([0.0, 0.1, 1.0])),
        max_acceleration_m_s2=draw(st.floats(0.5, 50)),
        max_jerk_m_s3=None if arcs else draw(st.none() | st.floats(10, 1e4)),
        shaped_axes=("path",),
    )


@settings(deadline=None, derandomize=True, max_examples=25)
@given(move=paths(), shaper=st.sampled_from([ZV, ZVD, FIR_ZVD]), sample_time_s=st.floats(1e-3, 8e-3))
def test_any_path_ends_exactly_at_rest_shaped_or_not(move, shaper, sample_time_s):
    for trajectory in (plan_move(move), plan_shaped(move, shaper)):
        end = trajectory.duration_s
        assert np.max(np.abs(trajectory(0.0) - move.from_m)) <= 1e-12  # identity
        assert np.max(np.abs(trajectory(end) - move.to_m)) <= 1e-11  # identity
        for order in (0, 1):
            before = trajectory(np.nextafter(trajectory.breaks_s, 0), order)
            assert np.max(np.abs(trajectory(trajectory.breaks_s, order) - before)) <= 1e-9  # identity
        if 10 * sample_time_s <= end:
            sampled = sample_trajectory(trajectory, sample_time_s)
            assert np.max(np.abs(sampled.position_m[-1] - move.to_m)) <= 1e-9
            assert np.max(np.abs(sampled.velocity_m_s[-1])) <= 1e-9


@settings(deadline=None, derandomize=True, max_examples=30)
@given(move=paths())
def test_a_path_keeps_its_limits_and_its_cornering_error(move):
    plan = plan_path(move)
    time = np.linspace(0, plan.trajectory.duration_s, 5001)
    for order, limit in ((1, move.feed_rate_m_s), (2, move.max_acceleration_m_s2), (3, move.max_jerk_m_s3)):
        if limit is not None:
            assert np.max(np.linalg.norm(plan.trajectory(time, order), axis=1)) <= limit * (1 + 1e-6)
    if move.arcs:
        return
    path = plan.trajectory(time)
    fastest = float(np.max(np.linalg.norm(plan.trajectory(time, 1), axis=1)))
    for corner, at in zip(plan.corners, move.waypoints_m, strict=True):
        near = float(np.min(np.linalg.norm(path - at, axis=1)))
        assert corner.error_m <= move.corner_error_mm / 1e3 * (1 + 1e-9)
        assert near <= corner.error_m + fastest * time[1]  # discretisation


def test_a_circle_is_round_at_its_feed_rate():
    trajectory = plan_move(CIRCLE)
    time = np.linspace(0, trajectory.duration_s, 3001)
    radius = np.linalg.norm(trajectory(time) - [0.1, 0, 0], axis=1)
    assert np.max(np.abs(radius - 0.1)) < 1e-10  # the fit's own bound
    speed = np.linalg.norm(trajectory(time, 1), axis=1)
    assert np.max(speed) == pytest.approx(0.5, rel=1e-9)
    report = check_limits(trajectory, trajectory, CIRCLE)
    assert not report.notices
    assert report.peak_jerk_m_s3[1] is None or report.peak_jerk_m_s3[0] is None


def test_a_shaped_feed_rate_on_a_circle_is_the_shaped_distance_along_it():
    plan, shaped = plan_path(CIRCLE), plan_path(CIRCLE, shaper=ZVD)
    time = np.linspace(0, shaped.trajectory.duration_s, 1001)
    distance = sum(i.amplitude * plan.feeds[0].distance(time - i.time_s)[:, 0] for i in ZVD.impulses)
    angle = math.pi - distance / 0.1
    expected = np.stack([0.1 + 0.1 * np.cos(angle), 0.1 * np.sin(angle), 0 * angle], axis=1)
    assert np.max(np.abs(shaped.trajectory(time) - expected)) < 2e-10  # the fit's own bound


def test_a_feed_rate_too_high_for_an_arc_is_lowered():
    trajectory = plan_move(replace(CIRCLE, feed_rate_m_s=5.0))
    report = check_limits(trajectory, trajectory, CIRCLE)
    speed = np.linalg.norm(trajectory(np.linspace(0, trajectory.duration_s, 999), 1), axis=1)
    assert np.max(speed) == pytest.approx(math.sqrt(5 / math.sqrt(2) * 0.1), rel=1e-6)
    assert not report.notices


@pytest.mark.parametrize("shaper", [None, ZV, FIR_ZVD], ids=["unshaped", "zv", "fir-zvd"])
def test_the_test_path_passes_each_corner_at_its_error(shaper):
    move = corner_test_move(corner_error_mm=0.5)
    plan = plan_path(move, shaper=shaper)
    assert [math.degrees(corner.angle_rad) for corner in plan.corners] == pytest.approx([45, 45, 135, 90])
    assert [1e3 * corner.error_m for corner in plan.corners] == pytest.approx([0.5] * 4, rel=1e-9)
    path = plan.trajectory(np.linspace(0, plan.trajectory.duration_s, 100_001))
    nearest = [1e3 * float(np.min(np.linalg.norm(path - at, axis=1))) for at in move.waypoints_m]
    assert nearest[1:] == pytest.approx([0.5] * 3, rel=1e-4)  # discretisation
    # The arc leaves its tangent, so that its corner is passed a little nearer or farther than planned.
    assert nearest[0] == pytest.approx(0.5, rel=0.03)


def test_the_test_path_runs_at_9600_mm_per_minute_and_stops_where_no_error_is_allowed():
    move = corner_test_move(corner_error_mm=0.0)
    stopping, passing = plan_path(move, shaper=ZV), plan_path(corner_test_move(), shaper=ZV)
    time = np.linspace(0, stopping.trajectory.duration_s, 20_001)
    speed = np.linalg.norm(stopping.trajectory(time, 1), axis=1)
    assert np.max(speed) == pytest.approx(0.16, rel=1e-6)
    ends = [s + f.distance.duration_s for s, f in zip(stopping.starts_s, stopping.feeds, strict=True)]
    for end, at in zip(ends, move.waypoints_m, strict=False):
        assert np.max(np.abs(stopping.trajectory(end) - at)) < 1e-12  # identity
        assert np.linalg.norm(stopping.trajectory(end, 1)) < 1e-9
    assert passing.trajectory.duration_s < stopping.trajectory.duration_s


def test_the_dual_mode_path_passes_its_points_in_its_time():
    move = dual_mode_move()
    plan = plan_path(move)
    assert plan.trajectory.duration_s == pytest.approx(0.25, rel=1e-12)
    # ours: the printed 0.6048 m fits no arc tangent to both straights
    assert plan.length_m == pytest.approx(0.30 + 0.3099385, abs=5e-8)
    path = plan.trajectory(np.linspace(0, 0.25, 200_001))
    for point in ((-200, 0, -740), (-200, 0, -710), (-182, -9, -670), (182, -191, -670), (200, -200, -710)):
        assert np.min(np.linalg.norm(path - np.array(point) / 1e3, axis=1)) < 2e-5  # discretisation: 4.6 m/s
    speed = np.linalg.norm(plan.trajectory(np.linspace(0, 0.25, 2001), 1), axis=1)
    # published value: 15/8 of 0.6048 m in 0.25 s is 4.536 m/s; ours is longer by the same share
    assert np.max(speed) * 0.6048 / plan.length_m == pytest.approx(4.536, abs=5e-4)
    push = plan.feeds[0].distance(np.linspace(0, 0.25, 20_001), 2)[:, 0]
    assert np.max(push) * 0.6048 / plan.length_m == pytest.approx(55.87, abs=5e-3)  # published value


def test_a_shaper_over_the_dual_mode_path_keeps_the_path():
    move = dual_mode_move()
    unshaped, shaped = plan_move(move), plan_shaped(move, ZV)
    assert shaped.duration_s == pytest.approx(0.25 + ZV.duration_s, rel=1e-12)
    assert check_limits(shaped, unshaped, move).path_deviation_m < 1e-6  # the polyline that it is compared with


def test_lines_that_go_on_are_one_way():
    through = Move(
        from_m=(0, 0, 0), to_m=(0.4, 0, 0), waypoints_m=((0.1, 0, 0),), profile="path", max_acceleration_m_s2=2
    )
    plan = plan_path(through)
    assert plan.corners == ()
    assert plan.trajectory.duration_s == pytest.approx(2 * math.sqrt(0.4 / 2), rel=1e-12)


def test_a_closed_path_comes_back():
    trajectory = plan_move(SQUARE)
    assert np.max(np.abs(trajectory(trajectory.duration_s))) < 1e-12
    assert trajectory.duration_s == pytest.approx(4 * (0.1 / 0.2 + 0.2 / 4), rel=1e-12)  # identity


def test_a_feed_that_runs_backwards_is_refused_on_an_arc():
    unity = Shaper(type="given", modes=(), impulses=(Impulse(time_s=0, amplitude=-1), Impulse(time_s=0.1, amplitude=2)))
    with pytest.raises(InputError, match="runs backwards"):
        plan_path(CIRCLE, shaper=unity)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"max_jerk_m_s3": 100.0}, "max_jerk_m_s3"),
        ({"arcs": (ArcThrough(segment=0, through_m=(0.1, 0.0, 0.0)),)}, "lie on a line"),
        ({"waypoints_m": ((0.1, 0.1, 0.0),), "arcs": (), "along_path": "quintic"}, "without corners"),
        ({"pick_height_m": 0.1}, "vertical ends"),
    ],
)
def test_a_path_that_cannot_be_planned_is_refused(changes, words):
    with pytest.raises(InputError, match=words):
        plan_move(replace(CIRCLE, **changes))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"arcs": (ArcThrough(segment=1, through_m=(0.1, 0.1, 0.0)),)}, "segments"),
        ({"waypoints_m": ((0.2, 0.0, 0.0),)}, "follow each other"),
        ({"waypoints_m": ((0.2, math.nan, 0.0),)}, "finite"),
        ({"waypoints_m": ((200.0, 0.0, 0.0),)}, "metres, not mm"),
        ({"to_m": (700.0, 0.0, 0.0)}, "metres, not mm"),
        ({"to_m": (0.0, 0.0, 0.0)}, "lead somewhere"),
        ({"to_m": (1e-12, 0.0, 0.0)}, "lead somewhere"),
        ({"feed_rate_m_s": 0.0}, "feed_rate_m_s"),
        ({"max_acceleration_m_s2": 0.0}, "max_acceleration_m_s2"),
        ({"corner_error_mm": -1.0}, "corner_error_mm"),
        ({"corner_error_mm": math.nan}, "corner_error_mm"),
        ({"profile": "quintic"}, "belongs to the profile path"),
        ({"profile": "quintic", "arcs": (), "feed_rate_m_s": None, "waypoints_m": ((0.1, 0, 0),)}, "waypoints_m"),
    ],
)
def test_a_path_that_means_nothing_cannot_be_made(changes, words):
    with pytest.raises(InputError, match=words):
        replace(CIRCLE, **changes)


def test_corners_take_no_filter():
    low_pass = replace(ZV, filter=DigitalFilter(numerator=(1.0,), denominator=(0.1, 1.0)))
    with pytest.raises(InputError, match="filter"):
        plan_path(SQUARE, shaper=low_pass)


def test_a_move_file_holds_a_path(tmp_path):
    file = tmp_path / "move.toml"
    file.write_text(
        """
schema = "tagsway/move/1"
profile = "path"
from_m = [0.18, 0.0, 0.0]
waypoints_m = [[0.21, 0.03, 0.0], [0.25, 0.03, 0.0]]
to_m = [0.25, 0.0, 0.0]
arcs = [{ segment = 0, through_m = [0.18878679656440358, 0.021213203435596423, 0.0] }]
feed_rate_m_s = 0.16
corner_error_mm = 0.5
max_acceleration_m_s2 = 5.0
shaped_axes = ["path"]
""",
        encoding="utf-8",
    )
    plan = plan_path(read_move(file))
    # the arc runs into the line, and the one corner is square
    assert [math.degrees(corner.angle_rad) for corner in plan.corners] == pytest.approx([90.0])
    assert plan.length_m == pytest.approx(0.03 * math.pi / 2 + 0.04 + 0.03, rel=1e-9)
