"""A planned move as a pendulum feels it: its pivot's motion in one plane, on steps that end where the move switches."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, Trajectory

OUT_OF_PLANE_M = 1e-6
"""A move that strays less stays in its plane."""

MOST_NODES = 400_000
"""Of one move: more is a mistyped step."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """How the pivot moves, for c moves at once.

    Parameters
    ----------
    time_s : ndarray, shape (n, c)
        Nodes. Where the acceleration may jump a node stands twice, once for either side; a move with fewer nodes than
        the others repeats its last.
    position_m, velocity_m_s, acceleration_m_s2 : ndarray, shape (n, 2, c)
        Along the plane's horizontal (the sense of the travel is positive) and upwards.
    step_m_s2 : ndarray, shape (n - 1, 3, 2, c)
        Acceleration at the start, in the middle and at the end of each step, from within it.
    end_s : ndarray, shape (c,)
        When each move is at rest.
    """

    time_s: FloatArray
    position_m: FloatArray
    velocity_m_s: FloatArray
    acceleration_m_s2: FloatArray
    step_m_s2: FloatArray
    end_s: FloatArray


def plan_drive(trajectories: Sequence[Trajectory], *, step_s: float, rest_s: float) -> Drive:
    """Lay out the steps of a simulation over planned moves.

    Parameters
    ----------
    trajectories : sequence of Trajectory
        c moves, each in one upright plane (its own).
    step_s : float
        The longest step; each polynomial piece is cut into equal ones, so that no step spans a switch.
    rest_s : float
        How long the pivot rests after each move.

    Returns
    -------
    Drive
        Of all of them.

    Raises
    ------
    InputError
        For a move that leaves its plane (around a corner seen from above): the pendulum sways in a plane.
    """
    if not (step_s > 0 and rest_s >= 0):
        raise InputError(
            f"a step of {step_s:g} s and a rest of {rest_s:g} s: expected a step above 0 and a rest from 0"
        )
    total = max((t.duration_s for t in trajectories), default=0.0) + rest_s
    if not total / step_s < MOST_NODES:
        raise InputError(
            f"{total:g} s in steps of {step_s:g} s are more than {MOST_NODES} steps: expected longer steps"
        )
    singles = [_lay_out(trajectory, step_s, rest_s) for trajectory in trajectories]
    n = max(len(time) for time, _, _ in singles)
    time, motion, inside = (np.stack([_lengthen(each[i], n - (i == 2)) for each in singles], axis=-1) for i in range(3))
    return Drive(
        time_s=time,
        position_m=motion[:, 0],
        velocity_m_s=motion[:, 1],
        acceleration_m_s2=motion[:, 2],
        step_m_s2=inside,
        end_s=np.array([t.duration_s for t in trajectories]),
    )


def _lay_out(trajectory: Trajectory, step_s: float, rest_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the nodes (n,), the motion (n, 3 orders, 2) and the accelerations in the steps (n - 1, 3, 2)."""
    plane = _in_plane(trajectory)
    lengths = np.append(np.diff(trajectory.breaks_s), rest_s)
    rest = np.zeros((1, *plane.shape[1:]))
    # The end as the polynomial reaches it, so that the rest begins where the move ends.
    rest[0, 0] = _evaluate(plane[-1:], lengths[-2:-1], 0)[0]
    pieces = np.concatenate([plane, rest])
    counts = np.maximum(np.ceil(lengths / step_s - 1e-9), 1).astype(int)
    # Each piece has its own first and last node: the node between two pieces stands twice.
    piece = np.repeat(np.arange(len(counts)), counts + 1)
    first = np.cumsum(counts + 1) - (counts + 1)
    share = (np.arange(len(piece)) - first[piece]) / counts[piece]
    offset = share * lengths[piece]
    motion = np.stack([_evaluate(pieces[piece], offset, order) for order in range(3)], axis=1)
    middle = _evaluate(pieces[piece], offset + lengths[piece] / (2 * counts[piece]), 2)
    time = trajectory.breaks_s[piece] + offset
    ends = share >= 1  # the step from a piece's last node to the next one's first takes no time
    middle[ends], after = motion[ends, 2], np.concatenate([motion[1:, 2], motion[-1:, 2]])
    after[ends] = motion[ends, 2]
    inside = np.stack([motion[:, 2], middle, after], axis=1)[:-1]
    return time, motion, inside


def _in_plane(trajectory: Trajectory) -> FloatArray:
    """Return the coefficients along the horizontal of the move's plane and upwards, shape (k, order, 2)."""
    time = np.union1d(np.linspace(0, trajectory.duration_s, 200), trajectory.breaks_s)
    level = trajectory(time)[:, :2]
    way = level - level[0]
    along = np.linalg.svd(way, full_matrices=False)[2][0]
    travel = float(way[-1] @ along)
    # Towards the place; a move back to where it began, or straight up, takes the axis' own sense.
    sense = travel if abs(travel) > OUT_OF_PLANE_M else float(along[np.argmax(np.abs(along))])
    along = along if sense > 0 else -along
    strays = float(np.max(np.abs(way @ np.array([-along[1], along[0]]))))
    if not strays <= OUT_OF_PLANE_M:
        raise InputError(
            f"the move leaves its upright plane by {1e3 * strays:.3g} mm: a simulated pendulum sways in one plane; "
            "give a move that is straight from above"
        )
    return np.stack([trajectory.coefficients[..., :2] @ along, trajectory.coefficients[..., 2]], axis=-1)


def _evaluate(coefficients: FloatArray, offset_s: FloatArray, order: int) -> FloatArray:
    """Return a derivative of each piece's polynomial at its own offset; coefficients (n, terms, 2)."""
    value = np.zeros((len(offset_s), 2))
    for power in range(coefficients.shape[1] - 1, order - 1, -1):
        factor = float(np.prod(np.arange(power - order + 1, power + 1), initial=1.0))
        value = value * offset_s[:, None] + factor * coefficients[:, power]
    return value


def _lengthen(values: FloatArray, n: int) -> FloatArray:
    """Return the values with the last one repeated up to n."""
    return np.concatenate([values, np.repeat(values[-1:], n - len(values), axis=0)])
