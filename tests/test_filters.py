"""Splines against the exact posterior, spikes against motions that have none."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.signal import savgol_filter

from tagsway.errors import InputError
from tagsway.filters import clean_track, find_spikes, fit_smoothing_spline, median_filter
from tagsway.model import FloatArray, TagTrack, Track


def bang_bang(time_s: FloatArray, order: int = 0, *, acceleration: float = 5.0, start_s: float = 0.5) -> FloatArray:
    """Return a move over 0.65 m that accelerates, then brakes, both at a constant rate."""
    half = np.sqrt(0.65 / acceleration)
    t = np.clip(time_s - start_s, 0, 2 * half)
    first = t < half
    if order == 0:
        return np.where(first, acceleration * t**2 / 2, 0.65 - acceleration * (2 * half - t) ** 2 / 2)
    if order == 1:
        return np.where(first, acceleration * t, acceleration * (2 * half - t))
    return np.where((t > 0) & (t < 2 * half), np.where(first, acceleration, -acceleration), 0.0)


def exact_posterior(
    time_s: FloatArray, values: FloatArray, std: FloatArray, intensity: float
) -> tuple[FloatArray, FloatArray]:
    """Return mean and standard error of position, velocity and acceleration, shape (n, 3), from the dense precision."""
    count = len(time_s)
    precision, right = np.zeros((3 * count, 3 * count)), np.zeros(3 * count)
    precision[::3, ::3], right[::3] = np.diag(std**-2.0), values / std**2
    for i, d in enumerate(np.diff(time_s)):
        onward = np.array([[1, d, d**2 / 2], [0, 1, d], [0, 0, 1]])
        kick = np.array([[d**5 / 20, d**4 / 8, d**3 / 6], [d**4 / 8, d**3 / 3, d**2 / 2], [d**3 / 6, d**2 / 2, d]])
        step = np.hstack([-onward, np.eye(3)])
        part = slice(3 * i, 3 * i + 6)
        precision[part, part] += step.T @ np.linalg.solve(intensity * kick, step)
    covariance = np.linalg.inv(precision)
    return (covariance @ right).reshape(count, 3), np.sqrt(np.diag(covariance)).reshape(count, 3)


def uneven_record(rng: np.random.Generator, count: int = 40) -> tuple[FloatArray, FloatArray, FloatArray]:
    time = np.cumsum(rng.uniform(0.5, 1.5, count))
    time[count // 2 :] += 5.0
    return time, 0.3 * np.cumsum(np.cumsum(rng.normal(size=count))), rng.uniform(0.5, 2.0, count)


def test_spline_is_the_exact_posterior_at_uneven_times_with_uneven_noise_and_a_gap() -> None:
    time, values, std = uneven_record(np.random.default_rng(1))
    spline = fit_smoothing_spline(time, values, std)
    mean, error = exact_posterior(time, values, spline.sample_std, spline.intensity)
    for order in range(3):
        # identity, but for the dense inverse's own conditioning
        np.testing.assert_allclose(spline(time, order), mean[:, order], atol=1e-6)
        np.testing.assert_allclose(spline.std(time, order), error[:, order], rtol=1e-6)


def test_errors_between_the_samples_are_the_exact_ones_too() -> None:
    time, values, std = uneven_record(np.random.default_rng(2))
    spline = fit_smoothing_spline(time, values, std)
    between = np.sort(np.concatenate([time, (time[:-1] + time[1:]) / 2]))
    blind = np.full(len(between), 1e9)  # a sample that says nothing
    blind[np.searchsorted(between, time)] = spline.sample_std
    filled = np.interp(between, time, values)
    mean, error = exact_posterior(between, filled, blind, spline.intensity)
    for order in range(3):
        # identity, but for the dense inverse's own conditioning
        np.testing.assert_allclose(spline(between, order), mean[:, order], atol=1e-5)
        np.testing.assert_allclose(spline.std(between, order), error[:, order], rtol=1e-5)


def test_draws_have_the_posterior_mean_and_spread() -> None:
    time, values, std = uneven_record(np.random.default_rng(3))
    spline = fit_smoothing_spline(time, values, std)
    paths = spline.draw(np.random.default_rng(4), 4000)
    middle = (time[:-1] + time[1:]) / 2
    for order in range(3):
        drawn = paths(time, order)
        assert drawn.shape == (len(time), 4000)
        # statistics: 5 standard errors of a mean and of a standard deviation of 4000 draws
        assert np.max(np.abs(drawn.mean(axis=1) - spline(time, order)) / spline.std(time, order)) < 5 / np.sqrt(4000)
        np.testing.assert_allclose(drawn.std(axis=1), spline.std(time, order), rtol=5 / np.sqrt(8000))
    # Between two samples the quintic leaves out the walk inside the step: a few per cent of the position's error.
    assert np.all(paths(middle).std(axis=1) < 1.1 * spline.std(middle))


def test_errors_are_calibrated_on_paths_of_the_prior_with_noise_and_roughness_estimated() -> None:
    rng = np.random.default_rng(5)
    time, inside = np.arange(400) / 200, slice(20, -20)
    squares: list[list[float]] = [[], [], []]
    for _ in range(40):
        acceleration = np.cumsum(rng.normal(size=4000)) * np.sqrt(60 / 2000)
        velocity = cumulative_trapezoid(acceleration, dx=1 / 2000, initial=0)
        path = cumulative_trapezoid(velocity, dx=1 / 2000, initial=0)
        truth = [series[::10][:400] for series in (path, velocity, acceleration)]
        spline = fit_smoothing_spline(time, truth[0] + 5e-5 * rng.normal(size=400), 1e-5)
        for order in range(3):
            z = (spline(time, order) - truth[order]) / spline.std(time, order)
            squares[order].append(float(np.mean(z[inside] ** 2)))
    for order in range(3):
        # statistics: 4 standard errors over the repeats, and 5 % for the finite steps of the simulated walk
        assert np.mean(squares[order]) == pytest.approx(1, abs=4 * np.std(squares[order]) / np.sqrt(40) + 0.05)


@pytest.mark.parametrize("told", [5e-5, 1e-6, None])
def test_noise_is_found_whether_it_is_told_or_not(told: float | None) -> None:
    rng = np.random.default_rng(6)
    time = np.arange(1200) / 200
    spline = fit_smoothing_spline(time, 0.03 * np.sin(15.5 * time) + 5e-5 * rng.normal(size=1200), told)
    assert spline.noise_std == pytest.approx(5e-5, rel=0.15)  # statistics: 4 standard errors, some samples spent on f


def test_noise_is_never_less_than_told() -> None:
    rng = np.random.default_rng(7)
    time = np.arange(400) / 200
    spline = fit_smoothing_spline(time, time + 1e-5 * rng.normal(size=400), 5e-5)
    assert spline.noise_std == pytest.approx(5e-5)


def test_velocity_of_a_bang_bang_move_is_nearer_than_savitzky_golays() -> None:
    rng = np.random.default_rng(8)
    time = np.arange(600) / 200
    path = bang_bang(time) + 5e-5 * rng.normal(size=600)
    truth = bang_bang(time, 1)
    spline_error = np.sqrt(np.mean((fit_smoothing_spline(time, path, 5e-5)(time, 1) - truth) ** 2))
    savgol_error = np.sqrt(np.mean((savgol_filter(path, 15, 3, deriv=1, delta=1 / 200) - truth) ** 2))
    assert spline_error < savgol_error
    assert spline_error < 3.5e-3  # m/s; differences of two samples leave 14e-3


def test_bandwidth_halves_an_oscillation() -> None:
    time = np.arange(2000) / 200
    spline = fit_smoothing_spline(time, np.sin(2 * np.pi * 10 * time), 1.0, bandwidth_hz=10.0)
    middle = (time > 3) & (time < 7)
    # identity, but for the error of the sampled frequency response, (ω Δt)² / 12 of it
    assert np.ptp(spline(time[middle])) / 2 == pytest.approx(0.5, rel=0.02)


def test_missing_samples_are_left_out_and_nothing_is_said_outside() -> None:
    rng = np.random.default_rng(9)
    time = np.arange(300) / 200
    values = np.sin(5 * time) + 1e-3 * rng.normal(size=300)
    values[:20], values[100:130], values[-10:] = np.nan, np.nan, np.nan
    seen = np.isfinite(values)
    spline, same = fit_smoothing_spline(time, values, 1e-3), fit_smoothing_spline(time[seen], values[seen], 1e-3)
    np.testing.assert_array_equal(spline(time[seen]), same(time[seen]))
    for answer in (spline(time), spline.std(time), spline.draw(rng, 2)(time)[:, 0]):
        assert np.isnan(answer[:20]).all()
        assert np.isnan(answer[-10:]).all()
        assert np.isfinite(answer[20:-10]).all()
    assert spline.std(time[115]) > 3 * spline.std(time[60])


def test_constant_and_parabolic_data_are_returned_as_they_are() -> None:
    time = np.arange(200) / 200
    for values in (np.full(200, 0.35), np.zeros(200), 0.35 + 2 * time - 4.9 * time**2):
        spline = fit_smoothing_spline(time, values)
        np.testing.assert_allclose(spline(time), values, atol=1e-9)  # identity
        np.testing.assert_allclose(spline(time, 2), np.gradient(np.gradient(values, time), time)[100], atol=1e-6)


@pytest.mark.parametrize("count", [0, 1, 2, 8])
def test_too_few_samples_are_refused(count: int) -> None:
    with pytest.raises(InputError, match="at least 9"):
        fit_smoothing_spline(np.arange(count) / 200, np.zeros(count))


def test_times_that_do_not_rise_are_refused() -> None:
    with pytest.raises(InputError, match="must rise"):
        fit_smoothing_spline(np.zeros(20), np.zeros(20))


# Spikes


@pytest.mark.parametrize("acceleration", [5.0, 20.0, 50.0])
@pytest.mark.parametrize("noise", [4e-6, 5e-5, 2e-4])
def test_a_bang_bang_move_loses_nothing(acceleration: float, noise: float) -> None:
    rng = np.random.default_rng(10)
    time = np.arange(600) / 200
    for start in np.linspace(0.5, 0.505, 6):
        path = bang_bang(time, acceleration=acceleration, start_s=float(start)) + noise * rng.normal(size=600)
        assert not find_spikes(time, path).any()


@pytest.mark.parametrize("fps", [30, 60, 200, 1000])
def test_a_fast_swing_loses_nothing(fps: int) -> None:
    rng = np.random.default_rng(11)
    time = np.arange(3 * fps) / fps
    swing = 0.06 * np.sin(2 * np.pi * 3.6 * time) * np.exp(-time) + 5e-5 * rng.normal(size=3 * fps)
    assert not find_spikes(time, swing).any()


@pytest.mark.parametrize("length", [1, 2, 3])
@pytest.mark.parametrize("size", [25.0, 1000.0])
def test_spikes_and_short_runs_go_and_their_neighbours_stay(length: int, size: float) -> None:
    rng = np.random.default_rng(12)
    time = np.arange(1200) / 200
    missed = taken = spikes = 0
    for _ in range(8):
        values = 0.03 * np.sin(2 * np.pi * 2.5 * time) + 5e-5 * rng.normal(size=1200)
        bad = np.zeros(1200, dtype=bool)
        for start in range(40, 1160, 60):
            bad[start : start + length] = True
            values[start : start + length] += 5e-5 * size * rng.choice([-1, 1])
        found = find_spikes(time, values)
        missed += np.count_nonzero(bad & ~found)
        taken += np.count_nonzero(found & ~bad)
        spikes += np.count_nonzero(bad)
    # statistics: of runs of three at 25 standard deviations 0.4 % are missed, 1.2 % as many good ones go
    assert missed <= 0.03 * spikes
    assert taken <= 0.03 * spikes


def test_a_spike_of_six_standard_deviations_is_found_every_other_time_and_one_of_eight_nine_times_of_ten() -> None:
    rng = np.random.default_rng(13)
    time = np.arange(6000) / 200
    share = []
    for size in (6.0, 8.0):
        values, bad = 5e-5 * rng.normal(size=6000), np.arange(20, 5990, 40)
        values[bad] += size * 5e-5
        share.append(np.mean(find_spikes(time, values)[bad]))
    # statistics: 50 ± 5 and 94 ± 1.6 % over many seeds; four of these
    assert 0.3 < share[0] < 0.7
    assert share[1] > 0.87


def test_a_spike_beside_a_gap_or_at_an_end_is_found() -> None:
    rng = np.random.default_rng(14)
    time = np.arange(300) / 200
    values = 0.2 * np.sin(5 * time) + 5e-5 * rng.normal(size=300)
    values[[0, 99, 130, 299]] += 5e-3
    values[100:130] = np.nan
    np.testing.assert_array_equal(np.flatnonzero(find_spikes(time, values)), [0, 99, 130, 299])


def test_constant_empty_and_short_records_have_no_spikes() -> None:
    for values in (np.zeros(0), np.zeros(2), np.zeros(300), np.full(300, np.nan), np.full(300, 0.35)):
        assert not find_spikes(np.arange(len(values)) / 200, values).any()


# Medians


def test_median_keeps_a_slope_at_the_ends_and_at_gaps() -> None:
    values = np.arange(30.0)
    values[12:15] = np.nan
    for width in (3, 5, 10):
        smooth = median_filter(values, width=width)
        np.testing.assert_array_equal(np.isnan(smooth), np.isnan(values))
        assert smooth[0] == 0
        assert smooth[-1] == 29
        np.testing.assert_allclose(smooth[:7], values[:7])  # identity
        assert np.nanmax(np.abs(smooth - values)) <= 2  # beside the gap the window is lopsided


def test_median_takes_two_bad_samples_of_five_away() -> None:
    values = np.zeros((20, 2))
    values[7:9, 0] = 100.0
    assert not median_filter(values, width=5).any()


def test_median_takes_a_record_shorter_than_its_window() -> None:
    np.testing.assert_array_equal(median_filter(np.array([1.0, 2.0]), width=41), [1.0, 2.0])
    assert median_filter(np.zeros(0), width=3).shape == (0,)


# Tracks


def track_of(time_s: FloatArray, position: FloatArray, *, std: float = 5e-5) -> Track:
    angle = np.full(len(time_s), np.nan)
    tag = TagTrack(position=position, position_std=np.full(position.shape, std), angle_rad=angle, angle_std_rad=angle)
    return Track(frame=np.arange(len(time_s)), time_s=time_s, length_unit="m", pcp=tag)


@pytest.mark.parametrize("method", ["spline", "median"])
def test_clean_track_follows_a_swing_without_its_spikes(method: str) -> None:
    rng = np.random.default_rng(15)
    time = np.arange(800) / 200
    truth = np.column_stack([0.05 * np.sin(2 * np.pi * 2 * time), 0.01 * np.cos(2 * np.pi * 2 * time)])
    position = truth + 5e-5 * rng.normal(size=(800, 2))
    position[100::97] += 0.1
    clean = clean_track(track_of(time, position), method=method)  # type: ignore[arg-type]
    inside = slice(20, -20)
    assert clean.spikes == 8
    assert np.max(np.abs(clean.pcp.position - truth)[inside]) < 3e-4
    velocity = np.gradient(truth, time, axis=0)
    assert np.max(np.abs(clean.pcp.velocity - velocity)[inside]) < (0.01 if method == "spline" else 0.05)
    assert clean.tcp is None
    assert 5 < clean.pcp.bandwidth_hz <= 100


@pytest.mark.parametrize("method", ["spline", "median"])
def test_clean_track_bridges_short_gaps_and_leaves_long_ones(method: str) -> None:
    time = np.arange(400) / 200
    position = np.column_stack([np.sin(3 * time), np.cos(3 * time)])
    position[:5], position[100:105], position[200:260], position[-5:] = np.nan, np.nan, np.nan, np.nan
    clean = clean_track(track_of(time, position, std=1e-6), method=method)  # type: ignore[arg-type]
    missing = np.zeros(400, dtype=bool)
    missing[:5] = missing[200:260] = missing[-5:] = True
    for series in (clean.pcp.position, clean.pcp.velocity, clean.pcp.acceleration):
        np.testing.assert_array_equal(np.isnan(series).all(axis=1), missing)


@pytest.mark.parametrize("count", [0, 1, 2, 5])
def test_clean_track_of_next_to_nothing_is_nothing(count: int) -> None:
    for method in ("spline", "median"):
        clean = clean_track(track_of(np.arange(count) / 200, np.zeros((count, 2))), method=method)  # type: ignore[arg-type]
        assert np.isnan(clean.pcp.position).all()
        assert clean.pcp.bandwidth_hz == 0


def test_clean_track_knows_two_methods() -> None:
    with pytest.raises(InputError, match="not by 'mean'"):
        clean_track(track_of(np.arange(20) / 200, np.zeros((20, 2))), method="mean")  # type: ignore[arg-type]
