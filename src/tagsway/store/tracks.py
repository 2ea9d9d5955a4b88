"""track.csv, and tracks that others wrote."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from tagsway.files import whole_file
from tagsway.model import CleanTrack, FloatArray, IntArray, TagTrack, Track
from tagsway.store.sources.build import TrackSource
from tagsway.store.sources.own import TAGS, UNITS
from tagsway.store.sources.reading import recognise

STEPS = {"m": 1e-9, "px": 1e-6, "m/s2": 1e-6, "rad": 1e-6}
"""Steps in which a track holds positions: six decimals of a millimetre, or of its other units."""

CSV_ROWS = 2000
"""Rows that are turned into text together."""

STEP_S = 1e-9
STEP_RAD = 1e-9
STEP_SHARE = 1e-6


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
            image_share=float(_to_steps(np.array(tag.image_share), STEP_SHARE)),
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
    unit, factor = UNITS[track.length_unit]
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
        if tag.image_share < 1:
            columns.append((f"{name}_image_share", "%.6f", np.full(len(track.time_s), tag.image_share)))
        smooth = cleaned.get(name)
        if smooth is None:
            continue
        for i, axis in enumerate("xz"):
            columns.append((f"{name}_{axis}_clean_{unit}", "%.6f", factor * smooth.position[:, i]))
            columns.append((f"{name}_{axis}_velocity_{unit}_s", "%.3f", factor * smooth.velocity[:, i]))
            columns.append((f"{name}_{axis}_acceleration_{unit}_s2", "%.1f", factor * smooth.acceleration[:, i]))
    return columns


def read_source(path: Path, *, columns: tuple[str, ...] | None = None, fps_hz: float | None = None) -> TrackSource:
    """Read a track: our own track.csv, or a table of another program, which its content tells.

    Parameters
    ----------
    path : Path
        A table as text or as a spreadsheet in XML; whatever separates its columns, with decimal points or commas.
    columns : tuple of str, optional
        Names of the time, the x and perhaps the z column of somebody else's table; they are the PCP's. Times are in s
        and positions in mm where the names state no unit.
    fps_hz : float, optional
        Capture rate, for a table of frames without times.

    Returns
    -------
    TrackSource
        Rows without a time are left out; what is not a number is NaN.

    Raises
    ------
    InputError
        Where the file is no such table, or its times do not rise.
    """
    source = recognise(path, columns=columns, fps_hz=fps_hz)
    return replace(source, track=quantise(source.track))


def read_track(path: Path, *, columns: tuple[str, ...] | None = None, fps_hz: float | None = None) -> Track:
    """Read a track; see `read_source`, which also says what was assumed."""
    return read_source(path, columns=columns, fps_hz=fps_hz).track


def _to_steps(values: FloatArray, step: float) -> FloatArray:
    rounded: FloatArray = np.round(values / step) / round(1 / step)
    return rounded
