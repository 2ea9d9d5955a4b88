"""The curves of the result made by hand: a payload of 2.47 Hz, moved by 0.7 m, then left to sway."""

import functools
import math

import numpy as np

from tagsway.dynamics import PendulumEnsemble, simulate_sway
from tagsway.model import (
    Curves,
    DecayCurve,
    ExcitationCurve,
    FloatArray,
    Pendulum,
    PendulumCurve,
    ResidualCurve,
    RidgeCurve,
    SpectrumCurve,
    TrackCurve,
    TrajectoryCurve,
)
from tagsway.model.curves import AmplitudeCurve, BackboneCurve

FREQUENCY_HZ = 2.4727
DAMPING = 0.004
LENGTH_M = 0.04585
MOVE_START_S = 0.5
MOVE_END_S = 1.62
END_S = 12.0
RATE_HZ = 200.0


def _quintic(u: FloatArray) -> FloatArray:
    u = np.clip(u, 0, 1)
    return u**3 * (10 - 15 * u + 6 * u**2)


def _path(time_s: FloatArray) -> FloatArray:
    """The tool's way, shape (n, 3): 0.7 m in x with 80 mm of lift."""
    u = (time_s - MOVE_START_S) / (MOVE_END_S - MOVE_START_S)
    lift = 0.08 * np.sin(np.pi * _quintic(u)) ** 2
    return np.stack([-0.35 + 0.7 * _quintic(u), np.zeros_like(u), lift], axis=1)


@functools.cache
def draw_curves() -> Curves:
    """Everything that a page can draw."""
    rng = np.random.default_rng(20)
    time = np.arange(0, END_S, 1 / RATE_HZ)
    pivot = _path(time)[:, [0, 2]]
    dense = np.linspace(0, time[-1], 2 * len(time) - 1)
    pivot_velocity = np.gradient(_path(dense)[:, [0, 2]], dense, axis=0)
    stiffness = (2 * math.pi * FREQUENCY_HZ) ** 2 - 9.81 / LENGTH_M
    pendulum = Pendulum(
        length_m=LENGTH_M,
        tag_radius_m=LENGTH_M,
        stiffness_over_inertia_rad2_s2=stiffness,
        damping_over_inertia_rad_s=2 * DAMPING * 2 * math.pi * FREQUENCY_HZ,
    )
    angle = simulate_sway(PendulumEnsemble.of(pendulum), time, pivot_velocity)[0][:, 0]
    simulated = LENGTH_M * np.stack([np.sin(angle), -np.cos(angle)], axis=1)
    noise = rng.normal(scale=0.0002, size=(2, *simulated.shape))
    tcp, pcp = pivot + noise[0], pivot + simulated + noise[1]
    pcp[700:712] = np.nan
    pcp[rng.integers(0, len(time), 8)] += 0.02
    return Curves(
        track=TrackCurve(
            time_s=time,
            pcp=pcp,
            pcp_clean=pivot + simulated,
            pcp_acceleration=_second_difference(pivot + simulated, time),
            tcp=tcp,
            tcp_clean=pivot,
            tcp_acceleration=_second_difference(pivot, time),
        ),
        decay=_decay(time, simulated[:, 0], noise[1][:, 0]),
        spectrum=_spectrum(simulated[time > MOVE_END_S, 0] + noise[1][time > MOVE_END_S, 0]),
        backbone=_backbone(),
        excitation=_excitation(time, pivot, pivot + simulated),
        pendulum=PendulumCurve(time_s=time, measured=pcp - tcp, simulated=simulated),
        ridge=_ridge(),
        residual=_residual(),
        trajectory=_trajectory(),
    )


def _decay(time: FloatArray, sway: FloatArray, noise: FloatArray) -> DecayCurve:
    inside = (time > 1.71) & (time < 11.9)
    t, fit = time[inside], sway[inside]
    peak = np.flatnonzero((fit[1:-1] > fit[:-2]) & (fit[1:-1] >= fit[2:])) + 1
    omega = 2 * math.pi * FREQUENCY_HZ
    return DecayCurve(
        time_s=t,
        sway=fit + noise[inside],
        fit=fit,
        envelope=np.max(np.abs(fit[:200])) * np.exp(-DAMPING * omega * (t - t[0])),
        residual=noise[inside],
        peak_time_s=t[peak],
        peak_sway=fit[peak] + noise[inside][peak],
    )


def _spectrum(sway: FloatArray) -> SpectrumCurve:
    padded = 8 * len(sway)
    amplitude = np.abs(np.fft.rfft(np.hanning(len(sway)) * (sway - sway.mean()), padded))
    frequency = np.arange(len(amplitude)) * RATE_HZ / padded
    return SpectrumCurve(frequency_hz=frequency, amplitude=amplitude)


def _backbone() -> BackboneCurve:
    amplitude = np.linspace(0.0105, 0.0031, 5)

    def column(at: FloatArray, *, half: float) -> AmplitudeCurve:
        frequency, ratio = FREQUENCY_HZ - 24 * at**2, 0.0039 + 0.02 * at
        return AmplitudeCurve(
            amplitude_m=at,
            frequency_hz=frequency,
            frequency_ci95_hz=np.stack([frequency - half, frequency + half], axis=1),
            damping_ratio=ratio,
            damping_ci95=np.stack([ratio - 0.2 * half, ratio + 0.2 * half], axis=1),
        )

    return BackboneCurve(fit=column(amplitude, half=2e-4), pieces=column(amplitude[:4] - 0.0004, half=9e-4))


def _excitation(time: FloatArray, tool: FloatArray, product: FloatArray) -> ExcitationCurve:
    lines = np.linspace(0, 40, 800)
    wave = np.exp(-2j * np.pi * np.outer(lines, time)) / RATE_HZ

    def parts(path: FloatArray) -> list[FloatArray]:
        acceleration = _second_difference(path, time)[:, 0]
        return [np.abs(wave @ np.where(time >= begin, acceleration, 0.0)) for begin in (0.0, MOVE_END_S, 6.76)]

    (tcp_whole, tcp_after, tcp_late), (pcp_whole, pcp_after, pcp_late) = parts(tool), parts(product)
    return ExcitationCurve(
        frequency_hz=lines,
        tcp_whole=tcp_whole,
        tcp_after=tcp_after,
        tcp_late=tcp_late,
        pcp_whole=pcp_whole,
        pcp_after=pcp_after,
        pcp_late=pcp_late,
        move_s=(MOVE_START_S, MOVE_END_S),
        late_s=6.76,
        bandwidth_hz=12.0,
    )


def _ridge() -> RidgeCurve:
    length = 1e-3 * np.linspace(45.1, 46.6, 15)
    return RidgeCurve(
        length_m=length,
        stiffness_over_inertia_rad2_s2=(2 * np.pi * 2.4727) ** 2 - 9.81 / length,
        delta_chi2=((length - 0.04585) / 0.00021) ** 2,
    )


def _residual() -> ResidualCurve:
    frequency = np.linspace(0.5 * FREQUENCY_HZ, 1.5 * FREQUENCY_HZ, 401)
    return ResidualCurve(frequency_hz=frequency, residual=np.abs(np.cos(np.pi / 2 * frequency / 2.4696)))


def _trajectory() -> TrajectoryCurve:
    time = np.arange(0, 2.0, 0.001)
    before, late = _path(time), _path(time - 0.202464)
    after = 0.50314 * before + 0.49686 * late
    return TrajectoryCurve(
        time_s=time,
        unshaped_m=before,
        shaped_m=after,
        unshaped_m_s2=_second_difference(before, time),
        shaped_m_s2=_second_difference(after, time),
    )


def _second_difference(position: FloatArray, time: FloatArray) -> FloatArray:
    return np.gradient(np.gradient(position, time, axis=0), time, axis=0)
