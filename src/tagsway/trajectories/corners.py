"""Corners: how early the next way may begin, for a given distance from the corner."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from tagsway.errors import InputError
from tagsway.model import FloatArray, Trajectory
from tagsway.trajectories.feeds import Feed
from tagsway.trajectories.limits import stationary_points
from tagsway.trajectories.pieces import cut, unite_breaks

SQUARE_SHARE = 1e-9
"""Of the end of an interval: a least distance that lies nearer to it is one at a step of the speed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Corner:
    """How a corner is passed; times count from the start of the deceleration on the first way.

    Parameters
    ----------
    angle_rad : float
        By which the direction changes, 0 to π.
    cornering_time_s : float
        t_c: both ways are under way.
    delay_time_s : float
        t_d: when the second way begins, the deceleration time less t_c.
    error_time_s : float
        t_e: when the tool is nearest to the corner.
    error_m : float
        How near.
    perpendicular : bool
        Whether the way to the corner is then square to the motion. A speed that steps (an impulse shaper alone) may
        have no such moment; the least distance counts all the same.
    """

    angle_rad: float
    cornering_time_s: float
    delay_time_s: float
    error_time_s: float
    error_m: float
    perpendicular: bool


def plan_corner(first: Feed, second: Feed, *, angle_rad: float, error_m: float) -> Corner:
    """Plan how early the second way may begin.

    Parameters
    ----------
    first, second : Feed
        Of the two ways; their ramps need be neither alike nor symmetric.
    angle_rad : float
        By which the direction of the tangents changes, 0 to π.
    error_m : float
        How far the tool may pass from the corner; 0 stops there.

    Returns
    -------
    Corner
        With the greatest cornering time that keeps the error, at most a whole ramp and half of either way's time.

    Notes
    -----
    Algorithm 1 of [1]_. With s1 left on the first way and s2 gone on the second, the distance from the corner is
    ε² = s1² + s2² - 2 s1 s2 cos θ, least where -s1 v1 + s2 v2 + cos θ (s2 v1 - s1 v2) = 0 or, if that is nowhere, at a
    step of the speed. It grows with t_c, so that one root gives t_c. On an arc θ and the two ways are those of the
    tangents at the corner, as the document has it: the true distance differs by the arc's sagitta there.

    References
    ----------
    .. [1] Hybrid prefilter and corner planning of a SCARA robot (document 4), section 4.
    """
    if not error_m >= 0:
        raise InputError(f"a cornering error must not be negative: {error_m:g} m; 0 stops at the corner")
    longest = min(first.ramp_s, second.ramp_s, first.distance.duration_s / 2, second.distance.duration_s / 2)
    widest = find_corner_error(first, second, angle_rad=angle_rad, cornering_time_s=longest)
    if widest.error_m <= error_m:
        return widest
    if error_m == 0:
        return find_corner_error(first, second, angle_rad=angle_rad, cornering_time_s=0.0)

    def excess(cornering_time_s: float) -> float:
        corner = find_corner_error(first, second, angle_rad=angle_rad, cornering_time_s=cornering_time_s)
        return corner.error_m - error_m

    time = float(brentq(excess, 0.0, longest, xtol=1e-15, rtol=1e-14))
    return find_corner_error(first, second, angle_rad=angle_rad, cornering_time_s=time)


def find_corner_error(first: Feed, second: Feed, *, angle_rad: float, cornering_time_s: float) -> Corner:
    """Return how near to the corner the tool passes for a given cornering time (steps 4 and 5 of Algorithm 1).

    Parameters
    ----------
    first, second : Feed
        Of the two ways.
    angle_rad : float
        By which the direction changes, 0 to π.
    cornering_time_s : float
        From 0 to the first way's ramp.

    Returns
    -------
    Corner
        Exact: the distance is a polynomial between the breaks of the two feeds.
    """
    if not 0 <= angle_rad <= math.pi:
        raise InputError(f"a change of direction lies between 0 and pi, not {angle_rad:g} rad")
    ramp = first.ramp_s
    if not 0 <= cornering_time_s <= ramp * (1 + 1e-12):
        raise InputError(f"a cornering time lies between 0 and the ramp's {ramp:g} s, not {cornering_time_s:g} s")
    delay = ramp - cornering_time_s
    start = first.distance.duration_s - ramp
    if cornering_time_s == 0:
        return _corner(angle_rad, ramp, 0.0, ramp, 0.0, perpendicular=True)
    time, distance, perpendicular = _nearest(first, second, angle_rad, start + delay)
    return _corner(angle_rad, ramp, cornering_time_s, time - start, distance, perpendicular=perpendicular)


def _corner(
    angle: float, ramp: float, cornering: float, nearest: float, distance: float, *, perpendicular: bool
) -> Corner:
    return Corner(
        angle_rad=angle,
        cornering_time_s=cornering,
        delay_time_s=ramp - cornering,
        error_time_s=nearest,
        error_m=distance,
        perpendicular=perpendicular,
    )


def _nearest(first: Feed, second: Feed, angle: float, begin_s: float) -> tuple[float, float, bool]:
    """Return when (from the first way's start) and how near the tool passes the corner, and whether squarely."""
    end = first.distance.duration_s
    breaks = unite_breaks(first.distance.breaks_s, second.distance.breaks_s + begin_s)
    pieces = _around_corner(first, second, angle, begin_s, breaks)
    middle = (breaks[:-1] + breaks[1:]) / 2
    best = (end, math.inf, False)
    for index in np.flatnonzero((middle > begin_s) & (middle < end)):
        length = float(breaks[index + 1] - breaks[index])
        scaled = pieces[index] * (length ** np.arange(pieces.shape[1]))[:, None]
        for share in stationary_points(scaled):
            distance = float(np.linalg.norm(share ** np.arange(len(scaled)) @ scaled))
            if distance < best[1]:
                inside = SQUARE_SHARE < share < 1 - SQUARE_SHARE
                best = (float(breaks[index] + share * length), distance, inside)
    return best


def _around_corner(first: Feed, second: Feed, angle: float, begin_s: float, breaks: FloatArray) -> FloatArray:
    """Return the position from the corner in the plane of the two tangents, shape (k, n, 2)."""
    before = _padded(cut(first.distance, breaks)[..., 0], second.distance)
    after = _padded(cut(second.distance, breaks, delay_s=begin_s)[..., 0], first.distance)
    before[:, 0] -= first.length_m
    return np.stack([before + math.cos(angle) * after, math.sin(angle) * after], axis=-1)


def _padded(coefficients: FloatArray, other: Trajectory) -> FloatArray:
    missing = max(other.coefficients.shape[1] - coefficients.shape[1], 0)
    return np.pad(coefficients, ((0, 0), (0, missing)))
