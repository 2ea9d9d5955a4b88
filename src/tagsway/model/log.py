"""What a robot's controller wrote down of a move, and how that lies against the video."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from tagsway.model.arrays import FloatArray
from tagsway.model.estimate import FORBID_UNKNOWN, Estimate, Notice


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerLog:
    """The controller's own record, at its own times.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        By its clock, strictly increasing.
    values : ndarray, shape (n, 3)
        The tool's x, y and z in the robot's frame in m, z up, or the three joints in rad (m where they slide). NaN
        where nothing was written.
    holds : {"tool", "joints"}
        Which of the two.
    """

    time_s: FloatArray
    values: FloatArray
    holds: Literal["tool", "joints"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LogAgreement:
    """How a controller's log and the tool's tag agree.

    Parameters
    ----------
    offset_s, rate : Estimate
        The log's time is offset + rate · the video's.
    scale : Estimate
        The tag's path over the log's: what the tag's size is off by.
    roll_rad : Estimate
        The camera's, counter-clockwise as the track turns against the robot's plane.
    rms_m : float
        Of the tag against the log, at a scale of 1: as the thesis compares them in Fig. 4.9.
    rms_scaled_m : float
        The same with that scale: what is left is the tag's noise, and what the motors do not see.
    samples : int
        Compared.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    offset_s: Estimate
    rate: Estimate
    scale: Estimate
    roll_rad: Estimate
    rms_m: float
    rms_scaled_m: float
    samples: int


@dataclass(frozen=True, slots=True, kw_only=True)
class AlignedLog:
    """A controller's log at the video's times, in the track's axes.

    Parameters
    ----------
    position : ndarray, shape (n, 2)
        x and z of the tool in m, in the log's own scale, about where the tag was; NaN outside the log.
    agreement : LogAgreement
        How well it fits the tag.
    notices : tuple of Notice
        What is odd about it.
    """

    position: FloatArray
    agreement: LogAgreement
    notices: tuple[Notice, ...]

    @property
    def offset_s(self) -> Estimate:
        """The log's time at the video's zero."""
        return self.agreement.offset_s

    @property
    def rate(self) -> Estimate:
        """Seconds of the log to one of the video."""
        return self.agreement.rate

    @property
    def rms_mm(self) -> float:
        """Of the tag against the log, in mm."""
        return 1e3 * self.agreement.rms_m
