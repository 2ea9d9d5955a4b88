"""All that one measurement told: what result.json holds."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from tagsway.model.estimate import FORBID_UNKNOWN, Estimate, Notice
from tagsway.model.events import Event
from tagsway.model.excitation import Excitation
from tagsway.model.indicators import Indicators
from tagsway.model.log import LogAgreement
from tagsway.model.modal import EstimatorResult, ModalEstimate, Window
from tagsway.model.pendulum import PendulumEstimate
from tagsway.model.settings import Settings
from tagsway.model.shaper import Shaper
from tagsway.model.video import VideoInfo


@dataclass(frozen=True, slots=True, kw_only=True)
class Creator:
    """The program that wrote a file."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    name: str
    version: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """What was measured, and with which settings."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    file: str
    sha256: str
    settings: Settings


@dataclass(frozen=True, slots=True, kw_only=True)
class CoordinateFrame:
    """Where the track's zero lies and which way its axes point."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    origin: str
    axes: str
    up_source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TagSummary:
    """How well one tag was seen; `detected` is the share of frames, 0..1."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    id: int | None
    detected: float
    mm_per_px: Estimate | None


@dataclass(frozen=True, slots=True, kw_only=True)
class TagsSummary:
    """The three tags; None for one that was not asked for, or not seen."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    tcp: TagSummary | None
    pcp: TagSummary | None
    reference: TagSummary | None


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimatorDetails:
    """How the estimators that were asked for were made, and two more that are only shown for comparison.

    Parameters
    ----------
    spectrum_window : str
        Of the transform.
    spectrum_resolution_hz : float
        Two frequencies closer than this are one peak, however far it is padded.
    spectrum_bin_hz : float
        Distance of two points of the padded transform.
    half_power : EstimatorResult
        From the width of the peak at 1/√2; the record's own length widens it, so ζ is an upper bound.
    decrement_cycles : int
        n of the next; 0 where there are too few peaks.
    decrement_over_cycles : EstimatorResult
        From the first swing and the one n cycles later alone, δ = ln(s_0 / s_n) / n.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    spectrum_window: str
    spectrum_resolution_hz: float
    spectrum_bin_hz: float
    half_power: EstimatorResult
    decrement_cycles: int
    decrement_over_cycles: EstimatorResult


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """All that one measurement told; None for what it did not, and a warning that says why."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    status: Literal["ok", "degraded", "not_determined"]
    created_by: Creator
    source: Source
    video: VideoInfo | None
    frame: CoordinateFrame
    tags: TagsSummary
    window_s: tuple[float, float] | None
    modal: ModalEstimate | None
    pendulum: PendulumEstimate | None
    indicators: Indicators | None
    shaper: Shaper | None
    warnings: tuple[Notice, ...]
    estimator_details: EstimatorDetails | None = None
    excitation: Excitation | None = None
    events: tuple[Event, ...] = ()
    controller_log: LogAgreement | None = None

    @property
    def window(self) -> Window | None:
        """The free vibration that was used."""
        return None if self.window_s is None else Window(start_s=self.window_s[0], end_s=self.window_s[1])
