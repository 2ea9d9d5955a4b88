"""A tag's pattern as an optical system shows it."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from tagsway.model import FloatArray
from tagsway.tags.families import tag_family, tag_pattern, used_cells

PARAMETERS = 10  # eight of the homography, gain, offset

_TEXELS_PER_PX = 4.2  # bilinear sampling of a blur of 0.6 px is then exact to a thousandth of a pixel
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
    texture : ndarray of float32, shape (m, m, 4)
        Derivatives of the pattern by x and y of the tag's frame, the pattern, and 1, where the family prints
        something; 0 elsewhere and outside: so the last one is the others' weight, however they are interpolated.
    texture_half_width : float
        Of the texture; a little more than is trusted, for what moves while it is exposed.
    texture_grid : ndarray, shape (3, 3)
        Takes the tag's own frame to (column, row) of the texture.
    scale_px, blur_px : float
        Pixels to a unit of the tag's frame, and standard deviation of the blur, that it was made for.
    """

    half_width: float
    texture: Float32Array
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
    pattern, by_x, by_y, printed, _ = draw_pattern(family, tag_id, reach, texels, blur_px / scale_px, 1 / scale_px)
    if not printed.all():
        pattern, by_x, by_y = pattern * printed, by_x * printed, by_y * printed
    to_texel, middle = texels / (2 * reach), (texels - 1) / 2
    return Template(
        half_width=half_width,
        texture=np.asarray(cv2.merge([by_x, by_y, pattern, printed]), dtype=np.float32),
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


def draw_pattern(
    family: str, tag_id: int, half_width: float, samples: int, blur: float, pixel: float
) -> tuple[Float32Array, ...]:
    """Return pattern, derivatives by x and by y, what is used, and where the columns lie.

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
    layout = tag_family(family)
    cell = 2 / layout.border_cells
    at: FloatArray = -half_width + (np.arange(samples, dtype=np.float64) + 0.5) * (2 * half_width / samples)
    edges: FloatArray = (np.arange(layout.cells + 1, dtype=np.float64) - layout.cells / 2) * cell
    level, density = _cell_weights(at, edges, blur, pixel)
    # A Gaussian's tail ends in numbers so small that processors take a hundred times as long for each.
    inside, slope = (np.where(np.abs(part) > _NEGLIGIBLE, part, 0.0).astype(np.float32) for part in (level, density))
    cells = tag_pattern(family, tag_id).astype(np.float32)
    index = np.clip(np.floor((at - edges[0]) / cell).astype(int), 0, layout.cells - 1)
    used = used_cells(family).astype(np.float32)[np.ix_(index, index)]
    parts = (inside @ cells @ inside.T, inside @ cells @ slope.T, -(slope @ cells @ inside.T), used, at)
    return tuple(np.asarray(part, dtype=np.float32) for part in parts)


def _cell_weights(at: FloatArray, edges: FloatArray, blur: float, pixel: float) -> tuple[FloatArray, FloatArray]:
    """Return how much of each cell a pixel sees through a Gaussian blur, and its derivative: (samples, cells)."""
    distance = (at[:, None] - edges) / blur
    half = pixel / 2 / blur
    level = (_integrate_ndtr(distance + half) - _integrate_ndtr(distance - half)) / (2 * half)
    level[:, 0], level[:, -1] = 1.0, 0.0  # the outermost cells go on outwards
    density = (ndtr(distance + half) - ndtr(distance - half)) / pixel
    density[:, [0, -1]] = 0.0
    return level[:, :-1] - level[:, 1:], density[:, :-1] - density[:, 1:]


def _integrate_ndtr(z: FloatArray) -> FloatArray:
    """Return the integral of the normal distribution function up to z."""
    return np.asarray(z * ndtr(z) + np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi), dtype=np.float64)
