"""A track from its parts, checked; shared by every kind of table."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, IntArray, Notice, TagTrack, Track

FARTHEST_M = 1000.0
"""No payload is filmed over a kilometre; a larger number is another unit, or no position."""

TrackUnit = Literal["m", "px", "m/s2", "rad"]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackSource:
    """A track that was read from a table, and what to know about it.

    Parameters
    ----------
    track : Track
        As the table has it.
    program : str
        Who wrote it: "tagsway", "Tracker", "Kinovea", "DeepLabCut", or "a table".
    notices : tuple of Notice
        What was assumed, and what such a table cannot tell.
    """

    track: Track
    program: str
    notices: tuple[Notice, ...] = ()


def make_tag(
    position: FloatArray,
    *,
    std: FloatArray | None = None,
    angle: FloatArray | None = None,
    angle_std: FloatArray | None = None,
    image_share: float = 1.0,
) -> TagTrack:
    """Return a tag's track; what is not given is not known."""
    unknown = np.full(len(position), np.nan)
    return TagTrack(
        position=position,
        position_std=np.full_like(position, np.nan) if std is None else std,
        angle_rad=unknown if angle is None else angle,
        angle_std_rad=unknown if angle_std is None else angle_std,
        image_share=image_share,
    )


def make_track(
    frame: IntArray, time_s: FloatArray, unit: TrackUnit, tags: dict[str, TagTrack], *, path: Path, first_line: int = 2
) -> Track:
    """Return a track, or raise an InputError that names the line of the file at fault."""
    if not np.isfinite(time_s).any():
        raise InputError(f"{path}: the time column holds no numbers; write them with a decimal point, such as 0.005")
    far = max((float(np.nanmax(np.abs(tag.position), initial=0.0)) for tag in tags.values()), default=0.0)
    if unit == "m" and not far <= FARTHEST_M:
        raise InputError(f"{path}: a position is {1e3 * far:.3g} mm; expected mm, and at most {1e3 * FARTHEST_M:g}")
    if len(time_s) < 2:
        raise InputError(f"{path} holds too few samples ({len(time_s)}): a track needs at least two")
    if not np.all(np.isfinite(time_s)):
        raise InputError(f"{path}: row {int(np.argmin(np.isfinite(time_s))) + first_line} has no time")
    steps = np.diff(time_s)
    if not np.all(steps > 0):
        row = int(np.argmin(steps > 0)) + first_line + 1
        raise InputError(f"{path}: the time does not rise at row {row}; sort the rows")
    return Track(frame=np.asarray(frame, dtype=np.int64), time_s=time_s, length_unit=unit, **tags)
