"""The scene's own simulator: against the fit's, against energy, and against linear theory."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.linalg import expm

from scenes import released_scene, small_scene, unmodelled_scene
from tagsway.dynamics import PendulumEnsemble, simulate_sway
from tagsway.model import GRAVITY_M_S2
from tagsway.scene.model import Payload, SecondBody, Tool, Waypoints
from tagsway.scene.motion import find_drive, find_modes, simulate_scene
from tagsway.trajectories import plan_move


def test_the_angle_agrees_with_the_fit_s_integrator_through_a_move():
    payload = Payload(length_m=0.0825, tag_radius_m=0.046, damping_ratio=0.01, quadratic_drag_per_rad=0.1)
    scene = small_scene(payload=payload, tool=Tool(start_s=0.0))
    drive = find_drive(scene)
    edges = np.append(drive.breaks_s, scene.duration_s)
    time = np.unique(np.concatenate([np.linspace(a, b, 2 + int(500 * (b - a))) for a, b in pairwise(edges)]))
    half = np.sort(np.concatenate([time, (time[1:] + time[:-1]) / 2]))
    theirs, rate = simulate_sway(PendulumEnsemble.of(payload.pendulum()), time, drive(half, 1)[:, [0, 2]])
    ours = simulate_scene(scene, time)
    # discretisation: theirs is of fourth order in steps of about 2 ms
    np.testing.assert_allclose(ours.angle_rad, theirs[:, 0], atol=1e-7)
    np.testing.assert_allclose(ours.rate_rad_s, rate[:, 0], atol=1e-6)
    assert np.max(np.abs(ours.angle_rad)) > 0.3


def test_nothing_moves_before_the_start():
    motion = simulate_scene(released_scene(), np.array([0.0, 0.05, 0.0999]))
    np.testing.assert_array_equal(motion.angle_rad, 0.5)
    np.testing.assert_array_equal(simulate_scene(small_scene(), np.array([-0.001, 0.09])).tcp_m, [(-0.14, 0, 0)] * 2)


def test_times_may_come_in_any_order_and_more_than_once():
    time = np.array([1.3, 0.2, 1.3, 0.9])
    motion = simulate_scene(small_scene(), time)
    again = simulate_scene(small_scene(), np.unique(time))
    # identity: the solver's own interpolation
    np.testing.assert_allclose(motion.angle_rad, again.angle_rad[[2, 0, 2, 1]], atol=1e-12)


def test_two_bodies_keep_their_energy():
    payload = Payload(length_m=0.08, centre_of_mass_m=0.05, mass_kg=0.2, release_angle_rad=0.7)
    second = SecondBody(hinge_m=0.07, length_m=0.05, centre_of_mass_m=0.03, mass_kg=0.1)
    scene = released_scene(payload=payload, second_body=second, tool=Tool(start_s=0.0))
    motion = simulate_scene(scene, np.linspace(0, 1.0, 2001))
    q1, q2 = motion.angle_rad, motion.second_angle_rad
    rate1, rate2 = motion.rate_rad_s, CubicSpline(motion.time_s, q2)(motion.time_s, 1)
    height1, height2 = -0.05 * np.cos(q1), -0.07 * np.cos(q1) - 0.03 * np.cos(q2)
    energy = (
        (0.2 * 0.08 * 0.05 + 0.1 * 0.07**2) / 2 * rate1**2
        + 0.1 * 0.05 * 0.03 / 2 * rate2**2
        + 0.1 * 0.07 * 0.03 * rate1 * rate2 * np.cos(q1 - q2)
        + GRAVITY_M_S2 * (0.2 * height1 + 0.1 * height2)
    )
    # discretisation: of the spline's derivative, of third order in 0.5 ms
    np.testing.assert_allclose(energy[5:-5], energy[0], rtol=1e-6)
    assert np.max(np.abs(q1 - q2)) > 0.5


def test_sideways_two_bodies_swing_as_they_do_in_the_plane():
    second = SecondBody(hinge_m=0.07, length_m=0.05, mass_kg=0.1, stiffness_n_m_per_rad=0.01)
    seen = []
    for angles in ((0.6, 0.0), (0.0, 0.6)):
        payload = Payload(length_m=0.08, release_angle_rad=angles[0], sideways_angle_rad=angles[1], damping_ratio=0.01)
        seen.append(simulate_scene(released_scene(payload=payload, second_body=second), np.linspace(0, 1.5, 31)))
    np.testing.assert_allclose(seen[0].angle_rad, seen[1].sideways_rad, atol=1e-8)
    np.testing.assert_allclose(seen[1].angle_rad, 0, atol=1e-12)


def test_a_body_alone_in_three_dimensions_keeps_energy_and_momentum_about_the_vertical():
    payload = Payload(length_m=0.08, tag_radius_m=0.08, release_angle_rad=0.7, sideways_angle_rad=0.3)
    motion = simulate_scene(released_scene(payload=payload, tool=Tool(start_s=0.0)), np.linspace(0, 2.0, 4001))
    d = (motion.pcp_m - motion.pivot_m) / 0.08
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1, atol=1e-12)
    speed = motion.rate_rad_s**2 * np.cos(motion.sideways_rad) ** 2 + motion.sideways_rate_rad_s**2
    energy = speed / 2 + GRAVITY_M_S2 / 0.08 * d[:, 2]
    # identity, up to the integrator's tolerance
    np.testing.assert_allclose(energy, energy[0], rtol=1e-8)
    assert np.ptp(motion.sideways_rad) > 0.5


def test_the_second_body_drives_the_first_as_linear_theory_says():
    payload = Payload(length_m=0.08, centre_of_mass_m=0.05, mass_kg=0.2, damping_ratio=0.02, release_angle_rad=1e-4)
    second = SecondBody(
        hinge_m=0.07, length_m=0.05, centre_of_mass_m=0.03, mass_kg=0.1, stiffness_n_m_per_rad=0.01,
        damping_n_m_s_per_rad=1e-4,
    )  # fmt: skip
    scene = released_scene(payload=payload, second_body=second, tool=Tool(start_s=0.0))
    j1, j2, h = 0.2 * 0.08 * 0.05, 0.1 * 0.05 * 0.03, 0.07
    b = payload.pendulum().damping_over_inertia_rad_s * j1
    mass = np.array([[j1 + 0.1 * h**2, 0.1 * h * 0.03], [0.1 * h * 0.03, j2]])
    stiffness = GRAVITY_M_S2 * np.diag([0.2 * 0.05 + 0.1 * h, 0.1 * 0.03]) + 0.01 * np.array([[1, -1], [-1, 1]])
    damping = np.array([[b + 1e-4, -1e-4], [-1e-4, 1e-4]])
    system = np.block(
        [[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)]]
    )
    time = np.linspace(0, 1.5, 31)
    expected = np.array([(expm(system * t) @ [1e-4, 1e-4, 0, 0])[:2] for t in time])
    motion = simulate_scene(scene, time)
    # discretisation of the linearisation: the cube of the swing, 1e-12
    np.testing.assert_allclose(motion.angle_rad, expected[:, 0], atol=1e-11)
    np.testing.assert_allclose(motion.second_angle_rad, expected[:, 1], atol=1e-11)
    roots = np.linalg.eigvals(system)
    frequencies = sorted({round(abs(r) / 2 / math.pi, 9) for r in roots})
    assert sorted(round(m.natural_frequency_hz, 9) for m in find_modes(scene)) == frequencies


def test_a_second_body_that_weighs_nothing_changes_nothing():
    second = SecondBody(hinge_m=0.07, length_m=0.05, mass_kg=1e-12)
    time = np.linspace(0, 2.5, 26)
    alone, both = simulate_scene(small_scene(), time), simulate_scene(small_scene(second_body=second), time)
    np.testing.assert_allclose(both.angle_rad, alone.angle_rad, atol=1e-8)


def test_dry_friction_takes_the_same_from_every_half_swing():
    payload = Payload(length_m=0.1, coulomb_friction_rad_s2=0.2, release_angle_rad=0.05)
    scene = released_scene(payload=payload, duration_s=3.0, tool=Tool(start_s=0.0))
    motion = simulate_scene(scene)
    turns = np.flatnonzero(np.diff(np.sign(motion.rate_rad_s[2:]))) + 2
    peaks = np.abs(motion.angle_rad[turns])
    # discretisation: the smoothed sign and the swing's cube; theory: 2 c / omega^2 = 4.077 mrad
    np.testing.assert_allclose(-np.diff(peaks)[:6], 2 * 0.2 / (GRAVITY_M_S2 / 0.1), rtol=0.02)


def test_a_table_of_a_smooth_move_gives_the_motion_of_the_move():
    move = replace(small_scene().move, profile="quintic", pick_height_m=0.0, place_height_m=0.0)
    planned = plan_move(move)
    time = np.append(np.arange(0.0, planned.duration_s, 2e-3), planned.duration_s)
    x, _, z = planned(time).T
    table = Waypoints(time_s=tuple(time), x_m=tuple(x), z_m=tuple(z))
    film = np.linspace(0, 2.0, 21)
    told = simulate_scene(small_scene(move=move), film)
    read = simulate_scene(small_scene(move=None, trajectory=table), film)
    # discretisation: the spline's, of fourth order in 2 ms
    np.testing.assert_allclose(read.tcp_m, told.tcp_m, atol=1e-8)
    np.testing.assert_allclose(read.angle_rad, told.angle_rad, atol=1e-5)
    assert read.move_s == pytest.approx(told.move_s)


def test_the_unmodelled_scene_leaves_the_plane_and_has_two_modes():
    scene = unmodelled_scene()
    motion = simulate_scene(scene)
    assert np.ptp(motion.sideways_rad) > 0.05
    first, other = find_modes(scene)
    assert abs(first.natural_frequency_hz - 2.4727) < 0.1 < abs(other.natural_frequency_hz - 2.4727)
