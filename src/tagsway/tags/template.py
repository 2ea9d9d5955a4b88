"""A tag's pattern as an optical system shows it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from tagsway.model import FloatArray
from tagsway.tags.families import tag_family, tag_pattern, used_cells

PARAMETERS = 10  # eight of the homography, gain, offset

_TEXELS_PER_PX = 4.2  # at 3.6 the derivatives are 1 % too steep, and what a step leaves is seen
_MOST_TEXELS = 640
_PAPER_CELLS = 0.75  # of the white cell around the square
_NEGLIGIBLE = 1e-9  # of the contrast

Float32Array = NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True)
class Template:
    """The pattern, finely drawn, as a texture to be seen by an image's pixels.

    Parameters
    ----------
    half_width : float
        As far as it is trusted, in the tag's own frame (the border square is ±1).
    texture : ndarray of float32, shape (m, m)
        The pattern. Its derivatives are those of what is interpolated, so they need no memory.
    printed : ndarray of float32, shape (m, m) or (0, 0)
        1 where the family prints something, 0 elsewhere; empty where it does so everywhere.
    texture_half_width : float
        Of the texture; a little more than is trusted, for what moves while it is exposed.
    texture_grid : ndarray, shape (3, 3)
        Takes the tag's own frame to (column, row) of the texture.
    scale_px, blur_px : float
        Pixels to a unit of the tag's frame, and standard deviation of the blur, that it was made for.
    """

    half_width: float
    texture: Float32Array
    printed: Float32Array
    texture_half_width: float
    texture_grid: FloatArray
    scale_px: float
    blur_px: float


def make_template(family: str, tag_id: int, *, scale_px: float, blur_px: float) -> Template:
    """Return the template of a tag seen at one size and sharpness.

    Parameters
    ----------
    family : str
        Of the tag.
    tag_id : int
        Its number.
    scale_px : float
        Pixels to a unit of the tag's frame: half the side of the border square.
    blur_px : float
        Standard deviation of the optics' blur, in px; the pixels' own area comes on top.

    Returns
    -------
    Template
        Ready to be seen; 1 ms for a tag of 60 px.

    Notes
    -----
    A cell's edge blurred by a Gaussian is an error function, and its mean over a pixel has a closed form too, so
    pattern and gradients are exact at any size (for a tag in line with the pixels, where it matters most).
    The pattern reaches a little over the edge, as far as the paper around the tag can be trusted to be white.
    """
    layout = tag_family(family)
    half_width = find_half_width(family, blur_px / scale_px)
    padded = layout.cells == layout.border_cells + 2
    reach = max(half_width, 1 + _PAPER_CELLS * 2 / layout.border_cells) if padded else half_width
    texels = int(min(np.ceil(2 * reach * scale_px * _TEXELS_PER_PX), _MOST_TEXELS))
    to_texel, middle = texels / (2 * reach), (texels - 1) / 2
    return Template(
        half_width=half_width,
        texture=draw_pattern(family, tag_id, reach, texels, blur_px / scale_px, 1 / scale_px),
        printed=np.empty((0, 0), np.float32) if used_cells(family).all() else find_printed(family, reach, texels),
        texture_half_width=reach,
        texture_grid=np.array([[to_texel, 0, middle], [0, -to_texel, middle], [0, 0, 1.0]]),
        scale_px=scale_px,
        blur_px=blur_px,
    )


def find_half_width(family: str, blur: float) -> float:
    """Return how far the pattern is known: three blurs over the edge, but never near what lies around the paper.

    Parameters
    ----------
    family : str
        Of the tag.
    blur : float
        Standard deviation, in the tag's own frame.

    Returns
    -------
    float
        In the tag's own frame.
    """
    layout = tag_family(family)
    cell = 2 / layout.border_cells
    if layout.cells > layout.border_cells + 2:
        return (layout.cells / layout.border_cells) - 0.25 * cell
    return 1 + float(np.clip(3 * blur, 0.3 * cell, _PAPER_CELLS * cell))


def draw_pattern(family: str, tag_id: int, half_width: float, samples: int, blur: float, pixel: float) -> Float32Array:
    """Return the pattern, shape (samples, samples).

    Parameters
    ----------
    family, tag_id
        The tag.
    half_width : float
        Of the square that is drawn, in the tag's own frame.
    samples : int
        To a side.
    blur, pixel : float
        Standard deviation of the blur and side of a pixel, in the tag's own frame.
    """
    level = _find_shares(_find_distances(family, half_width, samples), blur, pixel)
    return np.asarray(level @ _grey_cells(family, tag_id) @ level.T, dtype=np.float32)


def draw_slopes(
    family: str, tag_id: int, half_width: float, samples: int, blur: float, pixel: float
) -> tuple[Float32Array, Float32Array]:
    """Return the pattern's derivatives by x and by y; parameters as for `draw_pattern`."""
    distance = _find_distances(family, half_width, samples)
    level, slope = _find_shares(distance, blur, pixel), _find_slopes(distance, blur, pixel)
    cells = _grey_cells(family, tag_id)
    by_x, by_y = level @ cells @ slope.T, -(slope @ cells @ level.T)
    return np.asarray(by_x, dtype=np.float32), np.asarray(by_y, dtype=np.float32)


def find_printed(family: str, half_width: float, samples: int) -> Float32Array:
    """Return 1 where the family prints something and 0 elsewhere, shape (samples, samples); as for `draw_pattern`."""
    layout = tag_family(family)
    at = sample_places(half_width, samples) * (layout.border_cells / 2) + layout.cells / 2
    index = np.clip(np.floor(at).astype(int), 0, layout.cells - 1)
    return used_cells(family).astype(np.float32)[np.ix_(index, index)]


def sample_places(half_width: float, samples: int) -> FloatArray:
    """Return where the columns lie, from left to right; shape (samples,)."""
    return -half_width + (np.arange(samples, dtype=np.float64) + 0.5) * (2 * half_width / samples)


def _grey_cells(family: str, tag_id: int) -> Float32Array:
    return tag_pattern(family, tag_id).astype(np.float32)


def _find_distances(family: str, half_width: float, samples: int) -> FloatArray:
    """Return how far each sample lies from each edge of the cells, shape (samples, cells + 1)."""
    layout = tag_family(family)
    edges = (np.arange(layout.cells + 1) - layout.cells / 2) * (2 / layout.border_cells)
    return np.asarray(sample_places(half_width, samples)[:, None] - edges)


def _find_shares(distance: FloatArray, blur: float, pixel: float) -> Float32Array:
    """Return how much of each cell a pixel sees through a Gaussian blur, shape (samples, cells)."""
    level = (_integrate_ndtr((distance + pixel / 2) / blur) - _integrate_ndtr((distance - pixel / 2) / blur)) * (
        blur / pixel
    )
    level[:, 0], level[:, -1] = 1.0, 0.0  # the outermost cells go on outwards
    return _cut_tails(level[:, :-1] - level[:, 1:])


def _find_slopes(distance: FloatArray, blur: float, pixel: float) -> Float32Array:
    """Return the derivative of that."""
    density = (ndtr((distance + pixel / 2) / blur) - ndtr((distance - pixel / 2) / blur)) / pixel
    density[:, [0, -1]] = 0.0
    return _cut_tails(density[:, :-1] - density[:, 1:])


def _cut_tails(weights: FloatArray) -> Float32Array:
    """Return weights without a Gaussian's tail: processors take a hundred times as long for numbers so small."""
    return np.where(np.abs(weights) > _NEGLIGIBLE, weights, 0.0).astype(np.float32)


def _integrate_ndtr(z: FloatArray) -> FloatArray:
    """Return the integral of the normal distribution function up to z."""
    return np.asarray(z * ndtr(z) + np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi), dtype=np.float64)
