"""Pendulums with a known answer: scipy's DOP853 on the acceleration form, restarted at every switch of the move."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import solve_ivp

from tagsway.model import (
    Estimate,
    Estimates,
    EstimatorResult,
    FloatArray,
    ModalEstimate,
    Pendulum,
    TagTrack,
    Track,
    Window,
)

G = 9.81
MASS_KG = 0.225

FLEXIBLE = Pendulum(
    length_m=0.04585,
    tag_radius_m=0.04585,
    stiffness_over_inertia_rad2_s2=0.01297 / (MASS_KG * 0.04585**2),
    damping_over_inertia_rad_s=2 * 0.004 * 2 * np.pi * 2.4727,
)
STIFF = Pendulum(
    length_m=0.02295,
    tag_radius_m=0.02295,
    stiffness_over_inertia_rad2_s2=1.686e-4 * 180 / np.pi / (MASS_KG * 0.02295**2),
    damping_over_inertia_rad_s=2 * 0.012 * 2 * np.pi * 3.5906,
)
BAG = Pendulum(
    length_m=0.0825,
    tag_radius_m=0.04585,
    damping_over_inertia_rad_s=2 * 0.01 * 2 * np.pi * 1.735,
    quadratic_drag_per_rad=0.05,
)


@dataclass(frozen=True, kw_only=True)
class Move:
    """Pieces of constant acceleration: durations in s, accelerations of x and z in m/s²."""

    duration_s: FloatArray
    acceleration_m_s2: FloatArray

    @property
    def end_s(self) -> float:
        return float(np.sum(self.duration_s))


def pick_and_place(a: float, *, rest_s: float = 0.25) -> Move:
    """The reference move: 50 mm straight up, a 45° blend, bang-bang in x, mirrored; at rest for a while before it."""
    v = np.sqrt(2 * a * 0.05)
    lift, blend = v / a, np.sqrt(2) * v / a
    cruise = (-v + np.sqrt(v**2 + 2 * a * (0.35 - v * blend / 2))) / a
    s = a / np.sqrt(2)
    half = [(lift, 0.0, a), (blend, s, -s), (cruise, a, 0.0)]
    back = [(cruise, -a, 0.0), (blend, -s, -s), (lift, 0.0, a)]
    pieces = np.array([(rest_s, 0.0, 0.0), *half, *back])
    return Move(duration_s=pieces[:, 0], acceleration_m_s2=pieces[:, 1:])


STANDING = Move(duration_s=np.array([0.25]), acceleration_m_s2=np.zeros((1, 2)))


def simulate(
    pendulum: Pendulum, move: Move, time_s: FloatArray, *, angle_rad: float = 0.0, stiffening_per_rad2: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Return the pivot's path, shape (n, 2), and the angle, shape (n,), from first principles."""
    p = pendulum
    starts = np.concatenate([[0.0], np.cumsum(move.duration_s)])
    pieces = [*zip(starts[:-1], starts[1:], move.acceleration_m_s2, strict=True)]
    pieces.append((starts[-1], max(time_s[-1], starts[-1]) + 1e-3, np.zeros(2)))
    state, pivot, speed = np.array([angle_rad, 0.0]), np.zeros(2), np.zeros(2)
    path, angle = np.empty((len(time_s), 2)), np.empty(len(time_s))
    for begin, end, (ax, az) in pieces:

        def slope(_: float, y: FloatArray, ax: float = ax, az: float = az) -> list[float]:
            q, w = y
            spring = p.stiffness_over_inertia_rad2_s2 * q * (1 + stiffening_per_rad2 * q**2)
            pull = ((G + az) * np.sin(q) + ax * np.cos(q)) / p.length_m
            drag = p.damping_over_inertia_rad_s * w + p.quadratic_drag_per_rad * w * abs(w)
            return [w, -drag - spring - pull]

        run = solve_ivp(slope, (begin, end), state, method="DOP853", rtol=1e-10, atol=1e-12, dense_output=True)
        inside = (time_s >= begin) & (time_s < end)
        since = time_s[inside][:, None] - begin
        path[inside] = pivot + speed * since + np.array([ax, az]) * since**2 / 2
        if np.any(inside):
            angle[inside] = run.sol(time_s[inside])[0]
        span = end - begin
        pivot, speed = pivot + speed * span + np.array([ax, az]) * span**2 / 2, speed + np.array([ax, az]) * span
        state = run.y[:, -1]
    return path, angle


@dataclass(frozen=True, kw_only=True)
class Recording:
    """A track, and what stands around it in the pipeline."""

    track: Track
    window: Window
    modal: ModalEstimate
    angle_rad: FloatArray


OFFSET_M = np.array([0.003, -0.012])
"""From the TCP tag to the pivot."""


def record(
    pendulum: Pendulum,
    move: Move,
    *,
    seed: int,
    decay_s: float = 2.0,
    angle_rad: float = 0.0,
    fps_hz: float = 200.0,
    noise_m: float = 5e-5,
    angle_noise_rad: float | None = 2e-3,
    distort: Callable[[FloatArray], FloatArray] = lambda position: position,
    stiffening_per_rad2: float = 0.0,
) -> Recording:
    """Film a pendulum: tags with white noise, the true mode as the modal result, the window from the move's end."""
    rng = np.random.default_rng(seed)
    time = np.arange(round((move.end_s + decay_s) * fps_hz)) / fps_hz
    path, angle = simulate(pendulum, move, time, angle_rad=angle_rad, stiffening_per_rad2=stiffening_per_rad2)
    arm = pendulum.tag_radius_m * np.column_stack([np.sin(angle), -np.cos(angle)])
    return Recording(
        track=Track(
            frame=np.arange(len(time)),
            time_s=time,
            length_unit="m",
            tcp=_tag(distort(path), np.zeros_like(time), noise_m, angle_noise_rad, rng),
            pcp=_tag(distort(path + OFFSET_M + arm), angle + 0.02, noise_m, angle_noise_rad, rng),
        ),
        window=Window(start_s=move.end_s + 0.02, end_s=float(time[-1])),
        modal=modal_of(pendulum),
        angle_rad=angle,
    )


def _tag(
    position: FloatArray, angle: FloatArray, noise: float, angle_noise: float | None, rng: np.random.Generator
) -> TagTrack:
    turned = np.full_like(angle, np.nan) if angle_noise is None else angle
    spread = 0.0 if angle_noise is None else angle_noise
    return TagTrack(
        position=position + noise * rng.standard_normal(position.shape),
        position_std=np.full_like(position, noise),
        angle_rad=turned + spread * rng.standard_normal(len(angle)),
        angle_std_rad=np.full_like(angle, np.nan if angle_noise is None else spread),
    )


def modal_of(pendulum: Pendulum) -> ModalEstimate:
    """The modal result of a perfect modal stage."""
    nothing = EstimatorResult(natural_frequency_hz=None, damping_ratio=None)
    return ModalEstimate(
        natural_frequency_hz=Estimate.normal(pendulum.natural_frequency_hz, 1e-3),
        damping_ratio=Estimate.normal(pendulum.damping_ratio, 1e-3),
        covariance=((1e-6, 0.0), (0.0, 1e-6)),
        amplitude_m=None,
        operating_damping_ratio=None,
        operating_frequency_hz=None,
        noise_m=None,
        cycles=5.0,
        bound=None,
        estimates=Estimates(maximum_likelihood=nothing, fft=nothing, log_decrement=nothing, periods=nothing),
        modes=(),
        backbone=(),
    )


def with_pcp(recording: Recording, **changes: FloatArray) -> Track:
    """The same track with another PCP."""
    return replace(recording.track, pcp=replace(recording.track.pcp, **changes))


def with_tcp(recording: Recording, **changes: FloatArray) -> Track:
    """The same track with another TCP."""
    assert recording.track.tcp is not None
    return replace(recording.track, tcp=replace(recording.track.tcp, **changes))
