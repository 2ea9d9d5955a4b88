"""What a design or a simulation promised of a condition, against what was measured."""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tagsway.errors import InputError
from tagsway.model import Promise
from tagsway.repeats import share_interval
from tagsway.sets.comparison import PLAIN, Sorted, part_of, values_of
from tagsway.store.designs import DESIGN_SCHEMA

SIMULATION_SCHEMA = "tagsway/simulation/1"
FILES = ("design.json", "simulation.json")
ACCELERATION = "max_acceleration_m_s2"

SIMULATED = {
    "motion_time_s": "motion_time_s",
    "trajectory_time_s": "trajectory_time_s",
    "overshoot_percent": "overshoot_percent",
    "max_pcp_acceleration_m_s2": "pcp_acceleration_m_s2",
    "max_pcp_vector_m_s2": "pcp_vector_m_s2",
    "residual_max_m_s2": "residual_max_m_s2",
    "residual_rms_m_s2": "residual_rms_m_s2",
    "place_error_mm": "place_error_mm",
    "box_error_mm": "box_error_mm",
}
"""What is measured, and what a simulated row calls it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Said:
    shaping: str
    acceleration_m_s2: float
    quantity: str
    kind: Literal["planned", "at most"]
    value: float
    share: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Document:
    """What a design.json or a simulation.json says.

    Parameters
    ----------
    text : str
        As it was asked for: PATH or CONDITION=PATH.
    condition : str or None
        Of which it is said; None where its own words tell.
    source : str
        The file's name.
    said : tuple
        Values and limits.
    """

    text: str
    condition: str | None
    source: str
    said: tuple[_Said, ...]


def read_promises(texts: Sequence[str]) -> tuple[Document, ...]:
    """Read what was promised.

    Parameters
    ----------
    texts : sequence of str
        Each PATH or CONDITION=PATH: a design.json or a simulation.json, or the folder of one.

    Raises
    ------
    InputError
        Where a file is neither.
    """
    found = []
    for text in texts:
        name, sign, named = text.partition("=")
        whole = not sign or Path(text).exists()
        path = _file(Path(text if whole else named))
        condition = None if whole else name
        found.append(Document(text=text, condition=condition, source=path.name, said=tuple(_read(path))))
    return tuple(found)


def judge_promises(documents: Sequence[Document], rows: Sorted, *, within: str | None) -> tuple[Promise, ...]:
    """Hold what was promised against what was measured.

    Parameters
    ----------
    documents : sequence of Document
        What was promised.
    rows : Sorted
        The measurements.
    within : str, optional
        The factor that makes the groups: where it is the acceleration, a promise holds for the group of its own.

    Returns
    -------
    tuple of Promise

    Raises
    ------
    InputError
        Where one says nothing that was measured, or of no condition that there is.
    """
    found: list[Promise] = []
    for document in documents:
        name = document.condition
        if name is not None and name not in rows.conditions:
            raise InputError(
                f"--design {document.text}: there is no condition {name!r}, but {', '.join(rows.conditions)}"
            )
        new = list(_judge(document.said, name, rows, source=document.source, within=within))
        if not new:
            raise InputError(
                f"--design {document.text}: it says nothing of a condition that was measured; name the condition, as "
                f"in --design {rows.conditions[-1]}=PATH"
            )
        found += new
    return tuple(found)


def _judge(
    said: Sequence[_Said], name: str | None, rows: Sorted, *, source: str, within: str | None
) -> Iterator[Promise]:
    shaping_of = _match(sorted({one.shaping for one in said}), name, rows.conditions)
    for group in rows.groups:
        for condition in rows.conditions:
            for one in said:
                elsewhere = within == ACCELERATION and not _is_near(one.acceleration_m_s2, group)
                if shaping_of.get(condition) != one.shaping or elsewhere:
                    continue
                values = values_of(part_of(rows, group, condition), one.quantity)
                values = values[~np.isnan(values)]
                if len(values):
                    yield _promise(one, group, condition, source, values)


def _promise(one: _Said, group: str, condition: str, source: str, values: np.ndarray[Any, Any]) -> Promise:
    median = float(np.median(values))
    kept = int(np.count_nonzero(values <= one.value)) if one.kind == "at most" else None
    interval = None if kept is None else share_interval(kept, len(values))
    verdict: Literal["kept", "open", "broken"] | None = None
    if interval is not None and one.share is not None:
        verdict = "kept" if interval[0] >= one.share else "broken" if interval[1] < one.share else "open"
    return Promise(
        group=group,
        condition=condition,
        source=source,
        quantity=one.quantity,
        kind=one.kind,
        promised=one.value,
        share=one.share,
        n=len(values),
        kept=kept,
        median=median if np.isfinite(median) else None,
        kept_ci95=interval,
        verdict=verdict,
    )


def _match(shapings: Sequence[str], name: str | None, conditions: Sequence[str]) -> dict[str, str]:
    """Return how each condition is shaped, where that is said: by its name, or because nothing else is left."""
    asked = conditions if name is None else (name,)
    found = {condition: shaping for condition in asked for shaping in shapings if _alike(shaping, condition)}
    lone = conditions[1] if name is None and len(conditions) == 2 else name
    if lone is not None and lone not in found:
        shaped = [shaping for shaping in shapings if shaping != "unshaped"]
        left = [s for s in shaped or (shapings if name is not None else []) if s not in found.values()]
        if len(left) == 1:
            found[lone] = left[0]
    return found


def _alike(shaping: str, condition: str) -> bool:
    plain = "-".join(re.split(r"[,+\s_-]+", condition.strip().lower()))
    return plain in PLAIN if shaping == "unshaped" else plain == shaping


def _file(path: Path) -> Path:
    if not path.is_dir():
        return path
    inside = [path / name for name in FILES if (path / name).exists()]
    if len(inside) != 1:
        raise InputError(f"--design {path}: expected one of {' and '.join(FILES)} in it, found {len(inside)}")
    return inside[0]


def _read(path: Path) -> Iterator[_Said]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        schema = document["schema"]
        if schema == DESIGN_SCHEMA:
            yield from _read_design(document)
        elif schema == SIMULATION_SCHEMA:
            yield from _read_simulation(document)
        else:
            raise InputError(f"{path}: expected schema {DESIGN_SCHEMA!r} or {SIMULATION_SCHEMA!r}, found {schema!r}")
    except InputError:
        raise
    except OSError as fault:
        raise InputError(f"--design {path}: {(fault.strerror or 'cannot be read').lower()}") from None
    except (ValueError, KeyError, TypeError) as fault:
        raise InputError(f"{path} is no design.json and no simulation.json ({fault})") from None


def _read_design(document: Mapping[str, Any]) -> Iterator[_Said]:
    chosen, limits = document["chosen"], document["limits"]
    axes = "-".join(chosen["shaped_axes"])
    shaping = "unshaped" if chosen["name"] == "unshaped" or not axes else axes
    planned = _Said(
        shaping=shaping,
        acceleration_m_s2=float(chosen["max_acceleration_m_s2"]),
        quantity="trajectory_time_s",
        kind="planned",
        value=float(chosen["motion_time_s"]),
    )
    yield planned
    for quantity, limit in (
        ("place_error_mm", limits["placement_window_mm"]),
        ("max_pcp_acceleration_m_s2", limits["pcp_acceleration_m_s2"]),
    ):
        if limit is not None and np.isfinite(limit):
            share = float(limits["share"])
            yield replace(planned, quantity=quantity, kind="at most", value=float(limit), share=share)


def _read_simulation(document: Mapping[str, Any]) -> Iterator[_Said]:
    worst = int(document["payload"]["samples"]) > 1
    for row in document["rows"]:
        for quantity, name in SIMULATED.items():
            if row.get(name) is not None:
                yield _Said(
                    shaping="-".join(str(row["shaping"]).split(",")),
                    acceleration_m_s2=float(row["max_acceleration_m_s2"]),
                    quantity=quantity,
                    kind="at most" if worst and quantity != "trajectory_time_s" else "planned",
                    value=float(row[name]),
                )


def _is_near(acceleration_m_s2: float, group: str) -> bool:
    try:
        return bool(np.isclose(acceleration_m_s2, float(group), rtol=1e-3))
    except ValueError:
        return False
