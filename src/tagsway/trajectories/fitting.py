"""Motions that are no polynomials, as pieces of degree 7 that are closer to them than any robot."""

from collections.abc import Callable

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, Trajectory

MOST_FIT_ERROR_M = 1e-10
"""Between the nodes, where the pieces were compared with the motion itself."""

MOST_PIECES = 4096
"""Of one interval; a motion that needs more is none that a robot runs."""

ENDS = np.array([[1.0, 1, 1, 1], [4, 5, 6, 7], [12, 20, 30, 42], [24, 60, 120, 210]])
"""Value and three derivatives of u⁴ to u⁷ at u = 1."""

FACTORIALS = np.array([1.0, 1.0, 2.0, 6.0])
INSIDE = np.array([0.21, 0.5, 0.79])
"""Where a piece is compared; the largest error of a Hermite piece is in its middle."""

Derivatives = Callable[[FloatArray], FloatArray]
"""From times, shape (n,), to position and its three derivatives, shape (4, n, axes): inside one smooth interval."""


def fit_pieces(motion: Derivatives, start_s: float, end_s: float) -> tuple[FloatArray, FloatArray]:
    """Return pieces of degree 7 that share position, velocity, acceleration and jerk with a motion at their ends.

    Parameters
    ----------
    motion : callable
        The motion, smooth from `start_s` to `end_s`.
    start_s, end_s : float
        Its interval.

    Returns
    -------
    breaks_s : ndarray, shape (k + 1,)
        The intervals, halved until the error between them is below 1e-10 m.
    coefficients : ndarray, shape (k, 8, axes)
        Of rising powers.
    """
    pieces = 1
    while pieces <= MOST_PIECES:
        breaks: FloatArray = np.linspace(start_s, end_s, pieces + 1, dtype=np.float64)
        coefficients = _hermite(motion(breaks), np.diff(breaks))
        offset = np.diff(breaks)[:, None] * INSIDE
        exact = motion((breaks[:-1, None] + offset).ravel())[0].reshape(pieces, len(INSIDE), -1)
        powers = offset[..., None] ** np.arange(8)
        error = float(np.max(np.abs(powers @ coefficients - exact)))
        if error <= MOST_FIT_ERROR_M:
            return breaks, coefficients
        pieces *= 2
    raise InputError(
        f"a motion from {start_s:.4g} to {end_s:.4g} s cannot be fitted below 0.1 nm: {error:.2g} m remain"
    )


def join_pieces(parts: list[tuple[FloatArray, FloatArray]]) -> Trajectory:
    """Return pieces that follow one another as one trajectory."""
    order = max(coefficients.shape[1] for _, coefficients in parts)
    padded = [np.pad(piece, ((0, 0), (0, order - piece.shape[1]), (0, 0))) for _, piece in parts]
    breaks = np.concatenate([parts[0][0][:1], *(part[0][1:] for part in parts)])
    return Trajectory(breaks_s=breaks, coefficients=np.concatenate(padded))


def _hermite(nodes: FloatArray, length_s: FloatArray) -> FloatArray:
    """Return the coefficients between nodes; shapes (4, k + 1, axes) and (k,)."""
    scale = length_s[:, None] ** np.arange(8)
    values = nodes / FACTORIALS[:, None, None]
    low = values[:, :-1].transpose(1, 0, 2) * scale[:, :4, None]
    # In units of the interval: what the lower half leaves at its end is what u⁴ to u⁷ must bring.
    wanted = nodes[:, 1:].transpose(1, 0, 2) * scale[:, :4, None]
    from_low = np.array([[1.0, 1, 1, 1], [0, 1, 2, 3], [0, 0, 2, 6], [0, 0, 0, 6]]) @ low
    high = np.linalg.solve(ENDS, wanted - from_low)
    coefficients: FloatArray = np.concatenate([low, high], axis=1) / scale[..., None]
    return coefficients
