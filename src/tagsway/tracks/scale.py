"""Millimetres to a pixel, from the known side of a tag."""

import math

import numpy as np

from tagsway.model import Estimate, FloatArray, TagSightings

MEDIAN_ERROR = 1.2533141373155001
"""Standard error of a median of normal values, over that of their mean: √(π/2)."""


def side_lengths(tag: TagSightings) -> FloatArray:
    """Return the tag's apparent sides along its own x and along its own y, in pixels, shape (n, 2)."""
    corners = tag.corners_px
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    return np.stack([(sides[:, 0] + sides[:, 2]) / 2, (sides[:, 1] + sides[:, 3]) / 2], axis=1)


def measure_scale(tag: TagSightings, size_m: float, *, enlargement: FloatArray | float = 1.0) -> Estimate:
    """Return the scale of the plane in which a tag moves at the principal point, in mm per pixel.

    Parameters
    ----------
    tag : TagSightings
        Seen at least once.
    size_m : float
        Side of its black square, in metres.
    enlargement : ndarray, shape (n,), or float
        How much larger the tag looks in each frame than it would at the principal point, where the plane is tilted.

    Returns
    -------
    Estimate
        With the statistical error of the median over the frames. That the print is not exactly as large as stated is
        a systematic error of its own, the same in every frame: 1 % of print is 1 % of every length, and no residual
        shows it.

    Notes
    -----
    Each direction's median over the frames, then the larger of the two: a rotation out of the plane shortens the
    sides across its axis by its cosine and leaves those along it. Each tag has its own scale, since tags at different
    depths have different ones.
    """
    sides = side_lengths(tag) / np.reshape(enlargement, (-1, 1))
    sides = sides[np.isfinite(sides).all(axis=1)]
    typical = np.median(sides, axis=0)
    longer = int(np.argmax(typical))
    deviation = 1.4826 * float(np.median(np.abs(sides[:, longer] - typical[longer])))
    error = MEDIAN_ERROR * deviation / math.sqrt(len(sides))
    scale = 1000 * size_m / float(typical[longer])
    return Estimate.normal(scale, scale * error / float(typical[longer]), low=0.0)
