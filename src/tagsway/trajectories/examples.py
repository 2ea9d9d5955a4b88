"""The moves of the documents, as moves."""

import math

from tagsway.model import ArcThrough, Move

Point = tuple[float, float, float]


def dual_mode_move(*, duration_s: float = 0.25) -> Move:
    """Return the pick-and-place of the dual-mode paper: straight up, an arc, across, an arc, straight down.

    Parameters
    ----------
    duration_s : float
        0.25 s in the paper; it sets the greatest speed, 15/8 of the mean.

    Returns
    -------
    Move
        Profile "path", a quintic along it, with P0, P1 … P5 of Table 3 [1]_ on it; the speed sets its duration, the
        acceleration is left open.

    Notes
    -----
    P1 and P4 lie 40 mm below the way across and 20.1 mm beside its ends P2 and P3: no circular arc between them is
    tangent to both straights, and the printed length 0.6048 m fits none that is not (straights and chords are 0.5965 m,
    an arc tangent to one straight alone gives about 0.600 or 0.618 m). Here the verticals go on for 19.9 mm beyond P1
    and P4, and a quarter circle of 20.1 mm leads from there to P2 and P3: 0.6099 m. The paper's 55.87 m/s² is the
    acceleration along the path; in the arcs v²/R is ten times as much.

    References
    ----------
    .. [1] Dual-mode input shaping of a delta robot (document 3), section 3.1.
    """
    start, lifted, across, over, lowered, end = (
        (-0.2, 0.0, -0.74),
        (-0.2, 0.0, -0.71),
        (-0.182, -0.009, -0.67),
        (0.182, -0.191, -0.67),
        (0.2, -0.2, -0.71),
        (0.2, -0.2, -0.78),
    )
    radius = math.dist(lifted[:2], across[:2])
    low = across[2] - radius
    up, down = (*lifted[:2], low), (*lowered[:2], low)
    length = lifted[2] - start[2] + math.dist(across, over) + lowered[2] - end[2] + 2 * (low - lifted[2])
    length += math.pi * radius
    return Move(
        from_m=start,
        to_m=end,
        profile="path",
        along_path="quintic",
        waypoints_m=(lifted, up, across, over, down, lowered),
        arcs=(
            ArcThrough(segment=2, through_m=_on_quarter(up, across, radius)),
            ArcThrough(segment=4, through_m=_on_quarter(down, over, radius)),
        ),
        max_velocity_m_s=15 / 8 * length / duration_s,
        max_acceleration_m_s2=1e4,
        shaped_axes=("path",),
    )


def corner_test_move(*, corner_error_mm: float = 0.5, max_acceleration_m_s2: float = 5.0) -> Move:
    """Return a path with the features of the SCARA paper's: an arc, lines, obtuse and acute corners, 9600 mm/min.

    Parameters
    ----------
    corner_error_mm : float
        How far the tool may pass from a corner.
    max_acceleration_m_s2 : float
        Of the vector.

    Returns
    -------
    Move
        From (180, 0) to (270, 0) mm; the paper prints no other point, so the corners are ours: they turn by 45°, 45°,
        135° and 90°.
    """
    half = 0.03 * math.sqrt(0.5)
    return Move(
        from_m=(0.18, 0.0, 0.0),
        to_m=(0.27, 0.0, 0.0),
        profile="path",
        waypoints_m=((0.21, 0.03, 0.0), (0.24, 0.06, 0.0), (0.29, 0.06, 0.0), (0.25, 0.02, 0.0)),
        arcs=(ArcThrough(segment=0, through_m=(0.21 - half, half, 0.0)),),
        feed_rate_m_s=0.16,
        corner_error_mm=corner_error_mm,
        max_acceleration_m_s2=max_acceleration_m_s2,
        shaped_axes=("path",),
    )


def _on_quarter(low: Point, high: Point, radius: float) -> Point:
    """Return the middle of a quarter circle that is vertical at its low end and level at its high one."""
    share = 1 - math.sqrt(0.5)
    x, y = (a + share * (b - a) for a, b in zip(low[:2], high[:2], strict=True))
    return x, y, low[2] + radius * math.sqrt(0.5)
