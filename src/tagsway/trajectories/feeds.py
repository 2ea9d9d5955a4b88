"""The feed rate along a way: a rectangle, averaged over the time to full speed and to full acceleration, and shaped."""

import math
from dataclasses import dataclass

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, Shaper, Trajectory
from tagsway.trajectories.pieces import SHORTEST_PIECE_S, average, shape_axes


@dataclass(frozen=True, slots=True, kw_only=True)
class Feed:
    """How far the tool is along its way, at any time.

    Parameters
    ----------
    distance : Trajectory
        Its x is the distance in m; y and z are 0.
    ramp_s : float
        What the speed takes from 0 to its full value, and from there to 0.
    """

    distance: Trajectory
    ramp_s: float

    @property
    def length_m(self) -> float:
        """The way's length."""
        return float(self.distance(self.distance.duration_s)[0])


def plan_feed(
    length_m: float,
    *,
    max_velocity_m_s: float,
    max_acceleration_m_s2: float = math.inf,
    max_jerk_m_s3: float = math.inf,
    shaper: Shaper | None = None,
) -> Feed:
    """Plan the feed rate over a way from rest to rest, as quick as the limits allow.

    Parameters
    ----------
    length_m : float
        Of the way.
    max_velocity_m_s : float
        The feed rate; inf where only the acceleration limits it. A short way does not reach it.
    max_acceleration_m_s2 : float
        inf lets the speed step: what a prefilter alone is laid over in [1]_.
    max_jerk_m_s3 : float
        inf lets the acceleration step.
    shaper : Shaper, optional
        Laid over the feed rate.

    Returns
    -------
    Feed
        Its distance is a polynomial of degree 1 between breaks, 2 with an acceleration limit, 3 with a jerk limit, and
        one more with a shaper's box.

    Notes
    -----
    A rectangle of the height v and the length L/v, averaged over v/a and then over a/j, has the acceleration v/(v/a)
    and the jerk a/(a/j). Where v < a²/j full acceleration is not reached and both averages take √(v/j). The speed of a
    short way is that at which the rectangle is as long as both averages: then nothing overlaps, and it is the quickest.

    References
    ----------
    .. [1] Hybrid prefilter and corner planning of a SCARA robot (document 4), section 2.3.
    """
    limits = (max_velocity_m_s, max_acceleration_m_s2, max_jerk_m_s3)
    if not all(value > 0 for value in (length_m, *limits)):
        raise InputError(f"a way and its limits must be positive to be planned: {length_m:g} m with {list(limits)}")
    speed, boxes = _times(length_m, max_velocity_m_s, max_acceleration_m_s2, max_jerk_m_s3)
    duration = length_m / speed
    if not (math.isfinite(duration) and duration > SHORTEST_PIECE_S) or not all(math.isfinite(box) for box in boxes):
        raise InputError(
            f"a way of {length_m:g} m takes no time, or endless time, under its limits and cannot be planned: check "
            "from_m, to_m, max_acceleration_m_s2, max_velocity_m_s and feed_rate_m_s"
        )
    coefficients = np.zeros((1, 2, 3))
    coefficients[0, 1, 0] = speed
    distance = Trajectory(breaks_s=np.array([0.0, duration]), coefficients=coefficients)
    for box in boxes:
        distance = average(distance, box)
    if shaper is not None:
        refuse_inexact(shaper)
        distance = shape_axes(distance, shaper)
    return Feed(distance=_settle(distance, length_m), ramp_s=distance.duration_s - duration)


def refuse_inexact(shaper: Shaper) -> None:
    """Raise an InputError for what cannot be laid over a feed rate before its corners are planned."""
    if shaper.filter is not None or shaper.time_scale != 1:
        raise InputError("a feed rate with corners takes a shaper of impulses and a box, without filter or time scale")


def lay_along(feed: Feed, start_m: FloatArray, direction: FloatArray) -> Trajectory:
    """Return the motion of a feed on a straight line; `direction` is a unit vector, shape (3,)."""
    coefficients = feed.distance.coefficients[..., :1] * direction
    coefficients[:, 0] += start_m
    return Trajectory(breaks_s=feed.distance.breaks_s, coefficients=coefficients)


def _times(length: float, v: float, a: float, j: float) -> tuple[float, list[float]]:
    """Return the speed and the lengths of the averages, longest first; none where nothing limits the acceleration."""
    if math.isinf(a):
        if math.isfinite(j):
            a = math.sqrt(length * j)
        else:
            return v, []
    if math.isinf(j):
        speed = min(v, math.sqrt(a * length))
        return speed, [speed / a]
    jerk_time = a / j
    speed = min(v, 2 * length / (math.sqrt(jerk_time * jerk_time + 4 * length / a) + jerk_time))
    if speed >= a * jerk_time:
        return speed, [speed / a, jerk_time]
    speed = min(v, math.cbrt(length * length * j / 4))
    return speed, [math.sqrt(speed / j)] * 2


def _settle(distance: Trajectory, length_m: float) -> Trajectory:
    """Return it with the rounding of its averages taken off: it should end where the way does."""
    coefficients = distance.coefficients * (length_m / float(distance(distance.duration_s)[0]))
    return Trajectory(breaks_s=distance.breaks_s, coefficients=coefficients)
