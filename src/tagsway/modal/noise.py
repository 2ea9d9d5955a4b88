"""How coloured a residual is, and what that costs an estimate."""

from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from tagsway.model import FloatArray, IntArray

_MOST_ROUNDS, _SETTLED = 6, 1e-6


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
    count : int
        Samples that it was found from.
    """

    coefficients: FloatArray
    variance: float
    innovation: float
    count: int

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

    def freedom_at(self, turn_rad: float) -> float:
        """Return the degrees of freedom of the power density there, 2 / var(ln S): how well it is known."""
        a, order = self.coefficients, len(self.coefficients)
        if order == 0 or not self.innovation > 0:
            return float(self.count)
        kernel = np.exp(-1j * turn_rad * np.arange(1, order + 1))
        slope = 2 * (kernel / (1 - kernel @ a)).real
        # The asymptotic covariance of the coefficients is Γ⁻¹ times the innovation's variance over n.
        turns = np.linspace(0, np.pi, 4097)
        density = self.density(turns) * self.variance
        lags = np.array([np.trapezoid(density * np.cos(k * turns), turns) / np.pi for k in range(order)])
        try:
            spread = float(slope @ solve_toeplitz(lags, slope)) * self.innovation
        except np.linalg.LinAlgError:
            return 1.0
        return 2 * self.count / (max(spread, 0.0) + 2)

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


def find_colour(residual: FloatArray, place: IntArray, rows: FloatArray) -> Colour:
    """Fit an autoregression to a residual with gaps.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        At the samples that exist.
    place : ndarray of int, shape (n,)
        Their places on an even grid.
    rows : ndarray, shape (n, p)
        Derivatives of the model that left this residual: the fit took its share of the noise along them.

    Returns
    -------
    Colour
        White unless the Bayesian information criterion pays for more.

    Notes
    -----
    Yule-Walker equations on the autocovariance of the pairs that exist. A fit takes most where coloured noise is
    strongest, so the residual looks whiter than the noise was: E[r rᵀ] = (I - P) Σ (I - P), with P the projection on
    the rows. What is missing is added, with Σ of the last colour, until it no longer changes.
    """
    n, fitted = rows.shape
    variance = float(residual @ residual) / max(n - fitted, 1)
    white = Colour(coefficients=np.empty(0), variance=variance, innovation=variance, count=n)
    order_most = min(20, n // 8)
    if order_most < 1 or not variance > 0:
        return white
    length = int(place[-1]) + 1
    grid, there = np.zeros(length), np.zeros(length)
    grid[place], there[place] = residual, 1.0
    lags = np.arange(order_most + 1)
    pairs = np.maximum([there[k:] @ there[: length - k] for k in lags], 1.0)
    products = np.array([grid[k:] @ grid[: length - k] for k in lags])
    # Per pair, then tapered as the full record would be, which keeps the sequence positive definite.
    covariance = products / pairs * (1 - lags / length)
    best = _choose_order(covariance, n)
    if best is None:
        return white
    order = len(best.coefficients)
    basis = np.zeros((length, fitted))
    basis[place] = np.linalg.qr(rows)[0]
    size = next_fast_len(3 * length, real=True)
    spectra = rfft(basis, size, axis=0)
    for _ in range(_MOST_ROUNDS):
        coloured = irfft(spectra * _power(best, size)[:, None], size, axis=0)[:length] * there[:, None]
        taken = _taken_by_the_fit(coloured, basis, order)
        fuller = _yule_walker((products[: order + 1] + taken) / pairs[: order + 1], n)
        if fuller is None:
            break
        settled = abs(fuller.variance - best.variance) < _SETTLED * best.variance and np.allclose(
            fuller.coefficients, best.coefficients, rtol=0.0, atol=_SETTLED
        )
        best = fuller
        if settled:
            break
    return best


def _choose_order(covariance: FloatArray, count: int) -> Colour | None:
    """Return the autoregression that the Bayesian information criterion pays for; None for white noise."""
    # Levinson's recursion gives the innovation of every order on its way.
    a, left = np.empty(0), float(covariance[0])
    best, best_score = 0, 0.0
    for order in range(1, len(covariance)):
        mirrored = float(covariance[order] - a @ covariance[order - 1 : 0 : -1]) / left
        if not abs(mirrored) < 1:
            break
        a = np.append(a - mirrored * a[::-1], mirrored)
        left *= 1 - mirrored**2
        score = count * float(np.log(left / covariance[0])) + order * float(np.log(count))
        if score < best_score:
            best, best_score = order, score
    return _yule_walker(covariance[: best + 1], count) if best else None


def _yule_walker(covariance: FloatArray, count: int) -> Colour | None:
    order = len(covariance) - 1
    try:
        a = solve_toeplitz(covariance[:order], covariance[1:])
    except np.linalg.LinAlgError:
        return None
    share = 1 - float(a @ covariance[1:]) / covariance[0]
    if not 0 < share <= 1 or np.max(np.abs(np.roots(np.concatenate([[1.0], -a]))), initial=0.0) >= 0.9999:
        return None
    variance = float(covariance[0])
    return Colour(coefficients=a, variance=variance, innovation=variance * share, count=count)


def _power(colour: Colour, size: int) -> FloatArray:
    """Return the power spectrum at the frequencies of a transform of so many samples."""
    return np.asarray(colour.innovation / np.abs(rfft(np.append(1.0, -colour.coefficients), size)) ** 2, dtype=float)


def _taken_by_the_fit(coloured: FloatArray, basis: FloatArray, order: int) -> FloatArray:
    """Return the lag products that a residual lacks: of P Σ + Σ P - P Σ P, for orthonormal rows with gaps.

    `coloured` is Σ times the rows, where there are samples.
    """
    left = coloured - basis @ (basis.T @ coloured)
    n = len(basis)
    return np.array(
        [np.vdot(basis[k:], left[: n - k]) + np.vdot(coloured[k:], basis[: n - k]) for k in range(order + 1)]
    )
