"""The small mathematics of a pose: its derivative at the tag's centre, its pixels, a step back."""

import math
from collections.abc import Sequence

import cv2
import numpy as np

from tagsway.model import FloatArray

Jacobian = tuple[tuple[float, float], tuple[float, float]]
"""∂(pixel)/∂(tag's frame) at the tag's centre, row by row."""

Region = tuple[int, int, int, int]
"""Left, top, width and height of a part of the image."""

_SMALLEST_REGION_PX = 10


def local_jacobian(homography: FloatArray) -> Jacobian:
    """Return ∂(pixel)/∂(tag's frame) at the tag's centre, row by row."""
    (a, b, x), (c, d, y), (g, h, w) = homography.tolist()
    x, y = x / w, y / w
    return ((a - x * g) / w, (b - x * h) / w), ((c - y * g) / w, (d - y * h) / w)


def find_region(shape: tuple[int, ...], homography: FloatArray, half_width: float) -> Region | None:
    """Return the pixels that a square of the tag's frame covers; None where they are too few."""
    (a, b, x), (c, d, y), (g, h, w) = homography.tolist()
    across, down = [], []
    for u, v in (
        (-half_width, -half_width),
        (half_width, -half_width),
        (half_width, half_width),
        (-half_width, half_width),
    ):
        depth = g * u + h * v + w
        across.append((a * u + b * v + x) / depth)
        down.append((c * u + d * v + y) / depth)
    left, top = max(math.floor(min(across)), 0), max(math.floor(min(down)), 0)
    width = min(math.ceil(max(across)), shape[1] - 1) - left + 1
    height = min(math.ceil(max(down)), shape[0] - 1) - top + 1
    return (left, top, width, height) if min(width, height) >= _SMALLEST_REGION_PX else None


def turn_of_step(local: Jacobian) -> FloatArray:
    """Return the angle as a linear function of the solution's (xx, xy, yx, yy)."""
    (dx, _), (dy, _) = local
    return np.array([-dx * dy, -dy * dy, dx * dx, dx * dy]) / (dx * dx + dy * dy)


def move_back(homography: FloatArray, step: Sequence[float], scale: float) -> FloatArray:
    """Return V⁻¹ H to third order in the step, V given about the tag's centre in units of the scale."""
    x, y = float(homography[0, 2]), float(homography[1, 2])
    dx, dy, xx, xy, yx, yy, px, py = step
    p, q = px / scale, py / scale
    t = -p * x - q * y
    right, down = scale * dx - xx * x - xy * y + x * t, scale * dy - yx * x - yy * y + y * t
    move = np.array([[xx + x * p, xy + x * q, right], [yx + y * p, yy + y * q, down], [p, q, t]])
    back = move @ homography
    moved = homography - back + move @ back
    return np.asarray(moved / moved[2, 2], dtype=np.float64)


def invert(matrix: FloatArray) -> FloatArray:
    """Return the inverse of a small matrix, five times as fast as numpy's."""
    return np.asarray(cv2.invert(matrix)[1], dtype=np.float64)
