"""The small mathematics of a pose: its derivative at the tag's centre, its pixels, a step back."""

import math
from collections.abc import Sequence

import cv2
import numpy as np

from tagsway.model import FloatArray, GreyArray

Jacobian = tuple[tuple[float, float], tuple[float, float]]
"""∂(pixel)/∂(tag's frame) at the tag's centre, row by row."""

Region = tuple[int, int, int, int]
"""Left, top, width and height of a part of the image."""

_SMALLEST_REGION_PX = 10

CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


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


def project(homography: FloatArray, points: FloatArray) -> FloatArray:
    """Return where a homography takes points.

    Parameters
    ----------
    homography : ndarray, shape (3, 3)
        From the tag's frame to pixels.
    points : ndarray, shape (n, 2)
        In the tag's frame.

    Returns
    -------
    ndarray, shape (n, 2)
        Pixels.
    """
    image = points @ homography[:, :2].T + homography[:, 2]
    pixels: FloatArray = image[:, :2] / image[:, 2:]
    return pixels


def find_homography(corners_px: FloatArray) -> FloatArray:
    """Return the homography that takes the tag's frame to four corners.

    Parameters
    ----------
    corners_px : ndarray, shape (4, 2)
        Corners of the border square, in the order of `model.tags`.

    Returns
    -------
    ndarray, shape (3, 3)
        Its last element is 1.
    """
    found = cv2.getPerspectiveTransform(CORNERS.astype(np.float32), corners_px.astype(np.float32))
    return np.asarray(found, dtype=float)


def measure_scale(homography: FloatArray) -> float:
    """Return the pixels to a unit of the tag's frame, half a side; NaN where the tag is seen from behind.

    Parameters
    ----------
    homography : ndarray, shape (3, 3)
        From the tag's frame to pixels.

    Returns
    -------
    float
        Root of the area that a unit square at the centre takes.
    """
    (a, b), (c, d) = local_jacobian(homography)
    area = b * c - a * d  # y is up in the tag's frame and down in the image
    return math.sqrt(area) if area > 0 else math.nan


def lies_in(grey: GreyArray, homography: FloatArray) -> bool:
    """Tell whether the image holds all of the tag's square."""
    height, width = grey.shape
    (a, b, x), (c, d, y), (g, h, w) = homography.tolist()
    for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
        depth = g * u + h * v + w
        if not depth * w > 0:
            return False
        right, down = (a * u + b * v + x) / depth, (c * u + d * v + y) / depth
        if not (-0.5 <= right <= width - 0.5 and -0.5 <= down <= height - 0.5):
            return False
    return True
