"""Which kind of table a file is, told by its content."""

from pathlib import Path

from tagsway.errors import InputError
from tagsway.store.sources.build import TrackSource
from tagsway.store.sources.columns import read_columns, with_notice
from tagsway.store.sources.grid import Grid, find_grids
from tagsway.store.sources.kinovea import is_kinovea_text, is_xml, read_kinovea_text, read_xml_sheet
from tagsway.store.sources.movement import is_movement, read_movement
from tagsway.store.sources.own import is_own, read_own
from tagsway.store.sources.poses import is_pose_table, read_poses
from tagsway.store.sources.single import find_single, read_single
from tagsway.store.sources.text import read_text
from tagsway.store.sources.units import describe_column

EXPECTED = "a CSV with a time in s and positions in mm"


def recognise(path: Path, *, columns: tuple[str, ...] | None, fps_hz: float | None) -> TrackSource:
    """Read a table of whatever program.

    Parameters
    ----------
    path : Path
        The file.
    columns : tuple of str or None
        Names of the time, the x and perhaps the z column: these are taken, whoever wrote the table.
    fps_hz : float or None
        Capture rate, for a table of frames without times.

    Returns
    -------
    TrackSource

    Raises
    ------
    InputError
        Where it is no table, where it is not clear which columns are meant, or where its times do not rise.
    """
    if is_movement(path):
        return read_movement(path, fps_hz=fps_hz)
    text = read_text(path, expected=EXPECTED)
    if is_xml(text):
        return read_xml_sheet(text, path, fps_hz=fps_hz, columns=columns)
    if columns is None and is_kinovea_text(text):
        return read_kinovea_text(text, path, fps_hz=fps_hz)
    grids = find_grids(text)
    single = find_single(text) if columns is None else None
    if single is not None and len(single[1]) > max((len(grid.values) for grid in grids), default=0):
        return read_single(*single, path, fps_hz=fps_hz)
    grid = _largest(grids, path)
    if columns is not None:
        return read_columns(grid, path, columns=columns, fps_hz=fps_hz)
    if is_own(grid):
        if fps_hz is not None:
            raise InputError(f"--fps says something of a video, and {path} is a table with times: leave it out")
        return read_own(grid, path)
    if is_pose_table(grid):
        return read_poses(grid, path, fps_hz=fps_hz)
    if _is_tracker(grid, text):
        return _read_tracker(grid, path, fps_hz=fps_hz)
    return read_columns(grid, path, columns=None, fps_hz=fps_hz)


def _largest(grids: list[Grid], path: Path) -> Grid:
    if not grids:
        raise InputError(f"{path} holds no columns of numbers; give {EXPECTED}")
    return max(grids, key=lambda grid: len(grid.values))


def _is_tracker(grid: Grid, text: str) -> bool:
    """Say whether a table is Tracker's: t, x, y, between tabs or below the line with the track's name."""
    bare = [name.split(" (")[0] for name in grid.names[:3]]
    titled = len(grid.head) > 1 and len([cell for cell in grid.head[-2] if cell]) == 1
    return bare == ["t", "x", "y"] and (titled or "\t" in text)


def _read_tracker(grid: Grid, path: Path, *, fps_hz: float | None) -> TrackSource:
    source = read_columns(grid, path, columns=None, fps_hz=fps_hz, program="Tracker", default_factor=1.0, up_is_up=True)
    if describe_column(grid.names[1]).unit is None:
        message = "Tracker's table does not name its unit: taken as m; say --columns T,X,Z for mm"
        source = with_notice(source, "unit_assumed", message)
    return source
