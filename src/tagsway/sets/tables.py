"""From rows to tables: what is rejected, and what a subset's measurements say together."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from tagsway.errors import NotIdentifiableError
from tagsway.model import BoolArray, Estimate, FloatArray
from tagsway.repeats import (
    factor_share,
    fit_random_effects,
    pool_shares,
    reject_beyond_sigma,
    reject_by_esd,
    summarise_repeats,
)
from tagsway.sets.columns import FIRST, NUMBERS, TEXTS, WHOLE
from tagsway.sets.ledger import NO_NUMBER, Ledger
from tagsway.sets.manifest import Item
from tagsway.store.measurements import AMPLITUDE, DAMPING, FREQUENCY, FREQUENCY_STD, OPERATING, MeasuredModes

MEASUREMENTS = "measurements.csv"
CONDITION, GROUP, PLACE = "(condition)", "(group)", "(place)"
"""Columns that a comparison adds; factors have no such names."""

COPY = "copy of "
"""What `rejected_by` says of a file that holds what another holds, before the other's name."""

PICKED, SET = "pick_position", "set"
REPEATED = frozenset({SET, "repeat", "run", "date", "operator"})
"""Factors that tell repeats apart, and not what was repeated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tables:
    """What a set comes to.

    Parameters
    ----------
    measurements : DataFrame
        A row a measurement, sorted by subset, file and pick.
    summary : DataFrame
        A row a subset, one for each of several sets, and one for all.
    copies : int
        Measurements that were left out because another has the same content and settings.
    """

    measurements: pd.DataFrame
    summary: pd.DataFrame
    copies: int

    @property
    def subsets(self) -> list[str]:
        """Their names, sorted."""
        return [name for name in self.summary["subset"] if name != WHOLE]

    def kept(self, subset: str | None = None) -> pd.DataFrame:
        """Return the measurements that have a frequency and were not rejected, of one subset or of all."""
        table = self.measurements
        kept = table[(table["rejected_by"] == "") & table[FREQUENCY].notna()]
        return kept if subset is None else kept[kept["subset"] == subset]


def tabulate(items: Iterable[Item], ledger: Ledger) -> Tables:
    """Gather what is known of a set's files; those not tried yet are left out.

    Parameters
    ----------
    items : iterable of Item
        Of the set.
    ledger : Ledger
        Where their results are.
    """
    rows = []
    for item in items:
        key = ledger.result_of(item) or ""
        for row in ledger.rows(item):
            rows.append({"file": item.name, "subset": item.subset, "key": key, **dict(item.factors), **row})
    return make_tables(rows)


def make_tables(rows: Iterable[Mapping[str, Any]]) -> Tables:
    """Make a set's tables from a row a measurement.

    Parameters
    ----------
    rows : iterable of mapping
        With `file`, `subset`, `status`, factors, and the numbers that were found.
    """
    table = arrange_rows(rows)
    table = table.sort_values(["subset", "file", "pick"], kind="stable", ignore_index=True)
    first = table.groupby([table["key"], table["pick"].fillna(0)], sort=False)["file"].transform("first")
    copied = (table["key"] != "") & table[FREQUENCY].notna() & (first != table["file"])
    table.loc[copied, "rejected_by"] = COPY + first[copied]
    for _, part in table[~copied].groupby("subset", sort=True):
        table.loc[part.index, "rejected_by"] = reject(part)
    return Tables(measurements=table, summary=_summarise_all(table), copies=int(copied.sum()))


def arrange_rows(rows: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
    """Return rows as a table in their order, with all columns of measurements.csv; nothing is rejected."""
    table = pd.DataFrame.from_records(list(rows))
    factors = factors_of(table)
    table = table.reindex(columns=[*FIRST, *factors, "status", "error", *NUMBERS, "warnings", "rejected_by", "key"])
    for name in NUMBERS:
        table[name] = pd.to_numeric(table[name])
    for name in ("pick", "frames"):
        table[name] = pd.to_numeric(table[name]).astype("Int64")
    for name in factors:
        if not pd.api.types.is_numeric_dtype(table[name]):
            table[name] = _as_text(table[name])
    for name in ("error", "warnings", "rejected_by", "key"):
        table[name] = _as_text(table[name])
    return table


def factors_of(table: pd.DataFrame) -> list[str]:
    """Return the columns of a table of measurements that hold factors, sorted."""
    known = {*FIRST, *TEXTS, *NUMBERS}
    return sorted(name for name in table.columns if name not in known)


def _summarise_all(table: pd.DataFrame) -> pd.DataFrame:
    """Return summary.csv: the subsets, each of several sets, the whole."""
    sets = _sets_of(table)
    rows = [
        summarise(str(subset), part, of=str(sets[part.index[0]])) for subset, part in table.groupby("subset", sort=True)
    ]
    if sets.nunique() > 1:
        rows += [summarise(WHOLE, part, of=str(name)) for name, part in table.groupby(sets, sort=True) if name]
    return pd.DataFrame.from_records([*rows, summarise(WHOLE, table)])


def _sets_of(table: pd.DataFrame) -> "pd.Series[Any]":
    """Return the set of each measurement: the factor's value, or else the first folder above its subset's."""
    if SET in table:
        return _as_text(table[SET])
    subset = table["subset"].astype(str)
    nested = subset.str.contains("/", regex=False) & ~subset.str.contains("://", regex=False)
    return subset.str.partition("/")[0].where(nested, "")


def reject(part: pd.DataFrame) -> list[str]:
    """Return for each measurement of a subset which tests reject it, and by which number; "" where none does.

    ±3σ as it is usually asked for, and the generalised ESD test (Grubbs' below 15 repeats); the latter on the damping
    ratio's logarithm, as that spans decades.
    """
    frequency, damping = (part[name].to_numpy(dtype=float) for name in (FREQUENCY, DAMPING))
    logarithm: FloatArray = np.log(np.where(damping > 0, damping, np.nan))
    verdicts: list[tuple[str, BoolArray]] = []
    for name, value, scaled in ((FREQUENCY, frequency, frequency), (DAMPING, damping, logarithm)):
        verdicts.append((f"3-sigma {name}", np.isfinite(value) & ~reject_beyond_sigma(value).kept))
        verdicts.append((f"esd {name}", np.isfinite(scaled) & ~reject_by_esd(scaled).kept))
    return ["; ".join(name for name, out in verdicts if out[row]) for row in range(len(part))]


def summarise(name: str, part: pd.DataFrame, *, of: str = "") -> dict[str, Any]:
    """Return a row of summary.csv: which set, how many, and medians, ± deviation and s of what was kept."""
    failed = part["status"].isin(NO_NUMBER).to_numpy()
    rejected = (part["rejected_by"] != "").to_numpy()
    kept = part[~failed & ~rejected]
    row: dict[str, Any] = {
        "subset": name,
        "set": of,
        "n": len(part),
        "failed": int(failed.sum()),
        "rejected": int(rejected.sum()),
        "used": len(kept),
    }
    for label, column, ending in (
        ("natural_frequency", FREQUENCY, "_hz"),
        ("damping_ratio", DAMPING, ""),
        ("amplitude", "amplitude_mm", "_mm"),
        ("length", "length_mm", "_mm"),
    ):
        values = kept[column].to_numpy(dtype=float)
        told = summarise_repeats(values) if np.isfinite(values).any() else None
        row[f"{label}_median{ending}"] = None if told is None else told.median
        row[f"{label}_deviation_percent"] = None if told is None else told.deviation_percent
        row[f"{label}_s{ending}"] = None if told is None else told.std
    return {**row, **_between(kept)}


def share_picks(kept: pd.DataFrame) -> pd.DataFrame:
    """Return which share of the variance comes from the pick position, where it is varied and held.

    Parameters
    ----------
    kept : DataFrame
        Measurements, in which the factor `pick_position` is "varied" or "held".

    Returns
    -------
    DataFrame
        A row for each quantity and each combination of the other factors that has both, with the share's standard
        error and interval, and where there are several one for all; empty where nothing was varied or the sets are
        too small. A factor that varies within subsets widens both sets alike and is no such combination.
    """
    rows: list[dict[str, Any]] = []
    if PICKED not in kept or not {"varied", "held"} <= set(kept[PICKED]):
        return pd.DataFrame()
    others = [
        name
        for name in factors_of(kept)
        if name not in {PICKED, *REPEATED} and kept.groupby("subset")[name].nunique().max() == 1
    ]
    alike = kept[others].astype(str).agg(", ".join, axis=1) if others else pd.Series("", index=kept.index)
    for name in (FREQUENCY, DAMPING):
        shares: list[Estimate] = []
        for words, part in kept.groupby(alike, sort=True):
            varied, held = (part.loc[part[PICKED] == level, name].to_numpy(dtype=float) for level in ("varied", "held"))
            try:
                shares.append(factor_share(varied, held))
            except NotIdentifiableError:
                continue
            row = {"factors": words, "quantity": name, "n_varied": len(varied), "n_held": len(held)}
            rows.append({**row, **_told(shares[-1])})
        if len(shares) > 1:
            counts = {what: sum(row[what] for row in rows[-len(shares) :]) for what in ("n_varied", "n_held")}
            rows.append({"factors": WHOLE, "quantity": name, **counts, **_told(pool_shares(shares))})
    return pd.DataFrame.from_records(rows)


def _told(share: Estimate) -> dict[str, float]:
    return {"share": share.value, "std": share.std, "low": share.ci95[0], "high": share.ci95[1]}


def modes_of(kept: pd.DataFrame, *, source: str) -> MeasuredModes | None:
    """Return the modes of the measurements that have frequency and damping; None where there are none."""
    whole = kept[kept[FREQUENCY].notna() & kept[DAMPING].notna()]
    if not len(whole):
        return None
    frequency, damping, std, operating, amplitude = (
        whole[name].to_numpy(dtype=float) for name in (FREQUENCY, DAMPING, FREQUENCY_STD, OPERATING, AMPLITUDE)
    )
    return MeasuredModes(
        frequency_hz=frequency,
        damping_ratio=damping,
        source=source,
        frequency_std_hz=std,
        operating_hz=operating,
        amplitude_mm=amplitude,
    )


def _between(kept: pd.DataFrame) -> dict[str, Any]:
    """Return what differs between repeats against the error of each: of the natural frequency."""
    value, std = (kept[name].to_numpy(dtype=float) for name in (FREQUENCY, FREQUENCY_STD))
    usable = np.isfinite(value) & np.isfinite(std) & (std > 0)
    names = ("between_s_hz", "between_s_low_hz", "between_s_high_hz", "within_s_hz")
    if np.count_nonzero(usable) < 2:
        return dict.fromkeys(names)
    effects = fit_random_effects(value[usable], std[usable])
    between = effects.between_std
    return dict(zip(names, (between.value, *between.ci95, effects.within_std), strict=True))


def _as_text(column: "pd.Series[Any]") -> "pd.Series[Any]":
    return pd.Series(["" if pd.isna(value) else str(value) for value in column], index=column.index, dtype="str")
