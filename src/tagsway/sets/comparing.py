"""From conditions to their measurements: those that were made are read, the others are made."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from tagsway.errors import InputError
from tagsway.filters import clean_track
from tagsway.model import AlignedMove
from tagsway.pipeline import align_result
from tagsway.sets.batch import Begin, measure_items
from tagsway.sets.conditions import Sources
from tagsway.sets.jobs import Outcome, result_path
from tagsway.sets.ledger import open_ledger, read_kept
from tagsway.sets.measuring import row_of_result
from tagsway.sets.moves import to_move
from tagsway.sets.options import inside
from tagsway.sets.output import MEASUREMENTS
from tagsway.sets.tables import CONDITION, COPY, PLACE, arrange_rows
from tagsway.sets.workers import Crew
from tagsway.store.documents import read_result
from tagsway.store.tables import read_table
from tagsway.store.tracks import read_track

TRACK = "track.csv"
NEEDED = "max_pcp_acceleration_m_s2"
"""A column that sets measured by an earlier version do not have."""


MoveLoader = Callable[[], AlignedMove | None]
"""Reads a move once it is drawn: a set has more than anybody can draw, or keep in memory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Gathered:
    """The measurements of all conditions.

    Parameters
    ----------
    table : DataFrame
        A row a measurement: those of measurements.csv, `CONDITION` where it was named, and `PLACE` in `moves`.
    moves : tuple of callable
        Gives the move of each measurement; None where it shows none.
    """

    table: pd.DataFrame
    moves: tuple[MoveLoader, ...]


def gather(
    sources: Sources,
    out: Path,
    hired: Callable[[], AbstractContextManager[Crew]],
    *,
    begin: Begin,
    report: Callable[[Outcome], None],
) -> Gathered:
    """Read what was measured, and measure what was not.

    Parameters
    ----------
    sources : Sources
        Of all conditions.
    out : Path
        Folder in which new measurements are kept, and looked for.
    hired, begin, report : callable
        As in `measure_set`; called only where there is something to measure.

    Returns
    -------
    Gathered

    Raises
    ------
    InputError
        Where what was measured cannot be read.
    """
    rows: list[dict[str, Any]] = []
    moves: list[MoveLoader] = []

    def add(condition: str | None, row: Mapping[str, Any], move: MoveLoader) -> None:
        rows.append({**row, **({} if condition is None else {CONDITION: condition})})
        moves.append(move)

    for condition, path in sources.results:
        single, move = _read_single(path)
        add(condition, single, partial(_same, move))
    for condition, folder in sources.sets:
        for row in _read_set(folder):
            add(condition, row, partial(_load_move, folder, row["key"], row["pick"]))
    if sources.items:
        with open_ledger(out) as ledger:
            measure_items([item for _, item in sources.items], ledger, hired, begin=begin, report=report)
            for condition, item in sources.items:
                for row in ledger.rows(item):
                    own = {"file": item.name, "subset": item.subset, **dict(item.factors), **row}
                    add(condition, own, partial(_load_move, out, row.get("key"), row.get("pick")))
    if not rows:
        raise InputError("there is nothing to compare: no measurement was found")
    table = arrange_rows(rows)
    table[PLACE] = range(len(table))
    return Gathered(table=table, moves=tuple(moves))


def _read_single(path: Path) -> tuple[dict[str, Any], AlignedMove | None]:
    """Return the row of a single measurement, and its move from the track beside it."""
    result, track, move = read_result(path), path.parent / TRACK, None
    if result.indicators is not None and track.exists():
        whole = read_track(track)
        move = align_result(result, whole, clean_track(whole))
    error = result.warnings[-1].message if result.status == "not_determined" and result.warnings else None
    return {"file": path.as_posix(), "subset": "", "error": error, **row_of_result(result, move)}, move


def _read_set(folder: Path) -> Iterator[dict[str, Any]]:
    """Give the rows of a measured set."""
    table = read_table(folder / MEASUREMENTS, expected="the measurements.csv of a measured set")
    for name in ("file", "pick", "key", "status", NEEDED):
        if name not in table:
            raise InputError(
                f"{folder / MEASUREMENTS} has no column {name!r}: an earlier version measured it; measure it again, by "
                "the same identify batch (nothing is tracked again)"
            )
    for row in table.to_dict("records"):
        told = {str(name): None if pd.isna(value) else value for name, value in row.items()}
        if str(told.get("rejected_by") or "").startswith(COPY):
            continue  # a file twice is one repeat
        yield {**told, "file": f"{folder.as_posix()}/{row['file']}"}


def _load_move(folder: Path, key: str | None, pick: float | None) -> AlignedMove | None:
    """Return the move that a set keeps of a measurement."""
    if key is None:
        return None
    kept = read_kept(inside(result_path(folder, key), folder, origin=str(folder / MEASUREMENTS)))
    number = 0 if pick is None else int(pick) - 1
    return to_move(kept[number].get("move")) if number < len(kept) else None


def _same(move: AlignedMove | None) -> AlignedMove | None:
    return move
