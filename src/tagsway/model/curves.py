"""Everything that the figures and the page draw: they compute nothing themselves."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from tagsway.model.arrays import FloatArray
from tagsway.model.modal import BackbonePoint


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackCurve:
    """Raw and cleaned track; lengths in `length_unit` of the track, shape (n, 2) for x and z.

    `tcp` and `tcp_clean` are all NaN where the tool was never seen.
    """

    time_s: FloatArray
    pcp: FloatArray
    pcp_clean: FloatArray
    pcp_acceleration: FloatArray
    tcp: FloatArray
    tcp_clean: FloatArray
    tcp_acceleration: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class DecayCurve:
    """The free decay along the main axis of the sway, its fit, and what is left, all shape (n,)."""

    time_s: FloatArray
    sway: FloatArray
    fit: FloatArray
    envelope: FloatArray
    residual: FloatArray
    peak_time_s: FloatArray
    peak_sway: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class SpectrumCurve:
    """Amplitude of the zero-padded Fourier transform of the decay."""

    frequency_hz: FloatArray
    amplitude: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class AmplitudeCurve:
    """Undamped frequency and ζ against the amplitude of the sway, largest first.

    Parameters
    ----------
    amplitude_m, frequency_hz, damping_ratio : ndarray, shape (m,)
        Of each point.
    frequency_ci95_hz, damping_ci95 : ndarray, shape (m, 2)
        Low and high end of their 95 % intervals.
    """

    amplitude_m: FloatArray
    frequency_hz: FloatArray
    frequency_ci95_hz: FloatArray
    damping_ratio: FloatArray
    damping_ci95: FloatArray

    @classmethod
    def of(cls, points: Sequence[BackbonePoint]) -> Self:
        """Return the same points as columns."""
        return cls(
            amplitude_m=np.array([point.amplitude_m for point in points]),
            frequency_hz=np.array([point.frequency_hz.value for point in points]),
            frequency_ci95_hz=np.array([point.frequency_hz.ci95 for point in points]).reshape(-1, 2),
            damping_ratio=np.array([point.damping_ratio.value for point in points]),
            damping_ci95=np.array([point.damping_ratio.ci95 for point in points]).reshape(-1, 2),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class BackboneCurve:
    """How frequency and damping depend on the amplitude, told in two ways.

    Parameters
    ----------
    fit : AmplitudeCurve
        Of the one nonlinear decay.
    pieces : AmplitudeCurve
        Of plain decays, fitted piece by piece, each at its mean amplitude; no points where the record is too short.
    """

    fit: AmplitudeCurve
    pieces: AmplitudeCurve


@dataclass(frozen=True, slots=True, kw_only=True)
class ExcitationCurve:
    """Spectra of the horizontal acceleration of tool and product, zero-padded: |∫ x'' exp(-2πi f t) dt|.

    Parameters
    ----------
    frequency_hz : ndarray, shape (m,)
        Even.
    tcp_whole, tcp_after, tcp_late, pcp_whole, pcp_after, pcp_late : ndarray, shape (m,)
        Over the whole record, after the move, and over the second half of what follows it; in the track's length unit
        per second. NaN where the tool was never seen.
    move_s : tuple of float or None
        Begin and end of the move whose excitation is judged.
    late_s : float
        When the late part begins.
    bandwidth_hz : float
        Up to which the accelerations were seen.
    """

    frequency_hz: FloatArray
    tcp_whole: FloatArray
    tcp_after: FloatArray
    tcp_late: FloatArray
    pcp_whole: FloatArray
    pcp_after: FloatArray
    pcp_late: FloatArray
    move_s: tuple[float, float] | None
    late_s: float
    bandwidth_hz: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PendulumCurve:
    """PCP minus TCP, measured and simulated from the measured motion of the tool, shape (n, 2) for x and z."""

    time_s: FloatArray
    measured: FloatArray
    simulated: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class RidgeCurve:
    """The ridge of (l, k/J), shape (n,): each length with the k/J that then fits best, and what that costs in χ²."""

    length_m: FloatArray
    stiffness_over_inertia_rad2_s2: FloatArray
    delta_chi2: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class ResidualCurve:
    """Residual vibration V of the shaper over the natural frequency."""

    frequency_hz: FloatArray
    residual: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class TrajectoryCurve:
    """The move before and after shaping, shape (n, 3) for x, y and z in metres."""

    time_s: FloatArray
    unshaped_m: FloatArray
    shaped_m: FloatArray
    unshaped_m_s2: FloatArray
    shaped_m_s2: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Curves:
    """All curves of one measurement; None for what this measurement does not have."""

    track: TrackCurve
    decay: DecayCurve | None = None
    spectrum: SpectrumCurve | None = None
    excitation: ExcitationCurve | None = None
    backbone: BackboneCurve | None = None
    pendulum: PendulumCurve | None = None
    residual: ResidualCurve | None = None
    trajectory: TrajectoryCurve | None = None
    ridge: RidgeCurve | None = None
