"""The small mathematics of a pose: its derivative at the tag's centre, its pixels, its size."""

import math

import cv2
import numpy as np

from tagsway.model import FloatArray, GreyArray

Jacobian = tuple[tuple[float, float], tuple[float, float]]
"""∂(pixel)/∂(tag's frame) at the tag's centre, row by row."""

CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def local_jacobian(homography: FloatArray) -> Jacobian:
    """Return ∂(pixel)/∂(tag's frame) at the tag's centre, row by row."""
    (a, b, x), (c, d, y), (g, h, w) = homography.tolist()
    x, y = x / w, y / w
    return ((a - x * g) / w, (b - x * h) / w), ((c - y * g) / w, (d - y * h) / w)


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
