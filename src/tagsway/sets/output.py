"""What a set comes to, as files: tables, shapers, figures."""

from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from tagsway.model import FactorModel, Notice
from tagsway.report.subset import plot_factors, write_figure
from tagsway.sets.ahead import Ahead
from tagsway.sets.columns import WHOLE
from tagsway.sets.drawing import recommend_shaper
from tagsway.sets.effects import factor_values, find_effects
from tagsway.sets.ledger import Ledger
from tagsway.sets.manifest import MeasurementSet
from tagsway.sets.page import tell_effects, write_set_page
from tagsway.sets.subsets import MOST_POINTS, begin_subsets
from tagsway.sets.tables import MEASUREMENTS, Tables, modes_of, share_picks
from tagsway.sets.workers import Crew
from tagsway.store.documents import write_shaper
from tagsway.store.measurements import FREQUENCY, write_table

PARQUET, SUMMARY = "measurements.parquet", "summary.csv"
SHARES, EFFECTS = "shares.csv", "effects.csv"


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """What is said of a set beside its tables.

    Parameters
    ----------
    effects : tuple of str
        What the factors do, a sentence each.
    notices : tuple of Notice
        What to know of it, and what could not be written.
    """

    effects: tuple[str, ...]
    notices: tuple[Notice, ...]


def write_set(
    tables: Tables, found: MeasurementSet, ledger: Ledger, *, crew: Crew | None = None, ahead: Ahead | None = None
) -> Told:
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
    ahead : Ahead, optional
        What was drawn while the set was measured.

    Returns
    -------
    Told
    """
    out, kept = ledger.out, tables.kept()
    finish = begin_subsets(tables, found.items, ledger, crew, ahead)  # the workers draw while this process goes on
    write_table(out / MEASUREMENTS, tables.measurements)
    write_table(out / SUMMARY, tables.summary)
    shares, effects = share_picks(kept), find_effects(kept)
    for name, table in ((SHARES, shares), (EFFECTS, effects.table)):
        if len(table):
            write_table(out / name, table)
        else:
            (out / name).unlink(missing_ok=True)
    parquet = _write_parquet(out, tables)
    factors = [] if effects.frequency is None else [_write_factors(out, kept, effects.frequency)]
    subsets = finish()
    told = [
        Notice(code="no_shaper", message=f"no shaper for {subset.name}: {subset.no_shaper}")
        for subset in subsets
        if subset.shaper is None
    ]
    notices = [*effects.notices, *_tell_copies(tables), *told]
    figures = {subset.name: subset.figures for subset in subsets}
    if factors:
        figures[WHOLE] = tuple(factors)
    _remove_stale(out, {*factors, *(path for subset in subsets for path in subset.files)})
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
    return Told(effects=tell_effects(tables, effects), notices=(*notices, *parquet))


def _remove_stale(out: Path, written: set[Path]) -> None:
    """Remove the figures and the shapers of subsets that are no more."""
    for stale in {*(out / "figures").glob("*.png"), *(out / "shapers").glob("*.json")} - written:
        stale.unlink()


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
