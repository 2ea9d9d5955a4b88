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


def predict_angle(record: Record, parameters: FloatArray, velocity_m_s: FloatArray) -> FloatArray:
    """Return the pendulum's angle at the record's samples.

    Parameters
    ----------
    record : Record
        Gives the nodes and the samples' times.
    parameters : ndarray, shape (15, m)
        One set a column.
    velocity_m_s : ndarray, shape (2 k - 1, 2) or (2 k - 1, 2, m)
        The TCP's, as the camera saw it.

    Returns
    -------
    ndarray, shape (n, m)
        Simulated from node to node, between them the cubic of q and q'.
    """
    p = parameters
    velocity = velocity_m_s if velocity_m_s.ndim == 3 else velocity_m_s[:, :, None]
    if np.any(record.turn_rate_rad_s):
        across, up = _turned_offset(p, record.turn_at_rad)
        swirl = record.turn_rate_rad_s[:, None]
        velocity = velocity + np.stack([-swirl * up, swirl * across], axis=1)
    sine, cosine = np.sin(p[Unknown.TILT]), np.cos(p[Unknown.TILT])
    scale = 1 + p[Unknown.SCALE] - p[Unknown.RELATIVE_SCALE] / 2
    x, z = velocity[:, 0] / scale, velocity[:, 1] / (scale * (1 + p[Unknown.VERTICAL_SCALE]))
    true_velocity = np.stack([cosine * x + sine * z, cosine * z - sine * x], axis=1)
    columns = (true_velocity.shape[2],)
    length = np.broadcast_to(length_m(p), columns)
    angle = p[Unknown.ANGLE]
    push = (true_velocity[0, 0] * np.cos(angle) + true_velocity[0, 1] * np.sin(angle)) / length
    q, rate = simulate_sway(
        PendulumEnsemble(
            length_m=length,
            stiffness_over_inertia_rad2_s2=stiffness_over_inertia(p),
            damping_over_inertia_rad_s=damping_over_inertia(p),
            quadratic_drag_per_rad=p[Unknown.DRAG],
            coulomb_friction_rad_s2=np.broadcast_to(coulomb_friction(p), columns),
        ),
        record.nodes_s,
        true_velocity,
        angle_rad=angle,
        momentum_rad_s=p[Unknown.RATE] + push,
        stiction_rate_rad_s=SMOOTH_RATE_RAD_S,
    )
    step = record.nodes_s[1] - record.nodes_s[0]
    place = np.clip((record.time_s - record.nodes_s[0]) / step, 0.0, len(record.nodes_s) - 1)
    k = np.minimum(place.astype(int), len(record.nodes_s) - 2)
    s = (place - k)[:, None]
    start, end = (1 + 2 * s) * q[k] + s * step * rate[k], (3 - 2 * s) * q[k + 1] - (1 - s) * step * rate[k + 1]
    return np.asarray((1 - s) ** 2 * start + s**2 * end)


def predict(record: Record, parameters: FloatArray, velocity_m_s: FloatArray | None = None) -> FloatArray:
    """Return what the camera sees: x and z of the sway and the tag's angle, shape (3, n, m).

    Parameters
    ----------
    record : Record
        The samples and the pivot's motion.
    parameters : ndarray, shape (15, m)
        One set a column.
    velocity_m_s : ndarray, shape (2 k - 1, 2, m), optional
        Another velocity of the TCP than the record's.

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
    q = predict_angle(record, p, record.velocity_m_s if velocity_m_s is None else velocity_m_s)
    seen = q + p[Unknown.TILT]
    arm = (1 + p[Unknown.SCALE] + p[Unknown.RELATIVE_SCALE] / 2) * tag_radius_m(p)
    drift = record.tool_m[:, :, None] * p[Unknown.RELATIVE_SCALE]
    offset_x, offset_z = _turned_offset(p, record.tool_turn_rad)
    x = offset_x + arm * np.sin(seen) + drift[:, 0]
    z = offset_z - (1 + p[Unknown.VERTICAL_SCALE]) * arm * np.cos(seen) + drift[:, 1]
    return np.stack([x, z, q + p[Unknown.TAG_ANGLE]])


def _turned_offset(parameters: FloatArray, turn_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return x and z of the pivot from the TCP tag, turned with the tool, shape (n, m) each."""
    x, z = parameters[Unknown.OFFSET_X], parameters[Unknown.OFFSET_Z]
    sine, cosine = np.sin(turn_rad)[:, None], np.cos(turn_rad)[:, None]
    return cosine * x - sine * z, sine * x + cosine * z
