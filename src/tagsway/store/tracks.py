"""track.csv, and tracks that others wrote."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tagsway.errors import InputError
from tagsway.model import CleanTagTrack, CleanTrack, FloatArray, TagTrack, Track
from tagsway.store.tables import read_table

TAGS = ("tcp", "pcp", "reference")

STEPS = {"m": 1e-9, "px": 1e-6}
"""Steps in which a track holds positions: six decimals of a millimetre, or of a pixel."""

FARTHEST_M = 1000.0
"""No payload is filmed over a kilometre; a larger number is another unit, or no position."""

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


def track_table(track: Track, clean: CleanTrack | None) -> pd.DataFrame:
    """Return track.csv's table: one row a frame, NaN where a tag was not seen.

    Lengths are in mm (columns end in `_mm`), or in pixels (`_px`) where no tag's size is known.
    """
    unit, factor = ("mm", 1e3) if track.length_unit == "m" else ("px", 1.0)
    columns: dict[str, Any] = {"frame": track.frame, "time_s": [f"{t:.9f}" for t in track.time_s]}
    cleaned: Mapping[str, CleanTagTrack | None] = {"tcp": clean.tcp, "pcp": clean.pcp} if clean else {}
    for name in TAGS:
        tag: TagTrack | None = getattr(track, name)
        if tag is None:
            continue
        for i, axis in enumerate("xz"):
            columns[f"{name}_{axis}_{unit}"] = _texts(tag.position[:, i] * factor, 6)
        columns[f"{name}_angle_rad"] = _texts(tag.angle_rad, 9)
        for i, axis in enumerate("xz"):
            columns[f"{name}_{axis}_std_{unit}"] = _texts(tag.position_std[:, i] * factor, 9)
        columns[f"{name}_angle_std_rad"] = _texts(tag.angle_std_rad, 9)
        clean_tag = cleaned.get(name)
        if clean_tag is not None:
            for i, axis in enumerate("xz"):
                columns[f"{name}_{axis}_clean_{unit}"] = _texts(clean_tag.position[:, i] * factor, 6)
                columns[f"{name}_{axis}_velocity_{unit}_s"] = _texts(clean_tag.velocity[:, i] * factor, 3)
                columns[f"{name}_{axis}_acceleration_{unit}_s2"] = _texts(clean_tag.acceleration[:, i] * factor, 1)
    return pd.DataFrame(columns)


def track_csv(track: Track, clean: CleanTrack | None) -> str:
    """Return track.csv as text."""
    text = io.StringIO()
    track_table(track, clean).to_csv(text, index=False, lineterminator="\n")
    return text.getvalue()


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


def _texts(values: FloatArray, decimals: int) -> list[str]:
    return ["" if value != value else f"{value:.{decimals}f}" for value in values]
