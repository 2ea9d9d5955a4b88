"""track.csv, as tagsway writes it."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from tagsway.model import FloatArray
from tagsway.store.sources.build import TrackSource, TrackUnit, make_tag, make_track
from tagsway.store.sources.columns import NOTICES
from tagsway.store.sources.grid import Grid

TAGS = ("tcp", "pcp", "reference")

UNITS: Mapping[TrackUnit, tuple[str, float]] = MappingProxyType(
    {"m": ("mm", 1e3), "px": ("px", 1.0), "m/s2": ("m_s2", 1.0), "rad": ("rad", 1.0)}
)
"""How the columns of a track's unit end, and how many of that there are in one of the track's unit."""


def is_own(grid: Grid) -> bool:
    """Say whether a table is a track.csv."""
    return "time_s" in grid.names and _unit_of(grid) is not None


def read_own(grid: Grid, path: Path) -> TrackSource:
    """Return the track of a track.csv."""
    unit = _unit_of(grid)
    assert unit is not None
    ending, per_unit = UNITS[unit]
    tags = {}
    for name in TAGS:
        if f"{name}_x_{ending}" not in grid.names:
            continue
        tags[name] = make_tag(
            _pair(grid, f"{name}_{{}}_{ending}") / per_unit,
            std=_pair(grid, f"{name}_{{}}_std_{ending}") / per_unit,
            angle=_column(grid, f"{name}_angle_rad"),
            angle_std=_column(grid, f"{name}_angle_std_rad"),
            image_share=_constant(grid, f"{name}_image_share"),
        )
    frame = _column(grid, "frame")
    index = np.arange(len(frame)) if np.isnan(frame).any() else frame.astype(np.int64)
    track = make_track(index, _column(grid, "time_s"), unit, tags, path=path, first_line=grid.first_line)
    return TrackSource(track=track, program="tagsway", notices=(NOTICES[unit],) if unit in NOTICES else ())


def _unit_of(grid: Grid) -> TrackUnit | None:
    return next((unit for unit, (ending, _) in UNITS.items() if f"pcp_x_{ending}" in grid.names), None)


def _pair(grid: Grid, pattern: str) -> FloatArray:
    return np.column_stack([_column(grid, pattern.format(axis)) for axis in "xz"])


def _column(grid: Grid, name: str) -> FloatArray:
    if name not in grid.names:
        return np.full(len(grid.values), np.nan)
    return np.asarray(grid.values[:, grid.names.index(name)], dtype=float)


def _constant(grid: Grid, name: str) -> float:
    """Return what a column holds in every row; 1 where there is none."""
    values = _column(grid, name)
    known = values[(values > 0) & (values <= 1)]
    return float(known[0]) if len(known) else 1.0
