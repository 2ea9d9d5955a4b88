"""Draw a tag: the inverse of finding one."""

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, GreyArray
from tagsway.tags.families import tag_family, tag_pattern


def cover_tag(family: str, tag_id: int, x_edges: FloatArray, y_edges: FloatArray) -> FloatArray:
    """Return how white the rectangles of a grid are, by area; exact, whatever the grid.

    Parameters
    ----------
    family : str
        One of `tagsway.tags.families.FAMILIES`.
    tag_id : int
        Number in the family.
    x_edges : ndarray, shape (n + 1,)
        Edges of the grid's columns in the tag's own frame, where its square ends at ±1; monotonic.
    y_edges : ndarray, shape (m + 1,)
        Edges of its rows; in the tag's frame y is up, so a picture's rows run from high y to low.

    Returns
    -------
    ndarray, shape (m, n)
        1 is paper, 0 is ink; around the pattern is paper.
    """
    measures = tag_family(family)
    ink = ~tag_pattern(family, tag_id)
    lines = (2 * np.arange(measures.cells + 1) - measures.cells) / measures.border_cells
    columns, rows = _overlap(x_edges, lines), _overlap(y_edges, -lines)
    white: FloatArray = 1.0 - rows @ ink.astype(float) @ columns.T
    return white


def draw_tag(family: str, tag_id: int, *, cell_px: int = 10, quiet_cells: int = 1) -> GreyArray:
    """Draw a tag to be printed.

    Parameters
    ----------
    family : str
        One of `tagsway.tags.families.FAMILIES`.
    tag_id : int
        Number in the family.
    cell_px : int
        Pixels to a cell.
    quiet_cells : int
        White cells around the pattern.

    Returns
    -------
    ndarray of uint8, shape (n, n)
        Black 0, white 255, upright.
    """
    if not (cell_px >= 1 and quiet_cells >= 0):
        raise InputError(
            f"a tag needs cell_px of at least 1 and quiet_cells of at least 0, not {cell_px}, {quiet_cells}"
        )
    pattern = np.pad(tag_pattern(family, tag_id), quiet_cells, constant_values=True)
    return np.where(np.kron(pattern, np.ones((cell_px, cell_px), dtype=bool)), 255, 0).astype(np.uint8)


def _overlap(edges: FloatArray, lines: FloatArray) -> FloatArray:
    """Return which share of each interval between edges lies between each two lines, shape (n, cells)."""
    low, high = np.minimum(edges[:-1], edges[1:]), np.maximum(edges[:-1], edges[1:])
    first, last = np.minimum(lines[:-1], lines[1:]), np.maximum(lines[:-1], lines[1:])
    common = np.minimum(high[:, None], last) - np.maximum(low[:, None], first)
    share: FloatArray = np.clip(common, 0.0, None) / (high - low)[:, None]
    return share
