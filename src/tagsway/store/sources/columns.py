"""From columns that somebody named to a track: positions, accelerations, or an angle."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, IntArray, Notice, TagTrack
from tagsway.store.sources.build import TrackSource, TrackUnit, make_tag, make_track
from tagsway.store.sources.grid import Grid
from tagsway.store.sources.units import ANGLES, STANDARD_GRAVITY_M_S2, Column, describe_column, is_unit

TOOL, PRODUCT = re.compile(r"(?<![a-z])(tcp|tool|gripper)", re.I), re.compile(r"(?<![a-z])(pcp|product|payload)", re.I)

GRAVITY_TOLERANCE = 0.2
"""A swing of 0.6 rad and a poor calibration leave the mean reading within this share of g."""

NOTICES = {
    "px": Notice(
        code="no_tag_size",
        message="the table's positions have no length unit: f_n and ζ are found, everything in mm is not",
    ),
    "m/s2": Notice(
        code="acceleration_record",
        message="the table holds accelerations: f_n and ζ are found, the amplitude is in m/s², lengths are not known",
    ),
    "rad": Notice(
        code="angle_record",
        message="the table holds an angle: f_n and ζ are found, the amplitude is in rad, lengths are not known",
    ),
}
WITH_GRAVITY = Notice(
    code="acceleration_with_gravity",
    message="the sensor's reading contains gravity: on a swinging payload g sin q cancels most of the sway along the "
    "path and the axis along the string shows twice the frequency; record the acceleration without g",
)


def describe_columns(grid: Grid) -> list[Column]:
    """Return what the columns of a table hold; a row of units below the names is added to them."""
    names = list(grid.names)
    last = grid.head[-1] if grid.head else ()
    if len(grid.head) > 1 and any(last) and all(is_unit(cell) for cell in last if cell):
        above = grid.head[-2]
        if len(above) == len(last) == len(names):
            names = [
                f"{name} ({unit.strip('()[] ')})" if unit else name for name, unit in zip(above, last, strict=True)
            ]
    return [describe_column(name) for name in names]


def read_columns(
    grid: Grid,
    path: Path,
    *,
    columns: tuple[str, ...] | None,
    fps_hz: float | None,
    program: str = "a table",
    default_unit: TrackUnit = "m",
    default_factor: float = 1e-3,
    up_is_up: bool = False,
) -> TrackSource:
    """Return the track that a table's columns hold.

    Parameters
    ----------
    grid : Grid
        The table.
    path : Path
        For errors.
    columns : tuple of str or None
        Names of the time, the x and perhaps the z column: these are taken, and no others.
    fps_hz : float or None
        For a table of frames without times.
    program : str
        Who wrote it.
    default_unit, default_factor : str, float
        Of positions whose names state no unit.
    up_is_up : bool
        Whether y in pixels points up; in images it points down.
    """
    held = describe_columns(grid)
    time, motion = _named(held, columns, path) if columns is not None else _found(held, grid, path)
    time_s, keep = _times(grid, time, path, fps_hz=fps_hz)
    tags: dict[str, TagTrack] = {}
    units = set()
    for name, pair in motion.items():
        parts = []
        for place in pair:
            column = held[place]
            unit, factor = _unit(column, default_unit, default_factor)
            units.add(unit)
            down = unit == "px" and column.axis == "y" and not up_is_up and place != pair[0]
            parts.append(grid.values[keep, place] * (-factor if down else factor))
        if len(parts) == 1:
            parts.append(np.zeros(len(parts[0])))
        tags[name] = make_tag(np.column_stack(parts))
    if len(units) != 1:
        raise InputError(
            f"{path}: positions, accelerations and angles, or pixels and lengths, do not mix: its columns are in "
            f"{', '.join(sorted(units))}; say --columns T,X[,Z]"
        )
    unit = units.pop()
    notices = [NOTICES[unit]] if unit in NOTICES else []
    if unit == "m/s2" and _holds_gravity(held, grid):
        notices.append(WITH_GRAVITY)
    frame: IntArray = np.flatnonzero(keep)
    track = make_track(frame, time_s[keep], unit, tags, path=path, first_line=grid.first_line)
    return TrackSource(track=track, program=program, notices=tuple(notices))


def _named(held: Sequence[Column], columns: tuple[str, ...], path: Path) -> tuple[int, dict[str, tuple[int, ...]]]:
    places = []
    for wanted in columns:
        match = [i for i, column in enumerate(held) if column.name == wanted] or [
            i for i, column in enumerate(held) if column.name.lower().startswith(f"{wanted.lower()} ")
        ]
        if not match:
            raise InputError(f"{path} has no column {wanted!r}; it has {', '.join(column.name for column in held)}")
        places.append(match[0])
    return places[0], {"pcp": tuple(places[1:])}


def _found(held: Sequence[Column], grid: Grid, path: Path) -> tuple[int, dict[str, tuple[int, ...]]]:
    time = next((i for quantity in ("time", "index") for i, c in enumerate(held) if c.quantity == quantity), None)
    motion: dict[str, tuple[int, ...]] = {}
    for quantity in ("position", "acceleration", "angle"):
        places = [i for i, column in enumerate(held) if column.quantity == quantity]
        tool = [i for i in places if TOOL.search(held[i].name)]
        product = [i for i in places if PRODUCT.search(held[i].name)] or [i for i in places if i not in tool]
        if product:
            choose = _loudest if quantity == "acceleration" else _plane
            motion["pcp"] = choose(product, held, grid)
            if tool and quantity == "position":
                motion["tcp"] = choose(tool, held, grid)
            break
    if time is None or not motion:
        raise InputError(
            f"{path}: which columns are time and x? It has {', '.join(column.name for column in held)}; say --columns "
            "T,X[,Z]"
        )
    return time, motion


def _plane(places: Sequence[int], held: Sequence[Column], grid: Grid) -> tuple[int, ...]:
    """Return x and z of positions, y where there is no z; the first column where no name says an axis."""
    by_axis = {axis: next((i for i in places if held[i].axis == axis), None) for axis in "xyz"}
    up = by_axis["z"] if by_axis["z"] is not None else by_axis["y"]
    found = tuple(place for place in (by_axis["x"], up) if place is not None)
    return found or (places[0],)


def _loudest(places: Sequence[int], held: Sequence[Column], grid: Grid) -> tuple[int, ...]:
    """Return the two axes of a sensor that vary most, in their order: it was not mounted along the sway."""
    spread = np.array([np.nan_to_num(np.nanstd(grid.values[:, place])) for place in places])
    return tuple(sorted(places[i] for i in np.argsort(-spread, kind="stable")[:2]))


def _holds_gravity(held: Sequence[Column], grid: Grid) -> bool:
    """Say whether the axes of a sensor together read about g on the mean, whatever their names say."""
    means = [
        float(np.nanmedian(grid.values[:, i])) * column.factor
        for i, column in enumerate(held)
        if column.quantity == "acceleration" and np.isfinite(grid.values[:, i]).any()
    ]
    return abs(float(np.hypot.reduce(means)) / STANDARD_GRAVITY_M_S2 - 1) < GRAVITY_TOLERANCE


def _unit(column: Column, default_unit: TrackUnit, default_factor: float) -> tuple[TrackUnit, float]:
    if column.quantity == "acceleration":
        return "m/s2", column.factor
    if column.quantity == "angle":
        return "rad", column.factor if column.unit else ANGLES["deg"]
    if column.unit is None or column.quantity != "position":
        return default_unit, default_factor
    return ("px", 1.0) if column.unit.lower().startswith(("px", "pixel")) else ("m", column.factor)


def _times(grid: Grid, place: int, path: Path, *, fps_hz: float | None) -> tuple[FloatArray, FloatArray]:
    """Return the time of each row, and which rows have one."""
    column = describe_columns(grid)[place]
    values = np.asarray(grid.values[:, place], dtype=float)
    if column.quantity == "index":
        if fps_hz is None:
            raise InputError(f"{path} numbers its frames ({column.name}) and has no times: say --fps, the capture rate")
        values = values / fps_hz
    elif fps_hz is not None:
        raise InputError(f"--fps says something of a video, and {path} is a table with times: leave it out")
    else:
        values = values * column.factor
    if grid.coded_times:
        values = even_out(values)
    return values, np.isfinite(values)


def even_out(time_s: FloatArray) -> FloatArray:
    """Return times that were cut to hundredths or thousandths on the even clock that they agree with, if they do."""
    n = len(time_s)
    if n < 3 or not np.all(np.isfinite(time_s)):
        return time_s
    steps = np.diff(time_s)
    digit = 0.001 if np.any(np.abs(np.round(time_s, 2) - time_s) > 1e-6) else 0.01
    slope, start = np.polyfit(np.arange(n), time_s, 1)
    even = start + slope * np.arange(n)
    agrees = np.max(np.abs(even - time_s)) <= digit and np.all(steps >= 0)
    return np.asarray(even - even[0], dtype=float) if agrees else time_s


def with_notice(source: TrackSource, code: str, message: str) -> TrackSource:
    """Return a source with one more notice."""
    return replace(source, notices=(*source.notices, Notice(code=code, message=message)))
