"""How the payload of a scene moves: Lagrange's equations in their acceleration form.

One or two stiff bodies hang from each other, each along a direction d of unit length

    d(q, s) = (sin q cos s, sin s, -cos q cos s)          x right, y away from the camera, z up

with q in the plane and s out of it. With D = ∂d/∂(q, s) and A the pivot's acceleration plus g upwards,

    D1ᵀ [ J1 d1'' + m1 l1 A + m2 h (A + h d1'' + l2 d2'') ] = spring, damper, drag and friction of the pivot - hinge
    D2ᵀ [ m2 l2 (A + h d1'') + J2 d2'' ]                    = spring and damper of the hinge

where J1 is about the pivot, J2 about the hinge at h, l1 and l2 lead to the centres of mass. This is on purpose not the
formulation of `tagsway.dynamics`, and not its integrator: a fit is not to be judged by its own equations.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.linalg import eig

from tagsway.errors import InputError
from tagsway.model import GRAVITY_M_S2, FloatArray, Mode, Trajectory
from tagsway.scene.model import Scene, Waypoints
from tagsway.scene.slopes import load_slopes
from tagsway.trajectories import plan_move

UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """Where everything is at given times; x right, y away from the camera, z up.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        0 when the film begins.
    tcp_m, pivot_m, pcp_m : ndarray, shape (n, 3)
        The tool's tag, the pivot, and the product's tag without the depths of `Tag`.
    angle_rad, sideways_rad : ndarray, shape (n,)
        q and s of the first body.
    rate_rad_s, sideways_rate_rad_s : ndarray, shape (n,)
        Their derivatives.
    second_angle_rad : ndarray, shape (n,)
        q of the second body, NaN where there is none.
    move_s : tuple of float
        When the tool begins to move and when it is at rest again; equal without a move.
    """

    time_s: FloatArray
    tcp_m: FloatArray
    pivot_m: FloatArray
    pcp_m: FloatArray
    angle_rad: FloatArray
    sideways_rad: FloatArray
    rate_rad_s: FloatArray
    sideways_rate_rad_s: FloatArray
    second_angle_rad: FloatArray
    move_s: tuple[float, float]


def simulate_scene(scene: Scene, time_s: FloatArray | None = None) -> Motion:
    """Simulate the motion of a scene.

    Parameters
    ----------
    scene : Scene
        What moves.
    time_s : ndarray, shape (n,), optional
        Times, 0 when the film begins; by default every millisecond of it.

    Returns
    -------
    Motion
        At those times. Until the start nothing moves.

    Notes
    -----
    DOP853 with a relative tolerance of 1e-11, begun anew at each break of the trajectory, so that no step spans a jump
    of the acceleration. Dry friction's sign is smoothed over 1e-3 rad/s.
    """
    asked = np.arange(0.0, scene.duration_s, 1e-3) if time_s is None else np.asarray(time_s, dtype=float)
    time, places = np.unique(asked, return_inverse=True)
    drive = find_drive(scene)
    payload, start = scene.payload, scene.tool.start_s
    bodies = 1 if scene.second_body is None else 2
    state = np.zeros(4 * bodies)
    state[: 2 * bodies] = [payload.release_angle_rad, payload.sideways_angle_rad] * bodies
    states = np.tile(state, (len(time), 1))
    slopes, constants = load_slopes(), _constants(scene)
    end = max(float(time[-1]), start) + 1e-9
    breaks = start + drive.breaks_s
    edges = np.unique(np.append(breaks[breaks < end], end))
    for low, high in pairwise(edges):
        inside = (time > low) & (time <= high)
        piece = int(np.searchsorted(drive.breaks_s, (low + high) / 2 - start, side="right")) - 1
        nodes = np.union1d([low, high], time[inside])
        path = solve_ivp(
            slopes,
            (low, high),
            state,
            method="DOP853",
            t_eval=nodes,
            rtol=1e-11,
            atol=1e-12,
            args=(*_push(drive, piece, start), *constants),
        ).y.T
        states[inside] = path[1 : np.count_nonzero(inside) + 1]
        state = path[-1]
    return _describe(scene, asked, drive, states[places])


def find_drive(scene: Scene) -> Trajectory:
    """Return how the TCP tag's centre moves, from the start on; a tool at rest has a trajectory of one still piece."""
    if scene.move is not None:
        return plan_move(scene.move)
    if scene.trajectory is not None:
        return _spline(scene.trajectory)
    x, z = scene.tool.position_m
    return Trajectory(breaks_s=np.array([0.0, 1e-3]), coefficients=np.array([[[x, 0.0, z]]]))


def find_modes(scene: Scene) -> tuple[Mode, ...]:
    """Return the scene's linear modes in the plane, the one in which the first body sways most first."""
    payload, second = scene.payload, scene.second_body
    inertia = payload.inertia_kg_m2
    pendulum = payload.pendulum()
    moment = inertia / payload.length_m
    k, b = pendulum.stiffness_over_inertia_rad2_s2 * inertia, pendulum.damping_over_inertia_rad_s * inertia
    if second is None:
        return (Mode(natural_frequency_hz=pendulum.natural_frequency_hz, damping_ratio=pendulum.damping_ratio),)
    centre = second.centre_of_mass_m or second.length_m
    moment2 = second.mass_kg * centre
    k2, b2, h = second.stiffness_n_m_per_rad, second.damping_n_m_s_per_rad, second.hinge_m
    coupling = moment2 * h
    mass = np.array([[inertia + second.mass_kg * h**2, coupling], [coupling, moment2 * second.length_m]])
    damping = np.array([[b + b2, -b2], [-b2, b2]])
    gravity = GRAVITY_M_S2 * np.diag([moment + second.mass_kg * h, moment2])
    stiffness = np.array([[k + k2, -k2], [-k2, k2]]) + gravity
    still, one = np.zeros((2, 2)), np.eye(2)
    left = np.block([[still, one], [-stiffness, -damping]])
    roots, vectors = eig(left, np.block([[one, still], [still, mass]]))
    kept = [i for i in range(4) if roots[i].imag > 0]
    kept.sort(key=lambda i: -float(abs(vectors[0, i]) / np.linalg.norm(vectors[:2, i])))
    if not kept:
        raise InputError("this scene does not swing: both of its bodies are damped too much")
    return tuple(_mode_of(complex(roots[i])) for i in kept)


def _mode_of(root: complex) -> Mode:
    return Mode(natural_frequency_hz=abs(root) / (2 * math.pi), damping_ratio=max(0.0, -root.real / abs(root)))


def _spline(table: Waypoints) -> Trajectory:
    time = np.array(table.time_s) - table.time_s[0]
    x, z = np.array(table.x_m), np.array(table.z_m)
    spline = CubicSpline(time, np.stack([x, np.zeros_like(x), z], axis=1), bc_type="clamped")
    return Trajectory(breaks_s=time, coefficients=spline.c[::-1].transpose(1, 0, 2).copy())


def _push(drive: Trajectory, piece: int, start_s: float) -> tuple[float, FloatArray]:
    """Return A in one piece, also at its very end, where the next piece's already holds: its begin and its terms."""
    pieces, terms, _ = drive.coefficients.shape
    weights = np.zeros((max(terms - 2, 1), 3))
    inside = 0 <= piece < pieces
    if inside:
        power = np.arange(2, terms)
        weights[: terms - 2] = (power * (power - 1))[:, None] * drive.coefficients[piece, 2:]
    weights[0] += GRAVITY_M_S2 * UP
    return start_s + float(drive.breaks_s[piece]) if inside else 0.0, weights


def _constants(scene: Scene) -> tuple[FloatArray, FloatArray, FloatArray, tuple[float, ...]]:
    """Return inertias, moments, the pivot's springs and what resists, as `load_slopes` takes them."""
    payload, second = scene.payload, scene.second_body
    pendulum, inertia = payload.pendulum(), payload.inertia_kg_m2
    coupling, moments = np.array([[inertia]]), np.array([inertia / payload.length_m])
    spring = np.full(2, pendulum.stiffness_over_inertia_rad2_s2 * inertia)
    if payload.sideways_stiffness_n_m_per_rad is not None:
        spring[1] = payload.sideways_stiffness_n_m_per_rad
    resistance = (
        pendulum.damping_over_inertia_rad_s * inertia,
        payload.quadratic_drag_per_rad * inertia,
        payload.coulomb_friction_rad_s2 * inertia,
    )
    if second is None:
        return coupling, moments, spring, (*resistance, 0.0, 0.0)
    moment, hinge = second.mass_kg * (second.centre_of_mass_m or second.length_m), second.hinge_m
    across = moment * hinge
    coupling = np.array([[inertia + second.mass_kg * hinge**2, across], [across, moment * second.length_m]])
    moments = np.array([moments[0] + second.mass_kg * hinge, moment])
    return coupling, moments, spring, (*resistance, second.stiffness_n_m_per_rad, second.damping_n_m_s_per_rad)


def _describe(scene: Scene, time: FloatArray, drive: Trajectory, states: FloatArray) -> Motion:
    start = scene.tool.start_s
    tcp = drive(time - start)
    offset_x, offset_z = scene.tool.pivot_offset_m
    pivot = tcp + np.array([offset_x, 0.0, offset_z])
    bodies = states.shape[1] // 4
    q, s = states[:, 0], states[:, 1]
    direction = np.stack([np.sin(q) * np.cos(s), np.sin(s), -np.cos(q) * np.cos(s)], axis=1)
    moves = scene.move is not None or scene.trajectory is not None
    return Motion(
        time_s=time,
        tcp_m=tcp,
        pivot_m=pivot,
        pcp_m=pivot + scene.payload.pendulum().tag_radius_m * direction,
        angle_rad=q,
        sideways_rad=s,
        rate_rad_s=states[:, 2 * bodies],
        sideways_rate_rad_s=states[:, 2 * bodies + 1],
        second_angle_rad=states[:, 2] if bodies == 2 else np.full(len(time), np.nan),
        move_s=(start, start + drive.duration_s if moves else start),
    )
