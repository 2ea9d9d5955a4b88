"""A feed laid along lines and arcs."""

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.polynomial import polynomial
from scipy.optimize import brentq

from tagsway.errors import InputError
from tagsway.model import FloatArray, Trajectory
from tagsway.trajectories.curves import BentCurve, Line
from tagsway.trajectories.feeds import Feed, lay_along
from tagsway.trajectories.fitting import fit_pieces, join_pieces
from tagsway.trajectories.limits import find_extremes
from tagsway.trajectories.pieces import cut, slopes, unite_breaks

BACKWARDS_SHARE = 1e-9
"""Of the greatest speed: what a feed may run backwards by rounding."""


def trace_way(way: Sequence[Line | BentCurve], feed: Feed) -> Trajectory:
    """Return the motion of a feed along segments that run into one another.

    Parameters
    ----------
    way : sequence of Line or BentCurve
        Without corners.
    feed : Feed
        As long as they are together.

    Returns
    -------
    Trajectory
        Exact on lines; on arcs of degree 7 and within 1e-10 m of the circle at the right time.

    Raises
    ------
    InputError
        For a feed that runs backwards (a shaper with negative impulses) on more than one straight line.
    """
    if len(way) == 1 and isinstance(way[0], Line):
        return lay_along(feed, way[0].start_m, way[0].direction)
    _refuse_backwards(feed.distance)
    limits = [0.0, *itertools.accumulate(segment.length_m for segment in way)]
    crossings = [_time_at(feed.distance, distance) for distance in limits[1:-1]]
    breaks = unite_breaks(feed.distance.breaks_s, np.array(crossings))
    pieces = cut(feed.distance, breaks)[..., 0]
    middle = [float(feed.distance(time)[0]) for time in (breaks[:-1] + breaks[1:]) / 2]
    parts = []
    for index, distance in enumerate(middle):
        number = min(int(np.searchsorted(limits, distance, side="right")) - 1, len(way) - 1)
        begun = pieces[index].copy()
        begun[0] -= limits[number]
        parts.append(_lay(way[number], begun, float(breaks[index]), float(breaks[index + 1])))
    return join_pieces(parts)


def _lay(
    segment: Line | BentCurve, distance: FloatArray, start_s: float, end_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return breaks and coefficients of one piece of a feed on one segment."""
    if isinstance(segment, Line):
        coefficients = distance[:, None] * segment.direction
        coefficients[0] += segment.start_m
        return np.array([start_s, end_s]), coefficients[None]

    def motion(time_s: FloatArray) -> FloatArray:
        within = time_s - start_s
        s = np.asarray(polynomial.polyval(within, distance), dtype=np.float64)
        v, a, j = (polynomial.polyval(within, polynomial.polyder(distance, n))[:, None] for n in (1, 2, 3))
        position, first, second, third = segment.derivatives(s)
        return np.stack([position, first * v, second * v**2 + first * a, third * v**3 + 3 * second * v * a + first * j])

    return fit_pieces(motion, start_s, end_s)


def _time_at(feed: Trajectory, distance_m: float) -> float:
    """Return when a feed that never runs backwards has come a distance."""
    excess = lambda time: float(feed(time)[0]) - distance_m  # noqa: E731 - one use
    return float(brentq(excess, 0.0, feed.duration_s, xtol=1e-15, rtol=1e-14))


def _refuse_backwards(feed: Trajectory) -> None:
    speed = find_extremes(slopes(feed, 1)[..., :1], feed)
    if not math.isfinite(float(speed.min())) or speed.min() < -BACKWARDS_SHARE * speed.max():
        raise InputError(
            f"the shaped feed rate runs backwards, down to {speed.min():.3g} m/s: a path that bends needs a shaper "
            "without negative impulses"
        )
