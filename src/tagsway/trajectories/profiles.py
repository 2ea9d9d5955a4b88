"""Straight moves from rest to rest, and the ramp that the pick-and-place is made of."""

import math

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, Move, Trajectory
from tagsway.trajectories.feeds import lay_along, plan_feed
from tagsway.trajectories.pieces import stretch


def ramp(
    distance_m: float,
    *,
    speed_in_m_s: float,
    speed_out_m_s: float,
    acceleration_m_s2: float,
    max_velocity_m_s: float,
) -> list[tuple[float, float]]:
    """Return the quickest way over a distance between two speeds: full acceleration, cruise, full deceleration.

    Parameters
    ----------
    distance_m : float
        Not shorter than |v_in² - v_out²| / 2a.
    speed_in_m_s, speed_out_m_s : float
        At its ends, not above `max_velocity_m_s`.
    acceleration_m_s2, max_velocity_m_s : float
        Limits.

    Returns
    -------
    list of (float, float)
        Duration in s and signed acceleration in m/s².
    """
    a, v, w = acceleration_m_s2, speed_in_m_s, speed_out_m_s
    peak = min(math.sqrt(a * distance_m + (v**2 + w**2) / 2), max_velocity_m_s)
    cruise = distance_m - (2 * peak**2 - v**2 - w**2) / (2 * a)
    level = cruise / peak if peak == max_velocity_m_s else 0.0
    return [((peak - v) / a, a), (level, 0.0), ((peak - w) / a, -a)]


def plan_bang_bang(move: Move) -> Trajectory:
    """Plan a straight move at full acceleration, then full deceleration.

    It cruises where `max_velocity_m_s` is met, and with `max_jerk_m_s3` it is the S-curve.
    """
    distance, direction = straight_line(move)
    feed = plan_feed(
        distance,
        max_velocity_m_s=velocity_limit(move),
        max_acceleration_m_s2=move.max_acceleration_m_s2,
        max_jerk_m_s3=math.inf if move.max_jerk_m_s3 is None else move.max_jerk_m_s3,
    )
    return lay_along(feed, np.array(move.from_m, dtype=float), direction)


def plan_trapezoid(move: Move) -> Trajectory:
    """Plan a straight move whose velocity is a trapezoid: a bang-bang that cruises at `max_velocity_m_s`."""
    if move.max_velocity_m_s is None:
        raise InputError("the profile trapezoid needs max_velocity_m_s, the speed at which it cruises")
    return plan_bang_bang(move)


def plan_s_curve(move: Move) -> Trajectory:
    """Plan a straight move of limited jerk, of up to seven phases: the quickest that keeps all three limits.

    Notes
    -----
    Where the jerk time a/j is the damped period of a mode, its acceleration is a rectangle averaged over that period,
    and the mode stays at rest but for its damping: max_jerk_m_s3 = a f_d.
    """
    if move.max_jerk_m_s3 is None:
        raise InputError("the profile s-curve needs max_jerk_m_s3, the jerk that it keeps")
    return plan_bang_bang(move)


def plan_quintic(move: Move) -> Trajectory:
    """Plan a straight move s = 10 τ³ - 15 τ⁴ + 6 τ⁵, as quick as the limits allow.

    Notes
    -----
    Over a length L in the time T the peaks are v = 15/8 L/T, a = 10/√3 L/T² and jerk = 60 L/T³ (at the ends).
    """
    distance, direction = straight_line(move)
    duration = max(
        15 / 8 * distance / velocity_limit(move),
        math.sqrt(10 / math.sqrt(3) * distance / move.max_acceleration_m_s2),
        0.0 if move.max_jerk_m_s3 is None else math.cbrt(60 * distance / move.max_jerk_m_s3),
    )
    shape = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])
    coefficients = shape[:, None] * distance * direction
    coefficients[0] = move.from_m
    return stretch(Trajectory(breaks_s=np.array([0.0, 1.0]), coefficients=coefficients[None]), duration)


def straight_line(move: Move) -> tuple[float, FloatArray]:
    """Return the length of the way and its unit vector; refuse heights, which a straight line does not have."""
    refuse_heights(move)
    way = np.array(move.to_m) - np.array(move.from_m)
    distance = float(np.linalg.norm(way))
    return distance, way / distance


def refuse_heights(move: Move) -> None:
    """Raise an InputError where a move without vertical ends is given heights."""
    if move.pick_height_m > 0 or move.place_height_m > 0:
        raise InputError(
            f"the profile {move.profile} has no vertical ends: pick_height_m and place_height_m need pick-and-place"
        )


def velocity_limit(move: Move) -> float:
    """Return the speed that the tool may reach, inf where none was stated."""
    return math.inf if move.max_velocity_m_s is None else move.max_velocity_m_s


def refuse_jerk_limit(move: Move) -> None:
    """Raise an InputError where a move of constant accelerations is asked to keep a jerk."""
    if move.max_jerk_m_s3 is not None:
        raise InputError(
            f"the profile {move.profile} steps from one acceleration to the next: it cannot keep "
            f"max_jerk_m_s3 = {move.max_jerk_m_s3:g}; leave it out, or use s-curve, quintic or b-spline"
        )
