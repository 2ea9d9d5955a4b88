"""What a comparison comes to, as files."""

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pandas as pd

from tagsway.criteria import SETTLED
from tagsway.errors import InputError, TagswayError
from tagsway.files import write_text
from tagsway.model import Comparison, ConditionCurves
from tagsway.report.comparison import plot_indicators, plot_moves, write_comparison_figure
from tagsway.report.comparison_page import render_comparison
from tagsway.sets.comparing import MoveLoader
from tagsway.sets.comparison import QUANTITIES, Sorted, part_of, values_of
from tagsway.sets.ledger import read_kept
from tagsway.sets.moves import median_move
from tagsway.sets.subsets import name_files
from tagsway.sets.tables import CONDITION, GROUP, PLACE
from tagsway.store.comparisons import comparison_document, conditions_table, differences_table, read_comparison
from tagsway.store.documents import dump
from tagsway.store.measurements import write_table

TABLES = ("comparison.csv", "conditions.csv", "differences.csv")
OUTPUTS = (*TABLES, "report.html", "comparison.json")
FOREIGN = ("result.json", "measurements.csv", "design.json", "simulation.json")
"""What other commands leave in a folder of their own."""

MOST_LINES = 40
"""Measurements of a condition that are drawn over each other, and their median."""


def write_comparison(
    comparison: Comparison, rows: Sorted, moves: Sequence[MoveLoader], out: Path, *, title: str
) -> None:
    """Write tables, figures and page of a comparison; comparison.json comes last.

    Parameters
    ----------
    comparison : Comparison
        What was found.
    rows : Sorted
        The measurements.
    moves : sequence of callable
        By the column `place` of the rows.
    out : Path
        Made where it is missing; figures that an earlier comparison in it names are removed.
    title : str
        Of the page.
    """
    curves = gather_curves(rows, moves)
    figures = out / "figures"
    for stale in _earlier_figures(out):
        (figures / stale).unlink(missing_ok=True)
    write_table(out / TABLES[0], _rows_table(comparison, rows))
    write_table(out / TABLES[1], conditions_table(comparison))
    write_table(out / TABLES[2], differences_table(comparison))
    names = _figure_names(comparison.groups)
    for group in comparison.groups:
        own = [curve for curve in curves if curve.group == group and curve.moves]
        if own:
            figure = plot_moves(own, title=f"{title}, {group}" if group else title)
            write_comparison_figure(figure, figures / names[group])
    write_comparison_figure(plot_indicators(curves, over=comparison.within), figures / "indicators.png")
    write_text(out / "report.html", render_comparison(comparison, curves, title=title))
    write_text(out / "comparison.json", dump(comparison_document(comparison)))


def check_comparison_outputs(out: Path, inputs: Sequence[Path]) -> None:
    """Raise an InputError where a comparison would write over an input or other results, or a folder is in its way."""
    for name in FOREIGN:
        if (out / name).exists():
            raise InputError(
                f"--out {out}: {name} in it is another command's, whose files would be lost; give another folder"
            )
    for name in OUTPUTS:
        target = out / name
        if target.is_dir():
            raise InputError(f"--out {out}: {target} is a folder, where a file is to be; give another folder")
        for path in inputs:
            if target.exists() and path.exists() and target.samefile(path):
                raise InputError(f"--out {out} would write over the input {path}; give another folder")


def _figure_names(groups: Sequence[str]) -> dict[str, str]:
    return {group: f"moves-{name}.png" if group else "moves.png" for group, name in name_files(groups).items()}


def _earlier_figures(out: Path) -> list[str]:
    """Return the figures of an earlier comparison in a folder: those that its groups name."""
    try:
        earlier = read_comparison(out / "comparison.json")
    except InputError:
        return []
    return ["indicators.png", *_figure_names(earlier.groups).values()]


def _rows_table(comparison: Comparison, rows: Sorted) -> pd.DataFrame:
    """Return comparison.csv: a row a measurement; a factor that is called as one of our columns stands behind it."""
    own = {CONDITION: "condition", **({GROUP: "group"} if comparison.within else {})}
    table = rows.table.drop(columns=["key", PLACE, *({GROUP} - own.keys())])
    asked = {name: f"{name} (factor)" for name in own.values() if name in table}
    table = table.rename(columns=asked).rename(columns=own)
    return table[[*own.values(), *(name for name in table.columns if name not in own.values())]]


@contextmanager
def leaving_nothing(out: Path) -> Iterator[None]:
    """Remove the folder where what fails within made it and no result is kept in it for the next time."""
    made = not out.exists()
    try:
        yield
    except TagswayError:
        if made and not any(read_kept(path) for path in out.glob("results/*/*.jsonl")):
            shutil.rmtree(out, ignore_errors=True)
        raise


def gather_curves(rows: Sorted, moves: Sequence[MoveLoader]) -> tuple[ConditionCurves, ...]:
    """Return what is drawn of each condition in each group, in their order."""
    found = []
    for group in rows.groups:
        for condition in rows.conditions:
            part = part_of(rows, group, condition)
            if not len(part):
                continue
            places = part[PLACE].to_numpy(dtype=int)
            drawn = places[:: -(-len(places) // MOST_LINES)]
            own = [move for place in drawn if (move := moves[place]()) is not None]
            travel = part["reference_mm"].median()
            found.append(
                ConditionCurves(
                    group=group,
                    condition=condition,
                    moves=tuple(own),
                    middle=median_move(own),
                    band_m=SETTLED * float(travel) / 1e3 if np.isfinite(travel) else 0.0,
                    points={quantity: values_of(part, quantity) for quantity in QUANTITIES},
                )
            )
    return tuple(found)
