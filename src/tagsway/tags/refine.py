"""The last step of an alignment, on the image's own pixels, and what it is worth."""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from tagsway.model import FloatArray, GreyArray
from tagsway.tags.pose import Jacobian, Region, find_region, invert, local_jacobian, move_back, turn_of_step
from tagsway.tags.streak import find_streak
from tagsway.tags.template import PARAMETERS, Float32Array, Template

_GAIN, _OFFSET, _STEP = 2, 3, [0, 1, 4, 5, 6, 7, 8, 9]  # places in the solution

_ROUNDING = 1 / 12  # variance of the rounding to grey levels: no image is better
_BLOCKS = 10  # to a side
_SHORTEST_MOTION_PX = 0.5  # a shorter one blurs by less than a seventh of a pixel
_KNOWN_WEIGHT = 0.999  # a pixel that a streak brings less of the pattern to is not known
_LONGEST_STEP = 0.1  # of the tag's half side; a longer one was no refinement
_MIDDLE_GREY = 128  # taken off, so that sums of squares keep their digits


@dataclass(frozen=True, slots=True, kw_only=True)
class Refinement:
    """A pose at the noise's limit.

    Parameters
    ----------
    homography : ndarray, shape (3, 3)
        Takes the tag's frame to the pixels of the image that was given.
    plain : tuple of float
        Variances of (centre x, centre y in px, angle in rad), then the covariance of x and y, for white noise of the
        residual's size.
    sandwich : ndarray, shape (3,), or None
        The variances from the residual's sums over blocks: whatever the noise's correlation, but uncertain themselves.
    variance : float
        Of the residual, in grey levels squared.
    gain : float
        Grey levels from black to white.
    correlation : float
        Of pattern and image.
    step_px : float
        How far the centre or a corner was moved, about.
    """

    homography: FloatArray
    plain: tuple[float, float, float, float]
    sandwich: FloatArray | None
    variance: float
    gain: float
    correlation: float
    step_px: float


def refine(
    grey: GreyArray,
    homography: FloatArray,
    template: Template,
    *,
    motion_px: tuple[float, float] = (0.0, 0.0),
    with_blocks: bool = False,
) -> Refinement | None:
    """Return the pose after one Gauss-Newton step in the image's frame.

    Parameters
    ----------
    grey : ndarray of uint8, shape (height, width)
        The image.
    homography : ndarray, shape (3, 3)
        Takes the tag's frame to it; right to about 0.3 px.
    template : Template
        Of this size and sharpness.
    motion_px : tuple of float
        How far the tag moves, right and down, while the image is exposed.
    with_blocks : bool
        Also the sandwich, for more than half as much time again.

    Returns
    -------
    Refinement or None
        None where the step is none, or the tag leaves the image.

    Notes
    -----
    Grey I, pattern T: I(x) = a T(H⁻¹ V(x)) + b with V = id + δ(p) a homography of the image, so that each pixel is
    compared with the pattern at its own place; linear in (a p, a, b). The pixels' noise is independent, hence the
    covariance of p is σ² (JᵀJ)⁻¹ / a². Not for a first alignment: one step reaches only as far as a blur.

    The columns of J are the pattern's derivatives times powers of x and y, so all of JᵀJ and JᵀI are moments of nine
    products of images, over x, then over y: no column is ever formed.
    """
    still = math.hypot(*motion_px) < _SHORTEST_MOTION_PX
    region = find_region(grey.shape, homography, template.half_width if still else template.texture_half_width)
    if region is None:
        return None
    left, top, width, height = region
    scale = template.scale_px
    h = homography / homography[2, 2]
    local = local_jacobian(h)
    planes = _see(h, template, region, local, None if still else motion_px)
    np.subtract(grey[top : top + height, left : left + width], np.float32(_MIDDLE_GREY), out=planes[4])
    planes[4] *= planes[3]
    powers = _raise(region, h, scale)
    products = _multiply(planes, *powers)
    normal, sums, squares = products[:-1, :-1], products[:-1, -1], float(products[-1, -1])
    count = float(normal[_OFFSET, _OFFSET])
    if not count > PARAMETERS:
        return None
    inverse, turn = invert(normal), turn_of_step(local)
    solution = inverse @ sums
    values = solution.tolist()
    fitted, gain = float(solution @ sums), values[_GAIN]
    with_pattern, level = float(sums[_GAIN]), float(sums[_OFFSET])
    mean = float(normal[_GAIN, _OFFSET]) / count
    spread = (squares - level**2 / count) * (float(normal[_GAIN, _GAIN]) - mean**2 * count)
    step = [values[place] / gain for place in _STEP] if gain > 0 else [math.inf]
    longest = max(map(abs, step))
    (xx, xy), (_, yy) = inverse[:2, :2].tolist()
    turning = float(turn @ inverse[4:8, 4:8] @ turn)
    if not (min(spread, xx, yy, turning) > 0 and longest < _LONGEST_STEP):
        return None
    variance = max((squares - fitted) / (count - PARAMETERS), _ROUNDING)
    unit = variance / gain**2
    per_px = unit * scale**2
    influence = _functionals(turn, scale) @ inverse / gain if with_blocks else None
    return Refinement(
        homography=move_back(h, step, scale),
        plain=(per_px * xx, per_px * yy, unit * turning, per_px * xy),
        sandwich=None if influence is None else _sum_blocks(planes, powers, solution, influence),
        variance=variance,
        gain=gain,
        step_px=scale * longest,
        correlation=(with_pattern - level * mean) / math.sqrt(spread),
    )


def _see(
    homography: FloatArray,
    template: Template,
    region: Region,
    local: Jacobian,
    motion_px: tuple[float, float] | None,
) -> Float32Array:
    """Return the pattern as the image's pixels see it, shape (5, height, width).

    Its derivatives by x and y of the image, in units of the scale, itself, its weight, and room for the image.
    """
    left, top, width, height = region
    place = np.array([[1, 0, left], [0, 1, top], [0, 0, 1.0]])
    view = template.texture_grid @ invert(homography) @ place
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    seen = np.asarray(cv2.warpPerspective(template.texture, view, (width, height), flags=flags))
    if motion_px is not None:
        seen = np.asarray(cv2.filter2D(seen, -1, find_streak(motion_px), borderType=cv2.BORDER_CONSTANT))
    (a, b), (c, d) = local
    share = template.scale_px / (a * d - b * c)
    first = np.eye(4, dtype=np.float32)
    first[:2, :2] = (share * d, -share * c), (-share * b, share * a)
    planes = np.empty((5, height, width), np.float32)
    np.matmul(first, seen.reshape(-1, 4).T, out=planes[:4].reshape(4, -1))
    if motion_px is not None:
        planes[:4] *= planes[3] > _KNOWN_WEIGHT  # what the edge of the known part swept over is not known
    return planes


# The gradients' columns are sums of these: (plane, power of x, power of y); then pattern, weight and image.
_TERMS = [(0, 0, 0), (0, 1, 0), (0, 0, 1), (0, 2, 0), (0, 1, 1), (1, 0, 0), (1, 1, 0), (1, 0, 1), (1, 1, 1), (1, 0, 2)]
_ALL_TERMS = [*_TERMS, (2, 0, 0), (3, 0, 0), (4, 0, 0)]
_POWERS = 5


def _find_moment(one: tuple[int, int, int], other: tuple[int, int, int]) -> int:
    """Return where the sum of two terms' product is among the moments, then the products of the last three planes."""
    low, high = sorted((one[0], other[0]))
    if low > 1:
        return 9 * _POWERS**2 + 3 * (low - 2) + high - 2
    image = high if low == 0 else 5 + high - 1
    return _POWERS * (_POWERS * image + one[2] + other[2]) + one[1] + other[1]


_MOMENTS = np.array([[_find_moment(one, other) for other in _ALL_TERMS] for one in _ALL_TERMS])
_COLUMNS = np.zeros((PARAMETERS + 1, len(_ALL_TERMS)))  # of the solution, then the image
_COLUMNS[[0, 1, 2, 3, 4, 5, 6, 7, 10], [0, 5, 10, 11, 1, 2, 6, 7, 12]] = 1.0
_COLUMNS[8, [3, 8]] = _COLUMNS[9, [4, 9]] = -1.0


def _raise(region: Region, homography: FloatArray, scale: float) -> tuple[Float32Array, Float32Array]:
    """Return the powers 0 .. 4 of the columns' and the rows' places about the tag's centre, in units of the scale."""
    left, top, width, height = region
    powers = np.empty((_POWERS, width + height), np.float32)
    powers[0] = 1.0
    powers[1, :width] = (np.arange(width) + (left - float(homography[0, 2]))) / scale
    powers[1, width:] = (np.arange(height) + (top - float(homography[1, 2]))) / scale
    np.multiply(powers[1], powers[1], out=powers[2])
    np.multiply(powers[1:3], powers[2], out=powers[3:])
    return powers[:, :width], powers[:, width:]


def _multiply(planes: Float32Array, by_x: Float32Array, by_y: Float32Array) -> FloatArray:
    """Return the scalar products of the solution's columns and the image, shape (11, 11)."""
    _, height, width = planes.shape
    maps = np.empty((9, height, width), np.float32)
    np.multiply(planes[0], planes, out=maps[:5])
    np.multiply(planes[1], planes[1:], out=maps[5:])
    moments = by_y @ (maps.reshape(-1, width) @ by_x.T).reshape(9, height, _POWERS)
    pattern, weight, image = planes[2:].reshape(3, -1)
    with_weight, with_image = pattern @ weight, pattern @ image
    level = weight @ image
    rest = (
        pattern @ pattern,
        with_weight,
        with_image,
        with_weight,
        weight @ weight,
        level,
        with_image,
        level,
        image @ image,
    )
    every = np.concatenate([moments.ravel(), rest], dtype=float)
    products: FloatArray = _COLUMNS @ every[_MOMENTS] @ _COLUMNS.T
    return products


def _functionals(turn: FloatArray, scale: float) -> FloatArray:
    """Return centre x, centre y and angle as linear functions of the solution, shape (3, 10); signs left out."""
    rows = np.zeros((3, PARAMETERS))
    rows[0, 0] = rows[1, 1] = scale
    rows[2, 4:8] = turn
    return rows


def _sum_blocks(
    planes: Float32Array, powers: tuple[Float32Array, Float32Array], solution: FloatArray, influence: FloatArray
) -> FloatArray:
    """Return the variances of three sums from their parts over blocks of the image."""
    _, height, width = planes.shape
    wanted = np.vstack([influence, solution]) @ _COLUMNS[:-1, :-1]
    shares = np.zeros((2, len(wanted), 3, 3))  # of the two derivatives, by powers of y and x
    for k, (plane, power_x, power_y) in enumerate(_TERMS):
        shares[plane, :, power_y, power_x] = wanted[:, k]
    by_x, by_y = (part[:3] for part in powers)
    sums = planes[0] * (by_y.T @ shares[0].astype(np.float32) @ by_x)
    sums += planes[1] * (by_y.T @ shares[1].astype(np.float32) @ by_x)
    sums += (wanted[:, len(_TERMS) :].astype(np.float32) @ planes[2:4].reshape(2, -1)).reshape(sums.shape)
    parts = sums[:-1] * (planes[4] - sums[-1])
    rows, across = (np.arange(_BLOCKS) * size // _BLOCKS for size in (height, width))
    blocks = np.add.reduceat(np.add.reduceat(parts, rows, axis=1), across, axis=2).astype(float)
    variances: FloatArray = np.square(blocks).sum(axis=(1, 2)) * (_BLOCKS**2 / (_BLOCKS**2 - PARAMETERS))
    return variances
