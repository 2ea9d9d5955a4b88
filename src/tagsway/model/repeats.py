"""Many measurements of one quantity: what was left out, how much they scatter, and why."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from tagsway.model.arrays import BoolArray
from tagsway.model.estimate import FORBID_UNKNOWN, Estimate, Notice


@dataclass(frozen=True, slots=True, kw_only=True)
class Rejection:
    """Which of some repeats are kept.

    Parameters
    ----------
    method : {"3-sigma", "grubbs", "esd"}
        How the others were found.
    kept : ndarray of bool, shape (n,)
        False for an outlier, and for a repeat without a number.
    notices : tuple of Notice
        Where the method could not have found anything.
    """

    method: Literal["3-sigma", "grubbs", "esd"]
    kept: BoolArray
    notices: tuple[Notice, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class RepeatSummary:
    """What a table says of some repeats; None for what so few, or numbers of both signs, do not tell.

    Parameters
    ----------
    n : int
        Repeats with a number.
    median : float
        In the unit of the values.
    deviation_percent : float or None
        ± deviation: 100 (max - min) / (max + min); of positive numbers.
    std : float or None
        s, with n - 1, in the unit of the values.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    n: int
    median: float
    deviation_percent: float | None
    std: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomEffects:
    """Repeats that differ, each measured with its own error.

    Parameters
    ----------
    n : int
        Repeats.
    mean : Estimate
        Of the population from which the repeats come.
    between_std : Estimate
        Standard deviation between repeats: the spread that a shaper has to bear. Its interval is not symmetric.
    within_std : float
        Typical standard error of a single repeat.
    heterogeneity : float
        Cochran's Q: about n - 1 where nothing but measurement error makes the repeats differ.
    p_value : float
        Chance of a Q as large without any difference between repeats.
    method : {"reml", "dersimonian-laird"}
        Of the between-repeat variance.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    n: int
    mean: Estimate
    between_std: Estimate
    within_std: float
    heterogeneity: float
    p_value: float
    method: Literal["reml", "dersimonian-laird"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FactorEffect:
    """What one factor does to a quantity while all others stay as they are.

    Parameters
    ----------
    factor : str
        Its name.
    level : str or None
        Of a categorical factor; None for a continuous one.
    reference : str or None
        The level that it is compared with.
    n : int
        Measurements at the level; all of them for a continuous factor.
    effect : Estimate
        The difference from the reference, in the unit of the quantity; of a continuous factor the slope.
    p_value : float
        Chance of an effect as large, either way, where there is none.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    factor: str
    level: str | None
    reference: str | None
    n: int
    effect: Estimate
    p_value: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Unanswered:
    """A factor, or one level of it, whose effect the data do not tell.

    Parameters
    ----------
    factor : str
        Its name.
    level : str or None
        None for the whole factor.
    reason : str
        Why.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    factor: str
    level: str | None
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FactorModel:
    """A linear model of one quantity in several factors.

    Parameters
    ----------
    n : int
        Measurements.
    effects : tuple of FactorEffect
        That the data tell.
    unanswered : tuple of Unanswered
        That they do not.
    grouped_by : str or None
        A factor that is nested in another: measurements that share its level are no independent repeats, and the
        errors are those between its levels.
    residual_std : float
        s of what the factors leave, in the unit of the quantity.
    degrees_of_freedom : int
        Of the errors: independent groups of measurements less coefficients.
    lack_of_fit_p : float or None
        Chance of means that lie as far from this model where the effects simply add up; small where factors interact
        or a slope is bent. None where no combination of levels was repeated.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    n: int
    effects: tuple[FactorEffect, ...]
    unanswered: tuple[Unanswered, ...]
    grouped_by: str | None
    residual_std: float
    degrees_of_freedom: int
    lack_of_fit_p: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class RepeatDifference:
    """Some repeats minus some others, of the same quantity; None for what so few do not tell.

    Parameters
    ----------
    n_reference, n : int
        Repeats of either.
    difference, std : float or None
        Of the means, and its standard error.
    ci95 : tuple of float or None
        Welch's interval of that difference.
    median_difference : float or None
        Of the medians.
    ratio_percent : float or None
        Of the means: the reference is 100.
    ratio_ci95 : tuple of float or None
        Fieller's interval; None where the reference is not surely different from 0.
    test : {"welch", "mann-whitney"} or None
        Which one `p_value` is of.
    p_value : float or None
        Chance of a difference as large where there is none; two-sided.
    rank_p_value : float or None
        The same by ranks alone: it needs no normal repeats, and cannot be small for few.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    n_reference: int
    n: int
    difference: float | None
    std: float | None
    ci95: tuple[float, float] | None
    median_difference: float | None
    ratio_percent: float | None
    ratio_ci95: tuple[float, float] | None
    test: Literal["welch", "mann-whitney"] | None
    p_value: float | None
    rank_p_value: float | None
