"""The figures and the shaper of each subset: drawn where something changed, by the workers where there are any."""

import hashlib
import json
import re
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tagsway import __version__
from tagsway.files import whole_file, write_text
from tagsway.model import FloatArray
from tagsway.sets.drawing import DrawnSubset, SubsetTask, draw_subset
from tagsway.sets.effects import factor_values
from tagsway.sets.ledger import Ledger
from tagsway.sets.manifest import Item
from tagsway.sets.tables import MEASUREMENTS, Tables, modes_of
from tagsway.sets.workers import Crew
from tagsway.store.documents import write_shaper
from tagsway.store.measurements import FREQUENCY
from tagsway.store.steps import file_sha256

DRAWN = "steps/drawn.json"
"""Of what each subset was drawn last, and what came out: nothing is drawn twice."""

MOST_DECAYS = 200
"""That are drawn over each other."""

MOST_POINTS = 5000
"""That are drawn against a factor."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SubsetFiles:
    """What is written of a subset.

    Parameters
    ----------
    name : str
        Of the subset.
    figures : tuple of Path
        In the order in which they are shown.
    shaper : Path or None
        None where there is none.
    no_shaper : str
        Why.
    """

    name: str
    figures: tuple[Path, ...]
    shaper: Path | None
    no_shaper: str

    @property
    def files(self) -> tuple[Path, ...]:
        """All of them."""
        return self.figures if self.shaper is None else (*self.figures, self.shaper)


def begin_subsets(
    tables: Tables, items: Sequence[Item], ledger: Ledger, crew: Crew | None
) -> Callable[[], list[SubsetFiles]]:
    """Hand the subsets that changed to the workers, and return what waits for them and writes their files.

    Parameters
    ----------
    tables : Tables
        Of the set.
    items : sequence of Item
        Whose decays are drawn.
    ledger : Ledger
        Where their results are; its folder is written into.
    crew : Crew or None
        Who draws; None for this process, once it waits.

    Returns
    -------
    callable
        Gives the files of every subset, in the tables' order.
    """
    out = ledger.out
    earlier = _read_drawn(out)
    tasks = [_task(tables, subset, items, ledger) for subset in tables.subsets]
    keys = [_key(task) for task in tasks]
    known = [_known(out, task.name, key, earlier) for task, key in zip(tasks, keys, strict=True)]
    changed = [task for task, files in zip(tasks, known, strict=True) if files is None]
    drawing = _begin_to_draw(changed, crew)

    def finish() -> list[SubsetFiles]:
        drawn = iter(_end_drawing(drawing, changed, crew))
        told = [
            _write(out, task, next(drawn)) if files is None else files for task, files in zip(tasks, known, strict=True)
        ]
        _write_drawn(out, dict(zip(keys, told, strict=True)))
        return told

    return finish


def name_file(subset: str) -> str:
    """Return a subset's name as a file's: what other systems cannot write is replaced, and then told apart."""
    plain = re.sub(r"[^\w.-]+", "-", subset, flags=re.ASCII).strip("-.")[:80]
    if plain == subset:
        return plain
    return f"{plain}-{hashlib.sha256(subset.encode()).hexdigest()[:6]}".lstrip("-")


def _begin_to_draw(tasks: Sequence[SubsetTask], crew: Crew | None) -> list[Future[DrawnSubset]]:
    """Hand the subsets to the workers; none is handed over where there are none, or they have died."""
    if crew is None:
        return []
    try:
        return [crew.executor.submit(draw_subset, task) for task in tasks]
    except Exception as fault:
        if not crew.died(fault):
            raise
        return []


def _end_drawing(
    drawing: Sequence[Future[DrawnSubset]], tasks: Sequence[SubsetTask], crew: Crew | None
) -> list[DrawnSubset]:
    """Return the subsets as they are drawn: those that no worker has begun, by this process meanwhile."""
    if crew is None or not drawing:
        return [draw_subset(task) for task in tasks]
    own = {
        number: draw_subset(task)
        for number, task in reversed(list(enumerate(tasks)))
        if crew.take_back(drawing[number])
    }
    try:
        return [own[number] if number in own else future.result() for number, future in enumerate(drawing)]
    except Exception as fault:
        if not crew.died(fault):
            raise
        return [draw_subset(task) for task in tasks]


def _write(out: Path, task: SubsetTask, drawn: DrawnSubset) -> SubsetFiles:
    name = name_file(task.name)
    shaper = None
    if drawn.shaper is not None:
        shaper = out / "shapers" / f"{name}.json"
        write_shaper(shaper, drawn.shaper)
    figures = []
    for what, png in drawn.pictures:
        figures.append(out / "figures" / f"{name}-{what}.png")
        with whole_file(figures[-1]) as part:
            part.write_bytes(png)
    return SubsetFiles(name=task.name, figures=tuple(figures), shaper=shaper, no_shaper=drawn.no_shaper)


def _key(task: SubsetTask) -> str:
    """Return a digest of all that a subset's files depend on."""
    measured = task.measured
    told = [__version__, task.name, task.unit, {name: list(map(str, values)) for name, values in task.factors.items()}]
    digest = hashlib.sha256(json.dumps(told).encode())
    arrays = [task.frequency_hz, task.rejected_hz, task.few_hz, *(array for decay in task.decays for array in decay)]
    if measured is not None:
        arrays += [measured.frequency_hz, measured.damping_ratio]
        arrays += [] if measured.frequency_std_hz is None else [measured.frequency_std_hz]
    for array in arrays:
        digest.update(f"{len(array)} ".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _read_drawn(out: Path) -> dict[str, Any]:
    """Return what was drawn last, by its key; nothing where that cannot be read."""
    try:
        entries = json.loads((out / DRAWN).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return entries if isinstance(entries, dict) else {}


def _known(out: Path, name: str, key: str, earlier: dict[str, Any]) -> SubsetFiles | None:
    """Return the files of a subset where they are what was drawn of the same, whole and untouched."""
    try:
        entry = earlier[key]
        figures, shaper = entry["figures"], entry["shaper"]
        whole = all(file_sha256(out / file) == sha256 for file, sha256 in {**figures, **shaper}.items())
        return (
            SubsetFiles(
                name=name,
                figures=tuple(out / file for file in figures),
                shaper=next((out / file for file in shaper), None),
                no_shaper=str(entry["no_shaper"]),
            )
            if whole
            else None
        )
    except (KeyError, TypeError, AttributeError, OSError):
        return None


def _write_drawn(out: Path, subsets: dict[str, SubsetFiles]) -> None:
    def digests(paths: Sequence[Path]) -> dict[str, str]:
        return {path.relative_to(out).as_posix(): file_sha256(path) for path in paths}

    entries = {
        key: {
            "figures": digests(files.figures),
            "shaper": digests([] if files.shaper is None else [files.shaper]),
            "no_shaper": files.no_shaper,
        }
        for key, files in subsets.items()
    }
    write_text(out / DRAWN, json.dumps(entries, indent=1) + "\n")


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
