"""From conditions to their measurements: those that were made are read, the others are made."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from tagsway.errors import InputError
from tagsway.filters import clean_track
from tagsway.model import AlignedMove, Notice
from tagsway.pipeline import align_result
from tagsway.sets.batch import Begin, measure_items
from tagsway.sets.columns import NUMBERS
from tagsway.sets.conditions import Sources
from tagsway.sets.jobs import Outcome, result_path
from tagsway.sets.ledger import open_ledger, read_digests, read_kept
from tagsway.sets.manifest import as_text
from tagsway.sets.measuring import row_of_result
from tagsway.sets.moves import to_move
from tagsway.sets.options import inside
from tagsway.sets.tables import CONDITION, COPY, MEASUREMENTS, PLACE, arrange_rows
from tagsway.sets.workers import Crew
from tagsway.store.documents import read_result
from tagsway.store.tables import read_table
from tagsway.store.tracks import read_track

TRACK = "track.csv"
NEEDED = "max_pcp_acceleration_m_s2"
"""A column that sets measured by an earlier version do not have."""

MOST_NAMED = 5
"""Copies that are named."""

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
    notices : tuple of Notice
        What was left out.
    """

    table: pd.DataFrame
    moves: tuple[MoveLoader, ...]
    notices: tuple[Notice, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Origin:
    """Where a measurement comes from: the digest of its file, the folder that keeps it, and its key there."""

    content: str | None
    folder: Path
    key: str | None = None


@dataclass(slots=True)
class _Heap:
    """Rows and moves as they come in, each film once."""

    rows: list[dict[str, Any]] = field(default_factory=list)
    moves: list[MoveLoader] = field(default_factory=list)
    copies: list[str] = field(default_factory=list)
    seen: dict[tuple[str, Any], tuple[str | None, str, _Origin]] = field(default_factory=dict)

    def add(self, condition: str | None, row: Mapping[str, Any], move: MoveLoader, origin: _Origin) -> None:
        """Take a row, unless its film is in already: then leave it out, or refuse it in another condition."""
        if str(row.get("rejected_by") or "").startswith(COPY):
            self.copies.append(str(row["file"]))
            return
        if origin.content is not None and row.get("trajectory_time_s") is not None:
            name = str(row["file"])
            other, film, earlier = self.seen.setdefault((origin.content, row.get("pick")), (condition, name, origin))
            apart = origin.folder == earlier.folder and origin.key != earlier.key  # in one set: another window of it
            if earlier is not origin and not apart:
                if other != condition:
                    raise InputError(
                        f"condition {condition!r}: {name} holds the same as {film} in {other!r}; expected each "
                        "measurement in one condition, once"
                    )
                self.copies.append(name)
                return
        self.rows.append({**row, **({} if condition is None else {CONDITION: condition})})
        self.moves.append(move)

    def notices(self) -> tuple[Notice, ...]:
        """Tell what was left out."""
        if not self.copies:
            return ()
        more = f" and {len(self.copies) - MOST_NAMED} more" if len(self.copies) > MOST_NAMED else ""
        message = f"left out as copies of others, as a film twice is one repeat: {', '.join(self.copies[:MOST_NAMED])}"
        return (Notice(code="copies", message=message + more),)


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
        Where what was measured cannot be read, or one film stands in two conditions.
    """
    heap = _Heap()
    for condition, path in sources.results:
        single, move, content = _read_single(path)
        heap.add(condition, single, partial(_same, move), _Origin(content=content, folder=path))
    for condition, folder in sources.sets:
        digests = read_digests(folder)
        for name, row in _read_set(folder):
            origin = _Origin(content=digests.get(name, row["key"]), folder=folder.resolve(), key=row["key"])
            heap.add(condition, row, partial(_load_move, folder, row["key"], row["pick"]), origin)
    if sources.items:
        with open_ledger(out) as ledger:
            measure_items([item for _, item in sources.items], ledger, hired, begin=begin, report=report)
            for condition, item in sources.items:
                origin = _Origin(content=ledger.content_of(item), folder=out.resolve(), key=ledger.result_of(item))
                for row in ledger.rows(item):
                    own = {"file": item.name, "subset": item.subset, **dict(item.factors), **row}
                    heap.add(condition, own, partial(_load_move, out, row.get("key"), row.get("pick")), origin)
    if not heap.rows:
        raise InputError("there is nothing to compare: no measurement was found")
    table = arrange_rows(heap.rows)
    table[PLACE] = range(len(table))
    return Gathered(table=table, moves=tuple(heap.moves), notices=heap.notices())


def _read_single(path: Path) -> tuple[dict[str, Any], AlignedMove | None, str]:
    """Return the row of a single measurement, its move from the track beside it, and the digest of its film."""
    result, track, move = read_result(path), path.parent / TRACK, None
    if result.indicators is not None and track.exists():
        whole = read_track(track)
        move = align_result(result, whole, clean_track(whole))
    error = result.warnings[-1].message if result.status == "not_determined" and result.warnings else None
    row = {"file": as_text(path), "subset": "", "error": error, **row_of_result(result, move)}
    return row, move, result.source.sha256


def _read_set(folder: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Give the rows of a measured set, each behind the name of its file in the set."""
    table = read_table(folder / MEASUREMENTS, expected="the measurements.csv of a measured set")
    for name in ("file", "pick", "key", "status", NEEDED):
        if name not in table:
            raise InputError(
                f"{folder / MEASUREMENTS} has no column {name!r}: an earlier version measured it; measure it again, by "
                "the same identify batch (nothing is tracked again)"
            )
    for name in (name for name in ("pick", *NUMBERS) if name in table):
        wrong = pd.to_numeric(table[name], errors="coerce").isna() & table[name].notna()
        if wrong.any():
            raise InputError(f"{folder / MEASUREMENTS}: {name} is {table[name][wrong].iloc[0]!r}: expected a number")
    for row in table.to_dict("records"):
        told = {str(name): None if pd.isna(value) else value for name, value in row.items()}
        yield str(row["file"]), {**told, "file": f"{as_text(folder)}/{row['file']}"}


def _load_move(folder: Path, key: str | None, pick: float | None) -> AlignedMove | None:
    """Return the move that a set keeps of a measurement."""
    if key is None:
        return None
    kept = read_kept(inside(result_path(folder, key), folder, origin=str(folder / MEASUREMENTS)))
    number = 0 if pick is None else int(pick) - 1
    return to_move(kept[number].get("move")) if number < len(kept) else None


def _same(move: AlignedMove | None) -> AlignedMove | None:
    return move
