"""What a column's name says: which quantity, along which axis, in which unit."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

Quantity = Literal["time", "index", "position", "acceleration", "angle", "other"]

STANDARD_GRAVITY_M_S2 = 9.80665

LENGTHS: Mapping[str, float] = MappingProxyType(
    {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "px": 1.0, "pixel": 1.0, "pixels": 1.0}
)
TIMES: Mapping[str, float] = MappingProxyType(
    {"s": 1.0, "sec": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}
    | {"min": 60.0}
)
ANGLES: Mapping[str, float] = MappingProxyType(
    dict.fromkeys(("deg", "degree", "degrees", "°"), 0.017453292519943295)
    | dict.fromkeys(("rad", "radian", "radians"), 1.0)
)
ACCELERATIONS: Mapping[str, float] = MappingProxyType(
    {"g": STANDARD_GRAVITY_M_S2}
    | {
        f"{length}{per}": factor
        for length, factor in (("m", 1.0), ("cm", 1e-2), ("mm", 1e-3))
        for per in ("/s2", "s-2")
    }
)
"""Units and their factors to m (px), s, rad and m/s²; "m/s²", "m_s2" and "m s^-2" are written as these first."""

_BY_QUANTITY: tuple[tuple[Quantity, Mapping[str, float]], ...] = (
    ("position", LENGTHS),
    ("time", TIMES),
    ("angle", ANGLES),
    ("acceleration", ACCELERATIONS),
)
_BRACKETS = re.compile(r"^(.*?)\s*[(\[{]\s*([^()\[\]{}]+?)\s*[)\]}]\s*$")
_TAIL = re.compile(r"^(.*?)(?:\s*/\s*|_|\s+in\s+|\s+)([^\s_]+(?:_s2|_s\^2|/s\^?[2²])?)$")
_PER_SECOND_SQUARED = re.compile(
    r"[\s_·*]*(?:/\s*s(?:ec)?|_s|s)\s*\^?\s*-?\s*[2²]|[\s_·*]*/\s*\(?s\s*[*·]\s*s\)?|[\s·*]*s⁻²"
)

_TIME = re.compile(r"^(t|time|times?tamps?|zeit|temps|tiempo|tijd|tempo|elapsed|seconds?|sec|secs|clock)\b", re.I)
_INDEX = re.compile(r"^(frames?|frame[ _]?(no|number|index|idx)|index|sample|image|coords|step)$", re.I)
_ACCELERATION = re.compile(r"acc|beschl|versnel|acelera|\ba[ _]?[xyz]\b|^a$", re.I)
_NEVER = re.compile(r"absolut|betrag|magnitud|total|norm|resultant|\bspeed|veloc|geschwind|std|error|sigma|\|", re.I)
_ANGLE = re.compile(r"angle|winkel|theta|\bphi\b|[θφ]|^deg(rees?)?$|angul|hoek", re.I)
_POSITION = re.compile(
    r"^(pos(ition)?|displacement|deflection|weg|way|auslenkung|elongation|x|y|z)\b|[ _./-][xyz]\b", re.I
)
_AXIS = re.compile(r"(?:^|[^a-z])a?([xyz])(?:$|[^a-z])", re.I)


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """What a column holds.

    Parameters
    ----------
    name : str
        As the file has it.
    quantity : str
        "time", "index", "position", "acceleration", "angle" or "other".
    axis : {"x", "y", "z"} or None
        Of a position or an acceleration; None where the name does not say.
    unit : str or None
        As it was recognised; None where the name does not say.
    factor : float
        From that unit to m, px, s, rad or m/s²; 1 without one.
    """

    name: str
    quantity: Quantity
    axis: Literal["x", "y", "z"] | None
    unit: str | None
    factor: float


def describe_column(name: str) -> Column:
    """Return what a column's name says; a name that says nothing is "other"."""
    base, unit = _split(name)
    stated, factor = _unit(unit)
    spaced = base.replace("_", " ").strip()
    quantity: Quantity
    if _NEVER.search(name):
        quantity = "other"
    elif stated == "acceleration" or _ACCELERATION.search(spaced):
        quantity = "acceleration"
    elif _TIME.search(spaced):
        quantity = "time"
    elif _INDEX.search(base):
        quantity = "index"
    elif stated == "angle" or _ANGLE.search(spaced):
        quantity = "angle"
    else:
        quantity = "position" if stated == "position" or _POSITION.search(spaced) else "other"
    found = _AXIS.search(spaced)
    axis = found.group(1).lower() if found else None
    if unit is not None and stated != quantity:
        quantity = "other"  # a column called x in kg is no position
    return Column(
        name=name,
        quantity=quantity,
        axis=axis,  # type: ignore[arg-type] # the expression lets x, y and z through
        unit=unit,
        factor=factor,
    )


def is_unit(cell: str) -> bool:
    """Say whether a cell is a unit and nothing else, as in a row of units below the names."""
    return _unit(cell.strip("()[] "))[0] is not None


def _split(name: str) -> tuple[str, str | None]:
    """Return a name without its unit, and the unit; what stands in brackets is one, known or not."""
    if found := _BRACKETS.match(name):
        return found.group(1), found.group(2)
    found = _TAIL.match(name)
    if found and _unit(found.group(2))[0] is not None:
        return found.group(1), found.group(2)
    return (name, name) if name.lower() in {"deg", "degree", "degrees"} else (name, None)


def _unit(text: str | None) -> tuple[Quantity | None, float]:
    if text is None:
        return None, 1.0
    plain = _PER_SECOND_SQUARED.sub("/s2", text.strip()) if len(text.strip()) > 2 else text.strip()
    for quantity, units in _BY_QUANTITY:
        for known in (plain, plain.lower()):
            if known in units:
                return quantity, units[known]
    return None, 1.0
