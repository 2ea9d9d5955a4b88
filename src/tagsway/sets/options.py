"""The options of `identify`, as files of a set write them: from a table of them to settings."""

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, ClassVar

from tagsway.errors import InputError
from tagsway.model import Settings, Window
from tagsway.model.estimate import FORBID_UNKNOWN
from tagsway.store.documents import validate
from tagsway.tags.families import FAMILIES

PATHS = ("camera", "with", "log")
"""Options that name a file."""

TOGETHER = frozenset({"with", "up", "tcp_id", "pcp_id", "reference_id"})
"""Options that are judged beside others, which another table may state."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What a set says of its files: names and units are those of the command's options, `picks` apart.

    Parameters
    ----------
    picks : bool
        Each move in a file is a measurement of its own.
    fps, family, … : as `identify --help` says
        Lengths in mm, masses in g; `window` is "START:END" in s, `columns` is "T,X[,Z]".
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    picks: bool = False
    fps: float | None = None
    family: str = "tag36h11"
    tcp_id: int = 0
    pcp_id: int = 1
    reference_id: int | None = None
    tag_size: float | None = None
    tcp_tag_size: float | None = None
    pcp_tag_size: float | None = None
    camera: str | None = None
    up: str | float = "image"
    mass: float | None = None
    point_mass: bool = False
    length: float | None = None
    nonnegative_stiffness: bool = False
    other: str | None = None
    sway_axis: str | float | None = None
    window: str | None = None
    frequency_spread: float | None = None
    columns: str | None = None
    shaper: str = "zv"
    log: str | None = None


OPTIONS = frozenset({field.name for field in fields(Options)} - {"other"} | {"with"})
"""Their names, with an underscore for each hyphen."""


def read_options(table: Mapping[str, Any], *, folder: Path, root: Path, origin: str) -> dict[str, Any]:
    """Return the options that a table states, by their names, and with the paths in them made absolute.

    Parameters
    ----------
    table : mapping
        Options by name; hyphens may stand for underscores.
    folder : Path
        That its paths are relative to.
    root : Path
        The set, that they may not leave.
    origin : str
        The file, for the error.

    Raises
    ------
    InputError
        For an unknown name, a value that cannot be, or a path that leaves the set. What is wrong with several options
        together is told where they come together, by `make_settings`.
    """
    stated = {name.replace("-", "_"): value for name, value in table.items()}
    for name in stated:
        if name not in OPTIONS:
            raise InputError(f"{origin}: {unknown_key(name, OPTIONS)}")
    for name in PATHS:
        if isinstance(stated.get(name), str):
            stated[name] = str(inside(folder / stated[name], root, origin=origin))
    _validate(stated, origin)
    make_settings({name: value for name, value in stated.items() if name not in TOGETHER}, origin=origin)
    return stated


def make_settings(stated: Mapping[str, Any], *, origin: str) -> Settings:
    """Return the settings that some stated options make."""
    options = _validate(stated, origin)
    _check_names(stated, origin)
    size = options.tag_size
    try:
        return Settings(
            fps_hz=options.fps,
            family=options.family,
            tcp_id=options.tcp_id,
            pcp_id=options.pcp_id,
            reference_id=options.reference_id,
            tcp_tag_size_m=_thousandth(size if options.tcp_tag_size is None else options.tcp_tag_size),
            pcp_tag_size_m=_thousandth(size if options.pcp_tag_size is None else options.pcp_tag_size),
            camera=options.camera,
            up=str(options.up),
            mass_kg=_thousandth(options.mass),
            point_mass=options.point_mass,
            length_m=_thousandth(options.length),
            nonnegative_stiffness=options.nonnegative_stiffness,
            other=options.other,
            sway_axis=None if options.sway_axis is None else str(options.sway_axis),
            window=None if options.window is None else _window(options.window),
            frequency_spread_percent=options.frequency_spread,
            columns=None if options.columns is None else tuple(part.strip() for part in options.columns.split(",")),
            shaper=options.shaper,
            log=options.log,
        )
    except InputError as fault:
        raise InputError(f"{origin}: {fault}") from None


def _check_names(stated: Mapping[str, Any], origin: str) -> None:
    """Refuse a family or a shaper that there is none of, before the first film is tracked."""
    if stated.get("family", FAMILIES[0]) not in FAMILIES:
        raise InputError(f"{origin}: family is {stated['family']!r}: expected one of {', '.join(FAMILIES)}")
    if "shaper" in stated:
        from tagsway.shapers import SHAPER_TYPES  # which takes a second to load: only where one is stated

        if stated["shaper"] not in SHAPER_TYPES:
            raise InputError(f"{origin}: shaper is {stated['shaper']!r}: expected one of {', '.join(SHAPER_TYPES)}")


def _validate(stated: Mapping[str, Any], origin: str) -> Options:
    named = {("other" if name == "with" else name): value for name, value in stated.items()}
    options: Options = validate(Options, named, origin=origin)
    return options


def inside(path: Path, root: Path, *, origin: str) -> Path:
    """Return a path, links followed; an InputError where it leads out of the set."""
    whole = path.resolve()
    if not whole.is_relative_to(root.resolve()):
        raise InputError(f"{origin}: {path} leads out of the set {root}: expected a file inside it")
    return whole


def unknown_key(name: str, known: Iterable[str]) -> str:
    """Return what to say of a key that is not known."""
    close = difflib.get_close_matches(name, sorted(known), n=1)
    meant = f"; did you mean {close[0]!r}?" if close else ""
    return f"unknown key {name!r}{meant} expected one of {', '.join(sorted(known))}"


def _window(text: str) -> Window:
    try:
        start, end = (float(part) for part in text.split(":"))
    except ValueError:
        raise InputError(f"window is {text!r}: expected START:END in seconds, such as 1.3:4") from None
    return Window(start_s=start, end_s=end)


def _thousandth(value: float | None) -> float | None:
    return None if value is None else value / 1000
