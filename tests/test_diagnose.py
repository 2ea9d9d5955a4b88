"""Hints: given where two stages contradict each other, silent where they agree."""

from dataclasses import replace

import pytest

from tagsway.diagnose import diagnose
from tagsway.model import (
    Estimate,
    Estimates,
    EstimatorResult,
    Implied,
    ModalEstimate,
    PendulumEstimate,
    VideoInfo,
)

NOTHING = EstimatorResult(natural_frequency_hz=None, damping_ratio=None)


def says(frequency_hz: float, std: float = 0.001) -> EstimatorResult:
    return EstimatorResult(natural_frequency_hz=Estimate.normal(frequency_hz, std), damping_ratio=None)


def a_mode(frequency_hz: float, **others: EstimatorResult) -> ModalEstimate:
    estimates = {"fft": NOTHING, "log_decrement": NOTHING, "periods": NOTHING, **others}
    return ModalEstimate(
        natural_frequency_hz=Estimate.normal(frequency_hz, 0.001),
        damping_ratio=Estimate.normal(0.01, 0.001),
        covariance=None,
        amplitude_m=None,
        operating_damping_ratio=None,
        operating_frequency_hz=Estimate.normal(frequency_hz, 0.001),
        noise_m=None,
        cycles=10,
        bound=None,
        estimates=Estimates(maximum_likelihood=says(frequency_hz), **estimates),
        modes=(),
        backbone=(),
    )


def a_video(fps_hz: float) -> VideoInfo:
    return VideoInfo(
        frames=900,
        fps_hz=fps_hz,
        time_source="container",
        pts_rounding_s=0.0,
        dropped=0,
        duplicated=0,
        width=1280,
        height=720,
        duration_s=30.0,
    )


A_RADIUS = replace(PendulumEstimate.unknown("-"), tag_radius_m=Estimate.normal(0.0459, 1e-4))


def codes(*arguments) -> list[str]:
    return [hint.code for hint in diagnose(*arguments)]


def test_a_slow_motion_file_is_suspected_with_the_rate_that_makes_sense_of_it() -> None:
    # A point mass at 45.9 mm sways at 2.33 Hz; filmed at 240 Hz and played at 30 it looks like 0.29 Hz.
    (hint,) = diagnose(a_mode(2.33 * 30 / 240), A_RADIUS, a_video(30.0))
    assert hint.code == "frame_rate_suspect"
    assert "--fps 240" in hint.message


def test_a_flat_bag_is_not_suspected() -> None:
    assert codes(a_mode(1.73), A_RADIUS, a_video(200.0)) == []


def test_estimators_that_disagree_are_named() -> None:
    (hint,) = diagnose(a_mode(2.47, fft=says(2.47), periods=says(2.71)), None, None)
    assert hint.code == "estimators_disagree"
    assert "periods" in hint.message


def test_a_difference_within_the_errors_is_no_disagreement() -> None:
    assert codes(a_mode(2.47, periods=says(2.71, std=0.2)), None, None) == []


@pytest.mark.parametrize(("implied_hz", "expected"), [(2.48, []), (2.6, ["pendulum_disagrees"])])
def test_a_pendulum_that_does_not_sway_as_its_decay_is_noticed(implied_hz, expected) -> None:
    implied = Implied(natural_frequency_hz=implied_hz, damping_ratio=0.01)
    assert codes(a_mode(2.47), replace(A_RADIUS, determined=True, implied=implied), None) == expected
