"""What a set consists of: a folder of subsets, a manifest, or one clip with many picks."""

import math
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tagsway.errors import InputError
from tagsway.files import read_toml
from tagsway.model import Settings
from tagsway.sets.columns import OWN, WHOLE
from tagsway.sets.listing import number_or_text, read_listing
from tagsway.sets.options import OPTIONS, inside, make_settings, read_options, unknown_key
from tagsway.sets.remote import find_remote, is_url, refuse_url

SET_SCHEMA = "tagsway/set/1"
MANIFEST, TABLE, INHERITED = "set.toml", "set.csv", "identify.toml"
RESULTS = ("-identify", "-compare")
"""How the names of folders of results end."""

ATTEMPTS = "attempts.jsonl"
"""The log by which a folder of results is known."""

FILMS = frozenset(
    {".mp4", ".mov", ".m4v", ".mkv", ".webm", ".avi", ".mpg", ".mpeg", ".mts", ".m2ts", ".ts", ".wmv"}
    | {".cine", ".cihx", ".cih"}
)
TRACKS = frozenset({".csv", ".tsv"})

FACTORS = frozenset(
    {"condition", "cup", "date", "direction", "gripper", "move", "operator", "payload", "pick_position"}
    | {"place_position", "product", "repeat", "robot", "run", "sample", "set", "shaped", "shaped_axes", "speed"}
    | {"vacuum", "vacuum_mbar", "acceleration", "velocity", "max_acceleration_m_s2", "max_velocity_m_s"}
)
"""What a measurement may say of itself; others as `factor_NAME`."""

SAID = frozenset({"file", "subset", "settings"})
PREFIX = "factor_"

Factor = str | int | float | bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """One file of a set.

    Parameters
    ----------
    name : str
        Its path in the set, with forward slashes; or its URL.
    path : str
        Where it is read from.
    subset : str
        To which its measurements belong.
    factors : tuple of (str, Factor)
        What was varied, sorted by name.
    settings : Settings
        What the user said about it.
    picks : bool
        Each of its moves is a measurement of its own.
    """

    name: str
    path: str
    subset: str
    factors: tuple[tuple[str, Factor], ...]
    settings: Settings
    picks: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasurementSet:
    """All files of a set, by name.

    Parameters
    ----------
    name : str
        What to call it.
    root : Path
        Its folder.
    items : tuple of Item
        Sorted by subset and name.
    """

    name: str
    root: Path
    items: tuple[Item, ...]


def find_set(
    path: Path,
    *,
    leave_out: Path | None = None,
    may_be_empty: bool = False,
    stated: Mapping[str, Any] | None = None,
) -> MeasurementSet:
    """Find all files of a set and what is said of each.

    Parameters
    ----------
    path : Path
        A folder, with a set.toml or a set.csv, or of subfolders that are its subsets; a manifest (.toml, or a .csv
        with a column `file`); or a clip, each move of which is a measurement.
    leave_out : Path, optional
        A folder in which nothing is looked for: that of the results.
    may_be_empty : bool
        For a folder that is being filled.
    stated : mapping, optional
        Options for all of its files, by name; what the set itself says goes before.

    Returns
    -------
    MeasurementSet

    Raises
    ------
    InputError
        Where there is no such set, a key is not known, a path leaves the set, or a file is named twice.
    """
    refuse_url(path)
    if not path.exists():
        raise InputError(f"{path}: no such set; give a folder, a set.toml, a table of files, or a clip")
    folder = path if path.is_dir() else path.parent
    if leave_out is not None and folder.resolve().is_relative_to(leave_out.resolve()):
        raise InputError(f"--out {leave_out} holds the set {path}: give a folder of its own for the results")
    if path.is_dir():
        finder = _Finder(path, leave_out, may_be_empty, stated or {})
        items = finder.from_folder()
    else:
        finder = _Finder(path.parent, leave_out, may_be_empty, stated or {})
        if path.suffix.lower() == ".toml":
            items = list(finder.from_toml(path))
        elif path.suffix.lower() == ".csv" and (rows := read_listing(path)) is not None:
            items = list(finder.from_rows(rows, path))
        else:
            items = [
                finder.item(path.resolve(), subset=path.stem, stated={"picks": True}, factors={}, origin=path.name)
            ]
    if not items and not may_be_empty:
        raise InputError(f"{path} holds no videos and no tracks: expected files that end in {', '.join(sorted(FILMS))}")
    _refuse_twice(items)
    if any(item.subset == WHOLE for item in items):
        raise InputError(f"{path}: a subset is called {WHOLE!r}, as the whole is in summary.csv: give it another name")
    items = _tell_sets_apart(items)
    items.sort(key=lambda item: (item.subset, item.name))
    return MeasurementSet(name=path.resolve().stem, root=finder.root, items=tuple(items))


class _Finder:
    def __init__(self, root: Path, leave_out: Path | None, may_be_empty: bool, beneath: Mapping[str, Any]) -> None:
        self._beneath = beneath
        self.root = root.resolve()
        self._leave_out = None if leave_out is None else leave_out.resolve()
        self._may_be_empty = may_be_empty
        self._inherited: dict[Path, dict[str, Any]] = {}
        self._results: dict[Path, bool] = {}
        self._settings: dict[str, Settings] = {}

    def from_folder(self) -> list[Item]:
        """Return the files of the folder: as its manifest says, or else all of them."""
        if (path := self.root / MANIFEST).exists():
            return list(self.from_toml(path))
        if (path := self.root / TABLE).exists() and (rows := read_listing(path)) is not None:
            return list(self.from_rows(rows, path))
        return list(self.from_folders())

    def from_folders(self, stated: Mapping[str, Any] | None = None) -> Iterator[Item]:
        for file in _walk(self.root, self._leave_out):
            if file.is_symlink():  # folders that are links are not entered: nothing else leads out
                inside(file, self.root, origin=str(self.root))
            yield self.item(file, subset=_subset_of(file, self.root), stated=stated or {}, factors={}, origin="")

    def from_toml(self, path: Path) -> Iterator[Item]:
        document = read_toml(path, expected=f"a {SET_SCHEMA} file")
        if (schema := document.pop("schema", None)) != SET_SCHEMA:
            raise InputError(f"{path}: expected schema = {SET_SCHEMA!r}, found {schema!r}")
        entries, common = document.pop("measurement", []), document.pop("settings", {})
        for name in document:
            raise InputError(f"{path}: {unknown_key(name, ('schema', 'settings', 'measurement'))}")
        if not (isinstance(entries, list) and all(isinstance(entry, dict) for entry in entries)):
            raise InputError(f"{path}: measurement is one table: expected [[measurement]], in two brackets")
        if not isinstance(common, dict):
            raise InputError(f"{path}: settings is {common!r}: expected a table, [settings]")
        stated = read_options(common, folder=self.root, root=self.root, origin=f"{path}, settings")
        if not entries:
            yield from self.from_folders(stated)
        for number, entry in enumerate(entries, start=1):
            yield from self._entry(entry, stated, origin=f"{path}, measurement {number}")

    def from_rows(self, rows: list[dict[str, str]], path: Path) -> Iterator[Item]:
        for line, row in enumerate(rows, start=2):
            entry = {name: number_or_text(text) for name, text in row.items() if text and text.strip()}
            for name in ("file", "subset"):
                if name in entry:
                    entry[name] = row[name].strip()
            yield from self._entry(entry, {}, origin=f"{path}, line {line}")

    def item(
        self, file: Path | str, *, subset: str, stated: Mapping[str, Any], factors: Mapping[str, Factor], origin: str
    ) -> Item:
        if isinstance(file, Path):
            name = as_text(file.relative_to(self.root))
            stated = {**self._beneath, **self._inherit(file.parent), **stated}
        else:
            name = file
            stated = {**self._beneath, **self._inherit(self.root), **stated}
        settings, picks = self._make_settings(stated, origin or name), bool(stated.get("picks", False))
        if picks and settings.window is not None:
            raise InputError(
                f"{origin or name}: picks finds a window in each move, and one is stated: leave window out"
            )
        return Item(
            name=name,
            path=str(file),
            subset=subset,
            factors=tuple(sorted(factors.items())),
            settings=settings,
            picks=picks,
        )

    def _make_settings(self, stated: Mapping[str, Any], origin: str) -> Settings:
        """Return the same settings for the same options: a set has many files and few settings."""
        key = repr(sorted(stated.items()))
        if key not in self._settings:
            self._settings[key] = make_settings(stated, origin=origin)
        return self._settings[key]

    def _entry(self, entry: Mapping[str, Any], common: Mapping[str, Any], *, origin: str) -> Iterator[Item]:
        factors, flat = _sort_keys(entry, origin)
        nested = entry.get("settings", {})
        if not isinstance(nested, dict):
            raise InputError(f"{origin}: settings is {nested!r}: expected a table of options")
        stated = dict(common)
        for table in (flat, nested):
            stated |= read_options(table, folder=self.root, root=self.root, origin=origin)
        patterns = entry.get("file")
        patterns = [patterns] if isinstance(patterns, str) else patterns
        if not patterns or not isinstance(patterns, list) or not all(isinstance(p, str) and p for p in patterns):
            raise InputError(f"{origin}: file is {entry.get('file')!r}: expected a name or a pattern such as 'a/*.mp4'")
        subset = entry.get("subset")
        if subset is not None and not (isinstance(subset, str) and subset.strip()):
            raise InputError(f"{origin}: subset is {subset!r}: expected a name")
        for pattern in patterns:
            for file in self._matches(pattern, origin):
                own = subset or _subset_of(file, self.root)
                yield self.item(file, subset=own, stated=stated, factors=factors, origin=origin)

    def _matches(self, pattern: str, origin: str) -> Iterable[Path | str]:
        if is_url(pattern):
            return find_remote(pattern, origin=origin, may_be_empty=self._may_be_empty)
        if Path(pattern).is_absolute() or ".." in Path(pattern).parts:
            raise InputError(
                f"{origin}: file {pattern!r} may lead out of the set {self.root}: expected a path inside it"
            )
        try:
            found = [p for p in sorted(self.root.glob(pattern)) if not self._is_left_out(p)]
        except (ValueError, IndexError, NotImplementedError):
            raise InputError(f"{origin}: file is {pattern!r}: expected a name or a pattern such as 'a/*.mp4'") from None
        if any(sign in pattern for sign in "*?["):
            meant = (p for p in found if p.name not in (MANIFEST, TABLE, INHERITED) and self._is_meant(p, pattern))
            files = [p for p in meant if p.is_file()]
        else:
            files = [p for p in found if p.is_file() or p.is_dir()]
        if not files and not self._may_be_empty:
            raise InputError(f"{origin}: file {pattern!r} matches nothing in {self.root}")
        for file in files:
            inside(file, self.root, origin=origin)
        return files

    def _is_meant(self, path: Path, pattern: str) -> bool:
        """Tell whether a pattern means a file: what is hidden, or among results, only where it says so."""
        hidden = any(part.startswith(".") for part in path.relative_to(self.root).parts)
        if hidden and not any(part.startswith(".") for part in Path(pattern).parts):
            return False
        return any(ending in pattern for ending in RESULTS) or not self._holds_results(path.parent)

    def _holds_results(self, folder: Path) -> bool:
        if folder == self.root:
            return False
        if folder not in self._results:
            own = folder.name.endswith(RESULTS) or (folder / ATTEMPTS).exists()
            self._results[folder] = own or self._holds_results(folder.parent)
        return self._results[folder]

    def _is_left_out(self, path: Path) -> bool:
        return self._leave_out is not None and path.resolve().is_relative_to(self._leave_out)

    def _inherit(self, folder: Path) -> dict[str, Any]:
        """Return what the identify.toml of a folder and of those above it, up to the set's, say; the nearest wins."""
        if folder not in self._inherited:
            above = {} if folder == self.root else self._inherit(folder.parent)
            path = folder / INHERITED
            own: dict[str, Any] = {}
            if path.exists():
                table = read_toml(path, expected="a table of options")
                nested = table.pop("settings", {})
                table.pop("schema", None)
                if not isinstance(nested, dict):
                    raise InputError(f"{path}: settings is {nested!r}: expected a table of options")
                own = read_options({**table, **nested}, folder=folder, root=self.root, origin=str(path))
            self._inherited[folder] = {**above, **own}
        return self._inherited[folder]


def _walk(folder: Path, leave_out: Path | None) -> Iterator[Path]:
    """Give the videos and tracks in a folder and those below, sorted; nothing hidden, and no folder of results."""
    try:
        with os.scandir(folder) as found:
            entries = sorted(found, key=lambda entry: entry.name)
    except FileNotFoundError:  # removed meanwhile
        return
    except OSError as fault:
        raise InputError(f"{folder} cannot be listed: {(fault.strerror or 'not known').lower()}") from None
    for entry in entries:
        if entry.name.startswith(".") or entry.name.endswith(RESULTS):
            continue
        path = folder / entry.name
        if entry.is_dir(follow_symlinks=False):
            if path != leave_out and not (path / ATTEMPTS).exists():
                yield from _walk(path, leave_out)
        elif path.suffix.lower() in FILMS | TRACKS and path.is_file():
            yield path


def _sort_keys(entry: Mapping[str, Any], origin: str) -> tuple[dict[str, Factor], dict[str, Any]]:
    """Return the factors and the options among the keys of a measurement."""
    factors: dict[str, Factor] = {}
    options: dict[str, Any] = {}
    for key, value in entry.items():
        name = key.replace("-", "_")
        if name in SAID:
            continue
        if name in OPTIONS:
            options[name] = value
            continue
        if name.startswith(PREFIX) and len(name) > len(PREFIX):
            name = name.removeprefix(PREFIX)
        elif name not in FACTORS:
            known = unknown_key(name, SAID | OPTIONS | FACTORS)
            raise InputError(f"{origin}: {known}; a factor of another name is written {PREFIX}{name}")
        if isinstance(value, list) and all(isinstance(part, str) for part in value):
            value = "-".join(value) or "none"
        if not isinstance(value, (str, int, float, bool)) or value in (math.inf, -math.inf) or value != value:
            raise InputError(f"{origin}: {key} is {value!r}: expected a word or a number")
        if name in OWN:
            raise InputError(f"{origin}: {key} is the name of a column of measurements.csv: give the factor another")
        if name in factors:
            raise InputError(f"{origin}: the factor {name} is stated twice: expected {name} or {PREFIX}{name}")
        factors[name] = value
    return factors, options


def _subset_of(file: Path | str, root: Path) -> str:
    if isinstance(file, str):
        return file.rpartition("/")[0]
    where = as_text(file.parent.relative_to(root))
    return as_text(Path(root.name)) if where == "." else where


def as_text(path: Path | str) -> str:
    """Return a path with forward slashes; bytes in it that are no text as \\xff, since tables hold text."""
    return (
        (path if isinstance(path, str) else path.as_posix())
        .encode("utf-8", "surrogateescape")
        .decode("utf-8", "backslashreplace")
    )


def _tell_sets_apart(items: list[Item]) -> list[Item]:
    """Return the items, with the name of the set before that of a subset that several sets have."""
    sets: dict[str, set[str]] = {}
    for item in items:
        sets.setdefault(item.subset, set()).add(_set_of(item))
    return [
        replace(item, subset=f"{_set_of(item)}/{item.subset}") if len(sets[item.subset]) > 1 else item for item in items
    ]


def _set_of(item: Item) -> str:
    return str(dict(item.factors).get("set", "no set"))


def _refuse_twice(items: list[Item]) -> None:
    seen: set[str] = set()
    for item in items:
        if item.name in seen:
            raise InputError(f"{item.name} is in the set twice: expected each file in one [[measurement]] only")
        seen.add(item.name)
