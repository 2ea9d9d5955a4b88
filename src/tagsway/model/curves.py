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
class PendulumCurve:
    """PCP minus TCP, measured and simulated from the measured motion of the tool, shape (n, 2) for x and z."""

    time_s: FloatArray
    measured: FloatArray
    simulated: FloatArray


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
    pendulum: PendulumCurve | None = None
    residual: ResidualCurve | None = None
    trajectory: TrajectoryCurve | None = None
