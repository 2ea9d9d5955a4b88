"""The pendulum's equation of motion, for one pendulum or many at a time.

A body hangs from a pivot at (X, Z), z up; q is its angle from straight down, l its equivalent length, and the product's
tag sits at (X + r sin q, Z - r cos q). With p, a momentum per inertia,

    p  = q' + (X' cos q + Z' sin q) / l
    p' = -(b/J) q' - (k/J) q - (g/l) sin q - d q' |q'| - c sign(q') - q' (X' sin q - Z' cos q) / l

only the pivot's *velocity* is needed: a measured path is differentiated once, and a jump of the acceleration stays
inside a step (`simulate_sway`). Of a planned move the acceleration is known piece by piece, and gravity and the pivot
together are one pull of size H = |(X'', g + Z'')| that leans by φ = atan2(X'', g + Z''),

    q'' = -(b/J) q' - (k/J) q - d q' |q'| - c sign(q') - (H/l) sin(q + φ)

which takes one sine a stage (`simulate_planned`).
"""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from tagsway.marching import load_march, load_march_carried, load_step_each
from tagsway.model import GRAVITY_M_S2, FloatArray, Pendulum

STICTION_RATE_RAD_S = 1e-3
"""Below this rate dry friction's sign is smoothed: 0.05 mm/s at the payload, less than a camera sees."""


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


@dataclass(frozen=True, slots=True, kw_only=True)
class LightBody:
    """A second body so light that the pendulum does not feel it; each an array of shape (m,).

    Its way y beside the point of the pendulum that carries it, at R from the pivot, obeys
    y'' + 2 ζ ω_n y' + ω_n² y = -gain (X + R sin q)'', or, with the momentum p = y' + gain (X + R sin q)',
    p' = -2 ζ ω_n y' - ω_n² y.

    Parameters
    ----------
    carried_at_m : ndarray
        R.
    angular_frequency_rad_s, damping_ratio : ndarray
        ω_n and ζ of its own.
    gain : ndarray
        1 for a point that hangs there, less for a body whose tag moves less than its centre of percussion.
    """

    carried_at_m: FloatArray
    angular_frequency_rad_s: FloatArray
    damping_ratio: FloatArray
    gain: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedSway:
    """What m pendulums do under c planned moves, each shape (n, c, m); all of y is 0 without a light body."""

    angle_rad: FloatArray
    rate_rad_s: FloatArray
    acceleration_rad_s2: FloatArray
    second_m: FloatArray
    second_m_s: FloatArray
    second_m_s2: FloatArray


def simulate_sway(
    ensemble: PendulumEnsemble,
    time_s: FloatArray,
    pivot_velocity_m_s: FloatArray,
    *,
    angle_rad: FloatArray | float = 0.0,
    momentum_rad_s: FloatArray | float | None = None,
    stiction_rate_rad_s: float = STICTION_RATE_RAD_S,
) -> tuple[FloatArray, FloatArray]:
    """Simulate the angle of m pendulums under one pivot, or a pivot each.

    Parameters
    ----------
    ensemble : PendulumEnsemble
        m pendulums.
    time_s : ndarray, shape (n,)
        Nodes; the step is their distance, which may vary. At h = 0.1 / ω_n the phase is off by about
        5e-6 rad in a period, (ω_n h)⁴ / 120 in a radian.
    pivot_velocity_m_s : ndarray, shape (2 n - 1, 2) or (2 n - 1, 2, m)
        X' and Z' at the nodes and half-way between them, alternating.
    angle_rad : ndarray, shape (m,), or float
        q at the first node.
    momentum_rad_s : ndarray, shape (m,), or float, optional
        p at the first node; by default that of a pendulum that does not turn (q' = 0).
    stiction_rate_rad_s : float
        Rate over which dry friction's sign is smoothed: a fit by slopes wants it wider than a simulation.

    Returns
    -------
    angle_rad, rate_rad_s : ndarray, shape (n, m)
        q and q' at the nodes.

    Notes
    -----
    The classical fourth-order Runge-Kutta rule; a jump of the pivot's acceleration keeps its order where it falls on a
    node. Dry friction's sign is smoothed: where it reverses, the order does not hold, and neither does
    the standstill that real stiction ends in.
    """
    velocity = np.asarray(pivot_velocity_m_s, dtype=float)
    velocity = velocity if velocity.ndim == 3 else velocity[:, :, None]
    if len(velocity) != 2 * len(time_s) - 1:
        raise ValueError(f"{len(time_s)} nodes need {2 * len(time_s) - 1} pivot velocities, not {len(velocity)}")
    m = max(len(ensemble.length_m), velocity.shape[2])
    q = np.broadcast_to(np.asarray(angle_rad, dtype=float), (m,))
    p = _momentum(ensemble, velocity[0], q) if momentum_rad_s is None else np.asarray(momentum_rad_s, dtype=float)
    start = np.stack([q, np.broadcast_to(p, (m,))])
    angles, momenta = load_march()(
        start, velocity, np.diff(time_s).astype(float), _constants(ensemble), stiction_rate_rad_s
    )
    return angles, momenta - _momentum(ensemble, velocity[::2].swapaxes(0, 1), angles)


def simulate_carried(
    body: LightBody,
    time_s: FloatArray,
    pivot_velocity_m_s: FloatArray,
    angle_rad: FloatArray,
    rate_rad_s: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Simulate a light second body on m pendulums whose sway is known, hanging at rest at the first node.

    Parameters
    ----------
    body : LightBody
        m of them.
    time_s : ndarray, shape (n,)
        Nodes, rising.
    pivot_velocity_m_s : ndarray, shape (2 n - 1, 1) or (2 n - 1, m)
        X' at the nodes and half-way between them, alternating.
    angle_rad, rate_rad_s : ndarray, shape (n, m)
        q and q' at the nodes, of `simulate_sway`.

    Returns
    -------
    place_m, rate_m_s : ndarray, shape (n, m)
        y and y' at the nodes.

    Notes
    -----
    The momentum form needs the pivot's velocity alone, as `simulate_sway` does. Half-way between the nodes q is that of
    the cubic through both ends, which keeps the fourth order.
    """
    step = np.diff(time_s)
    span = step[:, None]
    q, turn = angle_rad, rate_rad_s
    middle = (q[1:] + q[:-1]) / 2 + span / 8 * (turn[:-1] - turn[1:])
    middle_turn = 1.5 * (q[1:] - q[:-1]) / span - (turn[1:] + turn[:-1]) / 4
    push = np.repeat(pivot_velocity_m_s, q.shape[1] // pivot_velocity_m_s.shape[1], axis=1)
    push[::2] += body.carried_at_m * turn * np.cos(q)
    push[1::2] += body.carried_at_m * middle_turn * np.cos(middle)
    push *= body.gain
    square = body.angular_frequency_rad_s**2
    damping = 2 * body.damping_ratio * body.angular_frequency_rad_s
    places, momenta = load_march_carried()(push, step, square, damping)
    return places, momenta - push[::2]


def step_sway(
    ensemble: PendulumEnsemble,
    step_s: float,
    pivot_velocity_m_s: FloatArray,
    *,
    angle_rad: FloatArray,
    momentum_rad_s: FloatArray,
    stiction_rate_rad_s: float = STICTION_RATE_RAD_S,
) -> tuple[FloatArray, FloatArray]:
    """Take one step of `simulate_sway` from each of n states of m pendulums, side by side.

    Parameters
    ----------
    ensemble : PendulumEnsemble
        m pendulums.
    step_s : float
        The step.
    pivot_velocity_m_s : ndarray, shape (3, 2, n, m)
        X' and Z' at the start, in the middle and at the end of each step.
    angle_rad, momentum_rad_s : ndarray, shape (n, m)
        q and p (not q') at the start of each.
    stiction_rate_rad_s : float
        As there.

    Returns
    -------
    angle_rad, momentum_rad_s : ndarray, shape (n, m)
        At the end of each.
    """
    states = np.stack([angle_rad, momentum_rad_s])
    q, p = load_step_each()(states, pivot_velocity_m_s, step_s, _constants(ensemble), stiction_rate_rad_s)
    return q, p


def simulate_planned(
    ensemble: PendulumEnsemble,
    time_s: FloatArray,
    pivot_m_s2: FloatArray,
    *,
    second: LightBody | None = None,
) -> PlannedSway:
    """Simulate m pendulums, hanging at rest, under each of c planned moves.

    Parameters
    ----------
    ensemble : PendulumEnsemble
        m pendulums.
    time_s : ndarray, shape (n, c)
        Nodes of each move. Where the acceleration jumps a node stands twice, once for either side.
    pivot_m_s2 : ndarray, shape (n - 1, 3, 2, c)
        X'' and Z'' at the start, in the middle and at the end of each step, from within the step.
    second : LightBody, optional
        Driven by the first body, without acting back on it.

    Returns
    -------
    PlannedSway
        At the nodes.

    Notes
    -----
    The classical fourth-order Runge-Kutta rule. Not for a measured path, whose acceleration is mostly noise: use
    `simulate_sway`.
    """
    accelerate = _accelerate_of(ensemble) if second is None else _accelerate_both(ensemble, second)
    rest = np.zeros((1 if second is None else 2, time_s.shape[1], len(ensemble.length_m)))
    places, rates, bends = _march_planned(accelerate, rest, time_s, pivot_m_s2)
    none = np.broadcast_to(0.0, places[:, 0].shape)
    return PlannedSway(
        angle_rad=places[:, 0],
        rate_rad_s=rates[:, 0],
        acceleration_rad_s2=bends[:, 0],
        second_m=none if second is None else places[:, 1],
        second_m_s=none if second is None else rates[:, 1],
        second_m_s2=none if second is None else bends[:, 1],
    )


_Accelerate = Callable[[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray], FloatArray]


def _march_planned(
    accelerate: _Accelerate, rest: FloatArray, time_s: FloatArray, pivot_m_s2: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return places, rates and accelerations at the nodes, from rest, each of shape (n, bodies, c, m)."""
    lifted = pivot_m_s2[:, :, 1] + GRAVITY_M_S2
    pull, lean = np.hypot(pivot_m_s2[:, :, 0], lifted), np.arctan2(pivot_m_s2[:, :, 0], lifted)
    push = pivot_m_s2[:, :, 0]
    place, rate = rest, rest
    places, rates, bends = np.empty((3, len(time_s), *rest.shape))
    steps = np.diff(time_s, axis=0)[:, :, None]
    for i, h in enumerate(steps if time_s.shape[1] > 1 else steps[:, 0, 0].tolist()):
        start, middle, end = ((pull[i, j, :, None], lean[i, j, :, None], push[i, j, :, None]) for j in range(3))
        half = h / 2
        bend1 = accelerate(place, rate, *start)
        places[i], rates[i], bends[i] = place, rate, bend1
        midway = place + half * rate
        rate2 = rate + half * bend1
        bend2 = accelerate(midway, rate2, *middle)
        rate3 = rate + half * bend2
        bend3 = accelerate(midway + (half * half) * bend1, rate3, *middle)
        bend4 = accelerate(place + h * rate3, rate + h * bend3, *end)
        place = place + h * (rate + (h / 6) * (bend1 + bend2 + bend3))
        rate = rate + (h / 6) * (bend1 + 2 * (bend2 + bend3) + bend4)
    last = (pull[-1, 2, :, None], lean[-1, 2, :, None], push[-1, 2, :, None])
    places[-1], rates[-1], bends[-1] = place, rate, accelerate(place, rate, *last)
    return places, rates, bends


def _accelerate_of(ensemble: PendulumEnsemble) -> _Accelerate:
    """Return q'' as a function of q, q', the pull H, its lean φ and X''."""
    per_length = 1 / ensemble.length_m
    stiffness, damping = ensemble.stiffness_over_inertia_rad2_s2, ensemble.damping_over_inertia_rad_s
    drag, friction = ensemble.quadratic_drag_per_rad, ensemble.coulomb_friction_rad_s2
    dragged, rubbed = bool(np.any(drag != 0)), bool(np.any(friction != 0))

    def accelerate(q: FloatArray, rate: FloatArray, pull: FloatArray, lean: FloatArray, push: FloatArray) -> FloatArray:
        force = q + lean
        np.sin(force, out=force)
        force *= pull * per_length
        force += stiffness * q
        force += damping * rate
        if dragged:
            force += drag * rate * np.abs(rate)
        if rubbed:
            force += friction * np.tanh(rate / STICTION_RATE_RAD_S)
        return np.negative(force, out=force)

    return accelerate


def _accelerate_both(ensemble: PendulumEnsemble, second: LightBody) -> _Accelerate:
    """Return (q'', y'') as a function of (q, y), (q', y') and the same three."""
    alone = _accelerate_of(ensemble)
    square = second.angular_frequency_rad_s**2
    damping = 2 * second.damping_ratio * second.angular_frequency_rad_s

    def accelerate(
        place: FloatArray, rate: FloatArray, pull: FloatArray, lean: FloatArray, push: FloatArray
    ) -> FloatArray:
        bend = np.empty_like(place)
        q, turn = place[0], rate[0]
        bend[0] = alone(q, turn, pull, lean, push)
        carrier = push + second.carried_at_m * (bend[0] * np.cos(q) - turn**2 * np.sin(q))
        bend[1] = -damping * rate[1] - square * place[1] - second.gain * carrier
        return bend

    return accelerate


def _constants(ensemble: PendulumEnsemble) -> FloatArray:
    """Return what `tagsway.marching` takes."""
    return np.stack(
        [
            ensemble.length_m,
            GRAVITY_M_S2 / ensemble.length_m,
            ensemble.stiffness_over_inertia_rad2_s2,
            ensemble.damping_over_inertia_rad_s,
            ensemble.quadratic_drag_per_rad,
            ensemble.coulomb_friction_rad_s2,
        ]
    )


def _momentum(ensemble: PendulumEnsemble, velocity: FloatArray, q: FloatArray) -> FloatArray:
    """Return the pivot's part of p, p - q', from its velocity, shape (2, ...)."""
    return np.asarray((velocity[0] * np.cos(q) + velocity[1] * np.sin(q)) / ensemble.length_m)
