"""Errors of a smoothing spline: variances at any time, and whole paths drawn from the posterior."""

import itertools
import math

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import cholesky_banded

from tagsway.filters.contrasts import ORDER, Contrasts
from tagsway.model import FloatArray, IntArray

STENCIL = 9
"""Samples around a time that touch the same contrasts as the three nearest of them."""

CHUNK = 4096
"""Times whose covariances are held in memory together."""

TOUCHED = STENCIL - ORDER
"""Contrasts that such a stencil holds."""


def factor(bands: FloatArray) -> tuple[FloatArray, bool]:
    """Return the banded Cholesky factor as `scipy.linalg.cho_solve_banded` takes it."""
    return cholesky_banded(bands, check_finite=False), False


def posterior_variance(
    contrasts: Contrasts, intensity: float, noise_variance: FloatArray, time: FloatArray, *, order: int
) -> FloatArray:
    """Return the posterior variance of the path's derivative of some order.

    Parameters
    ----------
    contrasts : Contrasts
        Of the n samples.
    intensity : float
        q.
    noise_variance : ndarray, shape (n,)
        Of the samples.
    time : ndarray, shape (m,)
        Inside the samples, in the unit of `contrasts.time`, rising.
    order : int
        0, 1 or 2.

    Returns
    -------
    ndarray, shape (m,)

    Notes
    -----
    With ℓ the weights that a parabola through the three nearest samples y gives to them, u = x⁽ᵏ⁾(t) - ℓᵀ y has the
    same posterior variance as x⁽ᵏ⁾(t), and depends on no start: var(u | d) = var u - cᵀ M⁻¹ c, where c = cov(d, u)
    has six entries and M = q R + Cᵀ Σ C is the covariance of the contrasts d. The six rows of M are all that is
    solved: what the rows before and behind them take away is in the last rows of two Cholesky factors, one from either
    end.
    """
    bands = intensity * contrasts.process + contrasts.noise(noise_variance)
    mirrored = np.zeros_like(bands)
    for lag in range(ORDER + 1):
        mirrored[ORDER - lag, lag:] = bands[ORDER - lag, lag:][::-1]
    before, behind = factor(bands)[0], factor(mirrored)[0]
    row, column = np.indices((TOUCHED, TOUCHED))
    banded = np.abs(row - column) <= ORDER
    diagonal = np.where(banded, ORDER - np.abs(row - column), 0)
    variance = np.empty(len(time))
    for first in range(0, len(time), CHUNK):
        part = slice(first, first + CHUNK)
        start, prior, covariance = _local_covariance(contrasts, intensity, noise_variance, time[part], order)
        block = banded * bands[diagonal, start[:, None, None] + np.maximum(row, column)]
        block[:, :ORDER, :ORDER] -= _eliminated(before, start)
        block[:, -ORDER:, -ORDER:] -= _eliminated(behind, bands.shape[1] - TOUCHED - start)[:, ::-1, ::-1]
        solution = np.linalg.solve(block, covariance[..., None])[..., 0]
        variance[part] = prior - np.einsum("mj,mj->m", covariance, solution)
    return np.maximum(variance, 0.0)


def _eliminated(upper: FloatArray, start: IntArray) -> FloatArray:
    """Return what eliminating all rows before `start` takes from the three rows from there on, shape (m, 3, 3)."""
    back, ahead = np.arange(1, ORDER + 1)[:, None], np.arange(ORDER)
    reached = back + ahead <= ORDER
    part = reached * upper[np.where(reached, ORDER - back - ahead, 0), start[:, None, None] + ahead]
    return np.asarray(np.swapaxes(part, 1, 2) @ part)


def _local_covariance(
    contrasts: Contrasts, intensity: float, noise_variance: FloatArray, time: FloatArray, order: int
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the first contrast that u touches, var u, and the covariance of u with six contrasts from there on."""
    knots = contrasts.time
    middle = np.clip(np.searchsorted(knots, time, side="right") - 1, 1, len(knots) - 2)
    start = np.clip(middle - STENCIL // 2, 0, len(knots) - STENCIL)
    local = sliding_window_view(knots, STENCIL)[start] - knots[start][:, None]
    here = (time - knots[start])[:, None]
    nearest = (middle - start)[:, None] + np.arange(-1, 2)
    three = np.take_along_axis(local, nearest, axis=1)
    parabola = _parabola(three, here, order)
    weights = np.zeros_like(local)
    np.put_along_axis(weights, nearest, parabola, axis=1)

    noise = weights * sliding_window_view(noise_variance, STENCIL)[start]
    between = _process_covariance(local[:, :, None], three[:, None, :], 0, 0)
    across = _process_covariance(here, local, order, 0)
    with_samples = intensity * (across - np.einsum("mij,mj->mi", between, parabola)) - noise
    own = _process_covariance(here, here, order, order)[:, 0] - np.sum(weights * across, axis=1)
    prior = intensity * own - np.sum(weights * with_samples, axis=1)
    rows = sliding_window_view(contrasts.weights, TOUCHED, axis=0)[start]
    windows = sliding_window_view(with_samples, TOUCHED, axis=1)
    return start, prior, np.einsum("mkj,mkj->mj", rows, windows)


def _parabola(nodes: FloatArray, here: FloatArray, order: int) -> FloatArray:
    """Return the weights of three nodes in the derivative of the parabola through them, shape (m, 3)."""
    one, two = np.roll(nodes, -1, axis=1), np.roll(nodes, -2, axis=1)
    top = ((here - one) * (here - two), 2 * here - one - two, np.full_like(nodes, 2.0))[order]
    return top / ((nodes - one) * (nodes - two))


def _process_covariance(s: FloatArray, r: FloatArray, s_order: int, r_order: int) -> FloatArray:
    """Return cov(x⁽ᵃ⁾(s), x⁽ᵇ⁾(r)) of a thrice integrated white noise that starts from zero."""
    p, w = ORDER - 1 - s_order, ORDER - 1 - r_order
    both = np.minimum(s, r)
    powers = [_powers(base, most) for base, most in ((s - both, p), (r - both, w), (both, p + w + 1))]
    total = np.zeros(both.shape)
    for i in range(p + 1):
        for j in range(w + 1):
            if i == p or j == w:  # s or r is the earlier one: one of the differences is zero
                binomials = math.comb(p, i) * math.comb(w, j) / (i + j + 1)
                total += binomials * powers[0][p - i] * powers[1][w - j] * powers[2][i + j + 1]
    return total / (math.factorial(p) * math.factorial(w))


def _powers(base: FloatArray, most: int) -> list[FloatArray]:
    """Return the powers 0 to `most`; NumPy's own take a logarithm each."""
    return list(itertools.accumulate(range(most), lambda power, _: power * base, initial=np.ones_like(base)))


def draw_process(time: FloatArray, intensity: float, rng: np.random.Generator, count: int) -> FloatArray:
    """Draw paths with random-walk acceleration that start from rest at zero.

    Returns
    -------
    ndarray, shape (3, n, count)
        Position, velocity and acceleration at the times.
    """
    step = np.diff(time)[:, None]
    factor_of_unit = np.linalg.cholesky(np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]]))
    kicks = np.einsum("ij,jnc->inc", factor_of_unit, rng.standard_normal((3, len(step), count))) * math.sqrt(intensity)
    paths = np.zeros((3, len(time), count))
    np.cumsum(kicks[2] * step**0.5, axis=0, out=paths[2, 1:])
    np.cumsum(kicks[1] * step**1.5 + paths[2, :-1] * step, axis=0, out=paths[1, 1:])
    np.cumsum(kicks[0] * step**2.5 + (paths[1, :-1] + paths[2, :-1] * step / 2) * step, axis=0, out=paths[0, 1:])
    return paths
