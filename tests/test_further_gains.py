"""The gain of a further mode, from the move that was filmed and the decay after it."""

from dataclasses import replace

import numpy as np
import pytest

from tagsway.dynamics import LightBody, PendulumEnsemble, simulate_carried, simulate_sway
from tagsway.model import GRAVITY_M_S2, Mode, Pendulum, TagTrack, Track, Window
from tagsway.pipeline.further import measure_gains

MODES = (Mode(natural_frequency_hz=2.5, damping_ratio=0.02), Mode(natural_frequency_hz=6.5, damping_ratio=0.01))
LENGTH_M = GRAVITY_M_S2 / (2 * np.pi * 2.5) ** 2
GAIN = 0.35
END_S = 0.9
"""Of a bang-bang move of 0.3 m that begins at 0.2 s."""


def tag(x: np.ndarray, z: np.ndarray) -> TagTrack:
    position = np.stack([x, z], axis=1)
    nothing = np.full(len(x), np.nan)
    return TagTrack(
        position=position, position_std=np.full_like(position, 2e-5), angle_rad=nothing, angle_std_rad=nothing
    )


@pytest.fixture(scope="module")
def film() -> tuple[Track, float]:
    """A track at 200 Hz, and the root of twice the second mode's mean square in the decay, fitted at leisure."""
    half, duration = (END_S - 0.2) / 2, 3.0
    push = 0.15 / (half**2 / 2)
    halves = np.linspace(0, duration, 12001)
    since = np.clip(halves - 0.2, 0, 2 * half)
    speed = push * np.minimum(since, 2 * half - since)
    time, velocity = halves[::2], np.stack([speed, 0 * speed], axis=1)[..., None]
    wn = MODES[0].angular_frequency_rad_s
    pendulum = Pendulum(length_m=LENGTH_M, tag_radius_m=LENGTH_M, damping_over_inertia_rad_s=0.04 * wn)
    q, rate = simulate_sway(PendulumEnsemble.of(pendulum), time, velocity)
    one = np.ones(1)
    body = LightBody(
        carried_at_m=LENGTH_M * one,
        angular_frequency_rad_s=MODES[1].angular_frequency_rad_s * one,
        damping_ratio=0.01 * one,
        gain=GAIN * one,
    )
    y = simulate_carried(body, time, velocity[:, 0], q, rate)[0][:, 0]
    after = time >= END_S
    omega, since = MODES[1].angular_frequency_rad_s, time[after] - END_S
    # Above 4 Hz there is the second mode alone: what the first one drags along lies at 2.5 Hz.
    spectrum = np.fft.rfft(y[after])
    spectrum[np.fft.rfftfreq(len(since), time[1]) < 4] = 0
    amplitude = float(np.sqrt(2 * np.mean(np.fft.irfft(spectrum, len(since)) ** 2)))
    assert 0 < amplitude < push / omega**2
    shown = slice(None, None, 10)
    x = np.concatenate([[0], np.cumsum((speed[2::2] + speed[1:-1:2] * 4 + speed[:-2:2]) / 6 * time[1])])
    rng = np.random.default_rng(2)
    noise = [rng.normal(0, 2e-5, len(time[shown])) for _ in range(4)]
    track = Track(
        frame=np.arange(len(time[shown])),
        time_s=time[shown],
        length_unit="m",
        tcp=tag(x[shown] + noise[0], noise[1]),
        pcp=tag(
            (x + LENGTH_M * np.sin(q[:, 0]) + y)[shown] + noise[2], (-LENGTH_M * np.cos(q[:, 0]))[shown] + noise[3]
        ),
    )
    return track, amplitude


def gains_of(track: Track, amplitude: float | None, *, start_s: float = END_S) -> tuple[float | None, ...]:
    window = Window(start_s=start_s, end_s=3.0)
    return measure_gains(track, window, MODES, [amplitude], length_m=LENGTH_M, radius_m=LENGTH_M)


def test_the_gain_is_that_of_the_body_that_was_filmed(film) -> None:
    # Statistics and discretisation: the tool's velocity comes from noisy places, 5 ms apart, with corners.
    assert gains_of(*film) == pytest.approx((GAIN,), rel=0.05)


def test_a_decay_without_a_move_does_not_tell_the_gain(film) -> None:
    track, amplitude = film
    assert track.tcp is not None
    still = replace(track, tcp=tag(np.zeros(len(track.time_s)), np.zeros(len(track.time_s))))
    assert gains_of(still, amplitude) == (None,)
    assert gains_of(replace(track, tcp=None), amplitude) == (None,)
    assert gains_of(replace(track, length_unit="px"), amplitude) == (None,)


def test_an_amplitude_that_is_not_known_gives_no_gain(film) -> None:
    assert gains_of(film[0], None) == (None,)
