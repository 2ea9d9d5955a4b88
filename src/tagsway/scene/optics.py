"""The part of a scene file that says how the scene is seen: camera, sensor, and the file it ends in."""

import math
from dataclasses import dataclass
from typing import ClassVar

from tagsway.errors import InputError
from tagsway.model.estimate import FORBID_UNKNOWN
from tagsway.scene.checks import Pair, check
from tagsway.video.writing import Codec


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneCamera:
    """A pinhole camera that looks at a point of the plane in which the payload swings.

    Parameters
    ----------
    width, height : int
        Of the image in px, both even.
    distance_m : float
        From the camera to the point it looks at.
    focal_px : float
        Focal length.
    target_m : tuple of float, optional
        That point (x, z); by default the middle of what moves.
    yaw_deg, pitch_deg : float
        The camera walks around the target to the left (and so looks to the right), and down (looks up).
    roll_deg : float
        The camera turned clockwise about its axis, as seen from behind it: the picture turns the other way.
    radial_k1 : float
        Radial distortion, ``x_d = x (1 + k1 ρ²)`` with ρ in units of the focal length.
    shake_px, shake_hz : float
        RMS of the picture's shift per axis, and about which frequency.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    width: int = 1280
    height: int = 720
    distance_m: float = 2.0
    focal_px: float = 3000.0
    target_m: Pair | None = None
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0
    radial_k1: float = 0.0
    shake_px: float = 0.0
    shake_hz: float = 8.0

    def __post_init__(self) -> None:
        check(self, positive=("distance_m", "focal_px", "shake_hz"), not_negative=("shake_px",))
        check(self, finite=("target_m", "roll_deg", "radial_k1"))
        for name in ("width", "height"):
            size = getattr(self, name)
            if not (16 <= size <= 8192 and size % 2 == 0):
                raise InputError(f"the camera's {name} must be an even number from 16 to 8192, not {size}")
        for name in ("yaw_deg", "pitch_deg"):
            if not abs(getattr(self, name)) <= 60:
                raise InputError(f"the camera's {name} must lie within ±60, not {getattr(self, name):g}")
        corner = math.hypot(self.width, self.height) / 2 / self.focal_px
        if not 1 + 3 * self.radial_k1 * (1.5 * corner) ** 2 > 0.1:
            raise InputError(
                f"radial_k1 = {self.radial_k1:g} folds the picture over at its corners: nearer to 0, please"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """What the sensor makes of the light, and what else is to be seen.

    Parameters
    ----------
    blur_px : float
        Standard deviation of the lens' blur; at least 0.3, which the sampling needs.
    exposure_s : float
        How long each image gathers light.
    noise_grey : float
        Standard deviation of a pixel's noise, in grey levels.
    black_grey, white_grey : float
        Grey levels of the tags' ink and paper.
    texture_grey : float
        Standard deviation of the background's texture.
    decoys : int
        How many squares that are no tags stand in the background.
    supersampling : int
        Samples a pixel and axis.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    blur_px: float = 0.6
    exposure_s: float = 0.001
    noise_grey: float = 1.0
    black_grey: float = 35.0
    white_grey: float = 215.0
    texture_grey: float = 0.0
    decoys: int = 0
    supersampling: int = 3

    def __post_init__(self) -> None:
        check(self, not_negative=("exposure_s", "noise_grey", "texture_grey"))
        if not 0.3 <= self.blur_px <= 20:
            raise InputError(f"blur_px must lie between 0.3 and 20, not {self.blur_px:g}")
        if not 0 <= self.black_grey < self.white_grey <= 255:
            raise InputError("black_grey must lie below white_grey, both in 0..255")
        if not (1 <= self.supersampling <= 16 and 0 <= self.decoys <= 1000):
            raise InputError("supersampling must lie in 1..16 and decoys in 0..1000")


@dataclass(frozen=True, slots=True, kw_only=True)
class VideoFormat:
    """How the frames are taken and stored.

    Parameters
    ----------
    fps_hz : float
        Capture rate.
    header_fps_hz : float, optional
        Rate that the file claims, as high-speed cameras do; by default the capture rate.
    time_jitter_s : float
        Standard deviation of the frames' true times about the uniform ones; the file has the true ones.
    time_rounding_s : float, optional
        The container rounds its times to this, as phones' do.
    codec : {"h264", "hevc", "mjpeg", "ffv1", "raw"}
        The last two lose nothing.
    quality : float
        Of h264 and hevc the crf (18 is fine, 28 poor), of mjpeg the quantiser (2 is fine, 31 poor).
    full_range : bool
        Luma in 0..255 rather than 16..235.
    lost : tuple of (first, last)
        Frames, by number, that never reached the file.
    lost_share : float
        Share of the others that were lost at random.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    fps_hz: float = 200.0
    header_fps_hz: float | None = None
    time_jitter_s: float = 0.0
    time_rounding_s: float | None = None
    codec: Codec = "h264"
    quality: float = 18.0
    full_range: bool = True
    lost: tuple[tuple[int, int], ...] = ()
    lost_share: float = 0.0

    def __post_init__(self) -> None:
        check(self, positive=("fps_hz", "header_fps_hz", "time_rounding_s"), not_negative=("time_jitter_s", "quality"))
        if not 0 <= self.lost_share < 1:
            raise InputError(f"lost_share must lie in [0, 1), not {self.lost_share:g}")
