import numpy as np
import pytest

from tagsway.errors import InputError
from tagsway.model import IntArray
from tagsway.video.clock import fit_clock

IDENTITY = 1e-9


def stamps_of(time_s: np.ndarray, tick_s: float, *, rounding: str = "rint") -> IntArray:
    return getattr(np, rounding)(np.asarray(time_s) / tick_s).astype(np.int64)


@pytest.mark.parametrize("hz", [24, 29.97, 30000 / 1001, 59.94, 120, 200, 239.76, 960])
@pytest.mark.parametrize("tick_s", [1 / 90000, 1 / 15360, 1e-6])
def test_even_stamps_give_an_even_clock(hz: float, tick_s: float) -> None:
    clock = fit_clock(stamps_of(np.arange(500) / hz, tick_s), tick_s=tick_s)
    assert clock.uniform
    assert clock.dropped == clock.duplicated == 0
    # discretisation: a tick over the record, as the slope of rounded stamps
    assert clock.fps_hz == pytest.approx(hz, rel=2 * tick_s / (500 / hz))
    assert np.ptp(np.diff(clock.time_s)) < IDENTITY


@pytest.mark.parametrize("rounding", ["rint", "floor"])
def test_a_phone_at_240_fps_whose_stamps_alternate_gets_an_even_clock(rounding: str) -> None:
    tick_s = 1 / 600
    stamps = stamps_of(np.arange(2000) / 240 + 0.0004, tick_s, rounding=rounding)
    assert set(np.diff(stamps)) == {2, 3}
    clock = fit_clock(stamps, tick_s=tick_s)
    assert clock.uniform
    assert clock.fps_hz == pytest.approx(240, rel=1e-5)
    assert clock.pts_rounding_s == pytest.approx(tick_s)
    assert np.abs(clock.time_s - np.arange(2000) / 240).max() < 1e-4  # discretisation: rounding / sqrt(12 n) and slope


def test_milliseconds_behind_a_finer_tick_are_recognised() -> None:
    milliseconds = np.rint(np.arange(900) * 1000 / 60)
    clock = fit_clock((milliseconds * 90).astype(np.int64), tick_s=1 / 90000)
    assert clock.uniform
    assert clock.pts_rounding_s == pytest.approx(1e-3)
    inexact = fit_clock(np.rint(milliseconds * 15.36).astype(np.int64), tick_s=1 / 15360)
    assert inexact.uniform
    assert inexact.pts_rounding_s == pytest.approx(1e-3)


def test_dropped_frames_stay_drops() -> None:
    rng = np.random.default_rng(3)
    kept = np.sort(rng.choice(np.arange(1, 999), 700, replace=False))
    kept = np.concatenate([[0], kept, [999]])
    clock = fit_clock(stamps_of(kept / 240, 1 / 600), tick_s=1 / 600)
    assert clock.uniform
    assert clock.dropped == 1000 - len(kept)
    np.testing.assert_allclose(clock.time_s, kept / 240, atol=2e-4)  # discretisation: a fraction of the 1.7 ms step


def test_a_long_gap_does_not_upset_the_count() -> None:
    kept = np.concatenate([np.arange(300), np.arange(2300, 2600)])
    clock = fit_clock(stamps_of(kept / 29.97, 1 / 90000), tick_s=1 / 90000)
    assert clock.uniform
    assert clock.dropped == 2000


def test_the_order_of_decoding_and_a_negative_start_do_not_matter() -> None:
    stamps = stamps_of(np.arange(64) / 25, 1 / 12800) - 1024
    shuffled = np.random.default_rng(0).permutation(stamps)
    clock = fit_clock(shuffled, tick_s=1 / 12800)
    assert clock.time_s[0] == 0
    assert list(clock.stamps) == list(stamps)
    assert clock.fps_hz == pytest.approx(25, rel=IDENTITY)


def test_the_header_rate_settles_what_rounded_stamps_leave_open() -> None:
    stamps = stamps_of(np.arange(30) * 1001 / 30000, 1e-3)
    clock = fit_clock(stamps, tick_s=1e-3, header_hz=30000 / 1001)
    assert clock.fps_hz == pytest.approx(30000 / 1001, rel=IDENTITY)
    wrong = fit_clock(stamps, tick_s=1e-3, header_hz=25.0)
    assert wrong.fps_hz == pytest.approx(30000 / 1001, rel=1e-3)  # discretisation: 1 ms in the record's second


def test_irregular_stamps_are_kept_as_they_are() -> None:
    rng = np.random.default_rng(1)
    time = np.cumsum(1 / 30 + 0.004 * rng.uniform(-1, 1, 400))
    clock = fit_clock(stamps_of(time - time[0], 1e-6), tick_s=1e-6)
    assert not clock.uniform
    assert clock.dropped == 0
    np.testing.assert_allclose(clock.time_s, time - time[0], atol=1e-6)
    assert clock.fps_hz == pytest.approx(399 / (time[-1] - time[0]), rel=1e-6)


def test_the_option_scales_every_time() -> None:
    stamps = np.arange(100) * 512
    clock = fit_clock(stamps, tick_s=1 / 15360, fps_hz=1000.0)
    assert clock.time_source == "option"
    assert clock.fps_hz == pytest.approx(1000)
    np.testing.assert_allclose(clock.time_s, np.arange(100) / 1000, rtol=IDENTITY)


def test_the_option_counts_frames_not_the_drops() -> None:
    kept = np.delete(np.arange(200), [7, 8, 90])
    clock = fit_clock(kept * 512, tick_s=1 / 15360, fps_hz=240.0)
    np.testing.assert_allclose(clock.time_s, kept / 240, rtol=IDENTITY)


@pytest.mark.parametrize("fps_hz", [0.0, -3.0, np.nan, np.inf])
def test_an_impossible_rate_is_refused(fps_hz: float) -> None:
    with pytest.raises(InputError, match="--fps"):
        fit_clock(np.arange(9), tick_s=0.01, fps_hz=fps_hz)


def test_slow_motion_in_the_metadata_scales_the_times_and_says_so() -> None:
    clock = fit_clock(np.arange(100) * 3000, tick_s=1 / 90000, captured_hz=240.0)
    assert clock.time_source == "metadata"
    assert clock.fps_hz == pytest.approx(240)
    assert [notice.code for notice in clock.notices] == ["capture_rate_from_metadata"]
    assert fit_clock(np.arange(9) * 3000, tick_s=1 / 90000, captured_hz=240.0, fps_hz=120.0).fps_hz == pytest.approx(
        120
    )


def test_a_nominal_rate_near_the_true_stamps_does_not_replace_them() -> None:
    clock = fit_clock(np.arange(100) * 3000, tick_s=1 / 90000, captured_hz=31.0)
    assert clock.time_source == "container"
    assert clock.fps_hz == pytest.approx(30)


@pytest.mark.parametrize(("before", "after"), [(240, 30), (30, 240), (120, 30), (200, 25), (60, 240), (200, 100)])
@pytest.mark.parametrize("tick_s", [1 / 90000, 1 / 600])
def test_edited_slow_motion_is_refused_at_its_break(before: float, after: float, tick_s: float) -> None:
    time = np.cumsum(np.concatenate([[0], np.full(150, 1 / before), np.full(150, 1 / after)]))
    with pytest.raises(InputError, match=r"at frame 1[45]"):
        fit_clock(stamps_of(time, tick_s), tick_s=tick_s)


def test_slow_motion_in_the_middle_is_refused_at_its_first_break() -> None:
    parts = [np.full(400, 1 / 240), np.full(100, 1 / 30), np.full(400, 1 / 240)]
    with pytest.raises(InputError, match=r"at frame (399|400|401)"):
        fit_clock(stamps_of(np.cumsum(np.concatenate([[0], *parts])), 1e-4), tick_s=1e-4)


def test_a_phone_that_slows_down_in_dim_light_is_not_refused() -> None:
    steps = np.concatenate([np.full(200, 1 / 30), np.full(200, 1 / 24)])
    clock = fit_clock(stamps_of(np.cumsum(steps), 1e-6), tick_s=1e-6)
    assert not clock.uniform


def test_bursts_are_not_refused() -> None:
    steps = np.tile(np.r_[np.full(7, 0.001), 0.05], 60)
    clock = fit_clock(stamps_of(np.cumsum(steps), 1e-6), tick_s=1e-6)
    assert len(clock.time_s) == len(steps)


def test_a_camera_that_alternates_between_two_rates_is_not_refused() -> None:
    steps = np.tile(np.r_[np.full(40, 1 / 30), np.full(40, 1 / 15)], 8)
    assert len(fit_clock(stamps_of(np.cumsum(steps), 1e-6), tick_s=1e-6).time_s) == len(steps)


def test_random_drops_are_not_taken_for_two_rates() -> None:
    rng = np.random.default_rng(5)
    for share in (0.05, 0.3, 0.6):
        kept = np.flatnonzero(rng.random(3000) > share)
        assert fit_clock(kept * 3000, tick_s=1 / 720000).uniform


def test_a_stamp_that_two_frames_share_counts_as_a_duplicate() -> None:
    clock = fit_clock(np.sort(np.r_[np.arange(50), 7, 7, 30]) * 512, tick_s=1 / 15360)
    assert clock.duplicated == 3
    assert len(clock.time_s) == 50


@pytest.mark.parametrize("stamps", [[], [5], [5, 5, 5]])
def test_less_than_two_times_are_refused(stamps: list[int]) -> None:
    with pytest.raises(InputError, match="at least two"):
        fit_clock(np.array(stamps, dtype=np.int64), tick_s=0.01)


def test_two_frames_make_a_clock() -> None:
    assert fit_clock(np.array([0, 10]), tick_s=0.01).fps_hz == pytest.approx(10)


def test_times_always_rise() -> None:
    rng = np.random.default_rng(8)
    for _ in range(200):
        steps = rng.choice([1, 2, 3, 7, 40], size=rng.integers(1, 60))
        try:
            clock = fit_clock(np.cumsum(np.r_[0, steps]), tick_s=float(rng.choice([1e-3, 1 / 600, 1e-5])))
        except InputError:
            continue
        assert np.all(np.diff(clock.time_s) > 0)


def test_the_capture_rate_holds_as_the_mean_rate_of_stamps_that_are_not_even() -> None:
    rng = np.random.default_rng(4)
    time = np.cumsum(rng.choice([0.02, 0.033, 0.05], size=400))
    clock = fit_clock(stamps_of(time, 1e-5), tick_s=1e-5, fps_hz=240.0)
    assert not clock.uniform
    assert clock.fps_hz == pytest.approx(240.0, rel=1e-9)  # identity
    assert clock.time_s[-1] == pytest.approx(399 / 240.0, rel=1e-9)
