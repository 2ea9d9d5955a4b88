"""A controller's log: the tool's position or the joints, at 1 kHz or so."""

import re
from pathlib import Path

import numpy as np

from tagsway.errors import InputError
from tagsway.model import ControllerLog, FloatArray
from tagsway.store.sources.columns import describe_columns
from tagsway.store.sources.grid import Grid, find_grids
from tagsway.store.sources.text import read_text
from tagsway.store.sources.units import Column, describe_column

EXPECTED = "a controller's log: a time in s, and x, y, z of the tool or three joints"
INDEX_RATE_HZ = 1000.0
"""Of a log that numbers its lines: the cycle of the external set-point generator."""

FARTHEST_M = 20.0
"""No robot reaches farther; such numbers are mm."""

_JOINT = re.compile(r"(?:joint|axis|motor|theta|\bq|\bj|\ba|drive|arm)[ _]?([1-3])\b", re.I)


def read_log(path: Path) -> ControllerLog:
    """Read a controller's log.

    Parameters
    ----------
    path : Path
        A table with a time in s (or ms, as its name says; lines that are only numbered are 1 ms apart) and x, y and z
        of the tool (a missing one is 0) in m, or in mm where the name says so; or three joints, called q1, joint_2,
        axis 3 …, in degrees or as the name says. Beckhoff's ``index;x;y;z`` needs no header.

    Returns
    -------
    ControllerLog

    Raises
    ------
    InputError
        Where it is no such table, its times do not rise, or it is in another unit.
    """
    grids = find_grids(read_text(path, expected=EXPECTED))
    if not grids:
        raise InputError(f"{path} holds no columns of numbers; give {EXPECTED}")
    grid = max(grids, key=lambda each: len(each.values))
    held = describe_columns(grid)
    if not grid.head and grid.values.shape[1] == 4:
        held = [describe_column(name) for name in ("index", "x_m", "y_m", "z_m")]
    time = _times(grid, held, path)
    joints = {int(found.group(1)): i for i, column in enumerate(held) if (found := _JOINT.search(_plain(column.name)))}
    kept = np.isfinite(time)
    if set(joints) == {1, 2, 3}:
        values = np.column_stack([_angle(grid, held[joints[k]], joints[k]) for k in (1, 2, 3)])
        return ControllerLog(time_s=time[kept], values=values[kept], holds="joints")
    places = {
        axis: next((i for i, c in enumerate(held) if c.quantity == "position" and c.axis == axis), None)
        for axis in "xyz"
    }
    if places["x"] is None and places["y"] is None:
        names = ", ".join(column.name for column in held)
        raise InputError(f"{path}: where are the tool's x, y, z, or joints 1, 2, 3? It has {names}; give {EXPECTED}")
    values = np.column_stack([_position(grid, held, place) for place in places.values()])
    far = float(np.nanmax(np.abs(values[kept]), initial=0.0))
    if not far <= FARTHEST_M:
        raise InputError(
            f"{path}: the tool is at {far:.4g} m; expected m: call the columns x_mm, y_mm, z_mm if they are in mm"
        )
    return ControllerLog(time_s=time[kept], values=values[kept], holds="tool")


def _times(grid: Grid, held: list[Column], path: Path) -> FloatArray:
    place = next((i for quantity in ("time", "index") for i, c in enumerate(held) if c.quantity == quantity), None)
    if place is None:
        return np.arange(len(grid.values)) / INDEX_RATE_HZ
    factor = held[place].factor if held[place].quantity == "time" else 1 / INDEX_RATE_HZ
    time: FloatArray = grid.values[:, place] * factor
    steps = np.diff(time[np.isfinite(time)])
    if not (len(steps) and np.all(steps > 0)):
        raise InputError(f"{path}: the log's time does not rise; sort its lines, and leave out repeated ones")
    return time


def _angle(grid: Grid, column: Column, place: int) -> FloatArray:
    # A joint that slides is called in a unit of length; a bare number is in degrees, as joint files are written.
    factor = column.factor if column.unit is not None else np.pi / 180
    return np.asarray(grid.values[:, place] * factor, dtype=float)


def _position(grid: Grid, held: list[Column], place: int | None) -> FloatArray:
    if place is None:
        return np.zeros(len(grid.values))
    return np.asarray(grid.values[:, place] * (held[place].factor if held[place].unit else 1.0), dtype=float)


def _plain(name: str) -> str:
    return name.split("(")[0].split("[")[0].replace("_", " ").strip()
