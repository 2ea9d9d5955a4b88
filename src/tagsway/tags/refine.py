"""The last step of an alignment, on the image's own pixels, and what it is worth."""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from tagsway.model import FloatArray
from tagsway.tags.template import PARAMETERS, Float32Array, Template

_GAIN, _OFFSET, _STEP = 2, 3, [0, 1, 4, 5, 6, 7, 8, 9]  # places in the solution

_ROUNDING = 1 / 12  # variance of the rounding to grey levels: no image is better
_BLOCKS = 10  # to a side
_MOTION_STEP_PX = 0.9  # a blur of half a pixel hides steps of this length
_MOST_MOTION_STEPS = 16
_LONGEST_STEP = 0.1  # of the tag's half side; a longer one was no refinement


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
    correlation : float
        Of pattern and image.
    step_px : float
        How far the centre was moved.
    """

    homography: FloatArray
    plain: FloatArray
    sandwich: FloatArray | None
    variance: float
    correlation: float
    step_px: float


def refine(
    grey: Float32Array,
    homography: FloatArray,
    template: Template,
    *,
    motion_px: tuple[float, float] = (0.0, 0.0),
    with_blocks: bool = False,
) -> Refinement | None:
    """Return the pose after one Gauss-Newton step in the image's frame.

    Parameters
    ----------
    grey : ndarray of float32, shape (height, width)
        The image around the tag.
    homography : ndarray, shape (3, 3)
        Takes the tag's frame to it; right to about 0.1 px.
    template : Template
        Of this size and sharpness.
    motion_px : tuple of float
        How far the tag moves, right and down, while the image is exposed.
    with_blocks : bool
        Also the sandwich, for a fifth more time.

    Returns
    -------
    Refinement or None
        None where the step is none, or the tag leaves the image.

    Notes
    -----
    Grey I, pattern T: I(x) = a T(H⁻¹ V(x)) + b with V = id + δ(p) a homography of the image, so that each pixel is
    compared with the pattern at its own place; linear in (a p, a, b). The pixels' noise is independent, hence the
    covariance of p is σ² (JᵀJ)⁻¹ / a². Not for a first alignment: one step reaches only as far as a blur.
    """
    still = motion_px == (0.0, 0.0)
    region = _region(grey.shape, homography, template.half_width if still else template.texture_half_width)
    if region is None:
        return None
    left, top, width, height = region
    scale = template.scale_px
    h = homography / homography[2, 2]
    local = local_jacobian(h)
    flat = _linearise(h, template, region, local, motion_px)
    seen = grey[top : top + height, left : left + width].reshape(-1) * flat[_OFFSET]
    normal = (flat @ flat.T).astype(float)
    inverse = _invert(normal)
    sums = (flat @ seen).astype(float)
    solution = inverse @ sums
    gain, count = solution[_GAIN], normal[_OFFSET, _OFFSET]
    squares = float(seen @ seen)
    mean = normal[_GAIN, _OFFSET] / count
    spread = (squares - sums[_OFFSET] ** 2 / count) * (normal[_GAIN, _GAIN] - mean**2 * count)
    if not (gain > 0 and spread > 0 and np.abs(solution[_STEP]).max() < _LONGEST_STEP * gain):
        return None
    variance = max((squares - float(solution @ sums)) / (count - PARAMETERS), _ROUNDING)
    influence = _functionals(local[:, 0], scale) @ inverse / gain
    sandwich = None
    if with_blocks:
        parts = influence.astype(np.float32) @ flat
        parts *= seen - solution.astype(np.float32) @ flat
        sandwich = _sum_blocks(parts.reshape(3, height, width))
    return Refinement(
        homography=_move_back(h, solution[_STEP] / gain, scale),
        plain=variance * influence @ normal @ influence.T,
        sandwich=sandwich,
        variance=variance,
        step_px=scale * math.hypot(solution[0], solution[1]) / gain,
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
    corners = homography @ square
    across, down = corners[0] / corners[2], corners[1] / corners[2]
    left, top = max(math.floor(across.min()), 0), max(math.floor(down.min()), 0)
    width = min(math.ceil(across.max()), shape[1] - 1) - left + 1
    height = min(math.ceil(down.max()), shape[0] - 1) - top + 1
    return (left, top, width, height) if min(width, height) >= _BLOCKS else None


def _linearise(
    homography: FloatArray,
    template: Template,
    region: tuple[int, int, int, int],
    local: FloatArray,
    motion_px: tuple[float, float],
) -> Float32Array:
    """Return the derivatives of the grey values by the solution, shape (10, height × width), times their weight."""
    left, top, width, height = region
    scale = template.scale_px
    seen = _expose(template.texture, template.texture_grid @ _invert(homography), region, motion_px)
    first = np.eye(4, dtype=np.float32)  # of derivatives, pattern and weight: the derivatives turn into the image
    first[:2, :2] = (scale * _invert(local)).T
    flat = np.empty((PARAMETERS, height * width), np.float32)
    np.matmul(first, seen.reshape(-1, 4).T, out=flat[:4])
    if motion_px != (0.0, 0.0):
        flat[:4] *= flat[_OFFSET] > 0.999  # what the edge of the known part swept over is not known
    x = ((np.arange(left, left + width) - homography[0, 2]) / scale).astype(np.float32)
    y = ((np.arange(top, top + height) - homography[1, 2]) / scale).astype(np.float32)[:, None]
    by_x, by_y, _, _, xx, xy, yx, yy, inward_x, inward_y = flat.reshape(PARAMETERS, height, width)
    for rate, place, out in ((by_x, x, xx), (by_x, y, xy), (by_y, x, yx), (by_y, y, yy)):
        np.multiply(rate, place, out=out)
    inward = xx + yy
    np.multiply(inward, -x, out=inward_x)
    np.multiply(inward, -y, out=inward_y)
    return flat


def _expose(
    texture: Float32Array, view: FloatArray, region: tuple[int, int, int, int], motion_px: tuple[float, float]
) -> Float32Array:
    """Return the texture as the image's pixels see it, averaged over the motion while they are exposed."""
    left, top, width, height = region
    steps = min(round(math.hypot(*motion_px) / _MOTION_STEP_PX) + 1, _MOST_MOTION_STEPS)
    seen: Float32Array = np.zeros((height, width, 4), np.float32)
    for k in range(steps):
        part = (k + 0.5) / steps - 0.5
        place = np.array([[1, 0, left - part * motion_px[0]], [0, 1, top - part * motion_px[1]], [0, 0, 1.0]])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        one = cv2.warpPerspective(texture, view @ place, (width, height), flags=flags)
        if steps == 1:
            return np.asarray(one, dtype=np.float32)
        seen += one
    return seen / np.float32(steps)


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


def _sum_blocks(parts: Float32Array) -> FloatArray:
    """Return the covariance of three sums from their parts over blocks of the image."""
    _, height, width = parts.shape
    rows, columns = (np.arange(_BLOCKS) * size // _BLOCKS for size in (height, width))
    blocks = np.add.reduceat(np.add.reduceat(parts, rows, axis=1), columns, axis=2).reshape(3, -1).astype(float)
    covariance: FloatArray = blocks @ blocks.T * (_BLOCKS**2 / (_BLOCKS**2 - PARAMETERS))
    return covariance
