"""The lens and the sensor that a video was taken with."""

import math
from dataclasses import dataclass
from typing import ClassVar

from tagsway.errors import InputError
from tagsway.model.estimate import FORBID_UNKNOWN


@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """A calibrated camera, schema "tagsway/camera/1".

    Parameters
    ----------
    width, height : int
        Of the images that were used to calibrate it, in pixels.
    fx, fy : float
        Focal lengths in pixels.
    cx, cy : float
        Principal point in pixels; (0, 0) is the centre of the first pixel.
    distortion : tuple of float
        k1, k2, p1, p2, k3 of the Brown-Conrady model, in OpenCV's order.
    readout_s : float
        From the first row's exposure to the last one's; 0 for a global shutter.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    readout_s: float = 0.0

    def __post_init__(self) -> None:
        for name in ("width", "height", "fx", "fy"):
            value = getattr(self, name)
            if not (value > 0 and math.isfinite(value)):
                raise InputError(f"a camera's {name} is {value:g}: expected a positive number of pixels")
        if not (0 <= self.cx < self.width and 0 <= self.cy < self.height):
            raise InputError(f"a camera's principal point is ({self.cx:g}, {self.cy:g}): expected it in the image")
        if len(self.distortion) != 5 or not all(math.isfinite(value) for value in self.distortion):
            raise InputError(f"a camera's distortion is {self.distortion}: expected five numbers, k1, k2, p1, p2, k3")
        if not (self.readout_s >= 0 and math.isfinite(self.readout_s)):
            raise InputError(f"a camera's readout_s is {self.readout_s:g}: expected a time in s, 0 or more")
