"""What a design or a simulation promised of a condition, against what was measured."""

import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd

from tagsway.errors import InputError
from tagsway.model import FloatArray, Notice, Promise
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
        whole = not sign or os.path.exists(text)  # noqa: PTH110 - Path.exists raises for a name too long
        path = _file(Path(text if whole else named))
        condition = None if whole else name
        said = tuple(_read(path))
        if not all(np.isfinite([number for one in said for number in (one.value, one.acceleration_m_s2)])):
            raise InputError(f"{path} holds a number that is not finite, where a time or a limit is to be")
        found.append(Document(text=text, condition=condition, source=path.name, said=said))
    return tuple(found)


def judge_promises(
    documents: Sequence[Document], rows: Sorted, *, within: str | None
) -> tuple[tuple[Promise, ...], tuple[Notice, ...]]:
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
    promises : tuple of Promise
    notices : tuple of Notice
        What they do not tell.

    Raises
    ------
    InputError
        Where one says nothing that was measured, or of no condition that there is.
    """
    found: list[Promise] = []
    notices: list[Notice] = []
    for document in documents:
        name = document.condition
        if name is not None and name not in rows.conditions:
            raise InputError(
                f"--design {document.text}: there is no condition {name!r}, but {', '.join(rows.conditions)}"
            )
        _require_one_acceleration(document, rows, within)
        told: list[Notice] = []
        new = list(_judge(document, rows, within=within, told=told))
        notices += told
        if not new:
            raise InputError(
                f"--design {document.text}: it says nothing of a condition that was measured, but of "
                f"{', '.join(dict.fromkeys(one.shaping for one in document.said)) or 'none'}; name the condition, as "
                f"in --design {rows.conditions[-1]}=PATH"
            )
        found += new
    return tuple(found), tuple(dict.fromkeys(notices))


def _require_one_acceleration(document: Document, rows: Sorted, within: str | None) -> None:
    """Refuse several promises for one measured move: nothing says which of them is meant."""
    if within == ACCELERATION:
        return
    shaping_of = _match(sorted({one.shaping for one in document.said}), document.condition, rows.conditions)
    for shaping in shaping_of.values():
        several = {one.acceleration_m_s2 for one in document.said if one.shaping == shaping}
        if len(several) > 1:
            raise InputError(
                f"--design {document.text}: it tells of {len(several)} accelerations of {shaping}, "
                f"{min(several):g} to {max(several):g} m/s², and only --within {ACCELERATION} tells which of them was "
                "run; or give the simulation of the one that was"
            )


def _judge(document: Document, rows: Sorted, *, within: str | None, told: list[Notice]) -> Iterator[Promise]:
    said, source = document.said, document.source
    shaping_of = _match(sorted({one.shaping for one in said}), document.condition, rows.conditions)
    for group in rows.groups:
        for condition in rows.conditions:
            part, limits = part_of(rows, group, condition), []
            for one in said:
                elsewhere = within == ACCELERATION and not _is_near(one.acceleration_m_s2, group)
                if shaping_of.get(condition) != one.shaping or elsewhere:
                    continue
                values = _known_values(one, part, condition, told)
                if one.kind == "at most":
                    limits.append((one, values))
                if not np.isnan(values).all():
                    yield _promise(one, group, condition, source, values[~np.isnan(values)])
            if len(limits) > 1:
                yield from _judge_together(limits, group, condition, source, told)


def _known_values(one: _Said, part: pd.DataFrame, condition: str, told: list[Notice]) -> FloatArray:
    """Return what was measured of a quantity, NaN where it does not tell whether the promise is kept."""
    values = values_of(part, one.quantity)
    open_end = np.isinf(values) & ~(part["watched_s"].to_numpy(dtype=float) >= one.value)
    if open_end.any():
        told.append(_tell_open(one, condition, int(open_end.sum())))
    return np.where(open_end, np.nan, values)


def _judge_together(
    limits: Sequence[tuple[_Said, FloatArray]], group: str, condition: str, source: str, told: list[Notice]
) -> Iterator[Promise]:
    """Give the promise of all limits at once, over the measurements that break one or tell all of those measured.

    A limit that was not measured can only be broken by more of them: then the rest breaks the promise, or leaves it
    open.
    """
    seen = [(one, values) for one, values in limits if not np.isnan(values).all()]
    unseen = [one.quantity for one, values in limits if np.isnan(values).all()]
    if not seen:
        told.append(_tell_unseen(unseen, condition))
        return
    broken = np.any([values > one.value for one, values in seen], axis=0)
    whole = np.all([~np.isnan(values) for _, values in seen], axis=0)
    kept, n = int(np.sum(whole & ~broken)), int(np.sum(whole | broken))
    if not n:
        told.append(_tell_apart([one.quantity for one, _ in limits], condition))
        return
    partly = int(np.sum(np.any([~np.isnan(values) for _, values in seen], axis=0))) - n
    share = limits[0][0].share
    interval = _interval_together(seen, kept, n, partly)
    verdict = _verdict(interval, share)
    if unseen:
        verdict = "open" if verdict == "kept" else verdict
        told.append(_tell_unseen(unseen, condition))
    yield Promise(
        group=group,
        condition=condition,
        source=source,
        quantity="limits",
        kind="all limits",
        promised=None,
        share=share,
        n=n,
        kept=kept,
        median=None,
        kept_ci95=interval,
        verdict=verdict,
    )


def _interval_together(seen: Sequence[tuple[_Said, FloatArray]], kept: int, n: int, partly: int) -> tuple[float, float]:
    """Return the interval of the share that keeps all limits.

    What breaks one limit counts where others are missing, what keeps one does not: so the counted ones alone would
    tell too small a share. Its upper end takes those that tell a part to keep the rest; nor do more keep all limits
    than keep any one of them.
    """
    singles = [values[~np.isnan(values)] <= one.value for one, values in seen]
    uppers = [share_interval(int(single.sum()), len(single))[1] for single in singles]
    return share_interval(kept, n)[0], min(share_interval(kept + partly, n + partly)[1], *uppers)


def _promise(one: _Said, group: str, condition: str, source: str, values: FloatArray) -> Promise:
    median = float(np.median(values))
    kept = int(np.count_nonzero(values <= one.value)) if one.kind == "at most" else None
    interval = None if kept is None else share_interval(kept, len(values))
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
        verdict=_verdict(interval, one.share),
    )


def _verdict(interval: tuple[float, float] | None, share: float | None) -> Literal["kept", "open", "broken"] | None:
    if interval is None or share is None:
        return None
    return "kept" if interval[0] >= share else "broken" if interval[1] < share else "open"


def _tell_unseen(unseen: Sequence[str], condition: str) -> Notice:
    message = (
        f"promised of {condition} and not measured: {', '.join(unseen)}; so all limits together can be broken by what "
        "was measured, and not kept"
    )
    return Notice(code="promise_not_measured", message=message)


def _tell_apart(quantities: Sequence[str], condition: str) -> Notice:
    message = (
        f"promised of {condition} and not measured of any one pick together: {', '.join(quantities)}; no pick breaks "
        "one of them, and so all limits together are not judged"
    )
    return Notice(code="promise_not_measured", message=message)


def _tell_open(one: _Said, condition: str, count: int) -> Notice:
    message = (
        f"{count} measurements of {condition} do not settle and were watched for less than the {one.value:.3g} s that "
        "were promised: whether they keep it is not known, and they do not count"
    )
    return Notice(code="promise_unwatched", message=message)


def _match(shapings: Sequence[str], name: str | None, conditions: Sequence[str]) -> dict[str, str]:
    """Return how each condition is shaped, where that is said: by its name, or because nothing else is left."""
    asked = conditions if name is None else (name,)
    found = {condition: shaping for condition in asked for shaping in shapings if _alike(shaping, condition)}
    lone = name
    if name is None and len(conditions) == 2 and not _alike("unshaped", conditions[1]):
        lone = conditions[1]
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
        document = json.loads(path.read_text(encoding="utf-8"), parse_constant=_refuse_constant)
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


def _refuse_constant(name: str) -> None:
    raise ValueError(f"it holds {name}, where a number is to be")


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
        ("box_error_mm", limits.get("box_error_mm")),
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
