"""What a set comes to, as files: tables, shapers, figures."""

import hashlib
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from tagsway.files import whole_file
from tagsway.model import FactorModel, FloatArray, Notice
from tagsway.report.subset import plot_factors, write_figure
from tagsway.sets.drawing import DrawnSubset, SubsetTask, draw_subset, recommend_shaper
from tagsway.sets.effects import factor_values, find_effects
from tagsway.sets.ledger import Ledger
from tagsway.sets.manifest import Item, MeasurementSet
from tagsway.sets.page import write_set_page
from tagsway.sets.tables import WHOLE, Tables, modes_of, share_picks
from tagsway.sets.workers import Crew
from tagsway.store.documents import write_shaper
from tagsway.store.measurements import FREQUENCY, write_table

MEASUREMENTS, PARQUET, SUMMARY = "measurements.csv", "measurements.parquet", "summary.csv"
SHARES, EFFECTS = "shares.csv", "effects.csv"
MOST_DECAYS = 200
"""That are drawn over each other."""

MOST_POINTS = 5000
"""That are drawn against a factor."""


def write_set(tables: Tables, found: MeasurementSet, ledger: Ledger, *, crew: Crew | None = None) -> tuple[Notice, ...]:
    """Write everything that a set's measurements tell together; the same data give the same bytes.

    Parameters
    ----------
    tables : Tables
        Of the set.
    found : MeasurementSet
        Whose decays are drawn.
    ledger : Ledger
        Where their results are; its folder is written into.
    crew : Crew, optional
        Who draws; by default this process.

    Returns
    -------
    tuple of Notice
        What to know of it, and what could not be written.
    """
    out, kept = ledger.out, tables.kept()
    write_table(out / MEASUREMENTS, tables.measurements)
    write_table(out / SUMMARY, tables.summary)
    shares, effects = share_picks(kept), find_effects(kept)
    for name, table in ((SHARES, shares), (EFFECTS, effects.table)):
        if len(table):
            write_table(out / name, table)
        else:
            (out / name).unlink(missing_ok=True)
    notices = [*effects.notices, *_tell_copies(tables)]
    figures, shapers, told = _write_subsets(tables, found, ledger, crew)
    notices += told
    if effects.frequency is not None:
        figures[WHOLE] = [_write_factors(out, kept, effects.frequency)]
    drawn = {path for paths in figures.values() for path in paths}
    for folder, ending, written in ((out / "figures", "*.png", drawn), (out / "shapers", "*.json", shapers)):
        for stale in set(folder.glob(ending)) - written:
            stale.unlink()
    shaper, reason = recommend_shaper(modes_of(kept, source=MEASUREMENTS))
    if shaper is not None:
        write_shaper(out / "shaper.json", shaper)
    else:
        (out / "shaper.json").unlink(missing_ok=True)
        notices.append(Notice(code="no_shaper", message=f"no shaper for the whole set: {reason}"))
    write_set_page(
        out,
        tables,
        title=found.name,
        shares=shares,
        effects=effects,
        shaper=shaper,
        no_shaper=reason,
        notices=notices,
        figures=figures,
    )
    return (*notices, *_write_parquet(out, tables))


def name_file(subset: str) -> str:
    """Return a subset's name as a file's: what other systems cannot write is replaced, and then told apart."""
    plain = re.sub(r"[^\w.-]+", "-", subset, flags=re.ASCII).strip("-.")[:80]
    if plain == subset:
        return plain
    return f"{plain}-{hashlib.sha256(subset.encode()).hexdigest()[:6]}".lstrip("-")


def _write_parquet(out: Path, tables: Tables) -> list[Notice]:
    try:
        write_table(out / PARQUET, tables.measurements)
    except ImportError:
        message = f"{PARQUET} needs pyarrow: pip install 'tagsway[cluster]'"
        return [Notice(code="no_parquet", message=message)]
    return []


def _tell_copies(tables: Tables) -> list[Notice]:
    if not tables.copies:
        return []
    many = "1 measurement is a copy" if tables.copies == 1 else f"{tables.copies} measurements are copies"
    message = (
        f"{many}: another file has the same content and settings; a copy is no repeat, and only one of them counts "
        "(see rejected_by)"
    )
    return [Notice(code="copies", message=message)]


def _write_factors(out: Path, kept: pd.DataFrame, model: FactorModel) -> Path:
    """Draw the frequency against the factors of the whole set, with their effects."""
    few = kept.iloc[:: max(1, len(kept) // MOST_POINTS)]
    asked = {one.factor for one in model.effects} | {one.factor for one in model.unanswered}
    factors = {name: values for name, values in factor_values(few).items() if name in asked and len(set(values)) > 1}
    frequency_hz = few[FREQUENCY].to_numpy(dtype=float)
    path = out / "figures" / "factors.png"
    write_figure(plot_factors(frequency_hz, factors, effects=model.effects, title="All subsets"), path)
    return path


def _write_subsets(
    tables: Tables, found: MeasurementSet, ledger: Ledger, crew: Crew | None
) -> tuple[dict[str, list[Path]], set[Path], list[Notice]]:
    """Write the figures and the shaper of each subset, and return their paths."""
    figures: dict[str, list[Path]] = {}
    shapers: set[Path] = set()
    notices: list[Notice] = []
    tasks = [_task(tables, subset, found.items, ledger) for subset in tables.subsets]
    for task, drawn in zip(tasks, _draw_all(tasks, crew), strict=True):
        name = name_file(task.name)
        if drawn.shaper is not None:
            path = ledger.out / "shapers" / f"{name}.json"
            write_shaper(path, drawn.shaper)
            shapers.add(path)
        else:
            notices.append(Notice(code="no_shaper", message=f"no shaper for {task.name}: {drawn.no_shaper}"))
        figures[task.name] = []
        for what, png in drawn.pictures:
            path = ledger.out / "figures" / f"{name}-{what}.png"
            with whole_file(path) as part:
                part.write_bytes(png)
            figures[task.name].append(path)
    return figures, shapers, notices


def _draw_all(tasks: list[SubsetTask], crew: Crew | None) -> list[DrawnSubset]:
    """Draw the subsets, by the workers where there are any."""
    if crew is not None and len(tasks) > 1:
        try:
            return list(crew.executor.map(draw_subset, tasks))
        except Exception as fault:
            if not crew.died(fault):
                raise
    return [draw_subset(task) for task in tasks]


def _task(tables: Tables, subset: str, items: Sequence[Item], ledger: Ledger) -> SubsetTask:
    whole, kept = tables.measurements, tables.kept(subset)
    out = (whole["subset"] == subset) & (whole["rejected_by"] != "")
    few = kept.iloc[:: max(1, len(kept) // MOST_POINTS)]
    decays, unit = _decays([item for item in items if item.subset == subset], kept, ledger)
    return SubsetTask(
        name=subset,
        frequency_hz=kept[FREQUENCY].to_numpy(dtype=float),
        rejected_hz=whole.loc[out, FREQUENCY].dropna().to_numpy(dtype=float),
        measured=modes_of(kept, source=MEASUREMENTS),
        few_hz=few[FREQUENCY].to_numpy(dtype=float),
        factors={name: values for name, values in factor_values(few).items() if few[name].nunique() > 1},
        decays=decays,
        unit=unit,
    )


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
