"""The last step of an alignment, on the image's own pixels, and what it is worth."""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from tagsway.model import FloatArray
from tagsway.tags.template import PARAMETERS, Float32Array, Template

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
    sandwich : ndarray, shape (3, 3)
        The same from the residual's sums over blocks: whatever the noise's correlation, but uncertain itself.
    variance : float
        Of the residual, in grey levels squared.
    correlation : float
        Of pattern and image.
    """

    homography: FloatArray
    plain: FloatArray
    sandwich: FloatArray
    variance: float
    correlation: float


def refine(
    grey: Float32Array, homography: FloatArray, template: Template, *, motion_px: tuple[float, float] = (0.0, 0.0)
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
    region = _region(grey.shape, homography, template.half_width)
    if region is None:
        return None
    left, top, width, height = region
    scale = template.scale_px
    centre = homography[:2, 2] / homography[2, 2]
    local = local_jacobian(homography)
    x = ((np.arange(left, left + width) - centre[0]) / scale).astype(np.float32)
    y = ((np.arange(top, top + height) - centre[1]) / scale).astype(np.float32)[:, None]
    design = _linearise(
        homography, template, region, scale * np.asarray(np.linalg.inv(local), dtype=np.float64), x, y, motion_px
    )
    flat = design.reshape(PARAMETERS, -1)
    seen = (grey[top : top + height, left : left + width] * design[9]).reshape(-1)
    normal = (flat @ flat.T).astype(float)
    inverse = np.linalg.inv(normal)
    sums = (flat @ seen).astype(float)
    solution = inverse @ sums
    gain, count = solution[8], normal[9, 9]
    squares = float(seen @ seen)
    spread = (squares - sums[9] ** 2 / count) * (normal[8, 8] - normal[8, 9] ** 2 / count)
    if not (gain > 0 and spread > 0 and np.abs(solution[:8]).max() < _LONGEST_STEP * gain):
        return None
    variance = max((squares - float(solution @ sums)) / (count - PARAMETERS), _ROUNDING)
    influence = _functionals(local[:, 0], scale) @ inverse / gain
    residual = seen - solution.astype(np.float32) @ flat
    parts = ((influence.astype(np.float32) @ flat) * residual).reshape(3, height, width)
    return Refinement(
        homography=_move_back(homography, solution[:8] / gain, centre, scale),
        plain=variance * influence @ normal @ influence.T,
        sandwich=_sum_blocks(parts),
        variance=variance,
        correlation=float((sums[8] - sums[9] * normal[8, 9] / count) / math.sqrt(spread)),
    )


def local_jacobian(homography: FloatArray) -> FloatArray:
    """Return ∂(pixel)/∂(tag's frame) at the tag's centre, shape (2, 2)."""
    h = homography
    jacobian: FloatArray = (h[:2, :2] - np.outer(h[:2, 2] / h[2, 2], h[2, :2])) / h[2, 2]
    return jacobian


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
    to_tag: FloatArray,
    x: Float32Array,
    y: Float32Array,
    motion_px: tuple[float, float],
) -> Float32Array:
    """Return the derivatives of the grey values by p (8), gain and offset, shape (10, height, width)."""
    *_, width, height = region
    view = template.texture_grid @ np.linalg.inv(homography)
    seen = _expose(template.texture, view, region, motion_px)
    design = np.empty((PARAMETERS, height, width), np.float32)
    used = design[9]
    np.greater(seen[..., 3], 0.999, out=used, casting="unsafe")
    np.multiply(seen[..., 0], used, out=design[8])
    rates = np.tensordot(to_tag.T.astype(np.float32), seen[..., 1:3], axes=(1, 2)) * used
    by_x, by_y = design[2], design[5]
    by_x[:], by_y[:] = rates
    np.multiply(by_x, x, out=design[0])
    np.multiply(by_x, y, out=design[1])
    np.multiply(by_y, x, out=design[3])
    np.multiply(by_y, y, out=design[4])
    inward = design[0] + design[4]
    np.multiply(inward, -x, out=design[6])
    np.multiply(inward, -y, out=design[7])
    return design


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
    rows[0, 2] = rows[1, 5] = scale
    dx, dy = along / math.hypot(*along)
    rows[2, [0, 1, 3, 4]] = [-dx * dy, -dy * dy, dx * dx, dx * dy]
    return rows


def _move_back(homography: FloatArray, p: FloatArray, centre: FloatArray, scale: float) -> FloatArray:
    """Return V⁻¹ H, V given about the centre in units of the scale."""
    to_unit = np.array([[1 / scale, 0, -centre[0] / scale], [0, 1 / scale, -centre[1] / scale], [0, 0, 1.0]])
    step = np.array([[1 + p[0], p[1], p[2]], [p[3], 1 + p[4], p[5]], [p[6], p[7], 1.0]])
    moved = np.linalg.solve(to_unit, np.linalg.solve(step, to_unit @ homography))
    moved /= moved[2, 2]
    return np.asarray(moved, dtype=np.float64)


def _sum_blocks(parts: Float32Array) -> FloatArray:
    """Return the covariance of three sums from their parts over blocks of the image."""
    _, height, width = parts.shape
    rows, columns = (np.arange(_BLOCKS) * size // _BLOCKS for size in (height, width))
    blocks = np.add.reduceat(np.add.reduceat(parts, rows, axis=1), columns, axis=2).reshape(3, -1).astype(float)
    covariance: FloatArray = blocks @ blocks.T * (_BLOCKS**2 / (_BLOCKS**2 - PARAMETERS))
    return covariance
