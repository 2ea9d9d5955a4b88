"""What a camera would see of a pendulum with given parameters, for many sets of them at a time."""

from enum import IntEnum

import numpy as np

from tagsway.dynamics import PendulumEnsemble, simulate_sway
from tagsway.model import GRAVITY_M_S2, FloatArray
from tagsway.pendulum.record import Record

SMOOTH_RATE_RAD_S = 0.05
"""Over which dry friction's sign is smoothed: wide enough for slopes and steps, 1 % of the rate of a usual swing."""


class Unknown(IntEnum):
    """Place of each unknown in a parameter vector.

    f and l are nearly independent of each other, l and k are not: (f, l, r, ζ) are fitted and k follows. Dry friction
    is the angle at which it would hold the pendulum, c/ω_n². The last four belong to the camera: what it shows as a
    length, in both tags, in one against the other, along z; and how far its vertical is from gravity's.
    """

    LOG_FREQUENCY = 0
    LOG_LENGTH = 1
    LOG_RADIUS = 2
    DAMPING_RATIO = 3
    DRAG = 4
    FRICTION = 5
    OFFSET_X = 6
    OFFSET_Z = 7
    ANGLE = 8
    RATE = 9
    TAG_ANGLE = 10
    SCALE = 11
    RELATIVE_SCALE = 12
    VERTICAL_SCALE = 13
    TILT = 14


def angular_frequency(parameters: FloatArray) -> FloatArray:
    """Return ω_n of parameters of shape (15, ...)."""
    return np.asarray(2 * np.pi * np.exp(parameters[Unknown.LOG_FREQUENCY]))


def length_m(parameters: FloatArray) -> FloatArray:
    """Return l."""
    return np.asarray(np.exp(parameters[Unknown.LOG_LENGTH]))


def tag_radius_m(parameters: FloatArray) -> FloatArray:
    """Return r."""
    return np.asarray(np.exp(parameters[Unknown.LOG_RADIUS]))


def pivot_offset_m(parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return x and z of the pivot from the TCP tag: what the camera shows of them, without its errors."""
    p = parameters
    scale = 1 + p[Unknown.SCALE] + p[Unknown.RELATIVE_SCALE] / 2
    sine, cosine = np.sin(p[Unknown.TILT]), np.cos(p[Unknown.TILT])
    x, z = p[Unknown.OFFSET_X] / scale, p[Unknown.OFFSET_Z] / scale / (1 + p[Unknown.VERTICAL_SCALE])
    return np.asarray(cosine * x + sine * z), np.asarray(cosine * z - sine * x)


def stiffness_over_inertia(parameters: FloatArray) -> FloatArray:
    """Return k/J = ω_n² - g/l."""
    return np.asarray(angular_frequency(parameters) ** 2 - GRAVITY_M_S2 / length_m(parameters))


def damping_over_inertia(parameters: FloatArray) -> FloatArray:
    """Return b/J = 2 ζ ω_n."""
    return np.asarray(2 * parameters[Unknown.DAMPING_RATIO] * angular_frequency(parameters))


def coulomb_friction(parameters: FloatArray) -> FloatArray:
    """Return c, dry friction's angular acceleration."""
    return np.asarray(parameters[Unknown.FRICTION] * angular_frequency(parameters) ** 2)


def ensemble_of(parameters: FloatArray) -> PendulumEnsemble:
    """Return the pendulums of parameters of shape (15, m)."""
    return PendulumEnsemble(
        length_m=length_m(parameters),
        stiffness_over_inertia_rad2_s2=stiffness_over_inertia(parameters),
        damping_over_inertia_rad_s=damping_over_inertia(parameters),
        quadratic_drag_per_rad=parameters[Unknown.DRAG],
        coulomb_friction_rad_s2=coulomb_friction(parameters),
    )


def pivot_velocity(record: Record, parameters: FloatArray) -> FloatArray:
    """Return the pivot's true velocity at the nodes and half-way between, shape (2 k - 1, 2, m)."""
    velocity = record.velocity_m_s[:, :, None]
    if np.any(record.turn_rate_rad_s):
        across, up = _turned_offset(parameters, record.turn_at_rad)
        swirl = record.turn_rate_rad_s[:, None]
        velocity = velocity + np.stack([-swirl * up, swirl * across], axis=1)
    return true_velocity(parameters, velocity)


def true_velocity(parameters: FloatArray, seen_m_s: FloatArray) -> FloatArray:
    """Return what is a velocity of the TCP where the camera shows another, shape (k, 2, m) both."""
    p = parameters
    sine, cosine = np.sin(p[Unknown.TILT]), np.cos(p[Unknown.TILT])
    scale = 1 + p[Unknown.SCALE] - p[Unknown.RELATIVE_SCALE] / 2
    x, z = seen_m_s[:, 0] / scale, seen_m_s[:, 1] / (scale * (1 + p[Unknown.VERTICAL_SCALE]))
    return np.stack([cosine * x + sine * z, cosine * z - sine * x], axis=1)


def start_of(parameters: FloatArray, velocity_m_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return q and p at the first node: the momentum is the rate's, and what the pivot's true velocity adds to it."""
    q = parameters[Unknown.ANGLE]
    push = velocity_m_s[0, 0] * np.cos(q) + velocity_m_s[0, 1] * np.sin(q)
    return q, parameters[Unknown.RATE] + push / length_m(parameters)


def predict_angle(record: Record, parameters: FloatArray) -> FloatArray:
    """Return the pendulum's angle at the record's samples, shape (n, m), of parameters of shape (15, m)."""
    return at_samples(record, *simulate(record, parameters))


def simulate(record: Record, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return q and q' at the record's nodes, shape (k, m), of parameters of shape (15, m)."""
    velocity = pivot_velocity(record, parameters)
    q, p = start_of(parameters, velocity)
    return simulate_sway(
        ensemble_of(parameters),
        record.nodes_s,
        velocity,
        angle_rad=q,
        momentum_rad_s=p,
        stiction_rate_rad_s=SMOOTH_RATE_RAD_S,
    )


def at_samples(record: Record, angle_rad: FloatArray, rate_rad_s: FloatArray) -> FloatArray:
    """Return the cubic of q and q' between the nodes, at the samples: shape (k, m) to (n, m)."""
    step = record.nodes_s[1] - record.nodes_s[0]
    place = np.clip((record.time_s - record.nodes_s[0]) / step, 0.0, len(record.nodes_s) - 1)
    k = np.minimum(place.astype(int), len(record.nodes_s) - 2)
    s, q, rate = (place - k)[:, None], angle_rad, rate_rad_s
    start, end = (1 + 2 * s) * q[k] + s * step * rate[k], (3 - 2 * s) * q[k + 1] - (1 - s) * step * rate[k + 1]
    return np.asarray((1 - s) ** 2 * start + s**2 * end)


def predict(record: Record, parameters: FloatArray) -> FloatArray:
    """Return what the camera sees of parameters of shape (15, m): `see` of `predict_angle`."""
    return see(record, parameters, predict_angle(record, parameters))


def see(record: Record, parameters: FloatArray, angle_rad: FloatArray) -> FloatArray:
    """Return what the camera sees of a pendulum's angle.

    Parameters
    ----------
    record : Record
        The samples.
    parameters : ndarray, shape (15, m)
        One set a column.
    angle_rad : ndarray, shape (n, m)
        q at the samples.

    Returns
    -------
    ndarray, shape (3, n, m)
        x and z of PCP minus TCP in m, the tag's angle in rad.

    Notes
    -----
    With s, e the overall and the relative scale, P the pivot and a = r (sin(q + τ), -cos(q + τ)) the arm, tilted by τ:
    PCP minus TCP is offset + (1 + s + e/2) a + e P, z stretched by the vertical scale.
    """
    p = parameters
    seen = angle_rad + p[Unknown.TILT]
    arm = (1 + p[Unknown.SCALE] + p[Unknown.RELATIVE_SCALE] / 2) * tag_radius_m(p)
    drift = record.tool_m[:, :, None] * p[Unknown.RELATIVE_SCALE]
    offset_x, offset_z = _turned_offset(p, record.tool_turn_rad)
    x = offset_x + arm * np.sin(seen) + drift[:, 0]
    z = offset_z - (1 + p[Unknown.VERTICAL_SCALE]) * arm * np.cos(seen) + drift[:, 1]
    return np.stack([x, z, angle_rad + p[Unknown.TAG_ANGLE]])


def _turned_offset(parameters: FloatArray, turn_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return x and z of the pivot from the TCP tag, turned with the tool, shape (n, m) each."""
    x, z = parameters[Unknown.OFFSET_X], parameters[Unknown.OFFSET_Z]
    sine, cosine = np.sin(turn_rad)[:, None], np.cos(turn_rad)[:, None]
    return cosine * x - sine * z, sine * x + cosine * z
