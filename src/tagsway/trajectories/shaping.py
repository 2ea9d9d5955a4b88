"""A shaper laid over a move."""

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, Shaper, Trajectory
from tagsway.trajectories.feed_rate import shape_feed_rate
from tagsway.trajectories.filtering import apply_filter
from tagsway.trajectories.pieces import combine, insert_hold, shape_axes, slopes, stretch

MOST_DRIFT_M = 1e-9
"""How far z may run during its hold if it went on as it was."""

SHORTEST_BOX_S = 1e-6
"""A moving average over less is no filter, and loses its digits."""


def apply_shaper(trajectory: Trajectory, shaper: Shaper, axes: tuple[str, ...]) -> Trajectory:
    """Convolve a move with a shaper.

    Parameters
    ----------
    trajectory : Trajectory
        From rest to rest.
    shaper : Shaper
        Impulses and perhaps a box; its time scale stretches the move first.
    axes : tuple of str
        ("x",): x and y are shaped, z is held at mid-move for the shaper's length and then goes on: the vertical ends
        stay vertical. ("x", "z"): all three are shaped; x then starts before the lift is over. ("path",): the feed rate
        along the path, which stays as it is. (): the move as it is.

    Returns
    -------
    Trajectory
        Longer by the shaper's duration (a filter's tail in it, or more where it would still be 1 µm off); it starts
        and ends at the same points, at rest.

    Raises
    ------
    InputError
        Where z moves at mid-move, for axes that are none of these, for a filter that does not settle at 1, and where
        the feed rate of a bent path cannot be shaped.

    Notes
    -----
    The sum of delayed pieces is again a piecewise polynomial, so nothing is rounded to a grid: an impulse between two
    samples loses nothing. Shaping the position, its velocity or its acceleration is the same thing. What is no
    polynomial (a filter's response, a shaped feed rate around a bend) is fitted within 1e-10 m.
    """
    if not axes:
        return trajectory
    if shaper.box_s is not None and not shaper.box_s >= SHORTEST_BOX_S:
        raise InputError(f"a shaper's box of {shaper.box_s:g} s is too short: expected a period, or none")
    scaled = trajectory if shaper.time_scale == 1 else stretch(trajectory, shaper.time_scale)
    if set(axes) == {"path"}:
        return shape_feed_rate(scaled, shaper)
    if set(axes) not in ({"x"}, {"x", "z"}):
        raise InputError(f"shaped_axes is {list(axes)}: expected ['x'], ['x', 'z'], ['path'] or []")
    shaped = shape_axes(scaled, shaper)
    if shaper.filter is not None:
        shaped = apply_filter(shaped, shaper.filter, tail_s=shaper.tail_s)
    if set(axes) == {"x", "z"}:
        return shaped
    longer = shaped.duration_s - scaled.duration_s
    return combine(shaped, insert_hold(scaled, _hold_time(scaled, longer), longer))


def slow_down(trajectory: Trajectory, speed: float) -> Trajectory:
    """Return the same path for a dry run.

    Parameters
    ----------
    trajectory : Trajectory
        The move as it will run, shaped.
    speed : float
        Share of its speed, above 0 and not above 1. A slow run shows the path; it says nothing of the vibration.

    Returns
    -------
    Trajectory
        1/speed times as long.
    """
    if not 0 < speed <= 1:
        raise InputError(f"a speed of {speed:g} cannot be run: expected more than 0 and at most 1")
    return trajectory if speed == 1 else stretch(trajectory, 1 / speed)


def _hold_time(trajectory: Trajectory, length_s: float) -> float:
    """Return the time nearest to mid-move at which z is at rest."""
    breaks, middle = trajectory.breaks_s, trajectory.duration_s / 2
    nearest = np.clip(middle, breaks[:-1], breaks[1:])
    offset = nearest - breaks[:-1]
    speed, push = (np.abs(_evaluate(slopes(trajectory, order)[..., 2], offset)) for order in (1, 2))
    drift = speed * length_s + push * length_s**2 / 2
    usable = (drift <= MOST_DRIFT_M) & (nearest > 0) & (nearest < trajectory.duration_s)
    if not np.any(usable):
        worst = float(drift[np.argmin(np.abs(nearest - middle))])
        raise InputError(
            f"the hold would drift: z is not at rest at mid-move and would run {worst * 1e3:.3g} mm in the shaper's "
            f"{length_s:.3g} s; shape x and z, or plan a move that is level there"
        )
    return float(nearest[usable][np.argmin(np.abs(nearest[usable] - middle))])


def _evaluate(coefficients: FloatArray, offset_s: FloatArray) -> FloatArray:
    """Return each piece's polynomial at its own offset; coefficients have shape (k, n)."""
    powers = offset_s[:, None] ** np.arange(coefficients.shape[1])
    value: FloatArray = np.sum(coefficients * powers, axis=1)
    return value
