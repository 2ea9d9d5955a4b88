"""track.csv, and tracks that others wrote."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tagsway.errors import InputError
from tagsway.files import whole_file
from tagsway.model import CleanTrack, FloatArray, IntArray, TagTrack, Track
from tagsway.store.tables import read_table

TAGS = ("tcp", "pcp", "reference")

STEPS = {"m": 1e-9, "px": 1e-6}
"""Steps in which a track holds positions: six decimals of a millimetre, or of a pixel."""

FARTHEST_M = 1000.0
"""No payload is filmed over a kilometre; a larger number is another unit, or no position."""

CSV_ROWS = 2000
"""Rows that are turned into text together."""

STEP_S = 1e-9
STEP_RAD = 1e-9


def quantise(track: Track) -> Track:
    """Round a track to what track.csv holds, so that a run from the file repeats the run from the video exactly.

    A nanometre (a millionth of a pixel), a nanosecond and a nanoradian; standard errors to a thousandth of that.
    """
    step = STEPS[track.length_unit]

    def rounded(tag: TagTrack) -> TagTrack:
        return TagTrack(
            position=_to_steps(tag.position, step),
            position_std=_to_steps(tag.position_std, step / 1000),
            angle_rad=_to_steps(tag.angle_rad, STEP_RAD),
            angle_std_rad=_to_steps(tag.angle_std_rad, STEP_RAD),
            scale_mm_per_px=tag.scale_mm_per_px,
        )

    return Track(
        frame=track.frame,
        time_s=_to_steps(track.time_s, STEP_S),
        length_unit=track.length_unit,
        pcp=rounded(track.pcp),
        tcp=track.tcp and rounded(track.tcp),
        reference=track.reference and rounded(track.reference),
    )


def track_csv(track: Track, clean: CleanTrack | None) -> str:
    """Return track.csv as text; see `write_track`."""
    return "".join(_csv_blocks(track, clean))


def write_track(path: Path, track: Track, clean: CleanTrack | None) -> None:
    """Write track.csv: one row a frame, nothing in a field where a tag was not seen; whole or not at all.

    Lengths are in mm (columns end in `_mm`), or in pixels (`_px`) where no tag's size is known.
    """
    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        file.writelines(_csv_blocks(track, clean))


def _csv_blocks(track: Track, clean: CleanTrack | None) -> Iterator[str]:
    """Give the header, then some thousand rows at a time, so that a long track is never in memory as text."""
    columns = _columns(track, clean)
    yield ",".join(name for name, _, _ in columns) + "\n"
    row = ",".join(form for _, form, _ in columns) + "\n"
    for first in range(0, len(track.time_s), CSV_ROWS):
        part = [values[first : first + CSV_ROWS].tolist() for _, _, values in columns]
        yield "".join([row % fields for fields in zip(*part, strict=True)]).replace("nan", "")


def _columns(track: Track, clean: CleanTrack | None) -> list[tuple[str, str, FloatArray | IntArray]]:
    """Return the columns of track.csv: name, format and numbers."""
    unit, factor = ("mm", 1e3) if track.length_unit == "m" else ("px", 1.0)
    columns: list[tuple[str, str, FloatArray | IntArray]] = [
        ("frame", "%d", track.frame),
        ("time_s", "%.9f", track.time_s),
    ]

    cleaned = {"tcp": clean.tcp, "pcp": clean.pcp} if clean else {}
    for name in TAGS:
        tag: TagTrack | None = getattr(track, name)
        if tag is None:
            continue
        position, error = factor * tag.position, factor * tag.position_std
        columns += [(f"{name}_{axis}_{unit}", "%.6f", position[:, i]) for i, axis in enumerate("xz")]
        columns.append((f"{name}_angle_rad", "%.9f", tag.angle_rad))
        columns += [(f"{name}_{axis}_std_{unit}", "%.9f", error[:, i]) for i, axis in enumerate("xz")]
        columns.append((f"{name}_angle_std_rad", "%.9f", tag.angle_std_rad))
        smooth = cleaned.get(name)
        if smooth is None:
            continue
        for i, axis in enumerate("xz"):
            columns.append((f"{name}_{axis}_clean_{unit}", "%.6f", factor * smooth.position[:, i]))
            columns.append((f"{name}_{axis}_velocity_{unit}_s", "%.3f", factor * smooth.velocity[:, i]))
            columns.append((f"{name}_{axis}_acceleration_{unit}_s2", "%.1f", factor * smooth.acceleration[:, i]))
    return columns


def read_track(path: Path, *, columns: tuple[str, ...] | None = None) -> Track:
    """Read a track: our own track.csv, or any table with a time in s and a position in mm.

    Parameters
    ----------
    path : Path
        A text table; comma, semicolon or tab between the columns.
    columns : tuple of str, optional
        Names of the time, the x and perhaps the z column of somebody else's table; they are the PCP's.

    Returns
    -------
    Track
        Rows without a time are left out; positions that are not numbers are NaN.

    Raises
    ------
    InputError
        Where the file is no such table, or its times do not rise.
    """
    table = read_table(path, expected="a CSV with a time in s and positions in mm")
    if columns is None and "time_s" in table and {"pcp_x_mm", "pcp_x_px"} & set(table.columns):
        return _own_track(table, path)
    time_name, x_name, *z_name = columns if columns is not None else _guess_columns(table, path)
    for name in (time_name, x_name, *z_name):
        if name not in table:
            raise InputError(f"{path} has no column {name!r}; it has {', '.join(map(str, table.columns))}")
    position = np.column_stack(
        [_numbers(table, x_name), _numbers(table, z_name[0]) if z_name else np.zeros(len(table))]
    )
    time_s = _numbers(table, time_name)
    keep = np.isfinite(time_s)
    tag = _tag(position[keep] / 1e3, np.full((int(keep.sum()), 2), np.nan), None, None)
    return _checked(np.arange(len(table))[keep], time_s[keep], "m", {"pcp": tag}, path)


def _own_track(table: pd.DataFrame, path: Path) -> Track:
    unit, factor = ("mm", 1e-3) if "pcp_x_mm" in table else ("px", 1.0)
    tags = {}
    for name in TAGS:
        needed = [f"{name}_{axis}_{unit}" for axis in "xz"]
        if not set(needed) <= set(table.columns):
            continue
        spread = [f"{name}_{axis}_std_{unit}" for axis in "xz"]
        position = np.column_stack([_numbers(table, column) for column in needed]) * factor
        std = np.column_stack([_optional(table, column) for column in spread]) * factor
        tags[name] = _tag(
            position, std, _optional(table, f"{name}_angle_rad"), _optional(table, f"{name}_angle_std_rad")
        )
    frame = _optional(table, "frame")
    index = np.arange(len(table)) if np.isnan(frame).any() else frame.astype(np.int64)
    return _checked(index, _numbers(table, "time_s"), "m" if unit == "mm" else "px", tags, path)


def _tag(position: FloatArray, std: FloatArray, angle: FloatArray | None, angle_std: FloatArray | None) -> TagTrack:
    unknown = np.full(len(position), np.nan)
    return TagTrack(
        position=position,
        position_std=std,
        angle_rad=unknown if angle is None else angle,
        angle_std_rad=unknown if angle_std is None else angle_std,
    )


def _checked(index: Any, time_s: FloatArray, unit: Any, tags: dict[str, TagTrack], path: Path) -> Track:
    if not np.isfinite(time_s).any():
        raise InputError(f"{path}: the time column holds no numbers; write them with a decimal point, such as 0.005")
    far = max((float(np.nanmax(np.abs(tag.position), initial=0.0)) for tag in tags.values()), default=0.0)
    if unit == "m" and not far <= FARTHEST_M:
        raise InputError(f"{path}: a position is {1e3 * far:.3g} mm; expected mm, and at most {1e3 * FARTHEST_M:g}")
    if len(time_s) < 2:
        raise InputError(f"{path} holds too few samples ({len(time_s)}): a track needs at least two")
    if not np.all(np.isfinite(time_s)):
        raise InputError(f"{path}: row {int(np.argmin(np.isfinite(time_s))) + 2} has no time")
    steps = np.diff(time_s)
    if not np.all(steps > 0):
        raise InputError(f"{path}: the time does not rise at row {int(np.argmin(steps > 0)) + 3}; sort the rows")
    return quantise(Track(frame=np.asarray(index, dtype=np.int64), time_s=time_s, length_unit=unit, **tags))


def _guess_columns(table: pd.DataFrame, path: Path) -> tuple[str, ...]:
    by_lower = {str(name).lower(): str(name) for name in table.columns}
    time = next((by_lower[name] for name in ("time_s", "t_s", "time", "t") if name in by_lower), None)
    x = next((by_lower[name] for name in ("x_mm", "x") if name in by_lower), None)
    z = next((by_lower[name] for name in ("z_mm", "z", "y_mm", "y") if name in by_lower), None)
    if time is None or x is None:
        raise InputError(
            f"{path}: which columns are time and x? It has {', '.join(map(str, table.columns))}; say --columns T,X[,Z]"
        )
    return (time, x) if z is None else (time, x, z)


def _numbers(table: pd.DataFrame, name: str) -> FloatArray:
    values: FloatArray = pd.to_numeric(table[name], errors="coerce").to_numpy(dtype=float)
    return values


def _optional(table: pd.DataFrame, name: str) -> FloatArray:
    return _numbers(table, name) if name in table else np.full(len(table), np.nan)


def _to_steps(values: FloatArray, step: float) -> FloatArray:
    rounded: FloatArray = np.round(values / step) / round(1 / step)
    return rounded
