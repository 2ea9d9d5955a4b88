"""Arithmetic of piecewise polynomials: joined, delayed, cut, stretched, averaged; all exact to rounding."""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, Shaper, Trajectory

SHORTEST_PIECE_S = 1e-12
"""Breaks that lie closer than this are one break; at 10 m/s it shifts a position by 0.01 nm."""

LONGEST_FACTOR = 1e9
"""A move of more seconds is one of mistyped limits."""


def join_phases(start_m: Sequence[float], phases: Iterable[tuple[float, FloatArray]]) -> Trajectory:
    """Return the motion that starts at rest and holds one acceleration after another.

    Parameters
    ----------
    start_m : sequence of float, length 3
        Where it starts.
    phases : iterable of (float, ndarray of shape (3,))
        Duration in s and acceleration in m/s²; phases of no length are left out.

    Returns
    -------
    Trajectory
        Of degree 2.
    """
    kept = [phase for phase in phases if phase[0] > SHORTEST_PIECE_S]
    duration, acceleration = np.array([d for d, _ in kept])[:, None], np.array([a for _, a in kept]).reshape(-1, 3)
    breaks = np.concatenate([[0.0], np.cumsum(duration)])
    velocity = np.cumsum(np.concatenate([np.zeros((1, 3)), acceleration * duration]), axis=0)[:-1]
    ways = velocity * duration + acceleration / 2 * duration**2
    position = np.cumsum(np.concatenate([np.array([start_m]), ways]), axis=0)[:-1]
    if not kept or not math.isfinite(breaks[-1]) or not np.all(np.diff(breaks) > 0):
        raise InputError(
            "a move whose phases take no time, or endless time, cannot be planned: "
            "check from_m, to_m, max_acceleration_m_s2 and max_velocity_m_s"
        )
    return Trajectory(breaks_s=breaks, coefficients=np.stack([position, velocity, acceleration / 2], axis=1))


def unite_breaks(*breaks_s: FloatArray) -> FloatArray:
    """Return all breaks in order, those that differ only by rounding once; the first and the last stay as they are."""
    every = np.unique(np.concatenate(breaks_s))
    inner = every[(every > every[0] + SHORTEST_PIECE_S) & (every < every[-1] - SHORTEST_PIECE_S)]
    kept = inner[np.diff(inner, prepend=-np.inf) > SHORTEST_PIECE_S]
    return np.concatenate([every[:1], kept, every[-1:]])


def cut(trajectory: Trajectory, breaks_s: FloatArray, *, delay_s: FloatArray | float = 0.0) -> FloatArray:
    """Return the coefficients of a delayed trajectory, or of several, between new breaks.

    Parameters
    ----------
    trajectory : Trajectory
        At rest before its start and after its end.
    breaks_s : ndarray, shape (k + 1,)
        New breaks; none of the delayed trajectory's own breaks lies strictly between two of them.
    delay_s : ndarray, shape (...), or float
        By which it is late.

    Returns
    -------
    ndarray, shape (..., k, order + 1, 3)
        Of rising powers of (t - breaks_s[i]).
    """
    start = breaks_s[:-1] - np.asarray(delay_s)[..., None]
    middle = start + np.diff(breaks_s) / 2
    piece = np.searchsorted(trajectory.breaks_s[1:-1], middle, side="right")
    coefficients = _move_origin(trajectory.coefficients[piece], start - trajectory.breaks_s[piece])
    for outside, time in ((middle < 0, 0.0), (middle > trajectory.duration_s, trajectory.duration_s)):
        if outside.any():
            coefficients[outside] = _rest(trajectory, time)
    return coefficients


def insert_hold(trajectory: Trajectory, time_s: float, length_s: float) -> Trajectory:
    """Return the trajectory with a rest of some length put in where it stands still."""
    if not length_s > SHORTEST_PIECE_S:
        return trajectory
    breaks = unite_breaks(trajectory.breaks_s, np.array([time_s]))
    split = int(np.argmin(np.abs(breaks - time_s)))
    coefficients = cut(trajectory, breaks)
    return Trajectory(
        breaks_s=np.concatenate([breaks[: split + 1], breaks[split:] + length_s]),
        coefficients=np.concatenate([coefficients[:split], _rest(trajectory, time_s)[None], coefficients[split:]]),
    )


def combine(horizontal: Trajectory, vertical: Trajectory) -> Trajectory:
    """Return x and y of the one and z of the other."""
    breaks = unite_breaks(horizontal.breaks_s, vertical.breaks_s)
    level, height = cut(horizontal, breaks), cut(vertical, breaks)
    order = max(level.shape[1], height.shape[1])
    coefficients = np.zeros((len(breaks) - 1, order, 3))
    coefficients[:, : level.shape[1], :2] = level[..., :2]
    coefficients[:, : height.shape[1], 2] = height[..., 2]
    return Trajectory(breaks_s=breaks, coefficients=coefficients)


def stretch(trajectory: Trajectory, factor: float) -> Trajectory:
    """Return the same path, `factor` times as slow."""
    if not SHORTEST_PIECE_S < factor < LONGEST_FACTOR:
        raise InputError(f"a move over {factor:.3g} s cannot be planned: check its points and its limits")
    powers = factor ** np.arange(trajectory.coefficients.shape[1])
    return Trajectory(breaks_s=trajectory.breaks_s * factor, coefficients=trajectory.coefficients / powers[:, None])


def convolve(trajectory: Trajectory, time_s: FloatArray, amplitude: FloatArray) -> Trajectory:
    """Return Σ A_i x(t - t_i), for amplitudes that sum to 1."""
    breaks = unite_breaks(*(trajectory.breaks_s + delay for delay in time_s))
    shares = cut(trajectory, breaks, delay_s=time_s)
    return Trajectory(breaks_s=breaks, coefficients=np.tensordot(amplitude, shares, axes=1))


def average(trajectory: Trajectory, box_s: float) -> Trajectory:
    """Return the moving average ∫ x dt / box over the last `box_s` seconds."""
    breaks = unite_breaks(trajectory.breaks_s, trajectory.breaks_s + box_s)
    start = _rest(trajectory, 0.0)[0]
    change = cut(trajectory, breaks) - cut(trajectory, breaks, delay_s=box_s)
    powers = np.arange(1, change.shape[1] + 1)[:, None]
    integral = np.concatenate([np.zeros((len(change), 1, 3)), change / (powers * box_s)], axis=1)
    # x(t) - x(t - box) is the average's slope: each piece starts where the one before it ends.
    gain = np.sum(integral * np.diff(breaks)[:, None, None] ** np.arange(change.shape[1] + 1)[:, None], axis=1)
    integral[:, 0] = start + np.concatenate([np.zeros((1, 3)), np.cumsum(gain, axis=0)[:-1]])
    return Trajectory(breaks_s=breaks, coefficients=integral)


def shape_axes(trajectory: Trajectory, shaper: Shaper) -> Trajectory:
    """Return a trajectory convolved with the impulses and the box of a shaper, alike on every axis."""
    time = np.array([impulse.time_s for impulse in shaper.impulses])
    amplitude = np.array([impulse.amplitude for impulse in shaper.impulses])
    # Their sum is 1 to 1e-9 only, and an end point should be exact.
    shaped = convolve(trajectory, time, amplitude / math.fsum(amplitude))
    return shaped if shaper.box_s is None else average(shaped, shaper.box_s)


def slopes(trajectory: Trajectory, order: int) -> FloatArray:
    """Return the coefficients of a derivative between the trajectory's own breaks, shape (k, n, 3)."""
    coefficients = trajectory.coefficients
    for _ in range(order):
        powers = np.arange(1, coefficients.shape[1])[:, None]
        coefficients = coefficients[:, 1:] * powers if coefficients.shape[1] > 1 else np.zeros_like(coefficients)
    return coefficients


def _move_origin(coefficients: FloatArray, offset_s: FloatArray) -> FloatArray:
    """Return p(u + offset) as coefficients of u, for each piece: Horner's rule, once for each coefficient."""
    moved, offset = coefficients.copy(), offset_s[..., None]
    degree = moved.shape[-2] - 1
    for settled in range(degree):
        for power in range(degree - 1, settled - 1, -1):
            moved[..., power, :] += offset * moved[..., power + 1, :]
    return moved


def _rest(trajectory: Trajectory, time_s: float) -> FloatArray:
    """Return the coefficients of a piece that stays where the trajectory is at a time, shape (order + 1, 3)."""
    coefficients = np.zeros(trajectory.coefficients.shape[1:])
    coefficients[0] = trajectory(time_s)
    return coefficients
