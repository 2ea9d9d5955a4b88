"""What a measurement that is still to be made can tell."""

from dataclasses import dataclass
from typing import ClassVar

from tagsway.errors import InputError
from tagsway.model.estimate import FORBID_UNKNOWN, Notice


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedMeasurement:
    """A free decay that is to be filmed.

    Parameters
    ----------
    frequency_hz, damping_ratio : float
        Expected.
    amplitude_m : float
        At its beginning.
    noise_m : float
        Of the product's path against the tool's, one axis, one frame.
    fps_hz : float
        Of the camera.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    frequency_hz: float
    damping_ratio: float
    amplitude_m: float
    noise_m: float
    fps_hz: float

    def __post_init__(self) -> None:
        for name, value, unit in (
            ("--frequency", self.frequency_hz, "Hz"),
            ("--amplitude", 1e3 * self.amplitude_m, "mm"),
            ("--noise", 1e3 * self.noise_m, "mm"),
            ("--fps", self.fps_hz, "Hz"),
        ):
            if not 0 < value < 1e9:
                raise InputError(f"{name} is {value:g} {unit}: expected a positive number")
        if not 0 <= self.damping_ratio < 0.5:
            raise InputError(f"--damping is {self.damping_ratio:g}: expected a ratio from 0 to 0.5, such as 0.005")
        if not self.fps_hz >= 4 * self.frequency_hz:
            raise InputError(
                f"{self.fps_hz:g} frames a second show {self.fps_hz / self.frequency_hz:.2g} of each period at "
                f"{self.frequency_hz:g} Hz: expected 4 or more; film faster"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedError:
    """What a decay of one length can tell; 1σ, in percent of the value."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    duration_s: float
    cycles: float
    frequency_error_percent: float
    damping_error_percent: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Need:
    """What a wanted error takes.

    Parameters
    ----------
    quantity : str
        "natural frequency" or "damping ratio".
    wanted_error_percent : float
        1σ.
    duration_s : float or None
        Of one record; None where no length of record is enough.
    repeats : int
        Records of the stated length (else of the longest that still tells more) whose mean is as good.
    repeat_duration_s : float
        Their length.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    quantity: str
    wanted_error_percent: float
    duration_s: float | None
    repeats: int
    repeat_duration_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraHints:
    """What the picture should be like.

    Parameters
    ----------
    scale_mm_per_px : float
        In the tags' plane.
    peak_speed_m_s : float
        Of the sway.
    longest_exposure_s : float
        For a pixel of blur.
    tag_side_px : float or None
        Of the printed tag, where its size is known.
    expected_noise_mm : dict
        Of product against tool, by the kind of video: "raw", "mjpeg", "h264_crf10", "h264_crf18".
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    scale_mm_per_px: float
    peak_speed_m_s: float
    longest_exposure_s: float
    tag_side_px: float | None
    expected_noise_mm: dict[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Errors over the length of the record, what the wanted ones take, and hints for the camera."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    measurement: PlannedMeasurement
    table: tuple[PlannedError, ...]
    needs: tuple[Need, ...]
    camera: CameraHints | None
    notices: tuple[Notice, ...]
