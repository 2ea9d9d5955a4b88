"""A further mode in the design: simulated on the first body, stopped by a shaper of its own, or left alone."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from design_cases import FREQUENCY_HZ, flexible_move, flexible_spread
from tagsway.design import (
    DesignTask,
    FurtherMode,
    design_shapers,
    draw_payloads,
    draw_settings,
    make_payloads,
    read_limits,
    search_candidate,
    simulate_motion,
)
from tagsway.design.motion import find_way, simulate_together
from tagsway.dynamics import LightBody, PendulumEnsemble, simulate_carried, simulate_planned, simulate_sway
from tagsway.errors import InputError
from tagsway.model import GRAVITY_M_S2, DesignMode, Mode, Pendulum
from tagsway.shapers import design_shaper
from tagsway.trajectories import apply_shaper, plan_move

FIRST = DesignMode(frequency_hz=FREQUENCY_HZ, damping_ratio=0.055)
SECOND = Mode(natural_frequency_hz=6.0, damping_ratio=0.02)


def carried_by(step_s: float) -> np.ndarray:
    """Return the second body's place under a smooth pivot, X' = sin² and Z' = sin, at 0, 0.1, … 1 s."""
    ensemble = PendulumEnsemble.of(Pendulum(length_m=0.05, tag_radius_m=0.05, damping_over_inertia_rad_s=1.0))
    body = LightBody(
        carried_at_m=np.array([0.05]),
        angular_frequency_rad_s=np.array([2 * np.pi * 6]),
        damping_ratio=np.array([0.02]),
        gain=np.array([0.4]),
    )
    time = np.linspace(0, 1, round(1 / step_s) + 1)
    halves = np.linspace(0, 1, 2 * len(time) - 1)
    velocity = np.stack([np.sin(np.pi * halves) ** 2, 0.2 * np.sin(2 * np.pi * halves)], axis=1)[..., None]
    q, rate = simulate_sway(ensemble, time, velocity)
    return simulate_carried(body, time, velocity[:, 0], q, rate)[0][:: round(0.1 / step_s), 0]


def test_a_carried_body_converges_with_the_fourth_order() -> None:
    truth = carried_by(5e-4)
    coarse, fine = (float(np.abs(carried_by(step) - truth).max()) for step in (0.01, 0.005))
    assert 12 < coarse / fine < 22  # discretisation: 16


def test_a_carried_body_is_that_of_the_acceleration_form() -> None:
    ensemble = PendulumEnsemble.of(Pendulum(length_m=0.05, tag_radius_m=0.05))
    one = np.ones(1)
    body = LightBody(
        carried_at_m=0.05 * one, angular_frequency_rad_s=40 * one, damping_ratio=0.01 * one, gain=0.3 * one
    )
    time = np.linspace(0, 1, 1001)
    push = np.zeros((1000, 3, 2, 1))
    push[:, :, 0, 0] = 3.0  # a held acceleration from rest
    other = simulate_planned(ensemble, time[:, None], push, second=body)
    halves = np.linspace(0, 1, 2001)
    velocity = np.stack([3 * halves, 0 * halves], axis=1)[..., None]
    q, rate = simulate_sway(ensemble, time, velocity)
    y, speed = simulate_carried(body, time, velocity[:, 0], q, rate)
    assert y[:, 0] == pytest.approx(other.second_m[:, 0, 0], abs=1e-9)  # discretisation
    assert speed[:, 0] == pytest.approx(other.second_m_s[:, 0, 0], abs=1e-8)


def both_by_dop853(trajectory, payloads) -> tuple[float, float]:
    """Return placement error and PCP x'' of one payload with one further body, begun anew at every break."""
    e, body, r = payloads.ensemble, payloads.further[0], payloads.tag_radius_m[0]
    way, (w, z, g) = find_way(trajectory), (body.angular_frequency_rad_s[0], body.damping_ratio[0], body.gain[0])
    state, after, peak = np.zeros(4), 0.0, 0.0
    for low, high in itertools.pairwise([*trajectory.breaks_s, trajectory.duration_s + 2 / payloads.frequency_hz[0]]):

        def slope(t, s, low=low, high=high):
            q, rate, y, speed = s
            push = trajectory(min(max(t, low + 1e-9), high - 1e-9), 2)
            turn = -e.damping_over_inertia_rad_s[0] * rate - e.stiffness_over_inertia_rad2_s2[0] * q
            turn -= ((GRAVITY_M_S2 + push[2]) * np.sin(q) + push @ way * np.cos(q)) / e.length_m[0]
            carrier = push @ way + r * (turn * np.cos(q) - rate**2 * np.sin(q))
            bend = -2 * z * w * speed - w**2 * y - g * carrier
            return np.array([rate, turn, speed, bend, carrier + bend])

        time = np.linspace(low, high, max(int((high - low) / 1e-3), 20))
        found = solve_ivp(
            lambda t, s: slope(t, s)[:4], (low, high), state, "DOP853", t_eval=time, rtol=1e-9, atol=1e-11
        )
        peak = max(peak, *(abs(slope(t, s)[4]) for t, s in zip(time, found.y.T, strict=True)))
        if low >= trajectory.duration_s - 1e-12:
            after = float(np.abs(r * np.sin(found.y[0]) + found.y[2]).max())
        state = found.y[:, -1]
    return after, peak


@pytest.mark.parametrize(("kind", "axes"), [(None, ()), ("zvd", ("x",))])
def test_two_modes_together_agree_with_another_integrator(kind, axes) -> None:
    trajectory = plan_move(flexible_move())
    if kind is not None:
        trajectory = apply_shaper(trajectory, design_shaper(kind, FIRST), axes)
    spread = flexible_spread(further=(FurtherMode(mode=SECOND, frequency_percent=3.0, gain=0.4),))
    payloads = make_payloads(spread, np.array([2.4]), np.array([0.05]), np.array([[6.1]]))
    outcome = simulate_motion(trajectory, payloads)
    after, peak = both_by_dop853(trajectory, payloads)
    # Discretisation: nodes a millisecond apart miss a peak of 6 Hz by (ω h)²/8, 2e-4 of it.
    assert outcome.placement_m[0] == pytest.approx(after, abs=2e-5)
    assert outcome.pcp_acceleration_m_s2[0] == pytest.approx(peak, rel=1e-3)
    scan = simulate_together([trajectory], payloads, np.arange(0, trajectory.duration_s + 0.9, 0.008))[0]
    assert scan.placement_m[0] == pytest.approx(after, abs=2e-4)


def test_a_further_mode_varies_by_its_own_spread_whatever_the_first_does() -> None:
    further = FurtherMode(mode=SECOND, frequency_percent=2.0)
    payloads = draw_payloads(flexible_spread(further=(further,)), 2000, rng=np.random.default_rng(5))
    second = payloads.further[0].angular_frequency_rad_s / (2 * np.pi)
    assert 0.98 * 6 <= second.min() < 0.985 * 6 < 1.015 * 6 < second.max() <= 1.02 * 6
    # Statistics: a correlation of 2000 independent pairs is below 0.07 in 99.8 %.
    assert abs(np.corrcoef(second, payloads.frequency_hz)[0, 1]) < 0.07


def task_with(gain: float) -> DesignTask:
    move = flexible_move()
    return DesignTask(
        moves=(move,),
        modes=(FIRST, DesignMode(frequency_hz=6.0, damping_ratio=0.02)),
        band_percent=(11.46, 2.0),
        payload=flexible_spread(further=(FurtherMode(mode=SECOND, frequency_percent=2.0, gain=gain),)),
        limits=read_limits(move),
        kinds=("zvd",),
        accelerations_m_s2=np.geomspace(4.4, 10.0, 8),
        checked=50,
    )


def quickest(gain: float) -> dict[str, float]:
    """Return the motion time of the legal ones of unshaped, ZVD and ZVD-ZV on x."""
    task = task_with(gain)
    settings = draw_settings(task, rng=np.random.default_rng(3))
    jobs = [(None, ()), *((shaper, ("x",)) for shaper in design_shapers(task)[0])]
    found = [
        search_candidate(task.moves, *job, task.limits, settings, accelerations_m_s2=task.accelerations_m_s2)
        for job in jobs
    ]
    return {c.name: c.motion_time_s for c in found if c.legal}


def test_a_further_mode_that_does_nothing_costs_nothing_and_one_that_does_has_its_own_shaper() -> None:
    still, moved = quickest(0.01), quickest(1.0)
    assert set(still) == {"unshaped", "zvd", "zvd-zv"}
    assert still["zvd"] < still["zvd-zv"]
    # A point on a string swings by a²/ω² of 7 mm and more: what does not stop it breaks the placement.
    assert moved["zvd-zv"] == min(moved.values())
    assert "unshaped" not in moved


def test_a_task_whose_modes_are_not_those_of_its_payload_is_refused() -> None:
    with pytest.raises(InputError, match="as many"):
        replace(task_with(0.1), payload=flexible_spread())


@pytest.mark.parametrize("changes", [{"frequency_percent": 0.0}, {"frequency_percent": np.nan}, {"gain": np.nan}])
def test_a_further_mode_that_cannot_be_is_refused(changes) -> None:
    with pytest.raises(InputError, match="further mode"):
        FurtherMode(**{"mode": SECOND, "frequency_percent": 2.0} | changes)
