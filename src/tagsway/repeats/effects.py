"""What differs between repeats, told apart from the error with which each was measured."""

from typing import Literal

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2
from scipy.stats import t as student_t

from tagsway.errors import InputError, NotIdentifiableError
from tagsway.model import NORMAL_95, Estimate, FloatArray, RandomEffects, Spread


def fit_random_effects(
    values: FloatArray, std: FloatArray, *, method: Literal["reml", "dersimonian-laird"] = "reml"
) -> RandomEffects:
    """Fit y_i = μ + b_i + e_i, with b_i ~ N(0, τ²) between repeats and e_i ~ N(0, s_i²) within each.

    Parameters
    ----------
    values, std : ndarray, shape (n,)
        Each repeat's value and its own standard error; a pair that is not finite is left out.
    method : {"reml", "dersimonian-laird"}
        How τ is found: by restricted maximum likelihood [2]_, or by moments [1]_.

    Returns
    -------
    RandomEffects
        The mean's interval is Hartung and Knapp's, with n - 1 degrees of freedom. τ's is the Q profile [3]_: exact
        where the s_i are right, with a lower end of 0 where measurement error alone explains the scatter; its standard
        error is that of the likelihood (where τ is 0, half of what the interval allows).

    Raises
    ------
    InputError
        For a standard error that is not positive, and for arrays that do not match.
    NotIdentifiableError
        For fewer than two repeats.

    Notes
    -----
    Do not pool repeats of different products or grippers: they are other populations. Where the s_i are too small
    (noise that is not white, a scale that differs), what they miss is counted as between repeats.

    References
    ----------
    .. [1] R. DerSimonian and N. Laird, Controlled Clinical Trials 7 (1986) 177-188.
    .. [2] W. Viechtbauer, J. Educational and Behavioral Statistics 30 (2005) 261-293.
    .. [3] W. Viechtbauer, Statistics in Medicine 26 (2007) 37-52.
    """
    y, s = _keep_finite(values, std)
    unit = float(np.median(s))  # solved in units of a typical error: the numbers may be Hz or 1e-4
    y, s = y / unit, s / unit
    moments = _by_moments(y, s)
    variance = moments if method == "dersimonian-laird" else _by_likelihood(y, s)
    q = float(_scatter(0.0, y, s))
    weight = 1 / s**2
    within = np.sqrt((y.size - 1) * weight.sum() / (weight.sum() ** 2 - (weight**2).sum()))
    return RandomEffects(
        n=y.size,
        mean=_mean(variance, y, s, unit),
        between_std=_between(variance, y, s, unit),
        within_std=float(within) * unit,
        heterogeneity=q,
        p_value=float(chi2.sf(q, y.size - 1)),
        method=method,
    )


def _keep_finite(values: FloatArray, std: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the repeats that have a value and an error."""
    y, s = np.asarray(values, dtype=float), np.asarray(std, dtype=float)
    if y.shape != s.shape or y.ndim != 1:
        raise InputError(f"each repeat has one value and one standard error, not {y.shape} and {s.shape}")
    both = np.isfinite(y) & np.isfinite(s)
    y, s = y[both], s[both]
    if not np.all(s > 0):
        raise InputError(f"a repeat's standard error is {s.min():g}: expected a positive one, from its own fit")
    if y.size < 2:
        raise NotIdentifiableError(
            f"{y.size} repeats do not tell how much repeats differ: film at least two", code="no_repeats"
        )
    return y, s


def between_repeat_spread(effects: RandomEffects, *, source: str) -> Spread:
    """Return the spread of a natural frequency that a shaper has to bear: between repeats, not within.

    Parameters
    ----------
    effects : RandomEffects
        Of the natural frequency.
    source : str
        Where it was measured.
    """
    percent = 100 * effects.between_std.value / effects.mean.value
    return Spread(source=source, natural_frequency_std_percent=percent, n=effects.n)


def _by_moments(y: FloatArray, s: FloatArray) -> float:
    w = 1 / s**2
    excess = _scatter(0.0, y, s) - (y.size - 1)
    return max(0.0, float(excess / (w.sum() - (w**2).sum() / w.sum())))


def _by_likelihood(y: FloatArray, s: FloatArray) -> float:
    """Return the τ² of the largest restricted likelihood.

    Its slope is a difference of rational functions and may vanish more than once where the errors are very unequal.
    """
    largest = float(np.var(y, ddof=1) * y.size + s.max() ** 2)
    grid = np.concatenate([[0.0], np.geomspace(1e-8 * largest, 2 * largest, 200)])
    slopes = np.array([_slope(tau2, y, s) for tau2 in grid])
    places = np.flatnonzero((slopes[:-1] > 0) & (slopes[1:] <= 0))
    roots = [0.0, *(float(brentq(_slope, grid[i], grid[i + 1], args=(y, s), xtol=1e-14)) for i in places)]
    return max(roots, key=lambda tau2: _likelihood(tau2, y, s))


def _likelihood(tau2: float, y: FloatArray, s: FloatArray) -> float:
    w = 1 / (s**2 + tau2)
    return float(0.5 * (np.log(w).sum() - np.log(w.sum()) - _scatter(tau2, y, s)))


def _slope(tau2: float, y: FloatArray, s: FloatArray) -> float:
    w = 1 / (s**2 + tau2)
    mean = w @ y / w.sum()
    return float(0.5 * (w**2 @ (y - mean) ** 2 - w.sum() + (w**2).sum() / w.sum()))


def _scatter(tau2: float, y: FloatArray, s: FloatArray) -> float:
    """Return Q(τ²) = Σ w (y - mean)², which is χ² with n - 1 degrees of freedom at the true τ²."""
    w = 1 / (s**2 + tau2)
    return float(w @ (y - w @ y / w.sum()) ** 2)


def _mean(tau2: float, y: FloatArray, s: FloatArray, unit: float) -> Estimate:
    w = 1 / (s**2 + tau2)
    value = float(w @ y / w.sum())
    std = float(np.sqrt(_scatter(tau2, y, s) / ((y.size - 1) * w.sum())))
    half = float(student_t.ppf(0.975, y.size - 1)) * std
    return Estimate(value=value * unit, std=std * unit, ci95=((value - half) * unit, (value + half) * unit))


def _between(tau2: float, y: FloatArray, s: FloatArray, unit: float) -> Estimate:
    tau = float(np.sqrt(tau2))
    low, high = (_profile(float(chi2.ppf(chance, y.size - 1)), y, s) for chance in (0.975, 0.025))
    w = 1 / (s**2 + tau2)
    information = 0.5 * float((w**2).sum() - 2 * (w**3).sum() / w.sum() + (w**2).sum() ** 2 / w.sum() ** 2)
    std = 1 / np.sqrt(information) / (2 * tau) if tau > 0 else high / NORMAL_95
    # The likelihood's maximum and the profile's ends answer different questions: near 0 they may pass one another.
    return Estimate(value=tau * unit, std=float(std) * unit, ci95=(min(low, tau) * unit, max(high, tau) * unit))


def _profile(quantile: float, y: FloatArray, s: FloatArray) -> float:
    """Return the τ at which Q falls to a quantile; 0 where it starts below."""
    if not _scatter(0.0, y, s) > quantile:
        return 0.0
    end = float(np.var(y, ddof=1) * (y.size - 1) / quantile) + 1e-12
    return float(np.sqrt(brentq(lambda tau2: _scatter(tau2, y, s) - quantile, 0.0, end)))
