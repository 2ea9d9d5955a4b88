"""The payload's first mode: how fast it sways, and how soon it stops."""

import math
from dataclasses import dataclass
from typing import ClassVar

from tagsway.errors import InputError
from tagsway.model.estimate import FORBID_UNKNOWN, Estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """The part of a record that is a free vibration."""

    start_s: float
    end_s: float

    def __post_init__(self) -> None:
        if not self.end_s > self.start_s:
            raise InputError(f"a window must end after it starts, not {self.start_s:g}:{self.end_s:g} s")


@dataclass(frozen=True, slots=True, kw_only=True)
class Mode:
    """A linear mode as a shaper sees it.

    Parameters
    ----------
    natural_frequency_hz : float
        Undamped.
    damping_ratio : float
        ζ, in [0, 1).
    """

    natural_frequency_hz: float
    damping_ratio: float

    def __post_init__(self) -> None:
        if not 1e-4 <= self.natural_frequency_hz <= 1e5:
            raise InputError(
                f"a natural frequency must be positive, from 0.0001 to 100 000 Hz, not {self.natural_frequency_hz:g} Hz"
            )
        if not 0 <= self.damping_ratio < 1:
            raise InputError(f"a damping ratio must lie in [0, 1), not {self.damping_ratio:g}")

    @property
    def angular_frequency_rad_s(self) -> float:
        """ω_n = 2π f_n."""
        return 2 * math.pi * self.natural_frequency_hz

    @property
    def damped_frequency_hz(self) -> float:
        """f_d = f_n √(1 - ζ²): what a clock sees."""
        return self.natural_frequency_hz * math.sqrt(1 - self.damping_ratio**2)

    @property
    def damped_period_s(self) -> float:
        """T_d = 1 / f_d."""
        return 1 / self.damped_frequency_hz


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimatorResult:
    """What one estimator says; None for what it cannot tell."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    natural_frequency_hz: Estimate | None
    damping_ratio: Estimate | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimates:
    """The estimators side by side; they are compared, never averaged."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    maximum_likelihood: EstimatorResult
    fft: EstimatorResult
    log_decrement: EstimatorResult
    periods: EstimatorResult


@dataclass(frozen=True, slots=True, kw_only=True)
class Bound:
    """Cramér-Rao bound, 1σ: what no unbiased estimator can beat on these samples."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    natural_frequency_hz: float
    damping_ratio: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ModeEstimate:
    """One mode of the decay."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    natural_frequency_hz: Estimate
    damping_ratio: Estimate
    amplitude_m: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class BackbonePoint:
    """Frequency and damping at one amplitude."""

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    amplitude_m: float
    frequency_hz: Estimate
    damping_ratio: Estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class ModalEstimate:
    """The first mode, with its errors; None where a track without a scale, or too poor a one, does not tell.

    Parameters
    ----------
    natural_frequency_hz : Estimate or None
        Undamped, for a small swing.
    damping_ratio : Estimate or None
        ζ, for a small swing.
    covariance : tuple of tuple of float or None
        2 × 2, of (natural frequency in Hz, damping ratio).
    amplitude_m : Estimate or None
        Of the sway along its main axis, mean over the window; the error of the scale included.
    amplitude_m_s2, amplitude_rad : Estimate or None
        The same of a record of accelerations, or of an angle.
    operating_frequency_hz, operating_damping_ratio : Estimate or None
        Undamped frequency and ζ at that amplitude: what a shaper is designed for.
    noise_m : float or None
        Standard deviation of the residual along the main axis.
    cycles : float
        Periods inside the window.
    bound : Bound or None
        Cramér-Rao.
    estimates : Estimates
        All estimators beside each other.
    modes : tuple of ModeEstimate
        All modes found, the first included.
    backbone : tuple of BackbonePoint
        Frequency and damping against amplitude, largest amplitude first.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = FORBID_UNKNOWN

    natural_frequency_hz: Estimate | None
    damping_ratio: Estimate | None
    covariance: tuple[tuple[float, float], tuple[float, float]] | None
    amplitude_m: Estimate | None
    operating_frequency_hz: Estimate | None
    operating_damping_ratio: Estimate | None
    noise_m: float | None
    cycles: float
    bound: Bound | None
    estimates: Estimates
    modes: tuple[ModeEstimate, ...]
    backbone: tuple[BackbonePoint, ...]
    amplitude_m_s2: Estimate | None = None
    amplitude_rad: Estimate | None = None
