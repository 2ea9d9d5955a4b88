"""How coloured a residual is, and what that costs an estimate."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from tagsway.model import FloatArray, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Colour:
    """An autoregressive model of a residual: e_i = Σ a_k e_(i-k) + white.

    Parameters
    ----------
    coefficients : ndarray, shape (order,)
        a; empty for white noise.
    variance : float
        Of the residual.
    innovation : float
        Variance of the white part.
    """

    coefficients: FloatArray
    variance: float
    innovation: float

    def density(self, turn_rad: FloatArray | float) -> FloatArray:
        """Return the power density over that of white noise of the same variance.

        Parameters
        ----------
        turn_rad : ndarray or float
            Angular frequency times the sample step.

        Returns
        -------
        ndarray
            1 for white noise.
        """
        if not self.variance > 0:
            return np.ones_like(np.asarray(turn_rad, dtype=float))
        lags = np.arange(1, len(self.coefficients) + 1)
        gain = 1 - np.exp(-1j * np.multiply.outer(turn_rad, lags)) @ self.coefficients
        return np.asarray(self.innovation / self.variance / np.abs(gain) ** 2, dtype=float)

    def meat(self, rows: FloatArray, place: IntArray) -> FloatArray:
        """Return Jᵀ R J with R the residual's covariance.

        Parameters
        ----------
        rows : ndarray, shape (n, p)
            J.
        place : ndarray of int, shape (n,)
            Of each row on the even grid of samples; what is missing there costs nothing and gives nothing.

        Returns
        -------
        ndarray, shape (p, p)
        """
        if self.coefficients.size == 0:
            return self.variance * rows.T @ rows
        grid = np.zeros((int(place[-1]) + 1, rows.shape[1]))
        grid[place] = rows
        pad = np.zeros((min(len(grid), 2000), rows.shape[1]))
        shaped = lfilter([1.0], np.concatenate([[1.0], -self.coefficients]), np.vstack([grid[::-1], pad]), axis=0)
        return self.innovation * np.asarray(shaped.T @ shaped, dtype=float)


def grid_places(time_s: FloatArray) -> IntArray:
    """Return the place of each sample on the even grid that fits them, or their rank where they are not even.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Strictly increasing, n at least 2.

    Returns
    -------
    ndarray of int, shape (n,)
        From 0, strictly increasing.
    """
    step = float(np.median(np.diff(time_s)))
    place: IntArray = np.rint((time_s - time_s[0]) / step).astype(np.int64)
    if np.all(np.diff(place) > 0) and place[-1] < 20 * len(time_s):
        return place
    return np.arange(len(time_s), dtype=np.int64)


def find_colour(residual: FloatArray, place: IntArray, *, fitted: int = 0) -> Colour:
    """Fit an autoregression to a residual with gaps.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        At the samples that exist.
    place : ndarray of int, shape (n,)
        Their places on an even grid.
    fitted : int
        Parameters that were fitted to make this residual; they took their share of the variance.

    Returns
    -------
    Colour
        White unless the Bayesian information criterion pays for more.

    Notes
    -----
    Yule-Walker equations on the autocovariance of the pairs that exist.
    """
    n = len(residual)
    variance = float(residual @ residual) / max(n - fitted, 1)
    white = Colour(coefficients=np.empty(0), variance=variance, innovation=variance)
    order_most = min(20, n // 8)
    if order_most < 1 or not variance > 0:
        return white
    grid, there = np.zeros(int(place[-1]) + 1), np.zeros(int(place[-1]) + 1)
    grid[place], there[place] = residual, 1.0
    length = len(grid)
    covariance = np.array([grid[k:] @ grid[: length - k] for k in range(order_most + 1)])
    pairs = np.array([there[k:] @ there[: length - k] for k in range(order_most + 1)])
    # Per pair, then tapered as the full record would be, which keeps the sequence positive definite.
    covariance = covariance / np.maximum(pairs, 1) * (1 - np.arange(order_most + 1) / length)
    best, best_score = white, 0.0
    for order in range(1, order_most + 1):
        try:
            a = solve_toeplitz(covariance[:order], covariance[1 : order + 1])
        except np.linalg.LinAlgError:
            break
        share = 1 - float(a @ covariance[1 : order + 1]) / covariance[0]
        if not 0 < share <= 1 or np.max(np.abs(np.roots(np.concatenate([[1.0], -a]))), initial=0.0) >= 0.9999:
            break
        score = n * np.log(share) + order * np.log(n)
        if score < best_score:
            best, best_score = Colour(coefficients=a, variance=variance, innovation=variance * share), score
    return best
