"""The parts of the pendulum's fit: slopes of a simulation, the search, and what is not modelled."""

from dataclasses import replace

import numpy as np
import pytest

from pendulum_scenes import FLEXIBLE, STANDING, Recording, pick_and_place, record
from tagsway.dynamics import PendulumEnsemble, simulate_sway, step_sway
from tagsway.model import FloatArray
from tagsway.pendulum import fit_arc
from tagsway.pendulum.assumed import believe, rows_of
from tagsway.pendulum.model import Unknown, predict
from tagsway.pendulum.problem import Problem, SharedErrors, measured
from tagsway.pendulum.record import Record, choose_record
from tagsway.pendulum.search import search
from tagsway.pendulum.tangent import Tangent
from tagsway.pendulum.unmodelled import find_sizes, find_ways

OMEGA = 2 * np.pi * FLEXIBLE.natural_frequency_hz
NEAR = 1e-6
"""Of the differences: their own error is as large, relative to the slopes."""


def parameters() -> FloatArray:
    p = np.zeros(len(Unknown))
    p[: Unknown.OFFSET_X] = [np.log(OMEGA / (2 * np.pi)), *np.log([0.04585, 0.04585]), 0.004, 0.05, 0.002]
    p[Unknown.OFFSET_X : Unknown.SCALE] = [0.003, -0.012, 1e-3, 0.01, 0.02]
    p[Unknown.SCALE :] = [0.002, 0.003, 0.001, 0.005]
    return p


@pytest.fixture(scope="module")
def film() -> Recording:
    return record(FLEXIBLE, pick_and_place(4.0), seed=1)


@pytest.fixture(scope="module")
def data(film: Recording) -> Record:
    rng = np.random.default_rng(0)
    return choose_record(film.track, film.window, angular_frequency_rad_s=OMEGA, rng=rng)


@pytest.fixture(scope="module")
def problem(data: Record) -> Problem:
    seen = np.isfinite(measured(data))
    priors = rows_of(believe(0.04585, point_mass=False, length_m=None, scale_std=0.003))
    return Problem(data, priors, np.stack([*data.sway_std_m.T, data.angle_std_rad]), seen)


def test_slopes_are_those_of_whole_simulations(data: Record) -> None:
    smooth = [u for u in Unknown if u is not Unknown.FRICTION]  # whose sign turns within a step
    p, rows = parameters(), np.arange(len(smooth))
    around = np.repeat(p[:, None], 2 * len(smooth), axis=1)
    around[smooth, rows] += NEAR
    around[smooth, len(smooth) + rows] -= NEAR
    seen = predict(data, around)
    whole = (seen[:, :, : len(smooth)] - seen[:, :, len(smooth) :]) / (2 * NEAR)
    found = Tangent.of(data, p).of_parameters(np.array(smooth))
    # discretisation: forward differences of one step, 1e-6 of curvatures about ten times the slopes
    np.testing.assert_allclose(found, whole, atol=1e-4 * float(np.max(np.abs(whole))))


def test_a_little_change_of_the_velocity_moves_the_samples_as_a_simulation_says(data: Record) -> None:
    p, tiny = parameters(), 1e-4
    change = data.velocity_draws_m_s[:, :, 0] - data.velocity_m_s
    moved = replace(data, velocity_m_s=data.velocity_m_s + tiny * change)
    whole = (predict(moved, p[:, None]) - predict(data, p[:, None]))[:, :, 0] / tiny
    found = Tangent.of(data, p).of_velocity(change[:, :, None])[:, :, 0]
    np.testing.assert_allclose(found, whole, atol=1e-3 * float(np.max(np.abs(whole))))  # discretisation: of `tiny`


def test_a_push_of_gravity_is_what_a_shorter_pendulum_feels(data: Record) -> None:
    # at the same k/J, c and b/J, with the pivot at rest: q'' changes by gravity's part alone
    p = parameters()
    p[Unknown.ANGLE] = 0.2
    still = replace(data, velocity_m_s=np.zeros_like(data.velocity_m_s))
    tangent = Tangent.of(still, p)
    stretch = np.zeros(len(Unknown))
    stretch[Unknown.LOG_LENGTH] = 1.0
    gravity = 9.81 / 0.04585
    stretch[Unknown.LOG_FREQUENCY] = -gravity / (2 * OMEGA**2)
    stretch[Unknown.DAMPING_RATIO] = 0.004 * gravity / (2 * OMEGA**2)
    stretch[Unknown.FRICTION] = 0.002 * gravity / OMEGA**2
    whole = tangent.of_parameters(np.arange(len(Unknown))) @ stretch
    pushed = tangent.of_push(gravity * np.sin(tangent.angle_rad))[:, :, 0]
    # discretisation: the push is straight between nodes
    np.testing.assert_allclose(pushed[0], whole[0], atol=0.01 * float(np.max(np.abs(whole[0]))))


def test_one_step_from_each_node_is_the_simulation() -> None:
    time = np.linspace(0, 1, 101)
    velocity = np.stack([np.sin(5 * np.linspace(0, 1, 201)), np.zeros(201)], axis=1)
    pendulum = PendulumEnsemble.of(FLEXIBLE)
    q, rate = simulate_sway(pendulum, time, velocity, angle_rad=0.3)
    p = rate + velocity[::2, :1] * np.cos(q) / FLEXIBLE.length_m
    places = np.stack([velocity[:-2:2], velocity[1:-1:2], velocity[2::2]]).transpose(0, 2, 1)[..., None]
    angle, momentum = step_sway(pendulum, 0.01, places, angle_rad=q[:-1], momentum_rad_s=p[:-1])
    np.testing.assert_allclose(angle, q[1:], atol=1e-13)  # identity
    np.testing.assert_allclose(momentum, p[1:], atol=1e-12)  # identity


def test_one_pendulum_and_several_are_simulated_alike() -> None:
    time, velocity = np.linspace(0, 2, 201), np.zeros((401, 2))
    alone, _ = simulate_sway(PendulumEnsemble.of(FLEXIBLE), time, velocity, angle_rad=0.4)
    twice, _ = simulate_sway(PendulumEnsemble.of(FLEXIBLE, FLEXIBLE), time, velocity, angle_rad=0.4)
    np.testing.assert_allclose(twice, np.repeat(alone, 2, axis=1), atol=1e-12)  # identity


def test_a_motion_that_flies_off_is_nan_and_not_an_error() -> None:
    wild = replace(FLEXIBLE, length_m=1e-9, damping_over_inertia_rad_s=-1e6)
    with np.errstate(all="ignore"):
        q, _ = simulate_sway(PendulumEnsemble.of(wild), np.linspace(0, 9, 400), np.zeros((799, 2)), angle_rad=1.0)
    assert not np.all(np.isfinite(q))


def test_the_search_finds_the_least_from_far_away(problem: Problem) -> None:
    start = parameters()
    start[[Unknown.LOG_LENGTH, Unknown.LOG_RADIUS]] += [0.2, -0.1]
    start[Unknown.FRICTION] = 0.0
    near = parameters()
    near[Unknown.FRICTION] = 0.0
    far, cost = search(problem, start, steps=60, tolerance=1e-6, loss="linear")
    close, least = search(problem, near, steps=60, tolerance=1e-6, loss="linear")
    assert cost == pytest.approx(least, abs=1e-4)  # discretisation: of the tolerance
    assert np.exp(far[Unknown.LOG_LENGTH]) == pytest.approx(np.exp(close[Unknown.LOG_LENGTH]), rel=1e-5)


def test_nothing_unmodelled_is_seen_where_there_is_nothing(problem: Problem) -> None:
    start = parameters()
    start[Unknown.FRICTION] = 0.0
    best, _ = search(problem, start, steps=60, tolerance=1e-4, loss="linear")
    data = problem.record
    draws = Tangent.of(data, best).of_velocity(data.velocity_draws_m_s - data.velocity_m_s[:, :, None])
    problem = problem.but(shared=SharedErrors.of(problem.scaled(draws) / np.sqrt(draws.shape[2])))
    best, _ = search(problem, best, steps=60, tolerance=1e-4, loss="linear")
    sizes = find_sizes(problem, best, find_ways(problem, best))
    assert (sizes.push, sizes.slip, sizes.lift) == (0.0, 0.0, 0.0)
    assert sizes.body < 1e-3  # what may hang there unseen


def test_the_scale_of_one_tag_does_not_bend_the_arc() -> None:
    film = record(FLEXIBLE, pick_and_place(4.0), seed=1)
    tool, pcp = film.track.tcp, film.track.pcp
    assert tool is not None
    sway = pcp.position - 1.005 * tool.position
    std = np.full_like(sway, 7e-5)
    plain = fit_arc(sway, std, pcp.angle_rad, pcp.angle_std_rad)
    arc = fit_arc(sway, std, pcp.angle_rad, pcp.angle_std_rad, tool_m=tool.position)
    assert abs(arc.radius_m - FLEXIBLE.tag_radius_m) < 4 * arc.radius_std_m  # statistics
    assert abs(plain.radius_m - FLEXIBLE.tag_radius_m) > abs(arc.radius_m - FLEXIBLE.tag_radius_m)


def test_a_light_body_that_swings_along_is_found_and_widens_l(problem: Problem) -> None:
    start = parameters()
    start[Unknown.FRICTION] = 0.0
    best, _ = search(problem, start, steps=60, tolerance=1e-4, loss="linear")
    ways = find_ways(problem, best)
    body = 0.02 * (problem.whiten(np.zeros_like(problem.measured)) + ways[1][:, 30])
    heavier = Problem(problem.record, (problem.rows, problem.target), problem.std, problem.seen)
    heavier.measured = problem.measured.copy()
    heavier.measured[problem.seen] += body * problem.std[problem.seen]
    assert find_sizes(heavier, best, ways).body > 2 * find_sizes(problem, best, ways).body


def test_a_codec_drags_no_tool_that_stands() -> None:
    film = record(FLEXIBLE, STANDING, seed=5, angle_rad=0.8)
    assert film.track.tcp is not None
    coded = replace(film.track, tcp=replace(film.track.tcp, image_share=0.3))
    draws = [
        choose_record(
            track, film.window, angular_frequency_rad_s=OMEGA, rng=np.random.default_rng(0)
        ).velocity_draws_m_s
        for track in (film.track, coded)
    ]
    np.testing.assert_array_equal(*draws)  # identity
