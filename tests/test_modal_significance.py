"""Whether a swing is one, and what its numbers are unsure of: codecs, poles of no payload, springs that stiffen."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tagsway.errors import NotIdentifiableError
from tagsway.modal import identify_modes
from tagsway.modal.decay import ALPHA, COSINE, OMEGA, PLACES, SINE, Terms, predict
from tagsway.modal.least_squares import DecayFit, Samples, fit_decay
from tagsway.modal.plane import _softening_of_weight
from tagsway.modal.significance import require_oscillation, significance
from tagsway.modal.start import find_start
from tagsway.model import FloatArray, TagTrack, Track, Window


def fit_swing(*, amplitude_m: float, pulled_m: float) -> tuple[DecayFit, Samples]:
    """Seven cycles at 3 Hz in noise of 0.03 mm."""
    time = np.arange(250) / 100.0
    noise = 3e-5 * np.random.default_rng(4).standard_normal(len(time))
    value = amplitude_m * np.exp(-0.15 * time) * np.cos(2 * np.pi * 3 * time) + noise
    samples = Samples(time_s=time, value=value, spread=np.ones(len(time)), stated=1e-5, pulled=pulled_m)
    begun = find_start(samples)
    assert begun is not None
    return fit_decay(samples, begun[0], Terms(), scale=begun[1]), samples


def make_track(time: FloatArray, path_m: FloatArray, *, noise_m: float, rng: np.random.Generator) -> Track:
    """A product on a path, below a tool at rest."""
    nothing = np.full(len(time), np.nan)
    tool, product = (
        TagTrack(
            position=path + noise_m * rng.standard_normal(path.shape),
            position_std=np.full(path.shape, noise_m),
            angle_rad=nothing,
            angle_std_rad=nothing,
        )
        for path in (np.zeros_like(path_m), path_m)
    )
    return Track(frame=np.arange(len(time)), time_s=time, tcp=tool, pcp=product, length_unit="m")


def test_a_swing_of_many_times_the_noise_is_one_though_a_codec_pulls_at_it() -> None:
    fit, samples = fit_swing(amplitude_m=4.5e-4, pulled_m=2e-4)
    size = float(fit.parameters[COSINE])
    # what a codec holds back stays in the amplitude's error
    assert np.sqrt(fit.covariance[COSINE, COSINE]) > 0.2 * size
    require_oscillation(fit, samples, where="here")
    assert significance(fit) == pytest.approx(significance(fit_swing(amplitude_m=4.5e-4, pulled_m=0.0)[0]), rel=0.2)


def test_noise_is_no_swing_whatever_a_codec_did() -> None:
    with pytest.raises(NotIdentifiableError, match="nothing swings"):
        require_oscillation(*fit_swing(amplitude_m=0.0, pulled_m=2e-4), where="here")


def test_a_fit_that_strayed_to_a_pole_of_no_payload_is_answered_with_numbers() -> None:
    # such as a fit of a rest comes to: the envelope dies within a sample, the frequency is negative
    p = np.zeros(PLACES)
    p[[OMEGA, ALPHA, COSINE]] = -9e6, 2e7, 1e-3
    value, jacobian = predict(np.arange(40) / 150.0, p, replace(Terms(), drag=True))
    assert np.isfinite(value).all()
    assert np.isfinite(jacobian).all()


def test_a_spring_that_stiffens_widens_the_interval_of_a_small_swings_frequency() -> None:
    natural_hz, radius, length_s = 2.5, 0.06, 4.0
    gravity = 9.81 / radius
    spring = (2 * np.pi * natural_hz) ** 2 - gravity

    def accelerate(_: float, state: np.ndarray) -> list[float]:
        q, rate = state
        return [rate, -0.157 * rate - spring * q * (1 + q**2) - gravity * np.sin(q)]

    time = np.arange(0, length_s, 1 / 200)
    angle = solve_ivp(accelerate, (0, length_s), [0.36, 0.0], t_eval=time, rtol=1e-9, atol=1e-10).y[0]
    path = radius * np.column_stack([np.sin(angle), -np.cos(angle)])
    track = make_track(time, path, noise_m=2e-5, rng=np.random.default_rng(12))
    fit = identify_modes(track, Window(start_s=0.0, end_s=float(time[-1])))
    found, at_swing = fit.estimate.natural_frequency_hz, fit.estimate.operating_frequency_hz
    assert "softening_contradicts_arc" in [notice.code for notice in fit.notices]
    assert found is not None
    assert at_swing is not None
    # it is off by 1 %, and says so; what the shaper is designed for is better known
    assert abs(found.value - natural_hz) < 3 * found.std
    assert 0.005 < found.std < 0.1
    assert at_swing.std < 0.5 * found.std


def test_a_long_record_that_hardly_decays_keeps_its_frequency() -> None:
    natural_hz, radius, length_s, zeta = 2.5, 0.06, 40.0, 1e-4
    omega, gravity = 2 * np.pi * natural_hz, 9.81 / radius

    def accelerate(_: float, state: np.ndarray) -> list[float]:
        q, rate = state
        return [rate, -2 * zeta * omega * rate - (omega**2 - gravity) * q - gravity * np.sin(q)]

    time = np.arange(0, length_s, 1 / 60)
    angle = solve_ivp(accelerate, (0, length_s), [0.5, 0.0], t_eval=time, rtol=1e-9, atol=1e-10).y[0]
    path = radius * np.column_stack([np.sin(angle), -np.cos(angle)])
    track = make_track(time, path, noise_m=5e-5, rng=np.random.default_rng(16))
    fit = identify_modes(track, Window(start_s=0.0, end_s=float(time[-1])))
    found = fit.estimate.natural_frequency_hz
    assert "softening_contradicts_arc" not in [notice.code for notice in fit.notices]
    assert found is not None
    # statistics: its own errors, which hold that of a softening of 1 %
    assert abs(found.value - natural_hz) < 3 * found.std
    assert found.std < 1.5e-3 * natural_hz


def test_a_tool_that_creeps_evenly_pushes_nothing() -> None:
    time, rng = np.arange(360) / 120.0, np.random.default_rng(17)
    sway = 0.02 * np.exp(-0.08 * time) * np.cos(2 * np.pi * 2.5 * time)
    still = make_track(time, np.column_stack([sway, 0 * sway]), noise_m=5e-5, rng=rng)
    assert still.tcp is not None
    way = np.column_stack([0.01 * time, 0 * time])
    moved = [replace(tag, position=tag.position + way) for tag in (still.tcp, still.pcp)]
    window = Window(start_s=0.0, end_s=float(time[-1]))
    first = identify_modes(still, window).estimate
    second = identify_modes(replace(still, tcp=moved[0], pcp=moved[1]), window).estimate
    # identity: by Galilei, the same sway, its error too
    for name in ("natural_frequency_hz", "damping_ratio"):
        one, other = getattr(first, name), getattr(second, name)
        assert other.value == pytest.approx(one.value, rel=1e-6)
        assert other.std == pytest.approx(one.std, rel=1e-3)


def test_a_beat_with_a_sway_across_is_unsure_of_its_softening() -> None:
    radius, gravity, natural = 0.06, 9.81 / 0.06, 2 * np.pi * np.array([2.5, 2.65])

    def accelerate(_: float, state: np.ndarray) -> np.ndarray:
        place, rate = state[:2], state[2:]
        lean = np.hypot(*place) + 1e-12
        pull = (natural**2 - gravity) * place + gravity * np.sin(lean) / lean * place
        return np.concatenate([rate, -0.006 * natural * rate - pull])

    time = np.arange(0, 9, 1 / 60)
    u, v = solve_ivp(accelerate, (0, 9), [0.1, 0.05, 0, 0], t_eval=time, rtol=1e-9, atol=1e-11).y[:2]
    lean = np.hypot(u, v) + 1e-12
    seen = np.sin(lean) / lean * (np.cos(0.5) * u + np.sin(0.5) * v)
    path = radius * np.column_stack([seen, -np.cos(lean)])
    track = make_track(time, path, noise_m=5e-5, rng=np.random.default_rng(18))
    found = identify_modes(track, Window(start_s=0.0, end_s=float(time[-1]))).estimate.natural_frequency_hz
    assert found is not None
    # statistics: 3 standard errors
    assert abs(found.value - 2.5) < 3 * found.std
    assert found.std < 0.01


def test_a_sway_that_every_second_picture_shows_a_little_smaller_has_one_mode() -> None:
    rate_hz, natural_hz = 120.0, 2.5
    time, rng = np.arange(440) / rate_hz, np.random.default_rng(14)
    sway = 0.008 * np.exp(-0.06 * time) * np.cos(2 * np.pi * natural_hz * time)
    shown = sway * (1 + 0.003 * (-1.0) ** np.arange(len(time)))
    track = make_track(time, np.column_stack([shown, 0 * shown]), noise_m=1e-5, rng=rng)
    fit = identify_modes(track, Window(start_s=0.0, end_s=float(time[-1])))
    assert len(fit.estimate.modes) == 1
    assert fit.estimate.natural_frequency_hz is not None
    low, high = fit.estimate.natural_frequency_hz.ci95
    assert low < natural_hz < high


def test_an_angle_that_swings_apart_is_in_the_positions_error() -> None:
    # what a sway towards the camera makes of a position: another phase as it goes on, which the angle does not see
    time, rng = np.arange(480) / 120.0, np.random.default_rng(15)
    swing = 0.02 * np.exp(-0.08 * time) * np.cos(2 * np.pi * 2.5 * time)
    shown = 0.02 * np.exp(-0.08 * time) * np.cos(2 * np.pi * 2.518 * time)
    radius = 0.06
    track = make_track(time, radius * np.column_stack([shown, -1 + shown**2 / 2]), noise_m=1e-5, rng=rng)
    assert track.tcp is not None
    level = np.zeros_like(time)
    angles = {"angle_std_rad": np.full(len(time), 2e-4)}
    track = replace(
        track,
        pcp=replace(track.pcp, angle_rad=swing + 2e-4 * rng.standard_normal(len(time)), **angles),
        tcp=replace(track.tcp, angle_rad=level, **angles),
    )
    fit = identify_modes(track, Window(start_s=0.0, end_s=float(time[-1])))
    found = fit.estimate.natural_frequency_hz
    assert "angle_disagrees" in [notice.code for notice in fit.notices]
    assert found is not None
    # the gap is 0.018 Hz, less what the angle is pulled towards the position, and either may be right
    assert 0.012 < found.std < 0.022
    assert abs(found.value - 2.518) < 0.004


def test_a_swing_that_hides_is_bounded_by_its_weight_only_where_lengths_are_known() -> None:
    fit, _ = fit_swing(amplitude_m=0.01, pulled_m=0.0)
    size, omega = float(np.hypot(*fit.parameters[[COSINE, SINE]])), float(fit.parameters[OMEGA])
    # Identity: half of q0² / 16, with q0² as it is bounded, or what gravity alone makes of the size.
    for in_metres, square in ((False, 2.0), (True, (size * omega**2 / 9.80665) ** 2)):
        assert _softening_of_weight(fit, 2.0, in_metres=in_metres).mean == pytest.approx(square / 32, rel=1e-3)
