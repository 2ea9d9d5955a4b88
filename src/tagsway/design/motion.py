"""What a motion of the tool does to every payload of a spread."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tagsway.design.payload import Payloads
from tagsway.dynamics import PendulumEnsemble, simulate_sway
from tagsway.errors import InputError
from tagsway.model import GRAVITY_M_S2, BoolArray, FloatArray, Trajectory

FINE_STEP_S = 1e-3
"""With the steps on the switching times: the sway is then exact to 1e-7 mm."""

TAIL_PERIODS = 0.65
"""The farthest excursion after the end comes in the first half period, which a wide swing lengthens."""

SIDE_S = 1e-9
"""From a switching time to either side of it."""


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
    """

    placement_m: FloatArray
    pcp_acceleration_m_s2: FloatArray
    swing_rad: FloatArray


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
    end = trajectory.duration_s
    edges = np.append(trajectory.breaks_s, end + TAIL_PERIODS * payloads.longest_period_s)
    time = np.concatenate(
        [
            np.linspace(low, high, max(math.ceil((high - low) / step_s), 1), endpoint=False)
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
    ensemble = _tile(payloads.ensemble, len(trajectories))
    q, rate = simulate_sway(ensemble, time_s, np.repeat(velocity, count, axis=-1))
    outcomes = []
    for index, (trajectory, way) in enumerate(zip(trajectories, ways, strict=True)):
        columns = slice(index * count, (index + 1) * count)
        sides = [_in_plane(trajectory(time_s + side, 2), way) for side in (-SIDE_S, SIDE_S)]
        outcomes.append(_judge(q[:, columns], rate[:, columns], time_s >= trajectory.duration_s, sides, payloads))
    return tuple(outcomes)


def product_acceleration(
    q: FloatArray, rate: FloatArray, pivot_m_s2: FloatArray, payloads: Payloads, *, copies: int = 1
) -> FloatArray:
    """Return x'' of the product.

    Parameters
    ----------
    q, rate : ndarray, shape (n, m copies)
        Of each payload, the whole row of payloads repeated.
    pivot_m_s2 : ndarray, shape (n, 2) or (n, 2, m copies)
        X'' and Z''.
    payloads : Payloads
        m of them.
    copies : int
        How often they stand side by side.

    Returns
    -------
    ndarray, shape (n, m copies)
        X'' + r (q'' cos q - q'² sin q), with q'' from the equation of motion.
    """
    ensemble = _tile(payloads.ensemble, copies)
    radius = np.tile(payloads.tag_radius_m, copies)
    push = pivot_m_s2 if pivot_m_s2.ndim == 3 else pivot_m_s2[:, :, None]
    x, z = push[:, 0], push[:, 1]
    sine, cosine = np.sin(q), np.cos(q)
    turn = -(
        ensemble.damping_over_inertia_rad_s * rate
        + ensemble.stiffness_over_inertia_rad2_s2 * q
        + ((GRAVITY_M_S2 + z) * sine + x * cosine) / ensemble.length_m
    )
    acceleration: FloatArray = x + radius * (turn * cosine - rate**2 * sine)
    return acceleration


def _judge(q: FloatArray, rate: FloatArray, after: BoolArray, sides: list[FloatArray], payloads: Payloads) -> Outcome:
    peaks = [np.abs(product_acceleration(q, rate, side, payloads)).max(axis=0) for side in sides]
    return Outcome(
        placement_m=np.abs(payloads.tag_radius_m * np.sin(q[after])).max(axis=0),
        pcp_acceleration_m_s2=np.maximum(*peaks),
        swing_rad=np.abs(q).max(axis=0),
    )


def _with_middles(time_s: FloatArray) -> FloatArray:
    halves = np.empty(2 * len(time_s) - 1)
    halves[::2] = time_s
    halves[1::2] = (time_s[1:] + time_s[:-1]) / 2
    return halves


def _in_plane(vectors: FloatArray, way: FloatArray) -> FloatArray:
    """Return the components along the way and up, shape (n, 2)."""
    return np.stack([vectors @ way, vectors[:, 2]], axis=1)


def _tile(ensemble: PendulumEnsemble, copies: int) -> PendulumEnsemble:
    if copies == 1:
        return ensemble
    names = PendulumEnsemble.__slots__
    return PendulumEnsemble(**{name: np.tile(getattr(ensemble, name), copies) for name in names})
