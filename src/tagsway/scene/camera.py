"""Where a point of the scene falls in the picture, and back."""

import math
from dataclasses import dataclass

import numpy as np

from tagsway.model import FloatArray
from tagsway.scene.optics import SceneCamera

UNDISTORT_STEPS = 8
"""Newton steps: four are enough to the last bit for any distortion that a scene accepts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """A camera in its place.

    Parameters
    ----------
    centre_m : ndarray, shape (3,)
        Where it stands: x right, y away from it, z up.
    axes : ndarray, shape (3, 3)
        Rows: the picture's right, its down, and the camera's forward, in those coordinates.
    focal_px, radial_k1 : float
        As in `SceneCamera`.
    principal_px : ndarray, shape (2,)
        The middle of the picture; (0, 0) is the centre of the first pixel.
    """

    centre_m: FloatArray
    axes: FloatArray
    focal_px: float
    radial_k1: float
    principal_px: FloatArray

    def project(self, point_m: FloatArray) -> FloatArray:
        """Return pixels, shape (..., 2), of points, shape (..., 3)."""
        seen = (point_m - self.centre_m) @ self.axes.T
        plane = seen[..., :2] / seen[..., 2:]
        stretched = plane * (1 + self.radial_k1 * np.sum(plane**2, axis=-1, keepdims=True))
        pixel: FloatArray = self.principal_px + self.focal_px * stretched
        return pixel

    def cast(self, pixel: FloatArray) -> FloatArray:
        """Return where the rays of pixels, shape (..., 2), cross the plane at distance 1, in camera coordinates."""
        seen = (pixel - self.principal_px) / self.focal_px
        if self.radial_k1 == 0:
            return np.asarray(seen, dtype=float)
        radius = np.sqrt(np.sum(seen**2, axis=-1, keepdims=True))
        true = radius.copy()
        for _ in range(UNDISTORT_STEPS):
            true -= (true * (1 + self.radial_k1 * true**2) - radius) / (1 + 3 * self.radial_k1 * true**2)
        return np.asarray(seen * np.divide(true, radius, out=np.ones_like(radius), where=radius > 0), dtype=float)

    def scale_m_per_px(self, point_m: FloatArray) -> float:
        """Return metres of the plane y = const to a pixel at a point, shape (3,): the root of the area's ratio."""
        step = 1e-5
        right, up = np.array([step, 0.0, 0.0]), np.array([0.0, 0.0, step])
        across = self.project(point_m + right) - self.project(point_m - right)
        along = self.project(point_m + up) - self.project(point_m - up)
        return 2 * step / math.sqrt(abs(float(across[0] * along[1] - across[1] * along[0])))


def place_camera(camera: SceneCamera, target_m: tuple[float, float]) -> View:
    """Return the camera in its place before a target (x, z) of the plane y = 0."""
    yaw, pitch, roll = (math.radians(v) for v in (camera.yaw_deg, camera.pitch_deg, camera.roll_deg))
    right = np.array([math.cos(yaw), -math.sin(yaw), 0.0])
    ahead = np.array([math.sin(yaw) * math.cos(pitch), math.cos(yaw) * math.cos(pitch), math.sin(pitch)])
    down = np.cross(ahead, right)
    axes = np.stack(
        [math.cos(roll) * right + math.sin(roll) * down, math.cos(roll) * down - math.sin(roll) * right, ahead]
    )
    target = np.array([target_m[0], 0.0, target_m[1]])
    return View(
        centre_m=target - camera.distance_m * ahead,
        axes=axes,
        focal_px=camera.focal_px,
        radial_k1=camera.radial_k1,
        principal_px=np.array([(camera.width - 1) / 2, (camera.height - 1) / 2]),
    )
