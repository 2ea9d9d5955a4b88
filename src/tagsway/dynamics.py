"""The pendulum's equation of motion, for one pendulum or many at a time.

A body hangs from a pivot at (X, Z), z up; q is its angle from straight down, l its equivalent length, and the product's
tag sits at (X + r sin q, Z - r cos q). With p, a momentum per inertia,

    p  = q' + (X' cos q + Z' sin q) / l
    p' = -(b/J) q' - (k/J) q - (g/l) sin q - d q' |q'| - c sign(q') - q' (X' sin q - Z' cos q) / l

only the pivot's *velocity* is needed: a measured path is differentiated once, and a jump of the acceleration stays
inside a step.
"""

from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from tagsway.model import GRAVITY_M_S2, FloatArray, Pendulum


@dataclass(frozen=True, slots=True, kw_only=True)
class PendulumEnsemble:
    """Parameters of m pendulums side by side, each an array of shape (m,); see `Pendulum`."""

    length_m: FloatArray
    stiffness_over_inertia_rad2_s2: FloatArray
    damping_over_inertia_rad_s: FloatArray
    quadratic_drag_per_rad: FloatArray
    coulomb_friction_rad_s2: FloatArray

    @classmethod
    def of(cls, *pendulums: Pendulum) -> Self:
        """Return the ensemble of these pendulums, in their order."""
        return cls(**{f.name: np.array([getattr(p, f.name) for p in pendulums]) for f in fields(cls)})


def simulate_sway(
    ensemble: PendulumEnsemble,
    time_s: FloatArray,
    pivot_velocity_m_s: FloatArray,
    *,
    angle_rad: FloatArray | float = 0.0,
    momentum_rad_s: FloatArray | float | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Simulate the angle of m pendulums under one pivot, or a pivot each.

    Parameters
    ----------
    ensemble : PendulumEnsemble
        m pendulums.
    time_s : ndarray, shape (n,)
        Nodes; the step is their distance, which may vary. Choose it below 0.1 / ω_n for an error of the angle below
        about 1e-6 of the swing in a period.
    pivot_velocity_m_s : ndarray, shape (2 n - 1, 2) or (2 n - 1, 2, m)
        X' and Z' at the nodes and half-way between them, alternating.
    angle_rad : ndarray, shape (m,), or float
        q at the first node.
    momentum_rad_s : ndarray, shape (m,), or float, optional
        p at the first node; by default that of a pendulum that does not turn (q' = 0).

    Returns
    -------
    angle_rad, rate_rad_s : ndarray, shape (n, m)
        q and q' at the nodes.

    Notes
    -----
    The classical fourth-order Runge-Kutta rule. Dry friction's sign is smoothed over 1e-3 rad/s, below which the
    method's order does not hold.
    """
    velocity = pivot_velocity_m_s if pivot_velocity_m_s.ndim == 3 else pivot_velocity_m_s[:, :, None]
    if len(velocity) != 2 * len(time_s) - 1:
        raise ValueError(f"{len(time_s)} nodes need {2 * len(time_s) - 1} pivot velocities, not {len(velocity)}")
    m = max(len(ensemble.length_m), velocity.shape[2])
    inverse_length = 1 / ensemble.length_m
    gravity = GRAVITY_M_S2 * inverse_length
    stiffness = ensemble.stiffness_over_inertia_rad2_s2
    damping = ensemble.damping_over_inertia_rad_s
    drag = ensemble.quadratic_drag_per_rad
    friction = ensemble.coulomb_friction_rad_s2
    rough = bool(np.any(drag != 0) or np.any(friction != 0))
    push = velocity * inverse_length

    def rate_of(q: FloatArray, p: FloatArray, x: FloatArray, z: FloatArray) -> FloatArray:
        return p - x * np.cos(q) - z * np.sin(q)

    def slopes(q: FloatArray, p: FloatArray, x: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        sine, cosine = np.sin(q), np.cos(q)
        rate = p - x * cosine - z * sine
        slope = -damping * rate - stiffness * q - gravity * sine - rate * (x * sine - z * cosine)
        if rough:
            slope = slope - drag * rate * np.abs(rate) - friction * np.tanh(rate / 1e-3)
        return rate, slope

    q = np.broadcast_to(np.asarray(angle_rad, dtype=float), (m,)).copy()
    if momentum_rad_s is None:
        p = push[0, 0] * np.cos(q) + push[0, 1] * np.sin(q)
    else:
        p = np.broadcast_to(np.asarray(momentum_rad_s, dtype=float), (m,)).copy()
    angles, rates = np.empty((len(time_s), m)), np.empty((len(time_s), m))
    angles[0], rates[0] = q, rate_of(q, p, push[0, 0], push[0, 1])
    for i, step in enumerate(np.diff(time_s)):
        start, middle, end = push[2 * i], push[2 * i + 1], push[2 * i + 2]
        q1, p1 = slopes(q, p, start[0], start[1])
        q2, p2 = slopes(q + step / 2 * q1, p + step / 2 * p1, middle[0], middle[1])
        q3, p3 = slopes(q + step / 2 * q2, p + step / 2 * p2, middle[0], middle[1])
        q4, p4 = slopes(q + step * q3, p + step * p3, end[0], end[1])
        q = q + step / 6 * (q1 + 2 * q2 + 2 * q3 + q4)
        p = p + step / 6 * (p1 + 2 * p2 + 2 * p3 + p4)
        angles[i + 1], rates[i + 1] = q, rate_of(q, p, end[0], end[1])
    return angles, rates
