"""Errors of a smoothing spline: variances at any time, and whole paths drawn from the posterior."""

import math

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import cho_solve_banded, cholesky_banded

from tagsway.filters.contrasts import ORDER, Contrasts
from tagsway.model import FloatArray

STENCIL = 9
"""Samples around a time that touch the same contrasts as the three nearest of them."""

CHUNK = 256
"""Times whose variances are solved for together."""


def factor(bands: FloatArray) -> tuple[FloatArray, bool]:
    """Return the banded Cholesky factor as `scipy.linalg.cho_solve_banded` takes it."""
    return cholesky_banded(bands, check_finite=False), False


def posterior_variance(
    contrasts: Contrasts, intensity: float, noise_variance: FloatArray, time: FloatArray, *, order: int, memory: float
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
    memory : float
        Smoothing time constant in samples; what lies 15 of them away is left out (a part in 10⁶ of the variance).

    Returns
    -------
    ndarray, shape (m,)

    Notes
    -----
    With ℓ the weights that a parabola through the three nearest samples y gives to them, u = x⁽ᵏ⁾(t) - ℓᵀ y has the
    same posterior variance as x⁽ᵏ⁾(t), and depends on no start: var(u | d) = var u - cᵀ M⁻¹ c, where c = cov(d, u)
    has six entries and M = q R + Cᵀ Σ C is the covariance of the contrasts d.
    """
    bands = intensity * contrasts.process + contrasts.noise(noise_variance)
    margin = math.ceil(15 * memory) + STENCIL
    variance = np.empty(len(time))
    for first in range(0, len(time), CHUNK):
        part = slice(first, first + CHUNK)
        start, prior, covariance = _local_covariance(contrasts, intensity, noise_variance, time[part], order)
        low, high = max(start[0] - margin, 0), start[-1] + covariance.shape[1] + margin
        right = np.zeros((bands[:, low:high].shape[1], len(start)))
        rows = start[:, None] - low + np.arange(covariance.shape[1])
        right[rows, np.arange(len(start))[:, None]] = covariance
        solution = cho_solve_banded(factor(bands[:, low:high]), right, check_finite=False)
        variance[part] = prior - np.sum(right * solution, axis=0)
    return np.maximum(variance, 0.0)


def _local_covariance(
    contrasts: Contrasts, intensity: float, noise_variance: FloatArray, time: FloatArray, order: int
) -> tuple[np.ndarray, FloatArray, FloatArray]:
    """Return the first contrast that u touches, var u, and the covariance of u with six contrasts from there on."""
    knots = contrasts.time
    middle = np.clip(np.searchsorted(knots, time, side="right") - 1, 1, len(knots) - 2)
    start = np.clip(middle - STENCIL // 2, 0, len(knots) - STENCIL)
    local = sliding_window_view(knots, STENCIL)[start] - knots[start][:, None]
    here = (time - knots[start])[:, None]
    nearest = (middle - start)[:, None] + np.arange(-1, 2)
    weights = np.zeros_like(local)
    np.put_along_axis(weights, nearest, _parabola(np.take_along_axis(local, nearest, axis=1), here, order), axis=1)

    noise = weights * sliding_window_view(noise_variance, STENCIL)[start]
    between = _process_covariance(local[:, :, None], local[:, None, :], 0, 0)
    across = _process_covariance(here, local, order, 0)
    with_samples = intensity * (across - np.einsum("mij,mj->mi", between, weights)) - noise
    own = _process_covariance(here, here, order, order)[:, 0] - np.sum(weights * across, axis=1)
    prior = intensity * own - np.sum(weights * with_samples, axis=1)
    rows = sliding_window_view(contrasts.weights, STENCIL - ORDER, axis=0)[start]
    windows = sliding_window_view(with_samples, STENCIL - ORDER, axis=1)
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
    total = np.zeros(both.shape)
    for i in range(p + 1):
        for j in range(w + 1):
            binomials = math.comb(p, i) * math.comb(w, j) / (i + j + 1)
            total += binomials * (s - both) ** (p - i) * (r - both) ** (w - j) * both ** (i + j + 1)
    return total / (math.factorial(p) * math.factorial(w))


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
