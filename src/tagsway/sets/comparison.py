"""From a row a measurement to conditions beside each other."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from tagsway import __version__
from tagsway.errors import InputError, NotIdentifiableError
from tagsway.model import (
    Comparison,
    ConditionSummary,
    Creator,
    Difference,
    FloatArray,
    Notice,
    PickRate,
)
from tagsway.repeats import adjust_holm, compare_repeats, rate_gain, summarise_repeats
from tagsway.sets.columns import FIRST, NUMBERS, TEXTS
from tagsway.sets.concerns import find_concerns
from tagsway.sets.exchanges import find_exchanges
from tagsway.sets.tables import CONDITION, GROUP, PLACE

MOTION, SETTLING, TRAJECTORY = "motion_time_s", "settling_time_s", "trajectory_time_s"
QUANTITIES = (
    MOTION,
    SETTLING,
    TRAJECTORY,
    "overshoot_percent",
    "max_pcp_acceleration_m_s2",
    "max_pcp_vector_m_s2",
    "residual_max_m_s2",
    "residual_rms_m_s2",
    "place_error_mm",
    "box_error_mm",
)
"""What is compared: columns of measurements.csv."""

PARTIAL = frozenset({"box_error_mm"})
"""Of moves that rise above the rim of a box alone: compared where all of them do."""

NEVER = frozenset({MOTION, SETTLING})
"""Where a move that was judged has none, the product did not settle while it was watched."""

LEVEL = 0.05
PLAIN = ("unshaped", "none", "no", "off", "false", "reference", "before")
"""Levels of a factor that are the reference where nobody names one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Wish:
    """How measurements are to be compared.

    Parameters
    ----------
    by : str or None
        The factor whose levels are the conditions; None where they were named one by one.
    within : str or None
        A factor whose levels are compared each for itself.
    reference : str or None
        The condition that the others are compared with; None for the first.
    other_time_s : float
        Of a pick beside the move.
    """

    by: str | None = None
    within: str | None = None
    reference: str | None = None
    other_time_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Sorted:
    """Rows with their condition and their group, and the order of both.

    Parameters
    ----------
    table : DataFrame
        With the columns `CONDITION` and `GROUP`.
    conditions, groups : tuple of str
        In their order, the reference first.
    left_out : int
        Rows that have no level of the factor.
    """

    table: pd.DataFrame
    conditions: tuple[str, ...]
    groups: tuple[str, ...]
    left_out: int = 0


def sort_rows(table: pd.DataFrame, wish: Wish, *, named: Sequence[str] = ()) -> Sorted:
    """Give each row its condition and its group.

    Parameters
    ----------
    table : DataFrame
        A row a measurement, with factors, and with `CONDITION` where conditions were named.
    wish : Wish
        What is compared.
    named : sequence of str
        The named conditions in their order.

    Raises
    ------
    InputError
        Where a factor is not there, or does not make two conditions.
    """
    if wish.by is not None and wish.by == wish.within:
        raise InputError(f"--by and --within are both {wish.by!r}: expected two factors")
    groups = "" if wish.within is None else _levels(table, wish.within)
    levels = None if wish.by is None else _levels(table, wish.by)
    table = table.assign(**{GROUP: groups, **({} if levels is None else {CONDITION: levels})})
    if levels is not None:
        named = sorted({level for level in levels if level}, key=_plain_first)
    lost = (table[CONDITION] == "") | ((table[GROUP] == "") if wish.within is not None else False)
    table = table[~lost].reset_index(drop=True)
    conditions = [name for name in named if (table[CONDITION] == name).any()]
    if len(conditions) < 2:
        one = f"only {conditions[0]!r}" if conditions else "no condition"
        raise InputError(f"there is {one}: a comparison needs two; {_what_varies(table)}")
    if wish.reference is not None:
        if wish.reference not in conditions:
            raise InputError(f"--reference is {wish.reference!r}: expected one of {', '.join(conditions)}")
        conditions = [wish.reference, *(name for name in conditions if name != wish.reference)]
    order = sorted(set(table[GROUP]), key=_natural)
    ranks = table[GROUP].map(order.index), table[CONDITION].map(conditions.index)
    table = table.iloc[np.lexsort((ranks[1], ranks[0]))].reset_index(drop=True)
    return Sorted(table=table, conditions=tuple(conditions), groups=tuple(order), left_out=int(lost.sum()))


def compare(rows: Sorted, wish: Wish) -> Comparison:
    """Compare conditions.

    Parameters
    ----------
    rows : Sorted
        The measurements.
    wish : Wish
        What is compared.

    Returns
    -------
    Comparison
        Without promises.

    Raises
    ------
    InputError
        Where no file of a condition could be used.
    NotIdentifiableError
        Where files could, and none of them shows a move that can be judged.
    """
    for name in rows.conditions:
        _require_moves(rows.table[rows.table[CONDITION] == name], name)
    reference = rows.conditions[0]
    differences, summaries = list(_differences(rows)), tuple(_summaries(rows))
    held, tests = _hold_together(differences)
    notices = (*find_concerns(rows.table, rows.conditions, rows.groups), *_tell_unordered(rows))
    if rows.left_out:
        words = f"{rows.left_out} measurements have no level of {wish.by or wish.within} and are left out"
        notices = (*notices, Notice(code="without_level", message=words))
    return Comparison(
        created_by=Creator(name="tagsway", version=__version__),
        by=wish.by,
        within=wish.within,
        reference=reference,
        conditions=rows.conditions,
        groups=rows.groups,
        level=LEVEL,
        tests=tests,
        summaries=summaries,
        differences=held,
        rates=tuple(_rates(rows, wish)),
        exchanges=find_exchanges(summaries, rows.conditions, rows.groups, bounds_s=_bounds(rows)),
        promises=(),
        warnings=notices,
    )


def part_of(rows: Sorted, group: str, condition: str) -> pd.DataFrame:
    """Return the rows of a condition in a group that show a move."""
    table = rows.table
    return table[(table[GROUP] == group) & (table[CONDITION] == condition) & table[TRAJECTORY].notna()]


def values_of(part: pd.DataFrame, quantity: str) -> FloatArray:
    """Return a quantity of some measured moves; infinite where the product never settled, NaN where it is not known."""
    values: FloatArray = part[quantity].to_numpy(dtype=float)
    return np.where(np.isnan(values), np.inf, values) if quantity in NEVER else values


def _pairs(rows: Sorted) -> Iterator[tuple[str, str]]:
    """Give every group and condition that are compared with the reference."""
    for group in rows.groups:
        for condition in rows.conditions[1:]:
            if len(part_of(rows, group, condition)) and len(part_of(rows, group, rows.conditions[0])):
                yield group, condition


def _told(rows: Sorted) -> tuple[str, ...]:
    """Return the quantities that the measurements tell."""
    judged = rows.table[rows.table[TRAJECTORY].notna()]
    return tuple(name for name in QUANTITIES if name not in PARTIAL or judged[name].notna().all())


def _summaries(rows: Sorted) -> Iterator[ConditionSummary]:
    for group in rows.groups:
        for condition in rows.conditions:
            part = part_of(rows, group, condition)
            for quantity in _told(rows):
                values = values_of(part, quantity)
                seen = values[~np.isnan(values)]
                if len(seen):
                    yield _summary(group, condition, quantity, seen)


def _summary(group: str, condition: str, quantity: str, seen: FloatArray) -> ConditionSummary:
    finite = seen[np.isfinite(seen)]
    told = summarise_repeats(finite) if len(finite) else None
    median = float(np.median(seen))
    return ConditionSummary(
        group=group,
        condition=condition,
        quantity=quantity,
        n=len(seen),
        never=len(seen) - len(finite),
        median=median if np.isfinite(median) else None,
        mean=float(np.mean(seen)) if len(finite) == len(seen) else None,
        deviation_percent=None if told is None else told.deviation_percent,
        std=None if told is None else told.std,
    )


def _differences(rows: Sorted) -> Iterator[Difference]:
    for group, condition in _pairs(rows):
        for quantity in _told(rows):
            first, other = (values_of(part_of(rows, group, name), quantity) for name in (rows.conditions[0], condition))
            if np.isnan(first).all() or np.isnan(other).all():
                continue
            change = compare_repeats(first, other)
            if quantity in NEVER and not _is_ordered(rows, group, condition, quantity):
                change = replace(change, test=None, p_value=None, rank_p_value=None, median_difference=None)
            yield Difference(
                group=group,
                condition=condition,
                reference=rows.conditions[0],
                quantity=quantity,
                change=change,
                p_holm=None,
                significant=None,
            )


def _is_ordered(rows: Sorted, group: str, condition: str, quantity: str) -> bool:
    """Tell whether each move that never settled was watched until all that settled on the other side had."""
    parts = [part_of(rows, group, name) for name in (rows.conditions[0], condition)]
    for never, settled in (parts, parts[::-1]):
        known = settled[quantity].dropna()
        watched = never.loc[never[quantity].isna(), "watched_s"].fillna(0.0)
        if len(watched) and len(known) and not watched.min() >= known.max():
            return False
    return True


def _tell_unordered(rows: Sorted) -> Iterator[Notice]:
    for group, condition in _pairs(rows):
        if not all(_is_ordered(rows, group, condition, quantity) for quantity in NEVER):
            message = (
                f"{f'{group}: ' if group else ''}{condition} against {rows.conditions[0]}: a move that never settles "
                "was watched for a shorter time than another took to settle: which is the longer is not known, and "
                "these times are not tested; film on until all of them stand"
            )
            yield Notice(code="watched_too_briefly", message=message)


def _hold_together(differences: Sequence[Difference]) -> tuple[tuple[Difference, ...], int]:
    """Correct all p values for the number of tests, and return that number.

    Where motion and settling time are the same in rank they are one test: a move that swings on after the tool stands
    has one end.
    """
    p_values = np.array([np.nan if d.change.p_value is None else d.change.p_value for d in differences], dtype=float)
    place = {(d.group, d.condition, d.quantity): number for number, d in enumerate(differences)}
    twins = {
        number: place[d.group, d.condition, MOTION]
        for number, d in enumerate(differences)
        if d.quantity == SETTLING and _is_twin(d, differences[place.get((d.group, d.condition, MOTION), number)])
    }
    p_values[list(twins)] = np.nan
    adjusted = adjust_holm(p_values)
    for number, twin in twins.items():
        adjusted[number] = adjusted[twin]
    held = tuple(
        d if np.isnan(p) else replace(d, p_holm=float(p), significant=bool(p < LEVEL))
        for d, p in zip(differences, adjusted, strict=True)
    )
    return held, int(np.isfinite(p_values).sum())


def _is_twin(settling: Difference, motion: Difference) -> bool:
    """Tell whether two tests by ranks are one: of the same values."""
    return (
        settling.quantity != motion.quantity
        and settling.change == motion.change
        and settling.change.test == "mann-whitney"
    )


def _bounds(rows: Sorted) -> dict[str, float]:
    """Return, by group, how long those moves of the reference that never settled were watched, the shortest."""
    found = {}
    for group in rows.groups:
        part = part_of(rows, group, rows.conditions[0])
        watched = part.loc[part[MOTION].isna(), "watched_s"].fillna(0.0)
        if len(watched):
            found[group] = float(watched.min())
    return found


def _rates(rows: Sorted, wish: Wish) -> Iterator[PickRate]:
    for group, condition in _pairs(rows):
        parts = [part_of(rows, group, name) for name in (rows.conditions[0], condition)]
        first, other = (values_of(part, MOTION) for part in parts)
        unsettled = np.isinf(first)
        bound: FloatArray = np.where(unsettled, parts[0]["watched_s"].to_numpy(dtype=float), first)
        rate = PickRate(
            group=group,
            condition=condition,
            reference=rows.conditions[0],
            other_time_s=wish.other_time_s,
            reference_per_min=None if unsettled.any() else float(60 / (np.mean(first) + wish.other_time_s)),
            per_min=None,
            gained=None,
            std=None,
            ci95=None,
            at_least=bool(unsettled.any()),
        )
        if np.isinf(other).any() or not np.isfinite(bound).all():
            yield rate
            continue
        gained, std, ci95 = rate_gain(bound, other, rest_s=wish.other_time_s)
        rate = replace(rate, per_min=float(60 / (np.mean(other) + wish.other_time_s)), gained=gained)
        yield rate if rate.at_least else replace(rate, std=std, ci95=ci95)


def _require_moves(part: pd.DataFrame, name: str) -> None:
    if part[TRAJECTORY].notna().any():
        return
    reasons = [str(text) for text in part["error"] if text]
    if (part["status"] == "failed").all():
        raise InputError(f"condition {name!r}: none of its {len(part)} files can be used; {_first(reasons)}")
    why = (
        "the tool does not move in them or its tag is not seen (--tcp-id), or the sides of their tags are not known "
        "(--tag-size)"
    )
    raise NotIdentifiableError(
        f"condition {name!r}: none of its {len(part)} measurements shows a move that can be judged: "
        f"{_first(reasons) if reasons else why}",
        code="no_move",
    )


def _first(reasons: Sequence[str]) -> str:
    return reasons[0] if reasons else "nothing says why"


def _levels(table: pd.DataFrame, factor: str) -> list[str]:
    if factor not in table or factor in {*NUMBERS, *TEXTS, CONDITION, GROUP, PLACE}:
        raise InputError(f"there is no factor {factor!r}; {_what_varies(table)}")
    return [_word(value) for value in table[factor]]


def _word(value: object) -> str:
    if value is None or (isinstance(value, float) and np.isnan(value)):
        return ""
    return f"{value:.15g}" if isinstance(value, float) else str(value)


def _what_varies(table: pd.DataFrame) -> str:
    known = {*NUMBERS, *TEXTS, *FIRST, CONDITION, GROUP, PLACE} - {"subset"}
    names = [str(name) for name in table.columns if name not in known and table[name].nunique() > 1]
    return f"what varies: {', '.join(names)} (--by)" if names else "no factor of it varies"


def _plain_first(level: str) -> tuple[bool, tuple[bool, float, str]]:
    return level.lower() not in PLAIN, _natural(level)


def _natural(level: str) -> tuple[bool, float, str]:
    """Return what sorts numbers by their size, and before words."""
    try:
        return False, float(level), level
    except ValueError:
        return True, 0.0, level
