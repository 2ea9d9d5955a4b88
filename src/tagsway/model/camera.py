"""The lens and the sensor that a video was taken with, and how they look at the motion."""

import math
from dataclasses import dataclass
from typing import ClassVar

from tagsway.errors import InputError
from tagsway.model.estimate import FORBID_UNKNOWN, Estimate


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


@dataclass(frozen=True, slots=True, kw_only=True)
class SeenTag:
    """Where a tag moves in a `PlaneView`.

    Parameters
    ----------
    tag_id : int
        Its number.
    depth : float
        How far behind the view's plane, in its unit of length.
    scale : Estimate
        Units of length to a pixel of a picture that looks squarely at the plane; the error is that of any length in
        the tag's plane, the foreshortening's included.
    """

    tag_id: int
    depth: float
    scale: Estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaneView:
    """How a camera looks at the plane of a motion.

    The plane's own axes are right, down and away; the optical axis meets it at its origin. It is turned against the
    image first about its own x axis (pitch), then about the image's y axis (yaw).

    Parameters
    ----------
    camera : Camera
        The lens, as it is known or as it was found; fx = fy.
    focal_px, radial_k1, pitch_rad, yaw_rad : Estimate
        What was found; an error of 0 marks what was known.
    distance : float
        Along the optical axis, in metres; in pixels (of its own scale) where no tag's size is known.
    tags : tuple of SeenTag
        The tags it was found from.
    """

    camera: Camera
    focal_px: Estimate
    radial_k1: Estimate
    pitch_rad: Estimate
    yaw_rad: Estimate
    distance: float
    tags: tuple[SeenTag, ...]

    def depth(self, tag_id: int) -> float:
        """Return how far behind the plane a tag moves; in it, where that is not known."""
        return next((tag.depth for tag in self.tags if tag.tag_id == tag_id), 0.0)

    def scale(self, tag_id: int) -> Estimate:
        """Return the units of length to a pixel in a tag's plane; the first tag's, where that is not known."""
        return next((tag.scale for tag in self.tags if tag.tag_id == tag_id), self.tags[0].scale)
