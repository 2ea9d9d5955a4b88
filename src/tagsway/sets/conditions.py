"""What is compared with what: from the words of a command to the files of each condition."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tagsway.errors import InputError
from tagsway.sets.manifest import ATTEMPTS, FILMS, TRACKS, Item, as_text, find_set
from tagsway.sets.options import make_settings
from tagsway.sets.remote import is_url
from tagsway.sets.tables import MEASUREMENTS

RESULT = "result.json"
MEASURABLE = FILMS | TRACKS | {".txt"}
"""Endings of the files that a pattern means."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """A condition as it was asked for.

    Parameters
    ----------
    name : str or None
        None for a whole set, whose own factors make the conditions.
    paths : tuple of str
        Videos, tracks, results, sets, or patterns of them.
    """

    name: str | None
    paths: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sources:
    """Where the measurements of all conditions come from.

    Parameters
    ----------
    items : tuple of (str or None, Item)
        Files that are to be measured, each with its condition.
    results : tuple of (str or None, Path)
        result.json of single measurements.
    sets : tuple of (str or None, Path)
        Folders with the results of measured sets.
    """

    items: tuple[tuple[str | None, Item], ...]
    results: tuple[tuple[str | None, Path], ...]
    sets: tuple[tuple[str | None, Path], ...]


def read_conditions(words: Sequence[str]) -> tuple[Condition, ...]:
    """Return the conditions that some words name.

    Parameters
    ----------
    words : sequence of str
        NAME=FILES, where further files of the same condition may follow as words of their own; or files and folders
        alone, each a condition of that name; or a single set.

    Returns
    -------
    tuple of Condition
        In their order.

    Raises
    ------
    InputError
        Where a name is missing, or stands for two.
    """
    named: dict[str, list[str]] = {}
    bare: list[str] = []
    last: str | None = None
    for word in words:
        name, sign, path = word.partition("=")
        if not sign or _exists(word) or is_url(name):
            (bare if last is None else named[last]).append(word)
            continue
        if not (name.strip() and path.strip()):
            raise InputError(f"{word!r} names no condition: expected NAME=FILES, such as unshaped='before/*.mp4'")
        last = name.strip()
        named.setdefault(last, []).append(path)
    if named and bare:
        raise InputError(f"{bare[0]} belongs to no condition: expected NAME=FILES, such as unshaped={bare[0]}")
    if not named and len(bare) == 1:
        return (Condition(name=None, paths=(bare[0],)),)
    for word in bare:
        if (name := _name_of(Path(word))) in named:
            raise InputError(f"two conditions are called {name!r}: give them names, as in before={word}")
        named[name] = [word]
    if len(named) < 2:
        raise InputError(f"there is one condition, {next(iter(named), '')!r}: a comparison needs two; name another")
    return tuple(Condition(name=as_text(name), paths=tuple(paths)) for name, paths in named.items())


def find_sources(
    conditions: Sequence[Condition], stated: Mapping[str, Any], *, leave_out: Path | None = None
) -> Sources:
    """Find the files, results and sets of all conditions.

    Parameters
    ----------
    conditions : sequence of Condition
        What was asked for.
    stated : mapping
        Options for the files that are to be measured, by name; what a set says of its own goes before.
    leave_out : Path, optional
        The folder of the comparison.

    Returns
    -------
    Sources

    Raises
    ------
    InputError
        Where a file is missing, a pattern matches nothing, or a file stands in two conditions.
    """
    items: list[tuple[str | None, Item]] = []
    results: list[tuple[str | None, Path]] = []
    sets: list[tuple[str | None, Path]] = []
    for condition in conditions:
        for text in condition.paths:
            for path in _expand(text, condition.name):
                whole = Path(path)
                if is_url(path):
                    items.append((condition.name, _item(path, condition.name, stated)))
                elif is_measured_set(whole):
                    sets.append((condition.name, whole))
                elif (found := _result_of(whole)) is not None:
                    results.append((condition.name, found))
                else:
                    new = _items_of(whole, condition.name, stated, leave_out)
                    items += [(condition.name, item) for item in new]
    _refuse_twice(items, results, sets)
    return Sources(items=tuple(items), results=tuple(results), sets=tuple(sets))


def check_factor(sources: Sources, factor: str | None, *, option: str, least: int = 1) -> None:
    """Raise an InputError where no file that is to be measured says a factor: before the work, not after it.

    Parameters
    ----------
    sources : Sources
        Of all conditions.
    factor : str or None
        None asks for nothing.
    option : str
        That names it, for the error.
    least : int
        Levels that it must have.
    """
    if factor is None or sources.sets or sources.results:
        return
    said = [{"subset": item.subset, **dict(item.factors)} for _, item in sources.items]
    levels = {str(each[factor]) for each in said if factor in each}
    if len(levels) < least:
        known = sorted({name for each in said for name in each})
        varied = [name for name in known if len({str(each.get(name)) for each in said}) > 1]
        raise InputError(
            f"{option} {factor}: {len(levels)} levels of it in {len(said)} files, expected {least} or more; what "
            f"varies: {', '.join(varied) or 'nothing'}"
        )


def is_measured_set(path: Path) -> bool:
    """Tell whether a folder holds the results of a measured set."""
    return path.is_dir() and (path / ATTEMPTS).exists() and (path / MEASUREMENTS).exists()


def _exists(word: str) -> bool:
    """Tell whether a word is a file; one that is too long for a name is none."""
    return os.path.exists(word)  # noqa: PTH110 - Path.exists raises there


def _name_of(path: Path) -> str:
    whole = path.resolve()
    name = whole.parent.name if whole.name == RESULT else whole.name if whole.is_dir() else whole.stem
    return name.removesuffix("-identify")


def _expand(text: str, condition: str | None) -> list[str]:
    """Return the paths that a word stands for; a shell leaves a pattern behind NAME= as it is."""
    if is_url(text):
        return [text]
    path = str(Path(text).expanduser())
    if _exists(path) or "%" in Path(path).name:
        return [path]
    where = "" if condition is None else f" of condition {condition!r}"
    if not any(sign in path for sign in "*?["):
        raise InputError(f"{text}{where}: no such file; give a video, a track, a result, a set, or a pattern of them")
    anchor = Path(path).anchor
    try:
        matches = sorted(Path(anchor or ".").glob(str(Path(path).relative_to(anchor))))
    except (ValueError, OSError) as fault:
        raise InputError(
            f"{text!r}{where} is no pattern of files: {str(fault).lower()}; such as 'before/*.mp4'"
        ) from None
    found = [str(match) for match in matches if _is_meant(match)]
    if not found:
        raise InputError(f"{text!r}{where} matches nothing that can be measured or was")
    return found


def _is_meant(path: Path) -> bool:
    if path.is_dir():
        return is_measured_set(path) or _result_of(path) is not None
    if path.suffix.lower() in TRACKS and (path.parent / RESULT).exists():
        return False  # the tables beside a result are its own
    return path.suffix.lower() in MEASURABLE or path.name == RESULT


def _result_of(path: Path) -> Path | None:
    inside = path / RESULT if path.is_dir() else path
    return inside if inside.suffix == ".json" and inside.exists() else None


def _items_of(path: Path, condition: str | None, stated: Mapping[str, Any], leave_out: Path | None) -> list[Item]:
    """Return the files of a set, or a file as one of its own."""
    if condition is None:
        return list(find_set(path, leave_out=leave_out, stated=stated).items)
    if path.is_dir() or path.suffix.lower() == ".toml":
        found = find_set(path, leave_out=leave_out, stated=stated, may_be_empty=path.is_dir())
        if found.items or path.suffix.lower() == ".toml":
            folder = path if path.is_dir() else path.parent
            return [replace(item, name=as_text(folder / item.name)) for item in found.items]
    return [_item(str(path), condition, stated)]


def _item(path: str, condition: str | None, stated: Mapping[str, Any]) -> Item:
    return Item(
        name=path if is_url(path) else as_text(Path(path)),
        path=path if is_url(path) else str(Path(path).resolve()),
        subset=as_text(condition or ""),
        factors=(),
        settings=make_settings(stated, origin="the options"),
        picks=bool(stated.get("picks", False)),
    )


def _refuse_twice(
    items: Sequence[tuple[str | None, Item]],
    results: Sequence[tuple[str | None, Path]],
    sets: Sequence[tuple[str | None, Path]],
) -> None:
    """Refuse a file that is compared with itself, or counted twice."""
    seen: dict[str, str | None] = {}
    places = [(name, item.path) for name, item in items]
    for name, path in [*places, *((name, str(path.resolve())) for name, path in [*results, *sets])]:
        if path in seen:
            other = "twice in it" if seen[path] == name else f"in {seen[path]!r}, too"
            raise InputError(f"condition {name!r}: {path} is {other}; expected each measurement in one condition, once")
        seen[path] = name
