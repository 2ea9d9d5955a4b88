"""What a set comes to, as files: tables, shapers, figures."""

import hashlib
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from tagsway.errors import InputError
from tagsway.model import FloatArray, Notice, Shaper
from tagsway.report.subset import plot_decays, plot_factors, plot_scatter, write_figure
from tagsway.sets.ledger import Ledger
from tagsway.sets.manifest import Item
from tagsway.sets.tables import FIRST, NUMBERS, TEXTS, Tables, modes_of, share_picks
from tagsway.shapers import choose_shaper, design_shaper, residual_curve
from tagsway.store.documents import write_shaper
from tagsway.store.measurements import FREQUENCY, MeasuredModes, write_table

MEASUREMENTS, PARQUET, SUMMARY, SHARES = "measurements.csv", "measurements.parquet", "summary.csv", "shares.csv"
MOST_DECAYS = 200
"""That are drawn over each other."""

MOST_POINTS = 5000
"""That are drawn against a factor."""


def write_set(tables: Tables, items: Sequence[Item], ledger: Ledger) -> tuple[Notice, ...]:
    """Write everything that a set's measurements tell together; the same data give the same bytes.

    Parameters
    ----------
    tables : Tables
        Of the set.
    items : sequence of Item
        Whose decays are drawn.
    ledger : Ledger
        Where their results are; its folder is written into.

    Returns
    -------
    tuple of Notice
        What could not be written, and why.
    """
    out, notices = ledger.out, []
    write_table(out / MEASUREMENTS, tables.measurements)
    write_table(out / SUMMARY, tables.summary)
    shares = share_picks(tables.kept())
    if len(shares):
        write_table(out / SHARES, shares)
    else:
        (out / SHARES).unlink(missing_ok=True)
    try:
        write_table(out / PARQUET, tables.measurements)
    except ImportError:
        message = f"{PARQUET} needs pyarrow: pip install 'tagsway[cluster]'"
        notices.append(Notice(code="no_parquet", message=message))
    kept_names: set[Path] = set()
    for subset in tables.subsets:
        notices += _write_subset(tables, subset, items, ledger, kept_names)
    for folder, ending in ((out / "figures", "*.png"), (out / "shapers", "*.json")):
        for stale in set(folder.glob(ending)) - kept_names:
            stale.unlink()
    measured = modes_of(tables.kept(), source=MEASUREMENTS)
    shaper, reason = recommend_shaper(measured)
    if shaper is not None:
        write_shaper(out / "shaper.json", shaper)
    else:
        (out / "shaper.json").unlink(missing_ok=True)
        notices.append(Notice(code="no_shaper", message=f"no shaper for the whole set: {reason}"))
    return tuple(notices)


def recommend_shaper(measured: MeasuredModes | None) -> tuple[Shaper | None, str]:
    """Return the shortest shaper that keeps V under 5 % over the spread between measurements, or why there is none.

    Of a single measurement, whose spread is not known, it is a ZV.
    """
    if measured is None:
        return None, "no measurement has a frequency and a damping ratio"
    source = f"{measured.source}: median of {len(measured.frequency_hz)}"
    try:
        if measured.spread is None or not measured.spread.natural_frequency_std_percent > 0:
            return design_shaper("zv", measured.mode, source=source), ""
        return choose_shaper(measured.mode, spread=measured.spread, source=source), ""
    except InputError as fault:
        return None, str(fault)


def name_file(subset: str) -> str:
    """Return a subset's name as a file's: what other systems cannot write is replaced, and then told apart."""
    plain = re.sub(r"[^\w.-]+", "-", subset, flags=re.ASCII).strip("-.")[:80]
    if plain == subset:
        return plain
    return f"{plain}-{hashlib.sha256(subset.encode()).hexdigest()[:6]}".lstrip("-")


def _write_subset(
    tables: Tables, subset: str, items: Sequence[Item], ledger: Ledger, written: set[Path]
) -> list[Notice]:
    """Write a subset's shaper and its figures, and note their paths."""
    whole, kept = tables.measurements, tables.kept(subset)
    part = whole[whole["subset"] == subset]
    name, figures = name_file(subset), ledger.out / "figures"
    measured = modes_of(kept, source=MEASUREMENTS)
    shaper, reason = recommend_shaper(measured)
    curve = None
    if shaper is not None and measured is not None:
        path = ledger.out / "shapers" / f"{name}.json"
        write_shaper(path, shaper)
        written.add(path)
        mode = measured.mode
        half = max(0.25, 1.3 * float(np.max(np.abs(measured.frequency_hz / mode.frequency_hz - 1))))
        frequency = mode.frequency_hz * np.linspace(max(1 - half, 0.02), 1 + half, 401)
        curve = residual_curve(shaper, frequency, mode.damping_ratio)
    rejected = part.loc[part["rejected_by"] != "", FREQUENCY].dropna().to_numpy(dtype=float)
    frequency_hz: FloatArray = kept[FREQUENCY].to_numpy(dtype=float)
    path = figures / f"{name}-frequency.png"
    write_figure(plot_scatter(frequency_hz, curve, shaper=shaper, title=subset, rejected_hz=rejected), path)
    written.add(path)
    few = kept.iloc[:: max(1, len(kept) // MOST_POINTS)]
    factors = _varied(few)
    if factors:
        path = figures / f"{name}-factors.png"
        write_figure(plot_factors(few[FREQUENCY].to_numpy(dtype=float), factors, title=subset), path)
        written.add(path)
    decays, unit = _decays([item for item in items if item.subset == subset], kept, ledger)
    if decays:
        path = figures / f"{name}-decays.png"
        write_figure(plot_decays(decays, unit=unit, title=subset), path)
        written.add(path)
    return [] if shaper is not None else [Notice(code="no_shaper", message=f"no shaper for {subset}: {reason}")]


def _varied(kept: pd.DataFrame) -> dict[str, list[object]]:
    """Return the factors that differ within a subset."""
    known = {*FIRST, *TEXTS, *NUMBERS}
    names = [name for name in kept.columns if name not in known and kept[name].nunique() > 1]
    return {name: list(kept[name]) for name in names}


def _decays(
    items: Sequence[Item], kept: pd.DataFrame, ledger: Ledger
) -> tuple[list[tuple[FloatArray, FloatArray]], str]:
    """Return the decays of some of the measurements that were kept: those whose unit is the first one's."""
    numbers = kept["pick"].fillna(1).astype(int)
    wanted = set(zip(kept["file"], numbers, strict=True))
    found: list[tuple[FloatArray, FloatArray]] = []
    unit = "mm"
    for item in items[:: max(1, len(items) // MOST_DECAYS)]:
        for number, kept_of_it in enumerate(ledger.kept(item), start=1):
            decay = kept_of_it.get("decay")
            if decay is None or (item.name, number) not in wanted or len(found) >= MOST_DECAYS:
                continue
            unit = decay["unit"] if not found else unit
            if decay["unit"] == unit:
                found.append((np.asarray(decay["time_s"], dtype=float), np.asarray(decay["sway"], dtype=float)))
    return found, unit
