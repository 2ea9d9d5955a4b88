"""The figures and the shaper of each subset: drawn where something changed, by the workers where there are any."""

import hashlib
import json
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tagsway import __version__
from tagsway.files import whole_file, write_text
from tagsway.model import FloatArray
from tagsway.sets.ahead import Ahead
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


@dataclass(frozen=True, slots=True, kw_only=True)
class SubsetPlan:
    """What is to be drawn of a subset, but for the decays, which are read where it is drawn.

    Parameters
    ----------
    bare : SubsetTask
        Without decays.
    sources : sequence of (Item, str, tuple of int)
        Whose decays are drawn: a file, the key of its result, and which of its measurements.
    """

    bare: SubsetTask
    sources: Sequence[tuple[Item, str, tuple[int, ...]]]

    @property
    def key(self) -> str:
        """A digest of all that the subset's files depend on."""
        bare = self.bare
        factors = {name: list(map(str, values)) for name, values in bare.factors.items()}
        words = [__version__, bare.name, factors, [[key, numbers] for _, key, numbers in self.sources]]
        digest = hashlib.sha256(json.dumps(words).encode())
        arrays = [bare.frequency_hz, bare.rejected_hz, bare.few_hz]
        if bare.measured is not None:
            measured = bare.measured
            told = (measured.frequency_std_hz, measured.operating_hz, measured.amplitude_mm)
            arrays += [measured.frequency_hz, measured.damping_ratio, *(each for each in told if each is not None)]
        for array in arrays:
            digest.update(f"{len(array)} ".encode())
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()

    def task(self, ledger: Ledger) -> SubsetTask:
        """Return what is to be drawn, with the decays: those whose unit is the first one's."""
        found: list[tuple[FloatArray, FloatArray]] = []
        unit = self.bare.unit
        for item, _, numbers in self.sources:
            for number, kept in enumerate(ledger.kept(item), start=1):
                decay = kept.get("decay")
                if decay is None or number not in numbers or len(found) >= MOST_DECAYS:
                    continue
                unit = decay["unit"] if not found else unit
                if decay["unit"] == unit:
                    found.append((np.asarray(decay["time_s"], dtype=float), np.asarray(decay["sway"], dtype=float)))
        return replace(self.bare, decays=found, unit=unit)


def plan_subsets(tables: Tables, items: Sequence[Item], ledger: Ledger) -> list[SubsetPlan]:
    """Return what is to be drawn of each subset, in the tables' order; see `begin_subsets`."""
    of: dict[str, list[Item]] = defaultdict(list)
    for item in items:
        of[item.subset].append(item)
    return [_plan(tables, subset, of[subset], ledger) for subset in tables.subsets]


def begin_subsets(
    tables: Tables, items: Sequence[Item], ledger: Ledger, crew: Crew | None, ahead: Ahead | None = None
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
        Who draws what is not drawn yet, beside this process; None for this process alone.
    ahead : Ahead, optional
        What was drawn already.

    Returns
    -------
    callable
        Gives the files of every subset, in the tables' order.
    """
    out = ledger.out
    if ahead is not None:
        ahead.stop()
    earlier = _read_drawn(out)
    plans = plan_subsets(tables, items, ledger)
    keys = [plan.key for plan in plans]
    stems = name_files(plan.bare.name for plan in plans)
    known = [
        _known(out, plan.bare.name, stems[plan.bare.name], key, earlier) for plan, key in zip(plans, keys, strict=True)
    ]
    changed = [n for n, files in enumerate(known) if files is None and not (ahead and ahead.has(plans[n].bare.name))]
    drawing = _begin_to_draw([plans[n].task(ledger) for n in changed], crew)

    def finish() -> list[SubsetFiles]:
        drawn = dict(zip(changed, drawing(), strict=True))
        told = []
        for n, (plan, key, files) in enumerate(zip(plans, keys, known, strict=True)):
            if files is None:
                early = ahead.take(plan.bare.name, key) if ahead and n not in drawn else None
                picture = drawn.get(n) or early or draw_subset(plan.task(ledger))
                files = _write(out, plan.bare.name, stems[plan.bare.name], picture)
            told.append(files)
        _write_drawn(out, dict(zip(keys, told, strict=True)))
        return told

    return finish


def name_files(names: Iterable[str]) -> dict[str, str]:
    """Return a file's name for each of several names.

    What other systems cannot write is replaced, and then told apart; so are names that differ in their case alone.
    """
    several = set(names)
    alike = Counter(name.lower() for name in several)
    return {name: _name_file(name, alone=alike[name.lower()] == 1) for name in several}


def _name_file(name: str, *, alone: bool) -> str:
    plain = re.sub(r"[^\w.-]+", "-", name, flags=re.ASCII).strip("-.")[:80]
    if plain == name and alone:
        return plain
    return f"{plain}-{hashlib.sha256(name.encode()).hexdigest()[:6]}".lstrip("-")


def _begin_to_draw(tasks: Sequence[SubsetTask], crew: Crew | None) -> Callable[[], list[DrawnSubset]]:
    """Hand all subsets but one to the workers, and return what draws the rest: that one, and what none has begun."""
    drawing: list[Future[DrawnSubset]] = []
    if crew is not None:
        try:
            drawing = [crew.executor.submit(draw_subset, task) for task in tasks[:-1]]
        except Exception as fault:
            if not crew.died(fault):
                raise

    def finish() -> list[DrawnSubset]:
        own = {
            number: draw_subset(task)
            for number, task in reversed(list(enumerate(tasks)))
            if crew is None or number >= len(drawing) or crew.take_back(drawing[number])
        }
        try:
            return [own[number] if number in own else drawing[number].result() for number in range(len(tasks))]
        except Exception as fault:
            if crew is None or not crew.died(fault):
                raise
            return [own[number] if number in own else draw_subset(task) for number, task in enumerate(tasks)]

    return finish


def _write(out: Path, name: str, stem: str, drawn: DrawnSubset) -> SubsetFiles:
    shaper = None
    if drawn.shaper is not None:
        shaper = out / "shapers" / f"{stem}.json"
        write_shaper(shaper, drawn.shaper)
    figures = []
    for what, png in drawn.pictures:
        figures.append(out / "figures" / f"{stem}-{what}.png")
        with whole_file(figures[-1]) as part:
            part.write_bytes(png)
    return SubsetFiles(name=name, figures=tuple(figures), shaper=shaper, no_shaper=drawn.no_shaper)


def _read_drawn(out: Path) -> dict[str, Any]:
    """Return what was drawn last, by its key; nothing where that cannot be read."""
    try:
        entries = json.loads((out / DRAWN).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return entries if isinstance(entries, dict) else {}


def _known(out: Path, name: str, stem: str, key: str, earlier: dict[str, Any]) -> SubsetFiles | None:
    """Return the files of a subset where they are what was drawn of the same, whole, untouched and named alike."""
    try:
        entry = earlier[key]
        figures, shaper = entry["figures"], entry["shaper"]
        named = all(file.rpartition("-")[0] == f"figures/{stem}" for file in figures)
        whole = named and all(file_sha256(out / file) == sha256 for file, sha256 in {**figures, **shaper}.items())
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


def _plan(tables: Tables, subset: str, items: Sequence[Item], ledger: Ledger) -> SubsetPlan:
    whole, kept = tables.measurements, tables.kept(subset)
    out = (whole["subset"] == subset) & (whole["rejected_by"] != "")
    few = kept.iloc[:: max(1, len(kept) // MOST_POINTS)]
    bare = SubsetTask(
        name=subset,
        frequency_hz=kept[FREQUENCY].to_numpy(dtype=float),
        rejected_hz=whole.loc[out, FREQUENCY].dropna().to_numpy(dtype=float),
        measured=modes_of(kept, source=MEASUREMENTS),
        few_hz=few[FREQUENCY].to_numpy(dtype=float),
        factors={name: values for name, values in factor_values(few).items() if few[name].nunique() > 1},
        decays=(),
        unit="mm",
    )
    some = items[:: max(1, len(items) // MOST_DECAYS)]
    few = kept[kept["file"].isin([item.name for item in some])]
    numbers = few["pick"].fillna(1).astype(int).groupby(few["file"]).agg(tuple)
    sources = [(item, ledger.result_of(item) or "", numbers[item.name]) for item in some if item.name in numbers]
    return SubsetPlan(bare=bare, sources=sources)
