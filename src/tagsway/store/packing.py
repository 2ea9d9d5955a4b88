"""Any type of `model` in one .npz file: arrays as they are, the rest as JSON; nothing is pickled."""

import json
import types
import zipfile
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from tagsway.files import whole_file
from tagsway.model import Curves

T = TypeVar("T")

TREE = "tree.json"


def pack(value: Any) -> tuple[dict[str, np.ndarray[Any, Any]], Any]:
    """Take a value apart.

    Returns
    -------
    arrays : dict of ndarray
        Named by their place: "decay.time_s", "tags.0.centre_px".
    tree : Any
        Plain lists, dicts and numbers; "" stands where an array was.
    """
    arrays: dict[str, np.ndarray[Any, Any]] = {}

    def walk(item: Any, place: str) -> Any:
        if isinstance(item, np.ndarray):
            arrays[place] = item
            return ""
        if is_dataclass(item) and not isinstance(item, type):
            return {f.name: walk(getattr(item, f.name), _join(place, f.name)) for f in fields(item)}
        if isinstance(item, (tuple, list)):
            return [walk(part, _join(place, str(i))) for i, part in enumerate(item)]
        return item

    return arrays, walk(value, "")


def unpack(kind: type[T], arrays: dict[str, np.ndarray[Any, Any]], tree: Any) -> T:
    """Put a value together again; its type says what each part is."""

    def build(hint: Any, item: Any, place: str) -> Any:
        origin = get_origin(hint)
        if item is None:
            return None
        if origin in (Union, types.UnionType):
            return build(next(option for option in get_args(hint) if option is not type(None)), item, place)
        if place in arrays:
            return arrays[place]
        if isinstance(hint, type) and is_dataclass(hint):
            hints = get_type_hints(hint)
            return hint(**{f.name: build(hints[f.name], item[f.name], _join(place, f.name)) for f in fields(hint)})
        if origin is tuple:
            inner = get_args(hint)
            of = [inner[0]] * len(item) if inner[-1] is Ellipsis else list(inner)
            return tuple(build(h, part, _join(place, str(i))) for i, (h, part) in enumerate(zip(of, item, strict=True)))
        return item

    value: T = build(kind, tree, "")
    return value


def write_packed(path: Path, value: Any) -> None:
    """Write a value as .npz, whole or not at all."""
    arrays, tree = pack(value)
    with whole_file(path) as temporary:
        np.savez(temporary, allow_pickle=False, **arrays, **{TREE: np.array(json.dumps(tree))})


def read_packed(kind: type[T], path: Path) -> T:
    """Read a value that `write_packed` wrote.

    Raises
    ------
    ValueError
        Where the file is not one of these, or holds another type.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files if name != TREE}
            return unpack(kind, arrays, json.loads(str(archive[TREE])))
    except (OSError, EOFError, KeyError, TypeError, NotImplementedError, zipfile.BadZipFile) as fault:
        raise ValueError(f"{path} does not hold a {kind.__name__}: {fault}") from None


def write_curves(path: Path, curves: Curves) -> None:
    """Write curves.npz: one array a curve's part, named like "decay.time_s"."""
    write_packed(path, curves)


def read_curves(path: Path) -> Curves:
    """Read curves.npz."""
    return read_packed(Curves, path)


def _join(place: str, name: str) -> str:
    return f"{place}.{name}" if place else name
