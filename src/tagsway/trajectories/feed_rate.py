"""A shaper over the feed rate of any motion: the path stays, the time along it changes."""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import polynomial

from tagsway.errors import InputError
from tagsway.model import FloatArray, Shaper, Trajectory
from tagsway.trajectories.curves import SMOOTH_RAD, BentCurve, Line, change_of_direction
from tagsway.trajectories.feeds import Feed
from tagsway.trajectories.filtering import apply_filter
from tagsway.trajectories.fitting import fit_pieces, join_pieces
from tagsway.trajectories.pieces import shape_axes
from tagsway.trajectories.tracing import trace_way

STRAIGHT_SHARE = 1e-12
"""Of a piece's velocity: what may point aside on a straight line, by rounding."""

SLOWEST_SHARE = 1e-3
"""Of the fastest: a bend that is passed more slowly has no direction to be shaped along."""

MOST_STEPS = 50
"""Of Newton's method, which takes 4 or 5."""

STILL_M = 1e-15
"""A piece that moves the tool by less is a rest."""

X = np.array([1.0, 0.0, 0.0])

NODES, WEIGHTS = np.polynomial.legendre.leggauss(32)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bend:
    """A curved way, known by its motion.

    Parameters
    ----------
    coefficients : ndarray, shape (n, 3)
        Of the motion's position.
    duration_s, length_m : float
        Of that motion; nowhere in it does the tool stand still.
    """

    coefficients: FloatArray
    duration_s: float
    length_m: float

    def tangent(self, distance_m: float) -> FloatArray:
        """Return the direction after a distance, shape (3,)."""
        direction: FloatArray = self.derivatives(np.array([distance_m]))[1, 0]
        return direction / float(np.linalg.norm(direction))

    def derivatives(self, distance_m: FloatArray) -> FloatArray:
        """Return position and its three derivatives by the distance, shape (4, n, 3)."""
        time = self._time_at(distance_m)
        r, v, a, j = (polynomial.polyval(time, polynomial.polyder(self.coefficients, n)).T for n in range(4))
        _, speed, push, jerk = _distance_derivatives(self.coefficients, time)[..., 0]
        first, second = 1 / speed, -push / speed**3
        third = (3 * push**2 - speed * jerk) / speed**5
        first, second, third = first[:, None], second[:, None], third[:, None]
        return np.stack([r, v * first, a * first**2 + v * second, j * first**3 + 3 * a * first * second + v * third])

    def _time_at(self, distance_m: FloatArray) -> FloatArray:
        """Return the motion's time at each distance, by Newton's method; the speed is never near 0."""
        time: FloatArray = np.asarray(distance_m) / self.length_m * self.duration_s
        for _ in range(MOST_STEPS):
            distance, speed = _distance_derivatives(self.coefficients, time)[:2, :, 0]
            before, time = time, np.clip(time - (distance - distance_m) / speed, 0, self.duration_s)
            if np.max(np.abs(time - before), initial=0.0) <= 1e-14 * self.duration_s:
                break
        return time


def shape_feed_rate(trajectory: Trajectory, shaper: Shaper) -> Trajectory:
    """Shape the feed rate of a motion; its path stays as it is.

    Parameters
    ----------
    trajectory : Trajectory
        From rest to rest along a path without corners, straight where it is slow.
    shaper : Shaper
        Impulses, and perhaps a box and a filter; where the path bends, none that makes the feed rate run backwards.

    Returns
    -------
    Trajectory
        The distance along the path s(t) is shaped, then the path is followed at it: exact on straight lines, within
        1e-10 m on bends.

    Raises
    ------
    InputError
        For a path that turns on the spot, or bends where the tool starts or ends. A path move with such corners is
        planned with its shaper: `plan_path`.
    """
    way: list[Line | BentCurve] = []
    parts = []
    travelled = 0.0
    fastest = float(np.max(np.linalg.norm(trajectory(trajectory.breaks_s, 1), axis=1), initial=0.0))
    for index, piece in enumerate(trajectory.coefficients):
        start, end = trajectory.breaks_s[index : index + 2]
        segment = _segment(piece, float(end - start), fastest)
        if segment is None:
            parts.append((np.array([start, end]), np.array([[[travelled, 0.0, 0.0]]])))
            continue
        parts.append(_distance_pieces(piece, segment, float(start), float(end), travelled))
        travelled += segment.length_m
        _append(way, segment)
    for before, after in itertools.pairwise(way):
        if change_of_direction(before, after) > SMOOTH_RAD:
            raise InputError(
                "shaped_axes ['path'] needs a path without corners, and this one turns where it stops: use the profile "
                "path, ['x'] or ['x', 'z']"
            )
    shaped = shape_axes(join_pieces(parts), shaper)
    if shaper.filter is not None:
        shaped = apply_filter(shaped, shaper.filter, tail_s=shaper.tail_s)
    return trace_way(way, Feed(distance=shaped, ramp_s=shaped.duration_s))


def _append(way: list[Line | BentCurve], segment: Line | Bend) -> None:
    """Lengthen the line that ends here, or begin another segment."""
    last = way[-1] if way else None
    if isinstance(last, Line) and isinstance(segment, Line) and change_of_direction(last, segment) <= SMOOTH_RAD:
        way[-1] = Line(start_m=last.start_m, direction=last.direction, length_m=last.length_m + segment.length_m)
    else:
        way.append(segment)


def _segment(piece: FloatArray, duration_s: float, fastest_m_s: float) -> Line | Bend | None:
    """Return the way of one piece; None where it rests."""
    steps = piece * (duration_s ** np.arange(len(piece)))[:, None]
    if np.max(np.abs(steps[1:]), initial=0.0) <= STILL_M:
        return None
    gone = np.sum(steps[1:], axis=0)
    length = float(np.linalg.norm(gone))
    if length > STILL_M:
        direction = gone / length
        across = steps[1:] - (steps[1:] @ direction)[:, None] * direction
        if np.max(np.abs(across)) <= STRAIGHT_SHARE * max(float(np.max(np.abs(steps[1:]))), 1e-3):
            return Line(start_m=piece[0].copy(), direction=direction, length_m=length)
    time = np.linspace(0, duration_s, 65)
    distance, speed = _distance_derivatives(piece, time)[:2, :, 0]
    if not np.min(speed) > SLOWEST_SHARE * fastest_m_s:
        raise InputError(
            "shaped_axes ['path'] needs a path that is straight where it starts, stops or turns back, and this one "
            "bends there: use ['x'] or ['x', 'z']"
        )
    return Bend(coefficients=piece, duration_s=duration_s, length_m=float(distance[-1]))


def _distance_pieces(
    piece: FloatArray, segment: Line | Bend, start_s: float, end_s: float, travelled_m: float
) -> tuple[FloatArray, FloatArray]:
    """Return the distance along the path as pieces of one axis."""
    if isinstance(segment, Line):
        along = piece @ segment.direction
        along[0] = travelled_m
        return np.array([start_s, end_s]), along[None, :, None] * X
    breaks, coefficients = fit_pieces(lambda t: _distance_derivatives(piece, t - start_s), start_s, end_s)
    coefficients[:, 0] += travelled_m
    return breaks, coefficients * X


def _distance_derivatives(piece: FloatArray, time_s: FloatArray) -> FloatArray:
    """Return the distance gone since the piece began, speed and two more derivatives, shape (4, n, 1)."""
    v, a, j = (polynomial.polyval(time_s, polynomial.polyder(piece, n)).T for n in (1, 2, 3))
    speed = np.linalg.norm(v, axis=1)
    safe = np.maximum(speed, 1e-300)
    push = np.sum(v * a, axis=1) / safe
    jerk = (np.sum(a * a + v * j, axis=1) - push**2) / safe
    within = time_s[:, None] * (1 + NODES) / 2
    rates = np.linalg.norm(polynomial.polyval(within, polynomial.polyder(piece)), axis=0)
    distance = rates @ WEIGHTS * time_s / 2
    return np.stack([distance, speed, push, jerk])[..., None]
