"""Simulated moves against DOP853, closed forms and themselves."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pendulum_scenes import FLEXIBLE, STIFF
from tagsway.criteria import judge_move
from tagsway.errors import InputError
from tagsway.model import GRAVITY_M_S2, DesignMode, Mode, Move, Pendulum, Trajectory
from tagsway.shapers import design_shaper
from tagsway.simulation import (
    SimulatedMotion,
    add_second_body,
    hang_pendulums,
    pendulum_of_mode,
    plan_drive,
    simulate_moves,
    vary_modes,
)
from tagsway.store.moves import read_move
from tagsway.trajectories import plan_move, plan_shaped

MOVE = read_move(Path(__file__).parents[1] / "sample_data" / "move.toml")
BAG = Pendulum(length_m=0.0825, tag_radius_m=0.04585, damping_over_inertia_rad_s=0.3, quadratic_drag_per_rad=0.05)
SHAPER = design_shaper("zv", DesignMode(frequency_hz=2.4727, damping_ratio=0.004))


def shaped_move(acceleration: float = 5.0, axes: tuple[str, ...] = ("x",)) -> Trajectory:
    move = replace(MOVE, max_acceleration_m_s2=acceleration, shaped_axes=axes)
    return plan_shaped(move, SHAPER) if axes else plan_move(move)


def truth(pendulum: Pendulum, trajectory: Trajectory, time_s: np.ndarray) -> np.ndarray:
    """Return the angle at these times by DOP853 on the acceleration form, begun anew at every break."""
    state, angle = np.zeros(2), np.zeros(len(time_s))
    for start, end in pairwise(np.append(trajectory.breaks_s, max(time_s[-1], trajectory.duration_s) + 1e-6)):
        inside = (time_s > start) & (time_s <= end)

        def slope(t: float, y: np.ndarray, start: float = start, end: float = end) -> list[float]:
            # from within the piece: at its very end the next piece's acceleration would hold
            x, _, z = trajectory(min(max(t, start), np.nextafter(end, start)), 2)
            q, w = y
            brake = pendulum.damping_over_inertia_rad_s + pendulum.quadratic_drag_per_rad * abs(w)
            pull = ((GRAVITY_M_S2 + z) * np.sin(q) + x * np.cos(q)) / pendulum.length_m
            return [w, -brake * w - pendulum.stiffness_over_inertia_rad2_s2 * q - pull]

        at = np.unique(np.append(time_s[inside], end))
        run = solve_ivp(slope, (start, end), state, method="DOP853", t_eval=at, rtol=1e-11, atol=1e-12)
        angle[inside], state = run.y[0, : np.count_nonzero(inside)], run.y[:, -1]
    return angle


def error_mm(pendulum: Pendulum, trajectory: Trajectory, step_s: float) -> float:
    motion = simulate_moves(trajectory, hang_pendulums(pendulum), step_s=step_s, rest_s=0.5)
    nodes, first = np.unique(motion.time_s[:, 0], return_index=True)
    off = motion.sway.angle_rad[first, 0, 0] - truth(pendulum, trajectory, nodes)
    return 1e3 * pendulum.tag_radius_m * float(np.max(np.abs(off)))


@pytest.mark.parametrize("pendulum", [FLEXIBLE, STIFF, BAG], ids=["flexible", "stiff", "bag with drag"])
def test_a_shaped_move_at_1_ms_agrees_with_dop853(pendulum: Pendulum) -> None:
    assert error_mm(pendulum, shaped_move(), 1e-3) < 1e-4  # discretisation; drag has kinks where the swing turns


def test_the_error_falls_with_the_fourth_power_of_the_step() -> None:
    errors = [error_mm(FLEXIBLE, shaped_move(axes=("x", "z")), step) for step in (16e-3, 8e-3, 4e-3)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all((orders > 3.6) & (orders < 4.5))  # discretisation: order 4, also across switches off the grid


def test_a_smooth_move_agrees_with_dop853() -> None:
    quintic = Move(from_m=(0, 0, 0), to_m=(0.5, 0, 0.1), max_acceleration_m_s2=6.0, profile="quintic")
    assert error_mm(FLEXIBLE, plan_move(quintic), 1e-3) < 1e-5  # discretisation


def derivative_error(motion: SimulatedMotion, values: np.ndarray, slopes: np.ndarray) -> float:
    """Return the largest distance of slopes from central differences, away from the switches."""
    time = motion.time_s[:, 0]
    steps = np.diff(time)
    even = (steps[1:] > 0) & (np.abs(steps[1:] / np.maximum(steps[:-1], 1e-12) - 1) < 1e-6)
    differences = (values[2:] - values[:-2]) / (time[2:] - time[:-2]).clip(1e-9)[:, None]
    return float(np.max(np.abs(differences - slopes[1:-1])[even]))


def test_velocity_and_acceleration_at_the_tag_are_derivatives_of_its_place() -> None:
    motion = simulate_moves(shaped_move(8.0), hang_pendulums(BAG), step_s=1e-3, rest_s=0.5)
    place, velocity = motion.pcp_m[:, :, 0, 0], motion.pcp_velocity_m_s[:, :, 0, 0]
    # discretisation: central differences, step² / 6 of the third derivative
    assert derivative_error(motion, place, velocity) < 1e-3
    assert derivative_error(motion, velocity, motion.pcp_acceleration_m_s2[:, :, 0, 0]) < 2e-2


def test_a_node_stands_twice_where_the_acceleration_jumps_and_holds_both_sides() -> None:
    drive = plan_drive([plan_move(replace(MOVE, max_acceleration_m_s2=5.0))], step_s=1e-3, rest_s=0.1)
    time, push = drive.time_s[:, 0], drive.acceleration_m_s2[:, :, 0]
    twice = np.flatnonzero(np.diff(time) == 0)
    assert len(twice) == 6  # five switches and the end
    assert np.all(np.abs(push[twice + 1] - push[twice]).max(axis=1) > 1)
    assert np.linalg.norm(push[1:-1], axis=1).max() == pytest.approx(5.0)  # identity: the vector is limited to a


def test_the_force_holds_the_weight_at_rest() -> None:
    motion = simulate_moves(shaped_move(), hang_pendulums(replace(FLEXIBLE, damping_over_inertia_rad_s=8.0)))
    force = motion.pcp_force_n(0.225)[-1, :, 0, 0]
    np.testing.assert_allclose(force, [0, 0.225 * GRAVITY_M_S2], atol=1e-4)  # what still swings after 2 s
    with pytest.raises(InputError, match="mass"):
        motion.pcp_force_n(0.0)


def test_moves_and_samples_side_by_side_are_those_alone() -> None:
    moves = [shaped_move(3.0), shaped_move(9.0, ("x", "z")), plan_move(MOVE)]
    payload = hang_pendulums(FLEXIBLE, STIFF, BAG)
    together = simulate_moves(moves, payload, step_s=2e-3, rest_s=0.3)
    for c, move in enumerate(moves):
        for m, pendulum in enumerate((FLEXIBLE, STIFF, BAG)):
            alone = simulate_moves(move, hang_pendulums(pendulum), step_s=2e-3, rest_s=0.3)
            n = len(alone.time_s)
            np.testing.assert_allclose(together.pcp_m[:n, :, c, m], alone.pcp_m[:, :, 0, 0], atol=1e-12)  # identity
            # A shorter move's last node is repeated.
            np.testing.assert_allclose(
                together.pcp_m[n:, :, c, m],
                together.pcp_m[n - 1 : n, :, c, m] + 0 * together.pcp_m[n:, :, c, m],
                atol=1e-12,
            )


def test_samples_have_the_modes_that_were_asked_for_at_one_spring() -> None:
    frequency = np.array([2.11, 2.4727, 2.77])
    payload = vary_modes(FLEXIBLE, frequency, 0.07)
    np.testing.assert_allclose(payload.frequency_hz, frequency, rtol=1e-12)  # identity
    np.testing.assert_allclose(payload.damping_ratio, 0.07, rtol=1e-12)
    spring = payload.pendulums.stiffness_over_inertia_rad2_s2 * payload.pendulums.length_m**2
    np.testing.assert_allclose(spring, spring[0], rtol=1e-12)
    np.testing.assert_allclose(payload.tag_radius_m, payload.pendulums.length_m, rtol=1e-12)  # r = l stays


def test_a_mode_alone_makes_a_pendulum_without_a_spring() -> None:
    pendulum = pendulum_of_mode(Mode(natural_frequency_hz=2.0, damping_ratio=0.05))
    assert pendulum.natural_frequency_hz == pytest.approx(2.0)
    assert pendulum.damping_ratio == pytest.approx(0.05)
    assert pendulum.stiffness_over_inertia_rad2_s2 == 0


def test_a_second_body_obeys_its_own_equation_under_the_first_ones_tag() -> None:
    mode, gain = Mode(natural_frequency_hz=7.0, damping_ratio=0.03), 0.6
    trajectory = shaped_move(6.0)
    bare = simulate_moves(trajectory, hang_pendulums(BAG), rest_s=0.5)
    with_second = simulate_moves(trajectory, add_second_body(hang_pendulums(BAG), mode, gain=gain), rest_s=0.5)
    np.testing.assert_array_equal(with_second.sway.angle_rad, bare.sway.angle_rad)  # it does not act back
    carrier = bare.pcp_acceleration_m_s2[:, 0, 0, 0]
    wn, sway = 2 * np.pi * 7.0, with_second.sway
    y, v, a = (each[:, 0, 0] for each in (sway.second_m, sway.second_m_s, sway.second_m_s2))
    np.testing.assert_allclose(a, -2 * 0.03 * wn * v - wn**2 * y - gain * carrier, atol=1e-9)  # identity
    assert derivative_error(with_second, y[:, None], v[:, None]) < 1e-3  # discretisation
    np.testing.assert_allclose(with_second.pcp_m[:, 0, 0, 0], bare.pcp_m[:, 0, 0, 0] + y, atol=1e-12)


def test_a_second_body_held_by_a_stiff_spring_stays_where_it_is() -> None:
    stiff = add_second_body(hang_pendulums(FLEXIBLE), Mode(natural_frequency_hz=45.0, damping_ratio=0.5))
    motion = simulate_moves(shaped_move(), stiff, rest_s=0.3)
    expected = np.abs(motion.pcp_acceleration_m_s2[:, 0]).max() / (2 * np.pi * 45.0) ** 2
    assert np.abs(motion.sway.second_m).max() < 2 * expected


def test_a_move_seen_from_any_side_sways_alike() -> None:
    turned = replace(MOVE, from_m=(0, 0.35, -0.767), to_m=(0, -0.35, -0.767))
    slanted = replace(MOVE, from_m=(-0.21, -0.28, -0.767), to_m=(0.21, 0.28, -0.767))
    angles = [
        simulate_moves(plan_move(move), hang_pendulums(FLEXIBLE), rest_s=0.2).sway.angle_rad
        for move in (MOVE, turned, slanted)
    ]
    np.testing.assert_allclose(angles[1], angles[0], atol=1e-9)
    np.testing.assert_allclose(angles[2], angles[0], atol=1e-9)


def test_a_move_around_a_corner_is_refused() -> None:
    corner = Move(
        from_m=(0, 0, 0),
        to_m=(0.3, 0.3, 0),
        waypoints_m=((0.3, 0, 0),),
        profile="path",
        feed_rate_m_s=0.3,
        max_acceleration_m_s2=3.0,
    )
    with pytest.raises(InputError, match="leaves its upright plane"):
        simulate_moves(plan_move(corner), hang_pendulums(FLEXIBLE))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"step_s": 0.1}, "too long for this payload"),
        ({"step_s": -1e-3}, "expected a step above 0"),
        ({"step_s": 1e-7}, "steps"),
        ({"rest_s": -1.0}, "a rest from 0"),
        ({"rest_s": float("nan")}, "a rest from 0"),
    ],
)
def test_steps_that_cannot_be_are_refused(options: dict[str, float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        simulate_moves(plan_move(MOVE), hang_pendulums(FLEXIBLE), **options)


def test_no_payload_no_move_and_impossible_modes_are_refused() -> None:
    with pytest.raises(InputError, match="at least one pendulum"):
        hang_pendulums()
    with pytest.raises(InputError, match="at least one move"):
        simulate_moves([], hang_pendulums(FLEXIBLE))
    for frequency, zeta in ((np.nan, 0.1), (-1.0, 0.1), (2.0, 1.0), (2.0, np.nan)):
        with pytest.raises(InputError, match="a mode of"):
            vary_modes(FLEXIBLE, np.array([frequency]), zeta)


TIME = np.linspace(0, 3, 3001)


def level_tool(end_s: float = 1.0) -> np.ndarray:
    share = np.clip(TIME / end_s, 0, 1)
    return np.stack([0.7 * share, 0.12 * np.sin(np.pi * share)], axis=1)


def judge(sway: np.ndarray, **options: float):
    """Judge products that sway beside a tool, columns of shape (n, m)."""
    tool = level_tool()[:, :, None]
    pcp = tool + np.stack([sway, np.full(sway.shape, -0.05)], axis=1)
    return judge_move(
        TIME[:, None], tool, pcp, np.zeros(pcp.shape), end_s=1.0, final_m=np.array([[0.7], [-0.05]]), **options
    )


def test_settling_is_nan_for_never_and_early_for_a_product_that_comes_in_before_the_end() -> None:
    late, early = 0.05 * np.cos(9 * (TIME - 3)), 0 * TIME
    found = judge(np.stack([late, early, np.full(len(TIME), np.nan)], axis=1))
    assert np.isnan(found.settling_time_s[[0, 2]]).all()
    assert np.isnan(found.motion_time_s[0])
    assert found.settling_time_s[1] == pytest.approx(0.98, abs=1e-3)  # 14 of 700 mm before the end
    assert found.motion_time_s[1] == 1.0
    assert found.overshoot_percent[1] == pytest.approx(0, abs=1e-9)


def test_a_record_of_any_column_is_judged_as_alone() -> None:
    rng = np.random.default_rng(3)
    sway = 0.02 * rng.normal(size=(3001, 4)) * np.exp(-2 * TIME)[:, None]
    sway[rng.random(sway.shape) < 0.05] = np.nan
    together = judge(sway)
    for m in range(4):
        alone = judge(sway[:, m : m + 1])
        for name in ("settling_time_s", "overshoot_percent", "box_error_m", "place_error_m"):
            np.testing.assert_array_equal(getattr(together, name)[m], getattr(alone, name)[0])


def test_the_box_counts_from_the_rim_on_the_way_down_and_not_on_the_way_up() -> None:
    rim = float(TIME[np.flatnonzero(level_tool()[:, 1] >= 0.05)[-1]])
    bumps = ((0.6, rim, 0.1), (rim + 0.005, rim + 0.02, -0.2), (0.0, 0.05, 0.1))
    before, inside, lift = (np.where((a < TIME) & (b > TIME), size, 0.0) for a, b, size in bumps)
    slant = 0.7 * (1 - rim)  # the tool itself comes in from the side
    found = judge(np.stack([0 * TIME, before, inside, lift], axis=1))
    np.testing.assert_allclose(found.box_error_m[[0, 1, 3]], slant, atol=1e-3)  # discretisation: one sample
    assert found.box_error_m[2] == pytest.approx(0.2 + slant, abs=0.01)
    assert found.place_error_m.max() == pytest.approx(0, abs=1e-12)


def test_without_a_rim_to_pass_there_is_no_box() -> None:
    assert np.isnan(judge(np.zeros((3001, 1)), rim_m=0.2).box_error_m).all()


def test_the_residual_is_weighed_by_time_and_leaves_gaps_out() -> None:
    push = np.zeros((3001, 2, 2))
    push[:, 0] = np.where(TIME > 1, 2 * np.sin(40 * np.pi * TIME), 0)[:, None]
    push[1500:2000, 0, 1] = np.nan
    tool = level_tool()[:, :, None]
    found = judge_move(TIME[:, None], tool, tool, push, end_s=1.0, final_m=np.array([[0.7], [0.0]]))
    np.testing.assert_allclose(found.residual_rms_m_s2, np.sqrt(2), rtol=2e-3)
    np.testing.assert_allclose(found.residual_max_m_s2, 2, rtol=5e-3)  # discretisation: 50 samples a period
    assert found.vector_m_s2[0] == pytest.approx(np.hypot(2, GRAVITY_M_S2), rel=1e-3)


def test_the_residual_of_a_constant_push_is_that_push_however_few_samples_show_it() -> None:
    time = np.linspace(0, 2, 11)
    tool = np.stack([np.clip(time, 0, 1), 0 * time], axis=1)
    push = np.stack([np.where(time >= 1, 2.0, 0.0), 0 * time], axis=1)
    found = judge_move(time, tool, tool, push, end_s=1.0, final_m=np.array([1.0, 0.0]))
    assert found.residual_rms_m_s2 == pytest.approx(2.0, rel=1e-12)  # identity


def test_nothing_after_the_move_is_no_residual_and_no_travel_no_overshoot() -> None:
    tool = level_tool()[:1001, :, None]
    zero = np.zeros((1001, 2, 1))
    ended = judge_move(TIME[:1001, None], tool, tool, zero, end_s=1.0, final_m=np.array([[0.7], [0.0]]))
    assert np.isnan(ended.residual_rms_m_s2).all()
    assert np.isnan(ended.residual_max_m_s2).all()
    still = judge_move(TIME[:1001, None], zero, zero, zero, end_s=1.0, final_m=np.zeros((2, 1)))
    assert np.isnan(still.overshoot_percent).all()
    assert np.isnan(still.settling_time_s).all()
