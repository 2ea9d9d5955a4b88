"""Everything that the figures and the page draw: they compute nothing themselves."""

from dataclasses import dataclass

from tagsway.model.arrays import FloatArray


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
    pendulum: PendulumCurve | None = None
    residual: ResidualCurve | None = None
    trajectory: TrajectoryCurve | None = None
    ridge: RidgeCurve | None = None
