"""The page of a set: report.html, and the script that it shares with the measurements' own pages."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tagsway import __version__
from tagsway.files import write_text
from tagsway.model import Notice, Shaper
from tagsway.report.page import PLOTLY, SHARED_SCRIPT, load_asset
from tagsway.report.set_page import SetReport, SubsetPictures, render_set_page
from tagsway.report.set_words import describe_effects
from tagsway.sets.columns import WHOLE
from tagsway.sets.effects import Effects
from tagsway.sets.jobs import page_ending, page_path
from tagsway.sets.ledger import NO_NUMBER
from tagsway.sets.tables import Tables, factors_of

REPORT = "report.html"
MOST_LISTED = 2000
MOST_FAILED = 200
MOST_PICTURED = 60
"""Subsets whose figures are in the page; those of the others are in the folder figures."""

CAPTIONS = {
    "frequency": "How often each natural frequency was measured, over what the subset's shaper leaves there.",
    "factors": "The natural frequency against what was varied.",
    "decays": "The free decays, each from its own begin.",
}
"""What the figures of a subset show, by the end of their names."""


def write_set_page(
    out: Path,
    tables: Tables,
    *,
    title: str,
    shares: pd.DataFrame,
    effects: Effects,
    shaper: Shaper | None,
    no_shaper: str,
    notices: Sequence[Notice],
    figures: Mapping[str, Sequence[Path]],
) -> None:
    """Write the page of a set; the same data give the same bytes.

    Parameters
    ----------
    out : Path
        The folder of the results.
    tables : Tables
        Of the set.
    title : str
        The set's name.
    shares, effects : DataFrame, Effects
        What is written beside it.
    shaper, no_shaper : Shaper or None, str
        For the whole set, or why there is none.
    notices : sequence of Notice
        What to know.
    figures : mapping of str to sequence of Path
        The figures of each subset, and those of the whole set by its name.
    """
    whole = tables.measurements
    rows = _records(whole.iloc[:: max(1, len(whole) // MOST_LISTED)][:MOST_LISTED])
    for row in rows:
        page = page_path(out, row["key"], page_ending(row["pick"]))
        row["page"] = page.relative_to(out).as_posix() if row["key"] and page.exists() else ""
    failed = whole[whole["status"].isin(NO_NUMBER)]
    pictured = [name for name in tables.subsets if name in figures][:MOST_PICTURED]
    report = SetReport(
        title=title,
        version=__version__,
        whole=WHOLE,
        summary=_records(tables.summary),
        shares=_records(shares),
        effects=_records(effects.table),
        spans=_spans(tables.kept()),
        measurements=rows,
        failed=_records(failed[:MOST_FAILED]),
        shaper=shaper,
        no_shaper=no_shaper,
        notices=tuple(notices),
        factors=_pictures(WHOLE, figures[WHOLE]) if WHOLE in figures else None,
        subsets=[_pictures(name, figures[name]) for name in pictured],
    )
    script = out / SHARED_SCRIPT
    if not script.exists():
        write_text(script, load_asset(PLOTLY))
    write_text(out / REPORT, render_set_page(report, script_url=SHARED_SCRIPT))


def tell_effects(tables: Tables, effects: Effects) -> tuple[str, ...]:
    """Return what the factors do, in the words of the page."""
    return tuple(describe_effects(_records(effects.table), _spans(tables.kept())))


def _pictures(name: str, paths: Sequence[Path]) -> SubsetPictures:
    return SubsetPictures(
        name=name, pictures=tuple((CAPTIONS[path.stem.rpartition("-")[2]], path.read_bytes()) for path in paths)
    )


def _spans(kept: pd.DataFrame) -> dict[str, tuple[float, float]]:
    """Return the range of each factor that is a number."""
    numeric = [name for name in factors_of(kept) if pd.api.types.is_numeric_dtype(kept[name])]
    return {name: (float(np.min(kept[name])), float(np.max(kept[name]))) for name in numeric if len(kept)}


def _records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return rows as plain values, None for what is missing."""
    plain = table.astype(object).where(table.notna(), None)
    return [{str(name): value for name, value in row.items()} for row in plain.to_dict("records")]
