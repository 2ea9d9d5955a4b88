"""Pick and place: straight up, over a 45° blend, across, and the same way down."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.optimize import brentq

from tagsway.errors import InputError
from tagsway.model import Move, Trajectory
from tagsway.trajectories.pieces import join_phases
from tagsway.trajectories.profiles import ramp, refuse_jerk_limit, velocity_limit

LEAST_LEVEL_SHARE = 0.05
"""Of the horizontal way that is level at the apex: there z can be held for a shaper."""

SHORTEST_WAY_M = 1e-9

INSIDE = 1 - 1e-12
"""A root is found to rounding: on this side of it the blends leave room."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Corners:
    """The two ends of the move, pick and place: speed into the blend, and the strictly vertical way below it."""

    speed_m_s: tuple[float, float]
    vertical_m: tuple[float, float]

    @classmethod
    def of(cls, move: Move, acceleration_m_s2: float, max_speed_m_s: float) -> Self:
        """Return them for a common apex, which the higher end dictates.

        A blend entered at speed u climbs u²/(√2 a). Over a height h the tool can reach u = √(2 a h), so a climb C has a
        vertical part of C/(1 + √2), or more where u is limited.
        """
        a, w = acceleration_m_s2, max_speed_m_s
        ends = ((move.from_m[2], move.pick_height_m), (move.to_m[2], move.place_height_m))
        apex = max(z + h + min(w**2, 2 * a * h) / (math.sqrt(2) * a) for z, h in ends)
        climbs = [apex - z for z, _ in ends]
        pick, place = (min(w, math.sqrt(2 * a * climb / (1 + math.sqrt(2)))) for climb in climbs)
        up, down = (climb - u**2 / (math.sqrt(2) * a) for climb, u in zip(climbs, (pick, place), strict=True))
        return cls(speed_m_s=(pick, place), vertical_m=(up, down))

    def level_m(self, way_m: float, acceleration_m_s2: float) -> float:
        """Return what remains of the horizontal way between the blends."""
        return way_m - sum(u**2 for u in self.speed_m_s) / (math.sqrt(2) * acceleration_m_s2)

    def spare_m(self, way_m: float, acceleration_m_s2: float) -> float:
        """Return by how much the level part is longer than getting from the one speed to the other needs."""
        pick, place = self.speed_m_s
        needed = abs(pick**2 - place**2) / (2 * acceleration_m_s2)
        return self.level_m(way_m, acceleration_m_s2) - max(needed, LEAST_LEVEL_SHARE * way_m)


def plan_pick_and_place(move: Move) -> Trajectory:
    """Plan a move with strictly vertical ends and 45° parabolic blends.

    Parameters
    ----------
    move : Move
        `pick_height_m` and `place_height_m` are at least how far the tool rises straight up before it leaves the
        vertical; `max_acceleration_m_s2` limits the acceleration *vector*.

    Returns
    -------
    Trajectory
        From rest to rest, of degree 2: the jerk is infinite where the acceleration steps.

    Raises
    ------
    InputError
        For a jerk limit, and for two points above one another.

    Notes
    -----
    Up at a over the height, a blend at a/√2 on each axis for √2 v/a, across at ±a, mirrored [1]_: over 0.7 m with 50 mm
    of height it takes 2.517484/√a. Where the two ends differ, the apex is the higher one's and the lower one climbs
    farther before its blend. Where the way is too short for the blends, both are entered more slowly.

    References
    ----------
    .. [1] Table 8.1 to 8.4 of the thesis, as recomputed: 23 of its 26 motion times within 0.011 s.
    """
    refuse_jerk_limit(move)
    a, limit = move.max_acceleration_m_s2, velocity_limit(move)
    way = np.array(move.to_m[:2]) - np.array(move.from_m[:2])
    length = float(np.hypot(*way))
    if not length > SHORTEST_WAY_M:
        raise InputError("from_m and to_m lie above one another: pick-and-place needs a way across; use bang-bang")
    corners = _widest_corners(move, length)
    along, up = np.array([*(way / length), 0.0]), np.array([0.0, 0.0, 1.0])
    (pick, place), (rise, fall) = corners.speed_m_s, corners.vertical_m
    lift = ramp(rise, speed_in_m_s=0, speed_out_m_s=pick, acceleration_m_s2=a, max_velocity_m_s=limit)
    across = ramp(
        corners.level_m(length, a), speed_in_m_s=pick, speed_out_m_s=place, acceleration_m_s2=a, max_velocity_m_s=limit
    )
    lower = ramp(fall, speed_in_m_s=place, speed_out_m_s=0, acceleration_m_s2=a, max_velocity_m_s=limit)
    return join_phases(
        move.from_m,
        [
            *((duration, push * up) for duration, push in lift),
            (math.sqrt(2) * pick / a, a / math.sqrt(2) * (along - up)),
            *((duration, push * along) for duration, push in across),
            (math.sqrt(2) * place / a, -a / math.sqrt(2) * (along + up)),
            *((duration, -push * up) for duration, push in lower),
        ],
    )


def _widest_corners(move: Move, way_m: float) -> _Corners:
    """Return the fastest blends that leave room for the way between them."""
    a = move.max_acceleration_m_s2
    corners = _Corners.of(move, a, velocity_limit(move))
    if corners.spare_m(way_m, a) >= 0:
        return corners

    def spare_m(square: float) -> float:
        return _Corners.of(move, a, math.sqrt(square)).spare_m(way_m, a)

    # What is spared falls with the square of the speed, in straight pieces.
    widest = float(brentq(spare_m, 0.0, max(corners.speed_m_s) ** 2, xtol=1e-15))
    return _Corners.of(move, a, math.sqrt(widest * INSIDE))
