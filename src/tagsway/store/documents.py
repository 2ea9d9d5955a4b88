"""JSON documents: the types of `model`, in the units and with the keys that others rely on."""

import json
import math
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from tagsway.errors import InputError
from tagsway.files import write_text
from tagsway.model import Estimate, Result, Shaper

T = TypeVar("T")

RESULT_SCHEMA = "tagsway/result/1"
SHAPER_SCHEMA = "tagsway/shaper/1"

DOCUMENT_UNITS = {"_m": ("_mm", 1e3), "_kg": ("_g", 1e3)}
"""How a name of the model ends, how the document's does, and the factor between them."""

PER_DEGREE = {
    "stiffness_n_m_per_rad": "stiffness_n_m_per_deg",
    "damping_n_m_s_per_rad": "damping_n_m_s_per_deg",
}
"""Keys that a document gives a second time, in the thesis' unit."""


def to_document(value: Any, factor: float = 1.0) -> Any:
    """Return plain lists, dicts and numbers, in the units of a document.

    Parameters
    ----------
    value : Any
        A type of `model`, or what it is made of.
    factor : float
        By which every number inside is multiplied.

    Returns
    -------
    Any
        What `json.dumps` takes.
    """
    if is_dataclass(value) and not isinstance(value, type):
        return {
            _document_key(item.name): to_document(getattr(value, item.name), factor * _factor(item.name))
            for item in fields(value)
        }
    if isinstance(value, dict):
        return {key: to_document(item, factor) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_document(item, factor) for item in value]
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"a document holds finite numbers, not {value}")
        return _shortest(value * factor) if factor != 1.0 else value
    return value


def from_document(kind: type[T], document: Any, *, origin: str) -> T:
    """Return the type of `model` that a document holds.

    Parameters
    ----------
    kind : type
        What it should be.
    document : Any
        Plain lists, dicts and numbers, in the units of a document.
    origin : str
        The file's name, for the error.

    Raises
    ------
    InputError
        Where a key is missing, unknown or of the wrong kind: names the first one.
    """
    return validate(kind, _to_model_units(document), origin=origin)


def validate(kind: type[T], data: Any, *, origin: str) -> T:
    """Return `data` as a type of `model`, or raise an InputError that names the first fault."""
    try:
        # As JSON and strictly: a list stands for a tuple there, but no text for a number.
        return TypeAdapter(kind).validate_json(json.dumps(data, default=str), strict=True)
    except ValidationError as fault:
        first = fault.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        cause = first.get("ctx", {}).get("error")
        words = str(cause) if isinstance(cause, InputError) else f"{place}: {first['msg'].lower()}"
        raise InputError(f"{origin}: {words}") from None


def read_json(path: Path, schema: str) -> dict[str, Any]:
    """Read a JSON document and check that it is of one schema; the key `schema` is taken off.

    Raises
    ------
    InputError
        Where the file cannot be read, is no JSON object, or is of another schema.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as fault:
        raise InputError(f"{path}: {(fault.strerror or 'cannot be read').lower()}; give a {schema} file") from None
    except (UnicodeDecodeError, json.JSONDecodeError) as fault:
        raise InputError(f"{path} is not JSON ({fault}); give a {schema} file") from None
    if not isinstance(document, dict) or document.get("schema") != schema:
        found = document.get("schema") if isinstance(document, dict) else type(document).__name__
        raise InputError(f"{path}: expected schema {schema!r}, found {found!r}")
    del document["schema"]
    return document


def shaper_document(shaper: Shaper) -> dict[str, Any]:
    """Return what shaper.json holds."""
    return {"schema": SHAPER_SCHEMA, **to_document(shaper), "duration_s": shaper.duration_s}


def result_document(result: Result) -> dict[str, Any]:
    """Return what result.json holds."""
    document = {"schema": RESULT_SCHEMA, **to_document(result)}
    if result.shaper is not None:
        document["shaper"] = shaper_document(result.shaper)
    if result.pendulum is not None:
        for per_radian, per_degree in PER_DEGREE.items():
            estimate: Estimate | None = getattr(result.pendulum, per_radian)
            document["pendulum"][per_degree] = to_document(estimate, math.pi / 180)
    return document


def dump(document: Any) -> str:
    """Return a document as text."""
    return json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def write_shaper(path: Path, shaper: Shaper) -> None:
    """Write shaper.json."""
    write_text(path, dump(shaper_document(shaper)))


def read_shaper(path: Path) -> Shaper:
    """Read shaper.json."""
    return _shaper_from(read_json(path, SHAPER_SCHEMA), origin=str(path))


def write_result(path: Path, result: Result) -> None:
    """Write result.json."""
    write_text(path, dump(result_document(result)))


def read_result(path: Path) -> Result:
    """Read result.json."""
    document = read_json(path, RESULT_SCHEMA)
    for per_degree in PER_DEGREE.values():
        if isinstance(document.get("pendulum"), dict):
            document["pendulum"].pop(per_degree, None)
    if isinstance(document.get("shaper"), dict):
        document["shaper"] = {k: v for k, v in document["shaper"].items() if k not in ("schema", "duration_s")}
    return from_document(Result, document, origin=str(path))


def _shaper_from(document: dict[str, Any], *, origin: str) -> Shaper:
    document.pop("duration_s", None)
    return from_document(Shaper, document, origin=origin)


def _document_key(name: str) -> str:
    for ending, (replacement, _) in DOCUMENT_UNITS.items():
        if name.endswith(ending):
            return name.removesuffix(ending) + replacement
    return name


def _factor(name: str) -> float:
    return next((factor for ending, (_, factor) in DOCUMENT_UNITS.items() if name.endswith(ending)), 1.0)


def _to_model_units(value: Any, factor: float = 1.0) -> Any:
    if isinstance(value, dict):
        renamed = {}
        for key, item in value.items():
            name, scale = key, 1.0
            for ending, (replacement, unit) in DOCUMENT_UNITS.items():
                if key.endswith(replacement):
                    name, scale = key.removesuffix(replacement) + ending, 1 / unit
            renamed[name] = _to_model_units(item, factor * scale)
        return renamed
    if isinstance(value, list):
        return [_to_model_units(item, factor) for item in value]
    if isinstance(value, (int, float)) and not isinstance(value, bool) and factor != 1.0:
        return value * factor
    return value


def _shortest(value: float) -> float:
    """Take off the last bits that a change of unit adds: 45.85, not 45.849999999999994."""
    return float(f"{value:.15g}")
