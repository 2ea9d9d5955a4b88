"""Two sets of repeats against each other: by how much they differ, and whether chance explains it."""

from dataclasses import replace
from math import comb, sqrt
from typing import Literal

import numpy as np
from scipy.stats import PermutationMethod, binomtest, mannwhitneyu
from scipy.stats import t as student_t

from tagsway.errors import InputError
from tagsway.model import FloatArray, RepeatDifference

MOST_ORDERS = 20_000
"""Ways to deal the values to the two sets that are all gone through; beyond, the sum of ranks is taken as normal."""

SAME = 1e-12
"""A standard error below this share of the values is rounding: the repeats are all the same."""


def compare_repeats(reference: FloatArray, other: FloatArray) -> RepeatDifference:
    """Return by how much some repeats differ from others.

    Parameters
    ----------
    reference, other : ndarray, shape (n,), (m,)
        The same quantity; NaN is left out, infinity stands for "longer than was watched".

    Returns
    -------
    RepeatDifference
        Other minus reference.

    Notes
    -----
    Welch's test of the means [1]_: the two may scatter differently, as shaped and unshaped moves do, and few repeats
    suffice where they are about normal. Beside it the rank test of Mann and Whitney, exact for few repeats; it alone
    is left where a value is not known but larger than all (infinite), or nothing scatters. A single repeat of either
    leaves the difference, and no test at all. The repeats must be independent: a product that is gripped once and
    moved ten times is one repeat of the grip.

    References
    ----------
    .. [1] B. L. Welch, Biometrika 34 (1947) 28-35; the ratio: E. C. Fieller, J. R. Stat. Soc. B 16 (1954) 175-185.
    """
    a, b = _seen(reference), _seen(other)
    rank_p = _rank_p_value(a, b) if len(a) > 1 and len(b) > 1 else None
    by_ranks = RepeatDifference(
        n_reference=len(a),
        n=len(b),
        difference=None,
        std=None,
        ci95=None,
        median_difference=_difference_of_medians(a, b),
        ratio_percent=None,
        ratio_ci95=None,
        test=None if rank_p is None else "mann-whitney",
        p_value=rank_p,
        rank_p_value=rank_p,
    )
    if not (len(a) and len(b) and np.isfinite(a).all() and np.isfinite(b).all()):
        return by_ranks
    first, second = float(np.mean(a)), float(np.mean(b))
    plain = replace(by_ranks, difference=second - first, ratio_percent=100 * second / first if abs(first) > 0 else None)
    if rank_p is None:
        return plain
    errors = _error_of_mean(a), _error_of_mean(b)
    std = sqrt(errors[0] + errors[1])
    if not std > SAME * max(abs(first), abs(second)):
        return plain
    freedom = _freedom(errors, (len(a), len(b)))
    half = float(student_t.ppf(0.975, freedom)) * std
    return replace(
        plain,
        std=std,
        ci95=(plain.difference - half, plain.difference + half) if plain.difference is not None else None,
        ratio_ci95=_fieller((first, second), errors, (len(a), len(b))),
        test="welch",
        p_value=float(2 * student_t.sf(abs(second - first) / std, freedom)),
    )


def adjust_holm(p_values: FloatArray) -> FloatArray:
    """Correct p values for their number, by Holm's step-down method.

    Parameters
    ----------
    p_values : ndarray, shape (n,)
        Of tests that may depend on each other in any way; NaN stays NaN and does not count.

    Returns
    -------
    ndarray, shape (n,)
        Of those below a level, none is a false one but with that chance [1]_.

    References
    ----------
    .. [1] S. Holm, Scand. J. Stat. 6 (1979) 65-70.
    """
    p = np.asarray(p_values, dtype=float)
    adjusted: FloatArray = np.full(p.shape, np.nan)
    order = np.argsort(p)[: np.count_nonzero(np.isfinite(p))]  # NaN is sorted to the end
    steps = (len(order) - np.arange(len(order))) * p[order]
    adjusted[order] = np.minimum(np.maximum.accumulate(steps), 1.0)
    return adjusted


def rate_gain(
    reference_s: FloatArray, other_s: FloatArray, *, rest_s: float = 0.0
) -> tuple[float, float | None, tuple[float, float] | None]:
    """Return how many picks a minute a shorter time gains.

    Parameters
    ----------
    reference_s, other_s : ndarray, shape (n,), (m,)
        Times of the move; finite.
    rest_s : float
        Of a pick beside the move.

    Returns
    -------
    gained : float
        60 / (mean other + rest) - 60 / (mean reference + rest).
    std : float or None
        Its standard error, to first order; None for a single repeat of either.
    ci95 : tuple of float or None
        With Welch's degrees of freedom.
    """
    a, b = _seen(reference_s), _seen(other_s)
    whole = float(np.mean(a)) + rest_s, float(np.mean(b)) + rest_s
    if not (rest_s >= 0 and min(whole) > 0):
        raise InputError(f"a pick of {min(whole):g} s: expected a time of more than 0")
    gained = 60 / whole[1] - 60 / whole[0]
    if not (len(a) > 1 and len(b) > 1):
        return gained, None, None
    errors = _error_of_mean(a) * (60 / whole[0] ** 2) ** 2, _error_of_mean(b) * (60 / whole[1] ** 2) ** 2
    std = sqrt(errors[0] + errors[1])
    if not std > 0:
        return gained, None, None
    half = float(student_t.ppf(0.975, _freedom(errors, (len(a), len(b))))) * std
    return gained, std, (gained - half, gained + half)


def share_interval(kept: int, n: int) -> tuple[float, float]:
    """Return the exact 95 % interval of a share of which `kept` of `n` were seen (Clopper and Pearson)."""
    found = binomtest(kept, n).proportion_ci(confidence_level=0.95, method="exact")
    return float(found.low), float(found.high)


def _seen(values: FloatArray) -> FloatArray:
    values = np.asarray(values, dtype=float)
    return values[~np.isnan(values)]


def _difference_of_medians(a: FloatArray, b: FloatArray) -> float | None:
    if not (len(a) and len(b)):
        return None
    first, second = float(np.median(a)), float(np.median(b))
    return second - first if np.isfinite([first, second]).all() else None


def _rank_p_value(a: FloatArray, b: FloatArray) -> float:
    tied = len(np.unique([*a, *b])) < len(a) + len(b)
    few = comb(len(a) + len(b), len(a)) <= MOST_ORDERS
    method: Literal["exact", "asymptotic"] | PermutationMethod = "exact" if few else "asymptotic"
    if few and tied:
        method = PermutationMethod(n_resamples=MOST_ORDERS)  # as many as there are: all of them
    return float(mannwhitneyu(b, a, alternative="two-sided", method=method).pvalue)


def _error_of_mean(values: FloatArray) -> float:
    """Return the squared standard error of a mean."""
    return float(np.var(values, ddof=1)) / len(values)


def _freedom(errors: tuple[float, float], counts: tuple[int, int]) -> float:
    """Return Welch's and Satterthwaite's degrees of freedom of a sum with these squared errors."""
    a, b = errors
    return (a + b) ** 2 / (a**2 / (counts[0] - 1) + b**2 / (counts[1] - 1))


def _fieller(
    means: tuple[float, float], errors: tuple[float, float], counts: tuple[int, int]
) -> tuple[float, float] | None:
    """Return the interval of the second mean over the first, in percent; None where it has no end."""
    first, second = means
    if not abs(first) > 0:
        return None
    scaled = errors[0] * (second / first) ** 2, errors[1]
    t2 = float(student_t.ppf(0.975, _freedom(scaled, counts)) if sum(scaled) > 0 else 0.0) ** 2
    a, b, c = first**2 - t2 * errors[0], first * second, second**2 - t2 * errors[1]
    if not (a > 0 and b**2 - a * c >= 0):
        return None
    root = sqrt(b**2 - a * c)
    return 100 * (b - root) / a, 100 * (b + root) / a
