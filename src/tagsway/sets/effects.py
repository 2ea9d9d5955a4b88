"""What a set's factors do to frequency and damping, as a table."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from tagsway.errors import NotIdentifiableError
from tagsway.model import FactorModel, FloatArray, Notice
from tagsway.repeats import fit_factor_effects
from tagsway.sets.tables import factors_of
from tagsway.store.measurements import DAMPING, FREQUENCY

LABELS = frozenset(
    {"condition", "cup", "date", "direction", "gripper", "move", "operator", "payload", "pick_position"}
    | {"place_position", "product", "robot", "sample", "shaped", "shaped_axes"}
)
"""Factors whose numbers are names."""

COUNTERS = frozenset({"set", "repeat", "run"})
"""Factors that number the measurements: they cause nothing."""

COLUMNS = (
    "quantity",
    "factor",
    "level",
    "against",
    "n",
    "effect",
    "std",
    "low",
    "high",
    "unit",
    "p_value",
    "remark",
)

INTERACT = 0.01
"""Chance of a lack of fit below which the effects are said not to add up."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effects:
    """What the factors do.

    Parameters
    ----------
    table : DataFrame
        A row an effect, and one for each that the data do not tell; empty where no factor varies.
    frequency : FactorModel or None
        Of the natural frequency, in Hz.
    notices : tuple of Notice
        What to know about them.
    """

    table: pd.DataFrame
    frequency: FactorModel | None
    notices: tuple[Notice, ...]


def find_effects(kept: pd.DataFrame) -> Effects:
    """Return the effects of the factors of some measurements on their frequency and on their damping.

    Parameters
    ----------
    kept : DataFrame
        Measurements that were not rejected. The damping ratio spans decades: its logarithm is fitted, and its effects
        are told in percent.
    """
    factors = factor_values(kept)
    rows: list[dict[str, Any]] = []
    models: dict[str, FactorModel] = {}
    notices: dict[str, str] = {}
    for name in (FREQUENCY, DAMPING):
        values: FloatArray = kept[name].to_numpy(dtype=float)
        if name == DAMPING:
            values = np.log(np.where(values > 0, values, np.nan))
        try:
            models[name] = model = fit_factor_effects(values, factors, labels=LABELS)
        except NotIdentifiableError as fault:
            if fault.code != "no_factor":
                notices[fault.code] = str(fault)
            continue
        rows += _rows(name, model)
        notices |= _notices(name, model)
    table = pd.DataFrame.from_records(rows, columns=list(COLUMNS))
    table["n"] = table["n"].astype("Int64")
    return Effects(
        table=table,
        frequency=models.get(FREQUENCY),
        notices=tuple(Notice(code=code, message=message) for code, message in notices.items()),
    )


def factor_values(kept: pd.DataFrame) -> dict[str, list[object]]:
    """Return the factors of some measurements, without what merely counts them; numbers that are names as words."""
    found: dict[str, list[object]] = {}
    for name in factors_of(kept):
        if name not in COUNTERS:
            values: list[object] = kept[name].astype(object).tolist()
            found[name] = [_as_name(value) for value in values] if name in LABELS else values
    return found


def _as_name(value: object) -> object:
    """Return 3 and 3.0 as "3": a column with gaps holds floats."""
    number = isinstance(value, (int, float)) and not isinstance(value, bool) and value == value
    return f"{value:.15g}" if number else value  # 20260131 is a date: six digits would make a month one day


def _rows(quantity: str, model: FactorModel) -> list[dict[str, Any]]:
    in_percent = quantity == DAMPING
    rows: list[dict[str, Any]] = []
    for one in model.effects:
        value, low, high = (_percent(x) if in_percent else x for x in (one.effect.value, *one.effect.ci95))
        unit = "%" if in_percent else "Hz"
        rows.append(
            {
                "quantity": quantity,
                "factor": one.factor,
                "level": one.level or "",
                "against": one.reference or "",
                "n": one.n,
                "effect": value,
                "std": 100 * float(np.exp(one.effect.value)) * one.effect.std if in_percent else one.effect.std,
                "low": low,
                "high": high,
                "unit": unit if one.level is not None else f"{unit} per unit of {one.factor}",
                "p_value": one.p_value,
                "remark": "",
            }
        )
    for other in model.unanswered:
        rows.append({"quantity": quantity, "factor": other.factor, "level": other.level or "", "remark": other.reason})
    return rows


def _notices(quantity: str, model: FactorModel) -> dict[str, str]:
    """Return what to know of a model, by code."""
    words = {FREQUENCY: "the natural frequency", DAMPING: "the damping ratio"}[quantity]
    found = {}
    confounded = [one for one in model.unanswered if one.reason.startswith("confounded")]
    if confounded:
        told = "; ".join(f"{one.factor} is {one.reason}" for one in confounded)
        found["factors_confounded"] = f"the effect of {_and([one.factor for one in confounded])} is not told: {told}"
    if model.grouped_by is not None:
        found["factors_nested"] = (
            f"measurements of the same {model.grouped_by} are no independent repeats: the errors of the effects are "
            f"those between {model.grouped_by}s"
        )
    if model.lack_of_fit_p is not None and model.lack_of_fit_p < INTERACT:
        found[f"factors_interact_{quantity}"] = (
            f"the factors' effects on {words} do not simply add up (p = {model.lack_of_fit_p:.2g}): they depend on "
            "each other, or a slope is bent; compare the subsets"
        )
    return found


def _percent(logarithm: float) -> float:
    return 100 * float(np.expm1(logarithm))


def _and(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
