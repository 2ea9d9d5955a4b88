"""Conditions beside each other: what each measured, how it differs from the first, what was promised of it."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from tagsway.model.arrays import FloatArray
from tagsway.model.estimate import FORBID_UNKNOWN, Notice
from tagsway.model.indicators import AlignedMove
from tagsway.model.repeats import RepeatDifference
from tagsway.model.result import Creator


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionSummary:
    """One quantity of one condition, as the tables of document 1 print it.

    Parameters
    ----------
    group, condition : str
        Which; the group is "" where everything was compared at once.
    quantity : str
        Its name ends in its unit.
    n : int
        Measurements that tell it, those that never settled among them.
    never : int
        Of these, how many did not settle while they were watched: longer than any that did.
    median, mean : float or None
        None where there is none, or where it is one of those that never settled.
    deviation_percent, std : float or None
        ± deviation and s of those with a number.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    group: str
    condition: str
    quantity: str
    n: int
    never: int
    median: float | None
    mean: float | None
    deviation_percent: float | None
    std: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """One quantity of a condition against the reference.

    Parameters
    ----------
    group, condition, reference, quantity : str
        What is compared with what.
    change : RepeatDifference
        Condition minus reference.
    p_holm : float or None
        p corrected for all tests of the comparison (Holm).
    significant : bool or None
        Whether that is below the comparison's level; None where nothing could be tested.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    group: str
    condition: str
    reference: str
    quantity: str
    change: RepeatDifference
    p_holm: float | None
    significant: bool | None


@dataclass(frozen=True, slots=True, kw_only=True)
class PickRate:
    """How many picks a minute a condition gains, from the motion times.

    Parameters
    ----------
    group, condition, reference : str
        What is compared with what.
    other_time_s : float
        Of a pick beside this one move.
    reference_per_min, per_min : float or None
        60 over the sum of both times; None where some never settled.
    gained, std : float or None
        The difference, and its standard error.
    ci95 : tuple of float or None
        None where there is one measurement of either.
    at_least : bool
        The reference never settled in some: `gained` then takes for its time what was watched, which is a bound.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    group: str
    condition: str
    reference: str
    other_time_s: float
    reference_per_min: float | None
    per_min: float | None
    gained: float | None
    std: float | None
    ci95: tuple[float, float] | None
    at_least: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Promise:
    """What a design or a simulation said of a condition, and what was measured.

    Parameters
    ----------
    group, condition : str
        Of which it was said.
    source : str
        The file.
    quantity : str
        As in `ConditionSummary`; "limits" for all of them.
    kind : {"planned", "at most", "all limits"}
        A value that was to be met, a limit, or all limits of the file at once.
    promised : float or None
        In the quantity's unit; None for all limits.
    share : float or None
        Of the payloads that are to keep a limit, or all of them.
    n, kept : int
        Measurements that tell it, and those that keep the limit; of a planned value `kept` is None.
    median : float or None
        Measured; None for all limits, and where most never settle.
    kept_ci95 : tuple of float or None
        Share of such picks that keep it, exactly (Clopper and Pearson); of all limits the upper end takes picks that
        tell a part to keep the rest.
    verdict : {"kept", "open", "broken"} or None
        Kept where that interval lies above the promised share, broken where it lies below.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    group: str
    condition: str
    source: str
    quantity: str
    kind: Literal["planned", "at most", "all limits"]
    promised: float | None
    share: float | None
    n: int
    kept: int | None
    median: float | None
    kept_ci95: tuple[float, float] | None
    verdict: Literal["kept", "open", "broken"] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Exchange:
    """A condition in one group that is no slower and overshoots no more than the reference in another, by medians.

    Parameters
    ----------
    reference_group, condition, group : str
        The reference's group, and what can take its place: of those that can, the quickest.
    reference_motion_time_s, motion_time_s : float or None
        Medians; None for a reference that never settles.
    reference_overshoot_percent, overshoot_percent : float
        Medians.
    gentler : bool
        Whether it does not accelerate the product more, either.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    reference_group: str
    condition: str
    group: str
    reference_motion_time_s: float | None
    motion_time_s: float
    reference_overshoot_percent: float
    overshoot_percent: float
    gentler: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Conditions beside each other; what comparison.json holds.

    Parameters
    ----------
    created_by : Creator
        The program.
    by, within : str or None
        The factor that makes the conditions, and the one whose levels are compared separately.
    reference : str
        The condition that the others are compared with.
    conditions, groups : tuple of str
        In their order.
    level : float
        Of significance, for all tests together.
    tests : int
        How many there were.
    summaries, differences, rates, exchanges, promises : tuple
        What was found.
    warnings : tuple of Notice
        What to know about it.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    created_by: Creator
    by: str | None
    within: str | None
    reference: str
    conditions: tuple[str, ...]
    groups: tuple[str, ...]
    level: float
    tests: int
    summaries: tuple[ConditionSummary, ...]
    differences: tuple[Difference, ...]
    rates: tuple[PickRate, ...]
    exchanges: tuple[Exchange, ...]
    promises: tuple[Promise, ...]
    warnings: tuple[Notice, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionCurves:
    """What is drawn of one condition in one group.

    Parameters
    ----------
    group, condition : str
        Which.
    moves : tuple of AlignedMove
        Of its measurements, or of some where there are many.
    middle : AlignedMove or None
        Their median at each time; None of a single one.
    band_m : float
        Half the band that counts as settled.
    points : dict of ndarray
        By quantity: each measurement's value; infinite where it never settled.
    """

    group: str
    condition: str
    moves: tuple[AlignedMove, ...]
    middle: AlignedMove | None
    band_m: float
    points: dict[str, FloatArray]
