"""Noise that changes along a record is measured where it is, and paid for."""

import numpy as np
import pytest

from tagsway.filters import measure_noise
from tagsway.modal import identify_modes
from tagsway.model import FloatArray, TagTrack, Track, Window

RATE_HZ = 200.0


def path(time_s: FloatArray) -> FloatArray:
    return np.asarray(0.01 * np.sin(2 * np.pi * 1.5 * time_s))


@pytest.mark.parametrize("ratio", [1.0, 10.0])
def test_noise_is_found_in_each_part_of_a_record(ratio: float) -> None:
    rng, time = np.random.default_rng(0), np.arange(800) / RATE_HZ
    truth = np.where(time < 2, 1e-5, ratio * 1e-5)
    found = measure_noise(time, path(time) + truth * rng.normal(size=800), np.full(800, np.nan))
    for part in (slice(40, 360), slice(440, 760)):
        # Statistics: 320 samples in pools of 25 scatter by 14 % each and by 4 % together; 3 of those.
        assert np.sqrt(np.mean(found[part] ** 2)) == pytest.approx(np.mean(truth[part]), rel=0.15)


def test_what_exceeds_the_stated_noise_counts_for_more_since_a_codec_colours_it() -> None:
    rng, time = np.random.default_rng(0), np.arange(800) / RATE_HZ
    values = path(time) + 1e-5 * rng.normal(size=800)
    unstated, stated = (np.nanmean(measure_noise(time, values, np.full(800, std)) ** 2) for std in (np.nan, 1e-7))
    assert stated / unstated == pytest.approx(1.6, rel=0.01)  # identity: the density that the module states


def test_the_stated_noise_is_the_least() -> None:
    rng, time = np.random.default_rng(0), np.arange(400) / RATE_HZ
    found = measure_noise(time, path(time) + 1e-6 * rng.normal(size=400), np.full(400, 5e-5))
    assert np.all(found >= 5e-5)


def test_what_was_not_seen_has_no_noise_and_one_spike_does_not_make_its_neighbours_noisy() -> None:
    rng, time = np.random.default_rng(0), np.arange(400) / RATE_HZ
    values = path(time) + 1e-5 * rng.normal(size=400)
    values[100:120] = np.nan
    values[300] += 1.5e-4
    found = measure_noise(time, values, np.full(400, np.nan))
    assert np.array_equal(np.isnan(found), np.isnan(values))
    assert np.nanmedian(found[290:310]) < 2e-5


def a_decay(*, stated: float, noise: float) -> Track:
    rng, time = np.random.default_rng(2), np.arange(500) / RATE_HZ
    x = 0.008 * np.exp(-0.25 * time) * np.cos(2 * np.pi * 3.6 * time)
    position = np.column_stack([x, np.zeros(500)]) + noise * rng.normal(size=(500, 2))
    unknown = np.full(500, np.nan)
    tag = TagTrack(position=position, position_std=np.full((500, 2), stated), angle_rad=unknown, angle_std_rad=unknown)
    return Track(frame=np.arange(500), time_s=time, length_unit="m", pcp=tag)


def test_noise_beyond_what_the_tracker_states_widens_the_error_by_what_a_codec_may_drag() -> None:
    window = Window(start_s=0.0, end_s=2.495)
    sure, dragged = (
        identify_modes(a_decay(stated=stated, noise=1e-5), window).estimate.damping_ratio.std for stated in (1e-5, 2e-6)
    )
    assert dragged > 2 * sure


def test_a_source_that_states_no_noise_is_taken_at_its_residuals() -> None:
    window = Window(start_s=0.0, end_s=2.495)
    unstated, honest = (
        identify_modes(a_decay(stated=stated, noise=1e-5), window).estimate.damping_ratio.std
        for stated in (np.nan, 1e-5)
    )
    assert unstated == pytest.approx(honest, rel=0.1)
