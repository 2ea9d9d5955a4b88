"""Images of tags with known poses: the pattern blurred by a Gaussian, then averaged over each pixel's area.

Independent of the package's templates but for the cells themselves. The blurred pattern is smooth, so sampling it on a
fine texture with 4 × 4 points a pixel is exact to well under a thousandth of a pixel.
"""

import math
from functools import lru_cache

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter

from tagsway.tags.families import tag_family, tag_pattern

TEXELS_PER_PX = 12
POINTS = 4


def make_pose(centre: tuple[float, float], side: float, angle: float = 0.0, tilt: tuple[float, float] = (0.0, 0.0)):
    """Return the homography of a tag: centre and side in px, angle counter-clockwise, perspective terms."""
    c, s = math.cos(angle) * side / 2, math.sin(angle) * side / 2
    upright = np.array([[c, -s, 0], [-s, -c, 0], [tilt[0], tilt[1], 1]])
    return np.array([[1, 0, centre[0]], [0, 1, centre[1]], [0, 0, 1.0]]) @ upright


def see_tag(
    homography,
    shape,
    *,
    family="tag36h11",
    tag_id=0,
    blur_px=0.5,
    motion_px=(0.0, 0.0),
    dark=40.0,
    white=200.0,
    background=120.0,
    onto=None,
):
    """Return an image (float) of a tag; `motion_px` is how far it moves, about its pose, while it is exposed."""
    layout = tag_family(family)
    half = (layout.cells + 4) / layout.border_cells
    local = homography[:2, :2] - np.outer(homography[:2, 2], homography[2, :2])
    scale = round(math.sqrt(abs(np.linalg.det(local))), 1)
    cell_texels = max(1, round(TEXELS_PER_PX * scale * 2 / layout.border_cells))
    texel = 2 / layout.border_cells / cell_texels
    planes = _blur_pattern(family, tag_id, cell_texels, blur_px / scale / texel, dark, white)
    middle = (len(planes[0]) - 1) / 2
    to_texel = np.array([[1 / texel, 0, middle], [0, -1 / texel, middle], [0, 0, 1]])
    steps = [(0.0, 0.0)]
    length = math.hypot(*motion_px)
    if length:
        number = math.ceil(4 * length)
        steps = [tuple((k + 0.5) / number * m - m / 2 for m in motion_px) for k in range(number)]
    height, width = shape
    corners = np.array([[-half, -half, 1], [half, -half, 1], [half, half, 1], [-half, half, 1]]) @ homography.T
    corners = corners[:, :2] / corners[:, 2:]
    reach = math.ceil(length / 2 + 4 * blur_px + 3)
    left, top = np.maximum(np.floor(corners.min(axis=0)).astype(int) - reach, 0)
    right, bottom = np.minimum(np.ceil(corners.max(axis=0)).astype(int) + reach, [width, height])
    base = np.full(shape, background, float) if onto is None else onto.astype(float).copy()
    behind = base[top:bottom, left:right]
    fine = np.array([[1 / POINTS, 0, left - 0.5 + 0.5 / POINTS], [0, 1 / POINTS, top - 0.5 + 0.5 / POINTS], [0, 0, 1]])
    total = [0.0, 0.0]
    for dx, dy in steps:
        place = np.array([[1, 0, dx], [0, 1, dy], [0, 0, 1]]) @ homography
        view = to_texel @ np.linalg.inv(place) @ fine
        size = ((right - left) * POINTS, (bottom - top) * POINTS)
        for k, plane in enumerate(planes):
            seen = cv2.warpPerspective(
                plane, view, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, borderMode=cv2.BORDER_REPLICATE
            )
            total[k] = total[k] + seen.reshape(bottom - top, POINTS, right - left, POINTS).mean(axis=(1, 3))
    grey, cover = total[0] / len(steps), total[1] / len(steps)
    base[top:bottom, left:right] = cover * grey + (1 - cover) * behind
    return base


def photograph(image, noise, rng):
    """Return what a camera with this noise, in grey levels, makes of an image."""
    return np.clip(np.rint(image + noise * rng.standard_normal(image.shape)), 0, 255).astype(np.uint8)


def bound_centre(homography, shape, noise, **look):
    """Return the Cramér-Rao bound of the centre: rms over x and y, px.

    Unknown are the homography (8), gain and offset; seen are all pixels up to a cell around the border; noise is white
    and includes the rounding to grey levels.
    """
    local = homography[:2, :2] - np.outer(homography[:2, 2], homography[2, :2])
    step = 0.05 / math.sqrt(abs(np.linalg.det(local)))
    rows = []
    for k in range(8):
        move = np.zeros(9)
        move[k] = step
        move = move.reshape(3, 3)
        ahead, back = (see_tag(homography @ (np.eye(3) + s * move), shape, **look) for s in (1, -1))
        rows.append((ahead - back) / (2 * step))
    still = see_tag(homography, shape, **look)
    y, x = np.indices(shape)
    place = np.linalg.inv(homography) @ np.stack([x.ravel(), y.ravel(), np.ones(x.size)])
    inside = np.all(np.abs(place[:2] / place[2]) < 1.25, axis=0)
    design = np.stack([row.ravel()[inside] for row in [*rows, still, np.ones(shape)]])
    covariance = np.linalg.inv(design @ design.T) * (noise**2 + 1 / 12)
    return math.sqrt(np.trace(local @ covariance[np.ix_([2, 5], [2, 5])] @ local.T) / 2)


@lru_cache(maxsize=6)
def _blur_pattern(family, tag_id, cell_texels, sigma, dark, white):
    """Return the blurred pattern, with a white cell around it, and how much of each place it covers."""
    paper = np.pad(np.where(tag_pattern(family, tag_id), white, dark), 1, constant_values=white)
    share = np.pad(np.ones_like(paper), 1)
    paper = np.pad(paper, 1, constant_values=white)
    unit = np.ones((cell_texels, cell_texels))
    return [gaussian_filter(np.kron(p, unit), sigma, mode="nearest").astype(np.float32) for p in (paper, share)]
