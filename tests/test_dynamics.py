"""The equation of motion against an independent simulator, and its order."""

import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pendulum_scenes import BAG, FLEXIBLE, STIFF, pick_and_place, simulate
from tagsway.dynamics import PendulumEnsemble, simulate_sway
from tagsway.model import GRAVITY_M_S2, FloatArray, Pendulum


def smooth_velocity(time: FloatArray) -> FloatArray:
    """A pivot that moves smoothly in both axes."""
    return np.column_stack([0.6 * np.sin(4 * time), 0.3 * np.sin(5 * time)])


def smooth_truth(pendulum: Pendulum, angle: float, end: float) -> float:
    """The angle at the end, from the acceleration form."""

    def slope(t: float, y: FloatArray) -> list[float]:
        q, w = y
        x, z = 2.4 * np.cos(4 * t), 1.5 * np.cos(5 * t)
        brake = pendulum.damping_over_inertia_rad_s + pendulum.quadratic_drag_per_rad * abs(w)
        pull = ((GRAVITY_M_S2 + z) * np.sin(q) + x * np.cos(q)) / pendulum.length_m
        return [w, -brake * w - pendulum.stiffness_over_inertia_rad2_s2 * q - pull]

    run = solve_ivp(slope, (0, end), [angle, 0.0], method="DOP853", rtol=1e-12, atol=1e-13)
    return float(run.y[0, -1])


def simulate_smooth(pendulum: Pendulum, steps: int, *, angle: float = 0.4, end: float = 1.2) -> float:
    halves = np.linspace(0, end, 2 * steps + 1)
    q, _ = simulate_sway(PendulumEnsemble.of(pendulum), halves[::2], smooth_velocity(halves), angle_rad=angle)
    return float(q[-1, 0])


@pytest.mark.parametrize("pendulum", [FLEXIBLE, STIFF], ids=["flexible", "stiff"])
def test_error_against_dop853_falls_with_the_fourth_power_of_the_step(pendulum: Pendulum) -> None:
    truth = smooth_truth(pendulum, 0.4, 1.2)
    errors = [abs(simulate_smooth(pendulum, n) - truth) for n in (100, 200, 400)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all((orders > 3.7) & (orders < 4.4))  # discretisation: order 4
    assert errors[-1] < 5e-6  # discretisation: ω h below 0.07, four periods


def test_quadratic_drag_agrees_with_dop853() -> None:
    # discretisation: |q'| has a kink at each turn, so the order is that of a few kinks, not 4
    assert simulate_smooth(BAG, 800) == pytest.approx(smooth_truth(BAG, 0.4, 1.2), abs=1e-7)


def test_a_bang_bang_move_is_exact_to_the_order_where_its_switches_fall_on_nodes() -> None:
    move = pick_and_place(5.0)
    starts = np.concatenate([[0.0], np.cumsum(move.duration_s)])
    errors = []
    for parts in (40, 80):
        nodes = np.unique(np.concatenate([np.linspace(a, b, parts + 1) for a, b in pairwise(starts)]))
        halves = np.sort(np.concatenate([nodes, (nodes[1:] + nodes[:-1]) / 2]))
        speeds = np.concatenate(
            [np.zeros((1, 2)), np.cumsum(move.duration_s[:, None] * move.acceleration_m_s2, axis=0)]
        )
        velocity = np.column_stack([np.interp(halves, starts, speeds[:, axis]) for axis in (0, 1)])
        q, _ = simulate_sway(PendulumEnsemble.of(FLEXIBLE), nodes, velocity)
        _, truth = simulate(FLEXIBLE, move, nodes[:-1])
        errors.append(float(np.max(np.abs(q[:-1, 0] - truth))))
    assert errors[0] < 1e-4
    assert np.log2(errors[0] / errors[1]) > 3.5  # discretisation: order 4


def test_pendulums_side_by_side_move_as_each_alone() -> None:
    halves = np.linspace(0, 1, 401)
    velocity = smooth_velocity(halves)
    together, rates = simulate_sway(PendulumEnsemble.of(FLEXIBLE, STIFF, BAG), halves[::2], velocity, angle_rad=0.2)
    for i, pendulum in enumerate((FLEXIBLE, STIFF, BAG)):
        alone, rate = simulate_sway(PendulumEnsemble.of(pendulum), halves[::2], velocity, angle_rad=0.2)
        np.testing.assert_allclose(together[:, i], alone[:, 0], rtol=1e-12, atol=1e-14)  # identity
        np.testing.assert_allclose(rates[:, i], rate[:, 0], rtol=1e-11, atol=1e-12)  # identity


def test_a_pivot_each_is_the_same_as_one_at_a_time() -> None:
    halves = np.linspace(0, 1, 401)
    velocity = np.stack([smooth_velocity(halves), 0.5 * smooth_velocity(halves)], axis=2)
    both, _ = simulate_sway(PendulumEnsemble.of(FLEXIBLE), halves[::2], velocity)
    half, _ = simulate_sway(PendulumEnsemble.of(FLEXIBLE), halves[::2], velocity[:, :, 1])
    np.testing.assert_allclose(both[:, 1], half[:, 0], rtol=1e-12, atol=1e-14)  # identity


def test_rate_is_the_derivative_of_the_angle() -> None:
    halves = np.linspace(0, 1, 4001)
    q, rate = simulate_sway(PendulumEnsemble.of(FLEXIBLE), halves[::2], smooth_velocity(halves), angle_rad=0.3)
    slope = np.gradient(q[:, 0], halves[::2], edge_order=2)
    np.testing.assert_allclose(rate[1:-1, 0], slope[1:-1], atol=1e-3)  # discretisation: central differences


def test_without_a_momentum_it_starts_at_rest_beside_a_moving_pivot() -> None:
    halves = np.linspace(0, 0.1, 21)
    velocity = np.tile([0.7, -0.3], (21, 1))
    _, rate = simulate_sway(PendulumEnsemble.of(FLEXIBLE), halves[::2], velocity, angle_rad=0.3)
    assert rate[0, 0] == pytest.approx(0.0, abs=1e-12)  # identity


def test_an_undamped_free_pendulum_keeps_its_energy() -> None:
    pendulum = Pendulum(length_m=0.05, tag_radius_m=0.05, stiffness_over_inertia_rad2_s2=20.0)
    halves = np.linspace(0, 5, 4001)
    q, rate = simulate_sway(PendulumEnsemble.of(pendulum), halves[::2], np.zeros((4001, 2)), angle_rad=1.2)
    energy = rate**2 / 2 + 10 * q**2 - GRAVITY_M_S2 / 0.05 * np.cos(q)
    assert np.ptp(energy) < 1e-5 * (energy.max() + GRAVITY_M_S2 / 0.05)  # discretisation


def test_dry_friction_takes_the_same_angle_off_each_half_swing() -> None:
    friction = 2.0
    pendulum = Pendulum(length_m=0.05, tag_radius_m=0.05, coulomb_friction_rad_s2=friction)
    halves = np.linspace(0, 3, 6001)
    q, _ = simulate_sway(PendulumEnsemble.of(pendulum), halves[::2], np.zeros((6001, 2)), angle_rad=0.15)
    turns = q[1:-1, 0][(np.diff(q[:-1, 0]) * np.diff(q[1:, 0]) < 0)]
    lost = -np.diff(np.abs(turns))[:3]
    # 2 c / ω_n² a half swing; the tolerance is gravity's softening at 0.15 rad and the smoothed sign
    np.testing.assert_allclose(lost, 2 * friction / (GRAVITY_M_S2 / 0.05), rtol=0.02)


def test_velocities_that_do_not_fit_the_nodes_are_refused() -> None:
    with pytest.raises(ValueError, match="11 nodes need 21 pivot velocities, not 11"):
        simulate_sway(PendulumEnsemble.of(FLEXIBLE), np.linspace(0, 1, 11), np.zeros((11, 2)))


def test_whole_numbers_are_times_and_velocities_too() -> None:
    whole = simulate_sway(PendulumEnsemble.of(FLEXIBLE), np.arange(3), np.ones((5, 2), dtype=int))
    floats = simulate_sway(PendulumEnsemble.of(FLEXIBLE), np.arange(3.0), np.ones((5, 2)))
    np.testing.assert_array_equal(whole, floats)  # identity


@pytest.mark.parametrize("damage", [b"", b"no index"])
def test_a_damaged_cache_of_what_is_compiled_is_not_read(tmp_path: Path, damage: bytes) -> None:
    code = "from tagsway.marching import load_march; load_march()"
    run = [sys.executable, "-c", code]
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    subprocess.run(run, env=environment, check=True)
    kept = [file for file in tmp_path.rglob("*") if file.is_file()]
    assert kept  # or nothing would be damaged
    for file in kept:
        file.write_bytes(damage)
    subprocess.run(run, env=environment, check=True)
