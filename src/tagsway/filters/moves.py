"""When a tool moves, and when it stands: one answer for the window, the indicators and the pendulum."""

import numpy as np

from tagsway.model import BoolArray, FloatArray, IntArray, Window

MOVING = 0.01
"""Share of a move's top speed below which it has not begun, or is over."""

STANDING = 3.0
"""Speed, over that of the quietest fifth of the record, below which a tool may as well stand or drift."""

STEADY = 6.0
"""Top speed over that of the quietest fifth: what is no quicker drifts."""

PAUSE_S = 0.2
"""A shorter stop belongs to the move."""

MOST_PIECES = 300
"""From stop to stop, that are looked at in a record."""


def find_moves(time_s: FloatArray, position: FloatArray, velocity: FloatArray, *, least: float) -> tuple[Window, ...]:
    """Find every motion of a tool that takes it somewhere.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Rising.
    position, velocity : ndarray, shape (n, 2)
        x and z of the tool, cleaned; NaN where it was not seen.
    least : float
        A motion whose range is no larger is none, in the unit of the positions.

    Returns
    -------
    tuple of Window
        In their order; empty where the tool stands, drifts or rings.

    Notes
    -----
    The quickest instant of what is left is a move's core. From there the move reaches out, both ways, to where the
    speed falls below a hundredth of its top or the tool turns round: so it ends where a ringing begins, however large
    that is. Each move is measured by its own top speed: a slow one beside a quick one is seen. Moves with less than
    0.2 s between them are one. A tool that was lost and comes back elsewhere has moved.
    """
    free: BoolArray = np.asarray(np.isfinite(velocity).all(axis=1) & np.isfinite(position).all(axis=1), dtype=bool)
    if not free.any():
        return ()
    moves = _jumps(position, np.flatnonzero(free), least)
    speed = np.where(free, np.hypot(*velocity.T), 0.0)
    quiet = float(np.percentile(speed[free], 20))
    turns = _turns(velocity)
    for _ in range(MOST_PIECES):
        core = int(np.argmax(np.where(free, speed, -1.0)))
        if not (free[core] and speed[core] > STEADY * quiet):
            break
        stops = turns | ~(speed > max(MOVING * speed[core], STANDING * quiet))
        first, last = _reach(stops, core)
        path = position[first : last + 1]
        if float(np.hypot(*np.ptp(path[np.isfinite(path).all(axis=1)], axis=0))) > least:
            moves.append((first, last))
        free[first : last + 1] = False
    return _join(time_s, sorted(moves))


def _turns(velocity: FloatArray) -> BoolArray:
    """Return the samples before which a tool turns round, shape (n,)."""
    along = np.einsum("ij,ij->i", velocity[1:], velocity[:-1])
    return np.concatenate([[False], ~(along > 0)])


def _reach(stops: BoolArray, core: int) -> tuple[int, int]:
    """Return the last stop before a core and the first one after it; a turn stands between a sample and the last."""
    before, after = np.flatnonzero(stops[: core + 1]), np.flatnonzero(stops[core + 1 :])
    return int(before[-1]) if len(before) else 0, core + 1 + int(after[0]) if len(after) else len(stops) - 1


def _jumps(position: FloatArray, seen: IntArray, least: float) -> list[tuple[int, int]]:
    """Return the gaps across which the tool changed its place."""
    away = np.hypot(*np.diff(position[seen], axis=0).T)
    return [(int(seen[i]), int(seen[i + 1])) for i in np.flatnonzero((np.diff(seen) > 1) & (away > least))]


def _join(time_s: FloatArray, moves: list[tuple[int, int]]) -> tuple[Window, ...]:
    joined: list[tuple[int, int]] = []
    for first, last in moves:
        if joined and time_s[first] - time_s[joined[-1][1]] <= PAUSE_S:
            joined[-1] = (joined[-1][0], max(last, joined[-1][1]))
        elif last > first:
            joined.append((first, last))
    return tuple(Window(start_s=float(time_s[a]), end_s=float(time_s[b])) for a, b in joined)
