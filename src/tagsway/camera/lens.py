"""A known lens: pixels as an ideal camera would show them."""

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np

from tagsway.errors import InputError
from tagsway.model import Camera, FloatArray, Sightings, TagSightings

REFINEMENTS = 30
"""Rounds of a fixed-point iteration, each of which shrinks the error by the lens' own relative distortion."""

STEP_PX = 0.5
"""Half the distance over which a map's derivative is taken."""


def undistort(points_px: FloatArray, camera: Camera) -> FloatArray:
    """Return where points would be seen by a camera without distortion and with square pixels of side 1/fx.

    Parameters
    ----------
    points_px : ndarray, shape (..., 2)
        As seen; NaN stays NaN.
    camera : Camera
        The lens.

    Returns
    -------
    ndarray, shape (..., 2)
        cx + fx X/Z, cy + fx Y/Z of the same rays.
    """
    seen = np.isfinite(points_px).all(axis=-1)
    result = np.full(points_px.shape, np.nan)
    if seen.any():
        matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])
        lens, focal = np.array(camera.distortion), np.array([camera.fx, camera.fy])
        pixels = np.ascontiguousarray(points_px[seen], dtype=float)
        rays = cv2.undistortPoints(pixels[:, None], matrix, lens)[:, 0]
        still = np.zeros(3)
        # OpenCV stops after five rounds; more of them take a strong lens to the last digits.
        for _ in range(REFINEMENTS):
            points = np.column_stack([rays, np.ones(len(rays))])
            shown, _ = cv2.projectPoints(points, still, still, matrix, lens)
            rays = rays + (pixels - shown[:, 0]) / focal
        result[seen] = rays * camera.fx + np.array([camera.cx, camera.cy])
    return result


def undistort_sightings(sightings: Sightings, camera: Camera) -> Sightings:
    """Return sightings as an ideal camera would have made them: centres, corners, covariances and angles.

    Raises
    ------
    InputError
        Where the camera was calibrated at another image size than the video's.
    """
    size = (sightings.video.width, sightings.video.height)
    if size != (camera.width, camera.height):
        raise InputError(
            f"the camera was calibrated at {camera.width}×{camera.height}, the video is {size[0]}×{size[1]}: "
            "calibrate it at the video's size"
        )
    tags = tuple(carry_tag(tag, lambda points: undistort(points, camera)) for tag in sightings.tags)
    if not any(np.isfinite(tag.centre_px).any() for tag in tags):
        raise InputError(f"the camera's distortion {camera.distortion} leaves no tag in the image; calibrate it again")
    return replace(sightings, tags=tags)


def carry_tag(tag: TagSightings, carry: Callable[[FloatArray], FloatArray]) -> TagSightings:
    """Return one tag's sightings in other pixels; small vectors at its centre turn with the map's derivative."""
    columns = [carry(tag.centre_px + STEP_PX * unit) - carry(tag.centre_px - STEP_PX * unit) for unit in np.eye(2)]
    derivative = np.stack(columns, axis=-1) / (2 * STEP_PX)
    along = np.stack([np.cos(tag.angle_rad), -np.sin(tag.angle_rad)], axis=-1)
    turned = np.einsum("nij,nj->ni", derivative, along)
    (xx, xy), (yx, yy) = np.moveaxis(derivative, 0, -1)  # numpy's determinant warns of NaN
    area = xx * yy - xy * yx
    return replace(
        tag,
        centre_px=carry(tag.centre_px),
        covariance_px2=derivative @ tag.covariance_px2 @ np.swapaxes(derivative, -1, -2),
        corners_px=carry(tag.corners_px),
        angle_rad=np.arctan2(-turned[:, 1], turned[:, 0]),
        angle_std_rad=tag.angle_std_rad * area / np.sum(turned**2, axis=1),
    )
