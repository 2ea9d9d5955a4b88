"""Whether something covers a part of a tag: a hand, the robot, glare."""

from functools import cache

import cv2
import numpy as np

from tagsway.model import BoolArray, FloatArray, GreyArray
from tagsway.tags.families import tag_family, tag_pattern, used_cells

_POINTS = 4  # to a cell and side
_LEAST_CHANGE = 0.03  # of the contrast, in the mean of a cell: a twentieth of it covered by grey
_LEAST_FIRST_CHANGE = 0.35  # the same where nothing is known of this tag: prints and light are never even
_SIGMAS = 3.5  # of the change of the other cells
_QUANTILE, _QUANTILE_SIGMA = 0.4, 0.5244  # of their size: up to half of a tag may be covered
_FITS, _TRUSTED = 4, 0.7  # each fit is to the better part of the cells in the one before
_TINY = 1e-9  # beside squares of some dozens: a column that the better cells cannot tell stays out
_MEMORY = 8  # looks in the running mean


class CoverCheck:
    """Tells a covered cell from noise, blur and uneven light.

    Parameters
    ----------
    family : str
        Of the tag.
    tag_id : int
        Its number.

    Notes
    -----
    Each cell's mean grey value is fitted by pattern, pattern blurred to the next cells, offset and ramps of the light;
    what is left, over the contrast, is compared with what was left when nothing covered the tag. Noise and blur change
    all cells alike, so the size of the other cells' changes is their measure.
    """

    def __init__(self, family: str, tag_id: int) -> None:
        self._family = family
        self._tag_id = tag_id
        self._usual: FloatArray | None = None
        self._looks = 0

    @property
    def knows_tag(self) -> bool:
        """Whether this tag has been seen uncovered."""
        return self._usual is not None

    def learn(self, grey: GreyArray, homography: FloatArray) -> None:
        """Take this image for one of the uncovered tag."""
        left = _measure_cells(grey, homography, self._family, self._tag_id)
        if left is not None:
            self._looks = min(self._looks + 1, _MEMORY)
            usual = np.zeros_like(left) if self._usual is None else self._usual
            self._usual = usual + (left - usual) / self._looks

    def is_covered(self, grey: GreyArray, homography: FloatArray) -> bool:
        """Tell whether a part of the tag is covered.

        Parameters
        ----------
        grey : ndarray of uint8, shape (height, width)
            The image.
        homography : ndarray, shape (3, 3)
            Takes the tag's frame to pixels.

        Returns
        -------
        bool
            Also True where no pattern is left.
        """
        left = _measure_cells(grey, homography, self._family, self._tag_id)
        if left is None:
            return True
        if self._usual is None:
            return bool(np.abs(left).max() > _LEAST_FIRST_CHANGE)
        change = np.abs(left - self._usual)
        sigma = float(np.quantile(change, _QUANTILE)) / _QUANTILE_SIGMA
        return bool(change.max() > _LEAST_CHANGE + _SIGMAS * sigma)


def _measure_cells(grey: GreyArray, homography: FloatArray, family: str, tag_id: int) -> FloatArray | None:
    """Return what the fit leaves of each cell's mean, over the contrast; None where there is none."""
    grid, means = _layout(family)
    design, used = _design(family, tag_id)
    size = (means.shape[1], means.shape[1])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    patch = cv2.warpPerspective(grey, homography @ grid, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
    cells = (means @ patch.astype(np.float64) @ means.T)[used]
    trusted, most = np.ones(len(cells), dtype=bool), int(_TRUSTED * (len(cells) - 1))
    for _ in range(_FITS):
        known = design[trusted]
        solution = np.linalg.solve(known.T @ known + _TINY * np.eye(known.shape[1]), known.T @ cells[trusted])
        left: FloatArray = cells - design @ solution
        off = np.abs(left)
        trusted = off <= np.partition(off, most)[most]
    contrast = solution[0] + solution[1]
    return left / contrast if contrast > 1 else None


@cache
def _layout(family: str) -> tuple[FloatArray, FloatArray]:
    """Return what takes (column, row) of the samples to the tag's frame, and the mean of them to cells."""
    layout = tag_family(family)
    step = 2 / layout.border_cells / _POINTS
    edge = layout.cells / layout.border_cells - step / 2
    grid = np.array([[step, 0, -edge], [0, -step, edge], [0, 0, 1.0]])
    means = np.kron(np.eye(layout.cells), np.ones(_POINTS))
    means[:, 0] = means[:, -1] = 0  # nobody knows what lies beside the outermost cells
    return grid, means / means.sum(axis=1, keepdims=True)


@cache
def _design(family: str, tag_id: int) -> tuple[FloatArray, BoolArray]:
    """Return the design of the fit, and which cells are used."""
    pattern = tag_pattern(family, tag_id).astype(float)
    wide = np.pad(pattern, 1, mode="edge")
    blurred = (wide[:-2, 1:-1] + wide[2:, 1:-1] + wide[1:-1, :-2] + wide[1:-1, 2:]) / 4
    rows, columns = np.indices(pattern.shape) - (len(pattern) - 1) / 2
    used = used_cells(family)
    light = (np.ones_like(pattern), rows, columns, pattern * rows, pattern * columns)
    design = np.stack([plane[used] for plane in (pattern, blurred, *light)], axis=1)
    return design, used
