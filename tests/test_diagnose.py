"""Hints: given where two stages contradict each other, silent where they agree."""

from dataclasses import replace

import pytest

from tagsway.diagnose import diagnose
from tagsway.model import (
    Estimate,
    Estimates,
    EstimatorResult,
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


@pytest.mark.parametrize("rate", [120, 240, 480, 960, 1000])
def test_each_usual_rate_is_named_for_a_film_played_at_30_fps(rate) -> None:
    (hint,) = diagnose(a_mode(2.33 * 30 / rate), A_RADIUS, a_video(30.0))
    assert hint.code == "frame_rate_suspect"
    assert f"--fps {rate}" in hint.message


def test_every_rate_that_a_stiff_joint_would_make_sense_of_is_named() -> None:
    # 3.59 Hz at 50 mm, which a point mass without a spring has at 2.23 Hz; filmed at 240 Hz and played at 30
    size = replace(A_RADIUS, tag_radius_m=Estimate.normal(0.05, 1e-4))
    (hint,) = diagnose(a_mode(3.59 * 30 / 240), size, a_video(30.0))
    assert hint.code == "frame_rate_suspect"
    assert "200 or 240 Hz would make sense, too" in hint.message


def test_a_slow_body_filmed_at_its_true_rate_is_a_remark_and_no_suspicion() -> None:
    # 200 fps is no rate of playback: much inertia is the likelier reason, and the result stays sound
    (hint,) = diagnose(a_mode(0.45 * 2.33), A_RADIUS, a_video(200.0))
    assert hint.code == "slow_for_its_radius"
    assert "inertia" in hint.message
    assert hint.is_remark


def test_a_slow_body_that_slow_motion_would_have_made_slower_is_a_remark_also_at_30_fps() -> None:
    (hint,) = diagnose(a_mode(0.5 * 2.33), A_RADIUS, a_video(30.0))
    assert hint.code == "slow_for_its_radius"
    assert "inertia" in hint.message
    assert "--fps 60" in hint.message


def test_a_frequency_that_no_usual_rate_makes_sense_of_says_so() -> None:
    (hint,) = diagnose(a_mode(2.33 * 100 / 3000), A_RADIUS, a_video(100.0))
    assert hint.code == "slow_for_its_radius"
    assert "none of the usual rates" in hint.message


def test_a_slow_body_whose_length_was_measured_is_not_even_remarked_on() -> None:
    # l = 0.46 m with the tag at 46 mm: the tool's motion tells the length, and it explains the frequency
    heavy = replace(A_RADIUS, determined=True, length_m=Estimate.normal(0.459, 0.002))
    assert codes(a_mode(0.736), heavy, a_video(30.0)) == []


def test_a_measured_length_finds_slow_motion_by_a_factor_that_a_radius_would_let_pass() -> None:
    # filmed at 60, played at 50 fps: the length is as it is, the frequency 0.83 of what gravity alone gives
    free = replace(A_RADIUS, determined=True, length_m=Estimate.normal(0.0459, 1e-4))
    (hint,) = diagnose(a_mode(2.33 * 50 / 60), free, a_video(50.0))
    assert hint.code == "frame_rate_suspect"
    assert "--fps 60" in hint.message


def test_a_rate_that_was_typed_too_high_is_named_with_the_one_that_makes_sense() -> None:
    typed = replace(a_video(1000.0), time_source="option")
    (hint,) = diagnose(a_mode(2.33 * 1000 / 240), A_RADIUS, typed)
    assert hint.code == "fast_for_its_radius"
    assert "--fps 240" in hint.message
    assert "stiff" in hint.message


def test_a_stiff_gripper_is_not_suspected() -> None:
    assert codes(a_mode(2 * 2.33), A_RADIUS, a_video(200.0)) == []


def test_a_track_has_no_frame_rate_to_suspect() -> None:
    assert codes(a_mode(0.29), A_RADIUS, None) == []


def test_a_flat_bag_is_not_suspected() -> None:
    assert codes(a_mode(1.73), A_RADIUS, a_video(200.0)) == []


def test_estimators_that_disagree_are_named() -> None:
    (hint,) = diagnose(a_mode(2.47, fft=says(2.47), periods=says(2.71)), None, None)
    assert hint.code == "estimators_disagree"
    assert "periods" in hint.message


def test_a_difference_within_the_errors_is_no_disagreement() -> None:
    assert codes(a_mode(2.47, periods=says(2.71, std=0.2)), None, None) == []


def test_a_sway_with_few_images_to_a_cycle_may_be_another_one() -> None:
    (hint,) = diagnose(a_mode(4.9), None, a_video(12.0))
    assert hint.code == "alias_possible"
    assert "7.1 Hz" in hint.message
    assert codes(a_mode(4.9), None, a_video(30.0)) == []
