"""What to know before some conditions are compared."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pandas as pd

from tagsway.model import Notice
from tagsway.repeats import reject_by_esd
from tagsway.sets.tables import CONDITION, GROUP

SAME_TRAVEL = 0.02
"""Share by which the travels of moves that are compared may differ."""

SAME_WATCH = 0.2
"""The same of the time after the move: the RMS of a decay depends on how long it is watched."""

SAME_BANDWIDTH = 0.3
"""The same of the bandwidth: a peak of acceleration is lower where less of it is seen."""

LITTLE_PERCENT = 0.5
"""An overshoot of the reference below it makes the ratio of two overshoots a matter of chance."""

LOST = frozenset({"peel_off", "product_lost", "grip_slip"})
SUSPECT = ("overshoot_percent", "max_pcp_acceleration_m_s2", "residual_rms_m_s2")
"""In which an outlier is looked for; times come in whole frames, and so in heaps."""

LEAST_FOR_SUSPECT = 5
"""Of fewer repeats, two that happen to agree make any other an outlier."""

MOST_SUSPECTS, LEAST_FOR_SEVERAL = 5, 15
"""That are looked for and named of a condition, and the repeats from which on there may be more than one."""


def find_concerns(table: pd.DataFrame, conditions: Sequence[str], groups: Sequence[str]) -> tuple[Notice, ...]:
    """Return what limits a comparison.

    Parameters
    ----------
    table : DataFrame
        A row a measurement, with `CONDITION` and `GROUP`.
    conditions, groups : sequence of str
        In their order; the first condition is the reference.

    Returns
    -------
    tuple of Notice
    """
    judged = table[table["trajectory_time_s"].notna()]
    found = [
        *_missing(table, judged, conditions),
        *_single(judged, conditions, groups),
        *_never(judged, conditions),
        *_lost(judged, conditions),
        *_unlike(judged, conditions, groups),
        *_several(judged, conditions),
        *_ratio(judged, conditions, groups),
        *_suspects(judged, conditions, groups),
        *_rejected(judged),
    ]
    return tuple(found)


def _missing(table: pd.DataFrame, judged: pd.DataFrame, conditions: Sequence[str]) -> Iterator[Notice]:
    for name in conditions:
        whole, used = (int((part[CONDITION] == name).sum()) for part in (table, judged))
        if used < whole:
            words = f"{whole - used} of {whole} measurements of {name} show no move that can be judged"
            yield Notice(code="measurements_missing", message=f"{words}: comparison.csv says why")


def _single(judged: pd.DataFrame, conditions: Sequence[str], groups: Sequence[str]) -> Iterator[Notice]:
    alone = [_name(name, group) for group in groups for name in conditions if len(_part(judged, group, name)) == 1]
    if alone:
        message = (
            f"a single measurement of {_list(alone)}: one pair alone has no significance, as nothing says whether its "
            "differences would come again; film at least two repeats of each, five tell much more"
        )
        yield Notice(code="single_pair", message=message)
    for group in groups:
        if not len(_part(judged, group, conditions[0])):
            message = f"no measurement of the reference {_name(conditions[0], group)}: nothing to compare with"
            yield Notice(code="no_reference", message=message)


def _never(judged: pd.DataFrame, conditions: Sequence[str]) -> Iterator[Notice]:
    for name in conditions:
        part = judged[judged[CONDITION] == name]
        unsettled = part["settling_time_s"].isna()
        if unsettled.any():
            watched = part.loc[unsettled, "watched_s"].min()
            message = (
                f"{int(unsettled.sum())} of {len(part)} measurements of {name} do not settle while they are watched "
                f"(from {watched:.2f} s on after the start): by ranks they count as longer than any that settled sooner"
            )
            yield Notice(code="never_settles", message=message)


def _lost(judged: pd.DataFrame, conditions: Sequence[str]) -> Iterator[Notice]:
    for name in conditions:
        part = judged[judged[CONDITION] == name]
        gone = part["warnings"].astype(str).apply(lambda words: bool(LOST & set(words.split())))
        if gone.any():
            message = f"the grip slipped or was lost in {int(gone.sum())} of {len(part)} measurements of {name}"
            yield Notice(code="grip_lost", message=message)


def _several(judged: pd.DataFrame, conditions: Sequence[str]) -> Iterator[Notice]:
    for name in conditions:
        part = judged[judged[CONDITION] == name]
        count = int(part["warnings"].astype(str).apply(lambda words: "several_decays" in words.split()).sum())
        if count:
            message = (
                f"{count} of {len(part)} measurements of {name} hold several decays: the move before the one that "
                "stands farthest out of the noise was judged; --picks judges each move"
            )
            yield Notice(code="several_moves", message=message)


def _unlike(judged: pd.DataFrame, conditions: Sequence[str], groups: Sequence[str]) -> Iterator[Notice]:
    after = judged.assign(after_s=judged["watched_s"] - judged["trajectory_time_s"])
    checks: tuple[tuple[str, float, str, str, Callable[[float], str]], ...] = (
        (
            "reference_mm",
            SAME_TRAVEL,
            "moves_differ",
            "their travels differ: percentages and times are then those of different moves",
            lambda value: f"{value:.0f} mm",
        ),
        (
            "after_s",
            SAME_WATCH,
            "watched_differs",
            "they were watched for different times after the move: the RMS acceleration is over that time, and what "
            "swings up later settles only where it is watched",
            lambda value: f"{value:.2f} s",
        ),
        (
            "bandwidth_hz",
            SAME_BANDWIDTH,
            "bandwidth_differs",
            "their accelerations were seen up to different frequencies: peaks are lower where less is seen",
            lambda value: f"{value:.0f} Hz",
        ),
    )
    for column, same, code, words, shown in checks:
        for group in groups:
            medians = {name: float(_part(after, group, name)[column].median()) for name in conditions}
            known = {name: value for name, value in medians.items() if np.isfinite(value) and value > 0}
            if known and max(known.values()) > (1 + same) * min(known.values()):
                told = ", ".join(f"{name} {shown(value)}" for name, value in known.items())
                yield Notice(code=code, message=f"{f'{group}: ' if group else ''}{words} ({told})")


def _ratio(judged: pd.DataFrame, conditions: Sequence[str], groups: Sequence[str]) -> Iterator[Notice]:
    for group in groups:
        median = float(_part(judged, group, conditions[0])["overshoot_percent"].median())
        if median < LITTLE_PERCENT:
            message = (
                f"{_name(conditions[0], group)} overshoots by only {median:.2g} %: the residual vibration, which is a "
                "ratio to that, says little"
            )
            yield Notice(code="ratio_ill_conditioned", message=message)


def _suspects(judged: pd.DataFrame, conditions: Sequence[str], groups: Sequence[str]) -> Iterator[Notice]:
    """Name what generalised ESD takes for an outlier, once in twenty comparisons by chance; nothing is left out."""
    found = []
    parts = [_part(judged, group, name) for group in groups for name in conditions]
    parts = [part for part in parts if len(part) >= LEAST_FOR_SUSPECT]
    level = 0.05 / max(1, len(parts) * len(SUSPECT))
    for part in parts:
        for column in SUSPECT:
            values = part[column].to_numpy(dtype=float)
            most = MOST_SUSPECTS if np.count_nonzero(np.isfinite(values)) >= LEAST_FOR_SEVERAL else None
            out = np.isfinite(values) & ~reject_by_esd(values, most=most, level=level).kept
            found += [f"{file} ({column})" for file in part.loc[out, "file"]]
    if found:
        more = f" and {len(found) - MOST_SUSPECTS} more" if len(found) > MOST_SUSPECTS else ""
        message = f"unlike the other repeats, and not left out: {', '.join(found[:MOST_SUSPECTS])}{more}"
        yield Notice(code="outlier_suspected", message=message)


def _rejected(judged: pd.DataFrame) -> Iterator[Notice]:
    files = judged.loc[judged["rejected_by"] != "", "file"].astype(str).tolist()
    if files:
        message = f"rejected in their set for their frequency or damping, and compared all the same: {_list(files)}"
        yield Notice(code="rejected_in_set", message=message)


def _part(table: pd.DataFrame, group: str, condition: str) -> pd.DataFrame:
    return table[(table[GROUP] == group) & (table[CONDITION] == condition)]


def _name(condition: str, group: str) -> str:
    return f"{condition} ({group})" if group else condition


def _list(names: Sequence[str]) -> str:
    shown = ", ".join(names[:MOST_SUSPECTS])
    return f"{shown} and {len(names) - MOST_SUSPECTS} more" if len(names) > MOST_SUSPECTS else shown
