"""A first alignment on a grid of the pattern's own: from a pixel or five of error to a tenth, and is it the tag?"""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from tagsway.model import FloatArray, GreyArray
from tagsway.tags.families import tag_family
from tagsway.tags.template import (
    PARAMETERS,
    Float32Array,
    draw_pattern,
    draw_slopes,
    find_half_width,
    find_printed,
    sample_places,
)

LEAST_CORRELATION = 0.85  # background reaches .44 over the whole, another id .76 ...
LEAST_INNER_CORRELATION = 0.7  # ... and .56 and .45 over the inner cells; the true tag, blurred and noisy, .95
LEAST_CONTRAST = 6.0  # grey levels from black to white

_SAMPLES_PER_PX = 1.0
_FEWEST_SAMPLES, _MOST_SAMPLES = 24, 80
_MOST_STEPS = 12
_LAST_STEP_PX = 0.1  # the refinement takes what is left
_PAD_PX = 10  # of the crop around a predicted tag: what the alignment may move


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """What aligning the pattern needs and what does not change from image to image.

    Parameters
    ----------
    samples : int
        To a side.
    place : ndarray, shape (3, 3)
        Takes (column, row) of a sample to the tag's own frame.
    solver : ndarray of float32, shape (10, samples²)
        Takes sampled grey values to (gain × step of the homography (8), gain, offset), by least squares.
    normal : ndarray, shape (10, 10)
        Gram matrix of the least squares.
    used : ndarray of float32, shape (samples²,)
        1 where the family prints something, 0 in the corners of a round tag.
    inner : slice
        Rows (and columns) inside the border: the cells that tell one id from another.
    inner_pattern : ndarray of float32, shape (k, k)
        The pattern there, of zero mean and unit length.
    scale_px : float
        Pixels to a unit of the tag's frame that it was made for.
    """

    samples: int
    place: FloatArray
    solver: Float32Array
    normal: FloatArray
    used: Float32Array
    inner: slice
    inner_pattern: Float32Array
    scale_px: float


def make_grid(family: str, tag_id: int, *, scale_px: float, blur_px: float) -> Grid:
    """Return the grid of a tag seen at one size and sharpness.

    Parameters
    ----------
    family : str
        Of the tag.
    tag_id : int
        Its number.
    scale_px : float
        Pixels to a unit of the tag's frame.
    blur_px : float
        Standard deviation of the optics' blur, in px; right to a factor of two.

    Returns
    -------
    Grid
        About a sample to a pixel.

    Notes
    -----
    The derivative by the homography x → W(p) x at p = 0 is ∇T · ∂W/∂p (Baker and Matthews, IJCV 56 (2004) 221-255).
    """
    layout = tag_family(family)
    half_width = find_half_width(family, blur_px / scale_px)
    samples = int(np.clip(np.ceil(2 * half_width * scale_px * _SAMPLES_PER_PX), _FEWEST_SAMPLES, _MOST_SAMPLES))
    drawn = family, tag_id, half_width, samples, blur_px / scale_px, 1 / scale_px
    pattern, (by_x, by_y) = draw_pattern(*drawn), draw_slopes(*drawn)
    used = find_printed(family, half_width, samples)
    at = sample_places(half_width, samples).astype(np.float32)
    x, y = at, -at[:, None]
    inward = by_x * x + by_y * y
    columns = [by_x * x, by_x * y, by_x, by_y * x, by_y * y, by_y, -inward * x, -inward * y, pattern]
    design = (np.stack([*columns, np.ones_like(pattern)]) * used).reshape(PARAMETERS, -1)
    normal = (design @ design.T).astype(float)
    inner = np.flatnonzero(np.abs(at) <= (1.0 if layout.reversed_border else 1 - 2 / layout.border_cells))
    inside = slice(int(inner[0]), int(inner[-1]) + 1)
    core = pattern[inside, inside] - pattern[inside, inside].mean()
    step, first = float(at[1] - at[0]), float(at[0])
    return Grid(
        samples=samples,
        place=np.array([[step, 0, first], [0, -step, -first], [0, 0, 1.0]]),
        solver=np.linalg.inv(normal).astype(np.float32) @ design,
        normal=normal,
        used=used.ravel(),
        inner=inside,
        inner_pattern=core / np.linalg.norm(core),
        scale_px=scale_px,
    )


def align_grid(grey: GreyArray, homography: FloatArray, grid: Grid) -> FloatArray | None:
    """Return the pose after inverse-compositional steps; None where they do not end at the pattern.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
        The image.
    homography : ndarray, shape (3, 3)
        Takes the tag's frame to it; off by not more than about 5 px and half a cell.
    grid : Grid
        Of about this size.

    Returns
    -------
    ndarray, shape (3, 3), or None
        To about 0.1 px.

    Notes
    -----
    The least-squares solver is fixed, so a step costs one resampling and one matrix-vector product.
    """
    crop = _cut(grey, homography, grid)
    here = homography
    for _ in range(_MOST_STEPS):
        patch = _sample(*crop, here, grid)
        solution = (grid.solver @ patch).astype(float)
        gain = solution[8]
        if not gain > LEAST_CONTRAST:
            return None
        step = solution[:8] / gain
        longest_px = float(np.abs(step).max()) * grid.scale_px
        if not longest_px < 0.5 * grid.scale_px:
            return None
        here = _compose(here, step)
        if longest_px < _LAST_STEP_PX:
            return here if _is_pattern(patch, solution, grid) else None
    return None


def shows_pattern(grey: GreyArray, homography: FloatArray, grid: Grid) -> bool:
    """Tell whether the image shows the pattern at a pose: over the whole, and in the cells that make the id.

    Parameters
    ----------
    grey, homography, grid
        As for `align_grid`.

    Returns
    -------
    bool
        From the correlations.
    """
    patch = _sample(*_cut(grey, homography, grid), homography, grid)
    return _is_pattern(patch, (grid.solver @ patch).astype(float), grid)


def _cut(grey: GreyArray, homography: FloatArray, grid: Grid) -> tuple[Float32Array, FloatArray]:
    """Return the part of the image around a tag, and the homography that takes the image to it."""
    last = grid.samples - 1
    across, down, depth = homography @ grid.place @ np.array([[0, last, last, 0], [0, 0, last, last], [1.0] * 4])
    across, down = across / depth, down / depth
    pad = _PAD_PX + 0.05 * float(max(np.ptp(across), np.ptp(down)))
    left, top = max(int(across.min() - pad), 0), max(int(down.min() - pad), 0)
    part = grey[top : max(int(down.max() + pad), top) + 1, left : max(int(across.max() + pad), left) + 1]
    crop = part.astype(np.float32)
    crop -= 128  # sums of squares keep their digits
    return crop, np.array([[1, 0, -left], [0, 1, -top], [0, 0, 1.0]])


def _sample(crop: Float32Array, enter: FloatArray, homography: FloatArray, grid: Grid) -> Float32Array:
    size = (grid.samples, grid.samples)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    view = enter @ homography @ grid.place
    patch = cv2.warpPerspective(crop, view, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(patch, dtype=np.float32).reshape(-1) * grid.used


def _compose(homography: FloatArray, step: FloatArray) -> FloatArray:
    """Return the homography after the inverse of a step, to third order in it."""
    move = np.array([[step[0], step[1], step[2]], [step[3], step[4], step[5]], [step[6], step[7], 0.0]])
    back = homography @ move
    composed: FloatArray = homography - back + back @ move
    return composed


def _is_pattern(patch: Float32Array, solution: FloatArray, grid: Grid) -> bool:
    """Tell whether the image shows the pattern: over the whole, and in the cells that make the id."""
    normal = grid.normal
    sums, count = normal @ solution, normal[9, 9]
    spread = (float(patch @ patch) - sums[9] ** 2 / count) * (normal[8, 8] - normal[8, 9] ** 2 / count)
    if not spread > 0:
        return False
    correlation = (sums[8] - sums[9] * normal[8, 9] / count) / math.sqrt(spread)
    cells = patch.reshape(grid.samples, -1)[grid.inner, grid.inner]
    deviation = cells - cells.mean()
    length = math.sqrt(float(np.vdot(deviation, deviation)))
    inner = float(np.vdot(deviation, grid.inner_pattern)) / length if length > 0 else 0.0
    return bool(correlation >= LEAST_CORRELATION and inner >= LEAST_INNER_CORRELATION)
