"""The last step of an alignment, on the image's own pixels, and what it is worth."""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from tagsway.model import FloatArray, GreyArray
from tagsway.tags.template import PARAMETERS, Float32Array, Template

_GAIN, _OFFSET, _STEP = 2, 3, [0, 1, 4, 5, 6, 7, 8, 9]  # places in the solution

_ROUNDING = 1 / 12  # variance of the rounding to grey levels: no image is better
_BLOCKS = 10  # to a side
_SHORTEST_MOTION_PX = 0.3  # a shorter one blurs by less than a tenth of a pixel
_MOST_MOTION_PX = 16.0
_LONGEST_STEP = 0.1  # of the tag's half side; a longer one was no refinement
_MIDDLE_GREY = 128  # taken off, so that sums of squares keep their digits


@dataclass(frozen=True, slots=True, kw_only=True)
class Refinement:
    """A pose at the noise's limit.

    Parameters
    ----------
    homography : ndarray, shape (3, 3)
        Takes the tag's frame to the pixels of the image that was given.
    plain : ndarray, shape (3, 3)
        Covariance of (centre x, centre y in px, angle in rad) for white noise of the residual's size.
    sandwich : ndarray, shape (3, 3), or None
        The same from the residual's sums over blocks: whatever the noise's correlation, but uncertain itself.
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
    plain: FloatArray
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
    region = _region(grey.shape, homography, template.half_width if still else template.texture_half_width)
    if region is None:
        return None
    left, top, width, height = region
    scale = template.scale_px
    h = homography / homography[2, 2]
    local = local_jacobian(h)
    planes = _see(h, template, region, local, None if still else motion_px)
    np.subtract(grey[top : top + height, left : left + width], np.float32(_MIDDLE_GREY), out=planes[4])
    planes[4] *= planes[3]
    x = (np.arange(left, left + width) - h[0, 2]) / scale
    y = (np.arange(top, top + height) - h[1, 2]) / scale
    products = _multiply(planes, x, y)
    normal, sums, squares = products[:-1, :-1], products[:-1, -1], products[-1, -1]
    inverse = _invert(normal)
    solution = inverse @ sums
    gain, count = float(solution[_GAIN]), normal[_OFFSET, _OFFSET]
    mean = normal[_GAIN, _OFFSET] / count
    spread = (squares - sums[_OFFSET] ** 2 / count) * (normal[_GAIN, _GAIN] - mean**2 * count)
    if not (gain > 0 and spread > 0 and np.abs(solution[_STEP]).max() < _LONGEST_STEP * gain):
        return None
    variance = max(float(squares - solution @ sums) / (count - PARAMETERS), _ROUNDING)
    influence = _functionals(local[:, 0], scale) @ inverse / gain
    return Refinement(
        homography=_move_back(h, solution[_STEP] / gain, scale),
        plain=variance * influence @ normal @ influence.T,
        sandwich=_sum_blocks(planes, x, y, solution, influence) if with_blocks else None,
        variance=variance,
        gain=gain,
        step_px=scale * float(np.abs(solution[_STEP]).max()) / gain,
        correlation=float((sums[_GAIN] - sums[_OFFSET] * mean) / math.sqrt(spread)),
    )


def local_jacobian(homography: FloatArray) -> FloatArray:
    """Return ∂(pixel)/∂(tag's frame) at the tag's centre, shape (2, 2)."""
    (a, b, x), (c, d, y), (g, h, w) = homography.tolist()
    x, y = x / w, y / w
    return np.array([[(a - x * g) / w, (b - x * h) / w], [(c - y * g) / w, (d - y * h) / w]])


def _region(shape: tuple[int, ...], homography: FloatArray, half_width: float) -> tuple[int, int, int, int] | None:
    """Return left, top, width and height of the pixels that the pattern covers."""
    square = np.array([[-1, 1, 1, -1], [-1, -1, 1, 1], [1 / half_width] * 4])
    across, down, depth = (homography @ square).tolist()
    across = [place / w for place, w in zip(across, depth, strict=True)]
    down = [place / w for place, w in zip(down, depth, strict=True)]
    left, top = max(math.floor(min(across)), 0), max(math.floor(min(down)), 0)
    width = min(math.ceil(max(across)), shape[1] - 1) - left + 1
    height = min(math.ceil(max(down)), shape[0] - 1) - top + 1
    return (left, top, width, height) if min(width, height) >= _BLOCKS else None


def _see(
    homography: FloatArray,
    template: Template,
    region: tuple[int, int, int, int],
    local: FloatArray,
    motion_px: tuple[float, float] | None,
) -> Float32Array:
    """Return the pattern as the image's pixels see it, shape (5, height, width).

    Its derivatives by x and y of the image, in units of the scale, itself, its weight, and room for the image.
    """
    left, top, width, height = region
    place = np.array([[1, 0, left], [0, 1, top], [0, 0, 1.0]])
    view = template.texture_grid @ _invert(homography) @ place
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    seen = np.asarray(cv2.warpPerspective(template.texture, view, (width, height), flags=flags))
    if motion_px is not None:
        seen = np.asarray(cv2.filter2D(seen, -1, _streak(motion_px), borderType=cv2.BORDER_CONSTANT))
    first = np.eye(4, dtype=np.float32)
    first[:2, :2] = (template.scale_px * _invert(local)).T
    planes = np.empty((5, height, width), np.float32)
    np.matmul(first, seen.reshape(-1, 4).T, out=planes[:4].reshape(4, -1))
    if motion_px is not None:
        planes[:4] *= planes[3] > 0.999  # what the edge of the known part swept over is not known
    return planes


def _streak(motion_px: tuple[float, float]) -> Float32Array:
    """Return the kernel of a motion: a line in cubic interpolation (Keys), which keeps parabolas."""
    length = math.hypot(*motion_px)
    motion = [part * min(1.0, _MOST_MOTION_PX / length) for part in motion_px]
    steps = math.ceil(2 * length) + 2
    shares = (np.arange(steps) + 0.5) / steps - 0.5
    across, down = (_interpolate(part * shares, math.ceil(abs(part) / 2) + 1) for part in motion)
    return np.asarray(down.T @ across / steps, dtype=np.float32)


def _interpolate(places: FloatArray, reach: int) -> FloatArray:
    """Return the weights of the pixels -reach .. reach in a value between them, shape (places, 2 reach + 1)."""
    off = np.abs(np.arange(-reach, reach + 1) - places[:, None])
    near = (1.5 * off - 2.5) * off * off + 1
    far = ((-0.5 * off + 2.5) * off - 4) * off + 2
    weights: FloatArray = np.where(off < 1, near, np.where(off < 2, far, 0.0))
    return weights


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


def _multiply(planes: Float32Array, x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the scalar products of the solution's columns and the image, shape (11, 11)."""
    _, height, width = planes.shape
    maps = np.empty((9, height, width), np.float32)
    np.multiply(planes[0], planes, out=maps[:5])
    np.multiply(planes[1], planes[1:], out=maps[5:])
    by_x, by_y = (np.vander(at, _POWERS, increasing=True).astype(np.float32) for at in (x, y))
    moments = by_y.T @ (maps.reshape(-1, width) @ by_x).reshape(9, height, _POWERS)
    rest = planes[2:].reshape(3, -1)
    every = np.concatenate([moments.ravel(), *(rest @ one for one in rest)]).astype(float)
    products: FloatArray = _COLUMNS @ every[_MOMENTS] @ _COLUMNS.T
    return products


def _functionals(along: FloatArray, scale: float) -> FloatArray:
    """Return centre x, centre y and angle as linear functions of the solution, shape (3, 10); signs left out."""
    rows = np.zeros((3, PARAMETERS))
    rows[0, 0] = rows[1, 1] = scale
    dx, dy = along / math.hypot(*along)
    rows[2, 4:8] = [-dx * dy, -dy * dy, dx * dx, dx * dy]
    return rows


def _move_back(homography: FloatArray, step: FloatArray, scale: float) -> FloatArray:
    """Return V⁻¹ H to third order in the step, V given about the tag's centre in units of the scale."""
    x, y = homography[:2, 2]
    dx, dy, xx, xy, yx, yy, px, py = step
    to_unit = np.array([[1 / scale, 0, -x / scale], [0, 1 / scale, -y / scale], [0, 0, 1.0]])
    to_pixel = np.array([[scale, 0, x], [0, scale, y], [0, 0, 1.0]])
    move = to_pixel @ np.array([[xx, xy, dx], [yx, yy, dy], [px, py, 0.0]]) @ to_unit
    back = move @ homography
    moved = homography - back + move @ back
    return np.asarray(moved / moved[2, 2], dtype=np.float64)


def _invert(matrix: FloatArray) -> FloatArray:
    """Return the inverse of a small matrix, five times as fast as numpy's."""
    return np.asarray(cv2.invert(matrix)[1], dtype=np.float64)


def _sum_blocks(
    planes: Float32Array, x: FloatArray, y: FloatArray, solution: FloatArray, influence: FloatArray
) -> FloatArray:
    """Return the covariance of three sums from their parts over blocks of the image."""
    _, height, width = planes.shape
    wanted = np.vstack([influence, solution]) @ _COLUMNS[:-1, :-1]
    shares = np.zeros((2, len(wanted), 3, 3))  # of the two derivatives, by powers of y and x
    for k, (plane, power_x, power_y) in enumerate(_TERMS):
        shares[plane, :, power_y, power_x] = wanted[:, k]
    by_x, by_y = (np.vander(at, 3, increasing=True) for at in (x, y))
    weights = (by_y @ shares @ by_x.T).astype(np.float32)
    weights *= planes[:2, None]
    sums = weights[0] + weights[1]
    sums += np.tensordot(wanted[:, len(_TERMS) :].astype(np.float32), planes[2:4], axes=1)
    parts = sums[:-1] * (planes[4] - sums[-1])
    rows, across = (np.arange(_BLOCKS) * size // _BLOCKS for size in (height, width))
    blocks = np.add.reduceat(np.add.reduceat(parts, rows, axis=1), across, axis=2).reshape(3, -1).astype(float)
    covariance: FloatArray = blocks @ blocks.T * (_BLOCKS**2 / (_BLOCKS**2 - PARAMETERS))
    return covariance
