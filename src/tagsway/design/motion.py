"""What a motion of the tool does to every payload of a spread."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TypeVar

import numpy as np

from tagsway.criteria import find_box_error
from tagsway.design.payload import Payloads
from tagsway.dynamics import LightBody, PendulumEnsemble, simulate_carried, simulate_sway
from tagsway.errors import InputError
from tagsway.model import GRAVITY_M_S2, FloatArray, IntArray, Trajectory

FINE_STEP_S = 1e-3
"""With the steps on the switching times: the sway is then exact to 1e-7 mm."""

TAIL_PERIODS = 0.65
"""The farthest excursion after the end comes in the first half period, which a wide swing lengthens."""

FURTHER_TAIL_PERIODS = 2.0
"""With a further mode the two swings have to come together first."""

STEPS_A_PERIOD = 20
"""Of the fastest mode, at least: its phase is then off by 8e-5 rad in a radian."""

SIDE_S = 1e-9
"""From a switching time to either side of it."""

_Parameters = TypeVar("_Parameters", PendulumEnsemble, LightBody)


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What one motion did to m payloads, arrays of shape (m,).

    Parameters
    ----------
    placement_m : ndarray
        Largest distance of the product from the place point, along the way, from the end of the motion on.
    pcp_acceleration_m_s2 : ndarray
        Largest |x''| of the product.
    swing_rad : ndarray
        Largest |q|.
    box_error_m : ndarray
        Largest distance from the place point, along the way, below the rim of a box 50 mm above it, from the descent
        on (`tagsway.criteria`); NaN where the product never was above the rim.
    """

    placement_m: FloatArray
    pcp_acceleration_m_s2: FloatArray
    swing_rad: FloatArray
    box_error_m: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Swing:
    """What payloads do at the nodes, each of shape (n, m copies).

    Parameters
    ----------
    angle_rad, rate_rad_s : ndarray
        q and q'.
    carried : tuple of (ndarray, ndarray)
        Place and rate of each further body beside the product's tag, in m and m/s.
    """

    angle_rad: FloatArray
    rate_rad_s: FloatArray
    carried: tuple[tuple[FloatArray, FloatArray], ...] = ()

    def take(self, rows: slice | IntArray, columns: slice = slice(None)) -> "Swing":
        """Return the same at some nodes for some payloads."""
        return Swing(
            angle_rad=self.angle_rad[rows, columns],
            rate_rad_s=self.rate_rad_s[rows, columns],
            carried=tuple((y[rows, columns], rate[rows, columns]) for y, rate in self.carried),
        )


def find_way(trajectory: Trajectory) -> FloatArray:
    """Return the horizontal unit vector from start to end, shape (3,)."""
    way = (trajectory(trajectory.duration_s) - trajectory(0.0)) * np.array([1.0, 1.0, 0.0])
    length = float(np.linalg.norm(way))
    if not length > 1e-6:
        raise InputError("a move straight up makes nothing sway: a design needs a way across")
    unit: FloatArray = way / length
    return unit


def simulate_motion(trajectory: Trajectory, payloads: Payloads, *, step_s: float = FINE_STEP_S) -> Outcome:
    """Simulate one motion for all payloads, with the steps on its switching times.

    Parameters
    ----------
    trajectory : Trajectory
        Of the tool, from rest to rest.
    payloads : Payloads
        m of them.
    step_s : float
        Longest step.

    Returns
    -------
    Outcome
        At the nodes and on both sides of every switch, until 0.65 of the longest period after the end: from then on
        the swing only falls.
    """
    step = min(step_s, longest_step_s(payloads))
    edges = np.append(trajectory.breaks_s, trajectory.duration_s + tail_s(payloads))
    time = np.concatenate(
        [
            np.linspace(low, high, max(math.ceil((high - low) / step), 1), endpoint=False)
            for low, high in itertools.pairwise(edges)
        ]
        + [edges[-1:]]
    )
    return simulate_together([trajectory], payloads, time)[0]


def simulate_together(
    trajectories: Sequence[Trajectory], payloads: Payloads, time_s: FloatArray
) -> tuple[Outcome, ...]:
    """Simulate several motions for all payloads on the same nodes, which should reach beyond the end of each.

    Notes
    -----
    The momentum form takes velocities, so that a switch between two nodes costs little: with steps of 4 ms and jumps of
    20 m/s² about 0.002 mm.
    """
    count = len(payloads)
    ways = [find_way(trajectory) for trajectory in trajectories]
    halves = _with_middles(time_s)
    velocity = np.stack(
        [_in_plane(trajectory(halves, 1), way) for trajectory, way in zip(trajectories, ways, strict=True)], axis=-1
    )
    swing = simulate_swing(payloads, time_s, np.repeat(velocity, count, axis=-1))
    outcomes = []
    for index, (trajectory, way) in enumerate(zip(trajectories, ways, strict=True)):
        own = swing.take(slice(None), slice(index * count, (index + 1) * count))
        outcomes.append(_judge(own, trajectory, way, time_s, payloads))
    return tuple(outcomes)


def simulate_swing(payloads: Payloads, time_s: FloatArray, pivot_velocity_m_s: FloatArray) -> Swing:
    """Simulate all payloads, the whole row of them under each of some pivots.

    Parameters
    ----------
    payloads : Payloads
        m of them.
    time_s : ndarray, shape (n,)
        Nodes.
    pivot_velocity_m_s : ndarray, shape (2 n - 1, 2, m copies)
        As `simulate_sway` takes it, along the way and up.
    """
    copies = pivot_velocity_m_s.shape[2] // len(payloads)
    q, rate = simulate_sway(_tile(payloads.ensemble, copies), time_s, pivot_velocity_m_s)
    carried = tuple(
        simulate_carried(_tile(body, copies), time_s, pivot_velocity_m_s[:, 0], q, rate) for body in payloads.further
    )
    return Swing(angle_rad=q, rate_rad_s=rate, carried=carried)


def product_sway(swing: Swing, payloads: Payloads, *, copies: int = 1) -> FloatArray:
    """Return how far the product is off its pivot along the way: r sin q, and what each further body adds."""
    sway: FloatArray = np.tile(payloads.tag_radius_m, copies) * np.sin(swing.angle_rad)
    for y, _ in swing.carried:
        sway += y
    return sway


def product_acceleration(swing: Swing, pivot_m_s2: FloatArray, payloads: Payloads, *, copies: int = 1) -> FloatArray:
    """Return x'' of the product.

    Parameters
    ----------
    swing : Swing
        Of each payload, the whole row of payloads repeated, at n nodes.
    pivot_m_s2 : ndarray, shape (n, 2) or (..., n, 2, m copies or 1)
        X'' and Z''.
    payloads : Payloads
        m of them.
    copies : int
        How often they stand side by side.

    Returns
    -------
    ndarray, shape (..., n, m copies)
        X'' + r (q'' cos q - q'² sin q), with q'' from the equation of motion, and y'' of each further body.
    """
    ensemble = _tile(payloads.ensemble, copies)
    radius = np.tile(payloads.tag_radius_m, copies)
    q, rate = swing.angle_rad, swing.rate_rad_s
    push = pivot_m_s2[:, :, None] if pivot_m_s2.ndim == 2 else pivot_m_s2
    x, z = push[..., 0, :], push[..., 1, :]
    sine, cosine = np.sin(q), np.cos(q)
    turn = -(
        ensemble.damping_over_inertia_rad_s * rate
        + ensemble.stiffness_over_inertia_rad2_s2 * q
        + ((GRAVITY_M_S2 + z) * sine + x * cosine) / ensemble.length_m
    )
    carrier: FloatArray = x + radius * (turn * cosine - rate**2 * sine)
    product = carrier.copy()
    for body, (y, speed) in zip((_tile(each, copies) for each in payloads.further), swing.carried, strict=True):
        omega = body.angular_frequency_rad_s
        product -= 2 * body.damping_ratio * omega * speed + omega**2 * y + body.gain * carrier
    return product


def tail_s(payloads: Payloads) -> float:
    """Return how long payloads are watched after a move, in s."""
    return (FURTHER_TAIL_PERIODS if payloads.further else TAIL_PERIODS) * payloads.longest_period_s


def longest_step_s(payloads: Payloads) -> float:
    """Return a 20th of the shortest period, in s."""
    return 1 / (STEPS_A_PERIOD * payloads.fastest_hz)


def _judge(swing: Swing, trajectory: Trajectory, way: FloatArray, time_s: FloatArray, payloads: Payloads) -> Outcome:
    peak = _peak_acceleration(swing, trajectory, way, time_s + SIDE_S, payloads)
    # On both sides of a switch; everywhere else they are one.
    before, after = (np.searchsorted(trajectory.breaks_s, time_s + side) for side in (-SIDE_S, SIDE_S))
    switches = np.flatnonzero(before != after)
    if len(switches):
        own = swing.take(switches)
        peak = np.maximum(peak, _peak_acceleration(own, trajectory, way, time_s[switches] - SIDE_S, payloads))
    sway = product_sway(swing, payloads)
    left = (_in_plane(trajectory(time_s), way) - _in_plane(trajectory(trajectory.duration_s)[None], way))[..., None]
    lifted = payloads.tag_radius_m * (1 - np.cos(swing.angle_rad))
    return Outcome(
        placement_m=np.abs(sway[time_s >= trajectory.duration_s]).max(axis=0),
        pcp_acceleration_m_s2=peak,
        swing_rad=np.abs(swing.angle_rad).max(axis=0),
        box_error_m=find_box_error(left[:, 1], left[:, 1] + lifted, np.abs(left[:, 0] + sway)),
    )


def _peak_acceleration(
    swing: Swing, trajectory: Trajectory, way: FloatArray, time_s: FloatArray, payloads: Payloads
) -> FloatArray:
    pivot = _in_plane(trajectory(time_s, 2), way)
    peak: FloatArray = np.abs(product_acceleration(swing, pivot, payloads)).max(axis=0)
    return peak


def _with_middles(time_s: FloatArray) -> FloatArray:
    halves = np.empty(2 * len(time_s) - 1)
    halves[::2] = time_s
    halves[1::2] = (time_s[1:] + time_s[:-1]) / 2
    return halves


def _in_plane(vectors: FloatArray, way: FloatArray) -> FloatArray:
    """Return the components along the way and up, shape (n, 2)."""
    return np.stack([vectors @ way, vectors[:, 2]], axis=1)


def _tile(parameters: _Parameters, copies: int) -> _Parameters:
    if copies == 1:
        return parameters
    return type(parameters)(**{f.name: np.tile(getattr(parameters, f.name), copies) for f in fields(parameters)})
