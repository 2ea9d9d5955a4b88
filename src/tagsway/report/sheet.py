"""A sheet of tags to print at their true size."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch, Rectangle
from matplotlib.path import Path as Outline

from tagsway.errors import InputError
from tagsway.files import whole_file
from tagsway.report.style import GREY, INK
from tagsway.tags.families import tag_family, tag_pattern

PAGE_MM = (210.0, 297.0)
MARGIN_MM = 15.0
FOOT_MM = 45.0
"""Kept free at the bottom for the ruler and what it is for."""

GAP_MM = 6.0
LABEL_MM = 7.0
RULER_MM = 100.0
QUIET_CELLS = 1
"""Of white paper around a tag's pattern, to the line where it is cut."""

LEAST_MM = 1.0
"""Of the smallest tag that is printed: a cell of it is some three dots of a usual printer."""

DPI = 300
SUFFIXES = (".pdf", ".svg", ".png")


def write_tag_sheet(path: Path, *, family: str, tag_ids: Sequence[int], size_m: float) -> int:
    """Write tags on A4, to be printed without scaling.

    Parameters
    ----------
    path : Path
        Ends in .pdf, .svg or .png (300 dots an inch); written whole or not at all. Only a PDF takes several pages.
    family : str
        One of `tagsway.tags.families.FAMILIES`.
    tag_ids : sequence of int
        Numbers in the family, drawn in this order.
    size_m : float
        Side of the black square (what --tag-size means); of a family whose border is inside out, of the white square
        within its ring.

    Returns
    -------
    int
        How many pages.

    Raises
    ------
    InputError
        Where there is no such tag, a tag does not fit on the page, or they need more pages than the file can have.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: expected a sheet that ends in {', '.join(SUFFIXES)}")
    if not tag_ids:
        raise InputError("a sheet needs at least one tag")
    grid = _Grid.of(family, 1000 * size_m)
    each = grid.columns * grid.rows
    pages = [tag_ids[first : first + each] for first in range(0, len(tag_ids), each)]
    if len(pages) > 1 and path.suffix.lower() != ".pdf":
        raise InputError(
            f"{len(tag_ids)} tags of {1000 * size_m:g} mm need {len(pages)} pages, and {path} has one: give fewer, or "
            "a name that ends in .pdf"
        )
    figures = [_draw_page(family, page, grid) for page in pages]
    with whole_file(path) as part, rc_context({"svg.hashsalt": "tagsway", "svg.fonttype": "none"}):
        if path.suffix.lower() == ".pdf":
            with PdfPages(part, metadata={"CreationDate": None}) as book:
                for figure in figures:
                    book.savefig(figure)
        else:
            figures[0].savefig(part, dpi=DPI, metadata={"Date": None} if path.suffix.lower() == ".svg" else None)
    return len(pages)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Grid:
    """Where tags lie on a page, in mm."""

    size_mm: float
    cell_mm: float
    box_mm: float
    columns: int
    rows: int

    @classmethod
    def of(cls, family: str, size_mm: float) -> "_Grid":
        measures = tag_family(family)
        width, height = PAGE_MM[0] - 2 * MARGIN_MM, PAGE_MM[1] - MARGIN_MM - FOOT_MM
        box = size_mm * (measures.cells + 2 * QUIET_CELLS) / measures.border_cells
        if not (size_mm >= LEAST_MM and box <= width):
            largest = width / box * size_mm if size_mm > 0 else 100.0
            raise InputError(
                f"a tag of {size_mm:g} mm cannot be printed on A4: expected the side of its square in mm, from "
                f"{LEAST_MM:g} to {largest:.0f}"
            )
        return cls(
            size_mm=size_mm,
            cell_mm=size_mm / measures.border_cells,
            box_mm=box,
            columns=int((width + GAP_MM) / (box + GAP_MM)),
            rows=int((height + GAP_MM) / (box + LABEL_MM + GAP_MM)) or 1,
        )

    def corners(self, count: int) -> Iterator[tuple[float, float]]:
        """Yield each box's left and top."""
        for k in range(count):
            row, column = divmod(k, self.columns)
            left = MARGIN_MM + column * (self.box_mm + GAP_MM)
            yield left, PAGE_MM[1] - MARGIN_MM - row * (self.box_mm + LABEL_MM + GAP_MM)


def _draw_page(family: str, tag_ids: Sequence[int], grid: _Grid) -> Figure:
    figure = Figure(figsize=(PAGE_MM[0] / 25.4, PAGE_MM[1] / 25.4), facecolor="white")
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.set_xlim(0, PAGE_MM[0])
    axes.set_ylim(0, PAGE_MM[1])
    for tag_id, (left, top) in zip(tag_ids, grid.corners(len(tag_ids)), strict=True):
        axes.add_patch(_draw_ink(~tag_pattern(family, tag_id), left, top, grid))
        box = grid.box_mm
        axes.add_patch(Rectangle((left, top - box), box, box, fill=False, edgecolor=GREY, lw=0.3, ls=(0, (4, 4))))
        words = f"{family}  id {tag_id}  {grid.size_mm:g} mm"
        size_pt = min(9.0, 2.83 * box / (0.6 * len(words)))
        axes.text(left, top - box - 1.5, words, va="top", size=size_pt, color=INK)
    _draw_ruler(axes, family, grid)
    return figure


def _draw_ink(ink: np.ndarray[tuple[int, ...], np.dtype[np.bool_]], left: float, top: float, grid: _Grid) -> PathPatch:
    """Return the black cells as one outline: drawn singly, light would show between them."""
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)], dtype=float)
    codes = [Outline.MOVETO, Outline.LINETO, Outline.LINETO, Outline.LINETO, Outline.CLOSEPOLY]
    rows, columns = np.nonzero(ink)
    cells = [square + np.array([column, -row - 1]) for row, column in zip(rows, columns, strict=True)]
    start = np.array([left, top]) + QUIET_CELLS * grid.cell_mm * np.array([1, -1])
    outline = Outline(start + grid.cell_mm * np.concatenate(cells), codes * len(cells))
    return PathPatch(outline, facecolor="black", edgecolor="none", lw=0)


def _draw_ruler(axes: Axes, family: str, grid: _Grid) -> None:
    left, foot = MARGIN_MM, 26.0
    axes.plot([left, left + RULER_MM], [foot, foot], color=INK, lw=0.6, solid_capstyle="butt")
    for tenth in range(11):
        at = left + tenth * RULER_MM / 10
        axes.plot([at, at], [foot, foot + (4 if tenth in (0, 5, 10) else 2.5)], color=INK, lw=0.6)
    inside_out = tag_family(family).reversed_border
    side = "white square within the black ring" if inside_out else "black square"
    axes.text(
        left,
        foot - 2.5,
        f"This line is {RULER_MM:g} mm long where the sheet was printed at its true size (100 %, not “fit to page”).\n"
        f"Measure it, and the side of a {side}: that length is --tag-size (here {grid.size_mm:g}).\n"
        "Print matt, glue flat, leave the white border.",
        va="top",
        size=8.5,
        color=INK,
        linespacing=1.4,
    )
