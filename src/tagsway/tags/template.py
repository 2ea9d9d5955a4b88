"""A tag's pattern as an optical system shows it, with what its alignment needs computed once."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from tagsway.model import FloatArray
from tagsway.tags.families import tag_family, tag_pattern, used_cells

PARAMETERS = 10  # eight of the homography, gain, offset

_SAMPLES_PER_PX = 1.0
_FEWEST_SAMPLES, _MOST_SAMPLES = 24, 80
_TEXELS_PER_PX = 4.2  # bilinear sampling of a blur of 0.6 px is then exact to a thousandth of a pixel
_MOST_TEXELS = 640
_PAPER_CELLS = 0.75  # of the white cell around the square

Float32Array = NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True)
class Template:
    """The pattern for the two alignments: image to pattern on a grid of its own, and pattern to image at the pixels.

    Parameters
    ----------
    samples : int
        Of the grid, to a side.
    half_width : float
        Of the grid, in the tag's own frame (the border square is ±1).
    grid : ndarray, shape (3, 3)
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
    texture : ndarray of float32, shape (m, m, 4)
        Derivatives of the pattern by x and y of the tag's frame, the pattern, and 1, where the family prints
        something; 0 elsewhere and outside: so the last one is the others' weight, however they are interpolated.
    texture_half_width : float
        Of the texture; a little more than the grid's, for what moves while it is exposed.
    texture_grid : ndarray, shape (3, 3)
        Takes the tag's own frame to (column, row) of the texture.
    scale_px, blur_px : float
        Pixels to a unit of the tag's frame, and standard deviation of the blur, that it was made for.
    """

    samples: int
    half_width: float
    grid: FloatArray
    solver: Float32Array
    normal: FloatArray
    used: Float32Array
    inner: slice
    inner_pattern: Float32Array
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
        Ready to be aligned.

    Notes
    -----
    A cell's edge blurred by a Gaussian is an error function, and its mean over a pixel has a closed form too, so
    pattern and gradients are exact at any size (for a tag in line with the pixels, where it matters most). The
    derivative by the homography x → W(p) x at p = 0 is ∇T · ∂W/∂p (Baker and Matthews, IJCV 56 (2004) 221-255).
    The pattern reaches a little over the edge, as far as the paper around the tag can be trusted to be white.
    """
    layout = tag_family(family)
    cell = 2 / layout.border_cells
    half_width = _half_width(layout.cells, layout.border_cells, cell, blur_px / scale_px)
    width_px = 2 * half_width * scale_px
    samples = int(np.clip(np.ceil(width_px * _SAMPLES_PER_PX), _FEWEST_SAMPLES, _MOST_SAMPLES))
    blur, pixel = blur_px / scale_px, 1 / scale_px
    pattern, by_x, by_y, used, at = _draw(family, tag_id, half_width, samples, blur, pixel)
    x, y = np.meshgrid(at, -at)
    inward = by_x * x + by_y * y
    columns = [by_x * x, by_x * y, by_x, by_y * x, by_y * y, by_y, -inward * x, -inward * y, pattern]
    design = (np.stack([*columns, np.ones_like(pattern)]) * used).reshape(PARAMETERS, -1)
    normal = design @ design.T
    inner = np.flatnonzero(np.abs(at) <= (1.0 if layout.reversed_border else 1 - cell))
    inside = slice(int(inner[0]), int(inner[-1]) + 1)
    core = pattern[inside, inside] - pattern[inside, inside].mean()
    step = at[1] - at[0]
    reach = max(half_width, 1 + _PAPER_CELLS * cell) if layout.cells == layout.border_cells + 2 else half_width
    texels = int(min(np.ceil(2 * reach * scale_px * _TEXELS_PER_PX), _MOST_TEXELS))
    fine, fine_x, fine_y, printed, _ = _draw(family, tag_id, reach, texels, blur, pixel)
    texture = np.stack([fine_x, fine_y, fine, np.ones_like(fine)], axis=-1) * printed[..., None]
    to_texel, middle = texels / (2 * reach), (texels - 1) / 2
    return Template(
        samples=samples,
        half_width=half_width,
        grid=np.array([[step, 0, at[0]], [0, -step, -at[0]], [0, 0, 1.0]]),
        solver=np.linalg.solve(normal, design).astype(np.float32),
        normal=normal,
        used=used.astype(np.float32).ravel(),
        inner=inside,
        inner_pattern=(core / np.linalg.norm(core)).astype(np.float32),
        texture=texture.astype(np.float32),
        texture_half_width=reach,
        texture_grid=np.array([[to_texel, 0, middle], [0, -to_texel, middle], [0, 0, 1.0]]),
        scale_px=scale_px,
        blur_px=blur_px,
    )


def _draw(
    family: str, tag_id: int, half_width: float, samples: int, blur: float, pixel: float
) -> tuple[FloatArray, ...]:
    """Return pattern, derivatives by x and by y, what is used, and where the columns lie."""
    layout = tag_family(family)
    cell = 2 / layout.border_cells
    at: FloatArray = -half_width + (np.arange(samples, dtype=np.float64) + 0.5) * (2 * half_width / samples)
    edges: FloatArray = (np.arange(layout.cells + 1, dtype=np.float64) - layout.cells / 2) * cell
    inside, slope = _cell_weights(at, edges, blur, pixel)
    cells = tag_pattern(family, tag_id).astype(float)
    index = np.clip(np.floor((at - edges[0]) / cell).astype(int), 0, layout.cells - 1)
    used = used_cells(family)[np.ix_(index, index)].astype(float)
    return inside @ cells @ inside.T, inside @ cells @ slope.T, -(slope @ cells @ inside.T), used, at


def _half_width(cells: int, border_cells: int, cell: float, blur: float) -> float:
    """Return how far the pattern is known: three blurs over the edge, but never near what lies around the paper."""
    if cells > border_cells + 2:
        return (cells / border_cells) - 0.25 * cell
    return 1 + float(np.clip(3 * blur, 0.3 * cell, _PAPER_CELLS * cell))


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
