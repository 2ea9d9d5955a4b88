"""Repeats that do not belong to the others."""

import math

import numpy as np
from scipy.stats import t as student_t

from tagsway.errors import InputError
from tagsway.model import FloatArray, IntArray, Notice, Rejection

LEAST_FOR_TEST = 3
"""Of two values neither is the outlier."""

LEAST_FOR_SEVERAL = 15
"""Rosner's limits hold for several outliers from here on; below, one is looked for."""

SAME = 1e-12
"""A standard deviation below this share of the mean is rounding: the values are all the same."""


def reject_beyond_sigma(values: FloatArray, *, sigmas: float = 3.0) -> Rejection:
    """Reject what lies more than 3 standard deviations from the mean, once.

    Parameters
    ----------
    values : ndarray, shape (n,)
        One number a repeat; NaN where there is none.
    sigmas : float
        Half the width of what is kept, in standard deviations s (with n - 1) of all values.

    Returns
    -------
    Rejection
        With a notice "rejection_powerless" where n is so small that nothing could have been rejected.

    Notes
    -----
    An outlier widens s as well: the largest possible ``|x - mean| / s`` is (n - 1) / √n [1]_, which passes 3 only from
    n = 11 on. Prefer `reject_by_esd`, which knows how large the farthest of n values may be.

    References
    ----------
    .. [1] R. E. Shiffler, The American Statistician 42 (1988) 79-80.
    """
    if not sigmas > 0:
        raise InputError(
            f"a rejection at ±{sigmas:g} standard deviations is none: expected a positive number, such as 3"
        )
    values, finite = _checked(values)
    n = int(np.count_nonzero(finite))
    kept = finite.copy()
    if n >= LEAST_FOR_TEST:
        mean, std = _moments(values[finite])
        kept[finite] = ~(np.abs(values[finite] - mean) > sigmas * std) if std > 0 else True
    notices: tuple[Notice, ...] = ()
    largest = (n - 1) / math.sqrt(n) if n else 0.0
    if not largest > sigmas:
        message = (
            f"±{sigmas:g} standard deviations cannot reject any of {n} repeats: the farthest of them lies at most "
            f"{largest:.2f} from the mean; Grubbs' test or generalised ESD can"
        )
        notices = (Notice(code="rejection_powerless", message=message),)
    return Rejection(method="3-sigma", kept=kept, notices=notices)


def reject_by_grubbs(values: FloatArray, *, level: float = 0.05) -> Rejection:
    """Reject the farthest value where Grubbs' two-sided test says so: at most one.

    Parameters
    ----------
    values : ndarray, shape (n,)
        One number a repeat; NaN where there is none.
    level : float
        Chance to reject a good value of a clean normal set.

    Returns
    -------
    Rejection
        Two outliers can hide each other: of 15 values or more take `reject_by_esd`.
    """
    esd = _reject(values, most=1, level=level)
    return Rejection(method="grubbs", kept=esd.kept, notices=esd.notices)


def reject_by_esd(values: FloatArray, *, most: int | None = None, level: float = 0.05) -> Rejection:
    """Reject by the generalised extreme Studentised deviate test.

    Parameters
    ----------
    values : ndarray, shape (n,)
        One number a repeat; NaN where there is none.
    most : int, optional
        Outliers to look for; by default one below 15 values (then it is Grubbs' test), else a fifth of them.
    level : float
        Chance to reject any good value of a clean normal set.

    Returns
    -------
    Rejection

    Notes
    -----
    The values are taken off one by one, farthest first; as many are outliers as the last step at which the farthest
    passes its limit, so that one outlier cannot hide another [1]_. For values that are about normal, not for a
    skewed set such as damping ratios of 1e-4: take their logarithm.

    References
    ----------
    .. [1] B. Rosner, Technometrics 25 (1983) 165-172.
    """
    return _reject(values, most=most, level=level)


def grubbs_limit(n: int, *, level: float = 0.05) -> float:
    """Return the largest ``|x - mean| / s`` of n normal values, passed with the chance `level`.

    Parameters
    ----------
    n : int
        Values, 3 or more.
    level : float
        Two-sided.

    Returns
    -------
    float
        (n - 1) / √n · √(t² / (n - 2 + t²)), t the quantile 1 - level / (2 n) of Student's t with n - 2 degrees [1]_.

    References
    ----------
    .. [1] F. E. Grubbs, Technometrics 11 (1969) 1-21.
    """
    if not n >= LEAST_FOR_TEST:
        raise InputError(f"an outlier cannot be told among {n} values: expected at least {LEAST_FOR_TEST}")
    if not 0 < level < 1:
        raise InputError(f"a level of significance is {level:g}: expected a chance between 0 and 1, such as 0.05")
    return float(_grubbs_limits(np.array([n]), level)[0])


def _grubbs_limits(n: IntArray, level: float) -> FloatArray:
    t: FloatArray = np.asarray(student_t.isf(level / (2 * n), n - 2))
    limits: FloatArray = (n - 1) / np.sqrt(n) * np.sqrt(t**2 / (n - 2 + t**2))
    return limits


def _reject(values: FloatArray, *, most: int | None, level: float) -> Rejection:
    values, finite = _checked(values)
    kept = finite.copy()
    n = int(np.count_nonzero(finite))
    if n < LEAST_FOR_TEST:
        message = f"{n} repeats do not tell an outlier: film at least {LEAST_FOR_TEST}"
        return Rejection(method="esd", kept=kept, notices=(Notice(code="rejection_powerless", message=message),))
    if most is None:
        most = 1 if n < LEAST_FOR_SEVERAL else n // 5
    if not 1 <= most <= n - 2:
        raise InputError(f"{most} outliers among {n} values: expected from 1 to {n - 2}")
    order, deviates = _take_off(values, np.flatnonzero(finite), most)
    passed = np.flatnonzero(deviates > _grubbs_limits(n - np.arange(len(deviates)), level))
    outliers = int(passed[-1]) + 1 if len(passed) else 0
    kept[order[:outliers]] = False
    return Rejection(method="esd", kept=kept)


def _take_off(values: FloatArray, left: IntArray, most: int) -> tuple[IntArray, FloatArray]:
    """Return the first `most` of the values `left`, farthest first, and how far each was off, in s of those with it.

    Where they are all the same, none is farther than another: then there are fewer.
    """
    rising = left[np.argsort(values[left], kind="stable")]
    falling = left[np.argsort(-values[left], kind="stable")]  # of equal values, the first one from either end
    ordered = values[rising]
    low, high, order, deviates = 0, len(left), [], []
    mean, std = _moments(ordered)
    squares = fresh = std**2 * (len(left) - 1)
    for _ in range(most):
        if not std > 0:
            break
        below, above = mean - ordered[low], ordered[high - 1] - mean
        lowest, highest = rising[low], falling[len(left) - high]
        is_low = below > above or (below == above and lowest < highest)
        order.append(lowest if is_low else highest)
        deviates.append(max(below, above) / std)
        low, high = (low + 1, high) if is_low else (low, high - 1)
        many = high - low
        off = -below if is_low else above
        squares -= off**2 * (many + 1) / many
        if squares < fresh / 2:  # what is left is no longer lost in the rounding of what was taken off
            mean, std = _moments(ordered[low:high])
            squares = fresh = std**2 * (many - 1)
        else:
            mean -= off / many
            std = math.sqrt(squares / (many - 1))
    return np.array(order, dtype=int), np.array(deviates)


def _checked(values: FloatArray) -> tuple[FloatArray, np.ndarray[tuple[int], np.dtype[np.bool_]]]:
    values = np.asarray(values, dtype=float)
    if values.ndim != 1:
        raise InputError(f"repeats are one number each, not an array of shape {values.shape}")
    return values, np.isfinite(values)


def _moments(values: FloatArray) -> tuple[float, float]:
    """Return mean and standard deviation; the latter is 0 where the values differ by rounding only."""
    mean, std = float(np.mean(values)), float(np.std(values, ddof=1))
    return mean, std if std > SAME * abs(mean) else 0.0
