"""Kinovea's exports: text for gnuplot, and the spreadsheet in XML. (Its CSV names its columns: a table like others.)"""

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from tagsway.errors import InputError
from tagsway.store.sources.build import TrackSource
from tagsway.store.sources.columns import PRODUCT, read_columns, with_notice
from tagsway.store.sources.grid import Grid, find_grids, find_grids_of_rows

TITLE = "#Kinovea"


def is_kinovea_text(text: str) -> bool:
    """Say whether a text is Kinovea's export of trajectories."""
    return text.lstrip().startswith(TITLE)


def is_xml(text: str) -> bool:
    """Say whether a text is XML."""
    return text.lstrip().startswith("<")


def read_kinovea_text(text: str, path: Path, *, fps_hz: float | None) -> TrackSource:
    """Return the track of the trajectory that is called PCP (product, payload), else of the first."""
    blocks = [
        replace(grid, head=(*grid.head, ("T", "X", "Y"))) for grid in find_grids(text) if grid.values.shape[1] == 3
    ]
    return _choose(blocks, path, fps_hz=fps_hz)


def read_xml_sheet(text: str, path: Path, *, fps_hz: float | None, columns: tuple[str, ...] | None) -> TrackSource:
    """Return the track of a spreadsheet in XML: of the first table in it that has a time and positions."""
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InputError(f"{path} declares XML entities: expected a plain spreadsheet in XML, as Kinovea exports it")
    try:
        root = ElementTree.fromstring(text.lstrip().encode())
    except (ElementTree.ParseError, ValueError) as fault:
        raise InputError(f"{path} is not well-formed XML ({fault}): export it again") from None
    kind = _local(root.tag)
    if kind != "Workbook":
        known = {"KinoveaVideoAnalysis": "Kinovea's own file of annotations", "object": "a project file of Tracker"}
        raise InputError(f"{path} is {known.get(kind, f'XML ({kind})')}: export the trajectory's data as a table")
    grids = find_grids_of_rows([_cells(row) for row in root.iter() if _local(row.tag) == "Row"])
    if columns is not None:
        return read_columns(_nonempty(grids, path)[0], path, columns=columns, fps_hz=fps_hz, program="Kinovea")
    return _choose(grids, path, fps_hz=fps_hz)


def _choose(grids: list[Grid], path: Path, *, fps_hz: float | None) -> TrackSource:
    named = [(_title(grid), grid) for grid in grids if len(grid.values) > 1]
    _nonempty([grid for _, grid in named], path)
    name, grid = next((entry for entry in named if PRODUCT.search(entry[0])), named[0])
    time = grid.values[:, 0]
    step = float(np.nanmedian(np.diff(time))) if len(time) > 1 else 0.0
    if not grid.coded_times and not any("(" in cell for cell in grid.names[:1]):
        counted = step == 1 and np.all(time == np.round(time))
        # No camera takes a frame a second: such steps are milliseconds.
        unit = "frame" if counted else "T (ms)" if step >= 1 else "T (s)"
        grid = replace(grid, head=(*grid.head, (unit, *grid.names[1:])))
    source = read_columns(
        grid,
        path,
        columns=None,
        fps_hz=fps_hz,
        program="Kinovea",
        default_unit="px",
        default_factor=1.0,
        up_is_up=True,
    )
    if len(named) > 1:
        others = ", ".join(other for other, _ in named if other != name)
        message = f"of several trajectories {name} was taken, and not {others}: call the product's pcp"
        source = with_notice(source, "several_tracks", message)
    return source


def _nonempty(grids: list[Grid], path: Path) -> list[Grid]:
    if not grids:
        raise InputError(f"{path} holds no trajectory: expected rows of time, x and y; export them from Kinovea again")
    return grids


def _title(grid: Grid) -> str:
    """Return what a trajectory is called, in the row above its numbers: not the file's own title, nor the columns'."""
    rows = [" ".join(row) for row in reversed(grid.head) if row[0].startswith("#") or len(row) == 1]
    names = [row.lstrip("# ") for row in rows if not row.startswith((TITLE, "#T X Y"))]
    return names[0] if names else "trajectory"


def _cells(row: ElementTree.Element) -> list[str]:
    cells: list[str] = []
    for cell in (child for child in row if _local(child.tag) == "Cell"):
        index = next((value for name, value in cell.attrib.items() if _local(name) == "Index"), None)
        if index is not None and index.isdigit() and len(cells) < int(index) - 1 <= 1000:
            cells += [""] * (int(index) - 1 - len(cells))
        cells.append(" ".join("".join(cell.itertext()).split()))
    return cells


def _local(tag: str) -> str:
    """Return a tag's name without its namespace."""
    return tag.rpartition("}")[2]
