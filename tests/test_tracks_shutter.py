"""Rows with times of their own, and images that come twice."""

from dataclasses import replace

import numpy as np
import pytest

from tagsway.errors import InputError
from tagsway.model import FloatArray, Sightings, TagSightings, VideoInfo
from tagsway.tracks.repeats import drop_repeats
from tagsway.tracks.shutter import correct_shutter

WIDTH, HEIGHT, FPS = 1280, 1024, 30.0
READOUT = 0.020
NOISE = 0.02


def sight(tag_id: int, centre: FloatArray, angle: FloatArray, noise: float = NOISE) -> TagSightings:
    count = len(centre)
    square = 30.0 * np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
    return TagSightings(
        tag_id=tag_id,
        centre_px=centre,
        covariance_px2=np.tile(noise**2 * np.eye(2), (count, 1, 1)),
        corners_px=centre[:, None] + square,
        angle_rad=np.angle(np.exp(1j * angle)),
        angle_std_rad=np.full(count, noise / 30),
        correlation=np.where(np.isfinite(centre[:, 0]), 0.99, np.nan),
    )


def film(tags: tuple[TagSightings, ...], time_s: FloatArray) -> Sightings:
    info = VideoInfo(
        frames=len(time_s),
        fps_hz=FPS,
        time_source="container",
        pts_rounding_s=0.0,
        dropped=0,
        duplicated=0,
        width=WIDTH,
        height=HEIGHT,
        duration_s=float(time_s[-1]),
    )
    return Sightings(video=info, frame=np.arange(len(time_s)), time_s=time_s, tags=tags, detector_calls=1)


def path_of(time_s: FloatArray, row: float, speed: float = 1000.0) -> FloatArray:
    """1 m/s at a millimetre to the pixel, to and fro, at one row."""
    omega = 2 * np.pi * 0.7
    return np.stack([640 + speed / omega * np.sin(omega * time_s), np.full_like(time_s, row)], axis=1)


def swing(time_s: FloatArray) -> FloatArray:
    return 0.2 * np.sin(2 * np.pi * 0.9 * time_s) + np.pi - 0.1  # beyond the seam of the angle


def rolling(rows: tuple[float, ...], rng: np.random.Generator, turns: int = 0) -> tuple[Sightings, FloatArray]:
    """What a rolling shutter sees of tags at some rows of the sensor, and the times of the frames."""
    time = np.arange(150) / FPS
    tags = []
    for tag_id, row in enumerate(rows):
        seen = time + READOUT * (row / (HEIGHT - 1) - 0.5)
        centre = path_of(seen, row) + NOISE * rng.standard_normal((len(time), 2))
        tags.append(sight(tag_id, centre, swing(seen) + NOISE / 30 * rng.standard_normal(len(time))))
    return film(tuple(tags), time), time


def test_two_tags_that_move_together_are_together_again() -> None:
    rolled, time = rolling((100.0, 900.0), np.random.default_rng(0))
    between = rolled.tags[1].centre_px[:, 0] - rolled.tags[0].centre_px[:, 0]
    assert np.abs(between).max() > 14  # 1000 px/s for 16 ms: what there is to correct
    corrected = correct_shutter(rolled, readout_s=READOUT)
    for tag, row in zip(corrected.tags, (100.0, 900.0), strict=True):
        error = tag.centre_px - path_of(time, row)
        assert np.sqrt(np.mean(error[2:-2] ** 2)) < 1.1 * NOISE  # statistics: 300 samples of noise, 10 % is 2.5 sigma
        assert np.abs(error[2:-2]).max() < 6 * NOISE  # statistics
        assert np.abs(error).max() < 9 * NOISE  # at the ends what a parabola leaves: 6 with some seeds
        turn = np.angle(np.exp(1j * (tag.angle_rad - swing(time))))
        assert np.abs(turn).max() < 6 * NOISE / 30
        corner = tag.corners_px.mean(axis=1) - tag.centre_px
        assert np.abs(corner).max() < 0.05  # discretisation: the corners' rows differ by 1.2 ms from the centre's


def test_a_tag_that_moves_along_the_rows_times_keeps_its_frequency() -> None:
    """Up and down: the rows' times change with the place itself."""
    time = np.arange(200) / FPS
    omega = 2 * np.pi * 1.3

    def height_px(at: FloatArray) -> FloatArray:
        return 512 + 400 * np.sin(omega * at)

    seen = time.copy()
    for _ in range(60):  # the row that is exposed as the tag passes it
        seen = time + READOUT * (height_px(seen) / (HEIGHT - 1) - 0.5)
    centre = np.stack([np.full_like(time, 300.0), height_px(seen)], axis=1)
    corrected = correct_shutter(film((sight(0, centre, 0 * time, 1e-3),), time), readout_s=READOUT)
    error = corrected.tags[0].centre_px[:, 1] - height_px(time)
    assert np.abs(centre[:, 1] - height_px(time)).max() > 10
    assert np.abs(error[5:-5]).max() < 0.05  # discretisation: a spline through 23 samples a period


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_turned_phone_has_its_rows_elsewhere(turns: int) -> None:
    rolled, time = rolling((100.0, 900.0), np.random.default_rng(1))

    def turn(point: FloatArray) -> FloatArray:
        """What the display matrix makes of a sensor's pixel."""
        x, y = point[..., 0], point[..., 1]
        turned = {1: (y, WIDTH - 1 - x), 2: (WIDTH - 1 - x, HEIGHT - 1 - y), 3: (HEIGHT - 1 - y, x)}[turns]
        return np.stack(turned, axis=-1)

    tags = tuple(replace(tag, centre_px=turn(tag.centre_px), corners_px=turn(tag.corners_px)) for tag in rolled.tags)
    size = {"width": HEIGHT, "height": WIDTH} if turns % 2 else {}
    shown = replace(rolled, tags=tags, video=replace(rolled.video, **size))
    corrected = correct_shutter(shown, readout_s=READOUT, turns=turns)
    for tag, row in zip(corrected.tags, (100.0, 900.0), strict=True):
        assert np.abs(tag.centre_px - turn(path_of(time, row))).max() < 6 * NOISE  # statistics


def test_gaps_and_spikes_do_not_spread() -> None:
    rolled, time = rolling((100.0,), np.random.default_rng(2))
    centre = rolled.tags[0].centre_px.copy()
    centre[40:52] = np.nan
    centre[80] += 30
    tag = sight(0, centre, rolled.tags[0].angle_rad)
    error = correct_shutter(film((tag,), time), readout_s=READOUT).tags[0].centre_px - path_of(time, 100.0)
    assert np.isnan(error[40:52]).all()
    np.testing.assert_allclose(error[80], 30, atol=1)
    error[80] = 0
    assert np.nanmax(np.abs(error)) < 8 * NOISE  # statistics; beside the gap the speed is known less well


def test_a_global_shutter_and_too_few_samples_change_nothing() -> None:
    rolled, time = rolling((100.0,), np.random.default_rng(3))
    assert correct_shutter(rolled, readout_s=0.0) is rolled
    rare = np.full_like(rolled.tags[0].centre_px, np.nan)
    rare[:5] = rolled.tags[0].centre_px[:5]
    few = film((sight(0, rare, np.where(np.isfinite(rare[:, 0]), 0.1, np.nan)),), time)
    assert correct_shutter(few, readout_s=READOUT).tags[0] is few.tags[0]


@pytest.mark.parametrize("readout_s", [-0.01, 0.04, float("nan")])
def test_a_readout_longer_than_a_frame_is_refused(readout_s: float) -> None:
    rolled, _ = rolling((100.0,), np.random.default_rng(4))
    with pytest.raises(InputError, match="readout_s"):
        correct_shutter(rolled, readout_s=readout_s)


def repeat(shown: FloatArray, speed: float = 60.0) -> tuple[Sightings, np.ndarray]:
    """Sightings of a moving tag where frame k shows the image of another, and which of them are repeated."""
    time = np.arange(len(shown)) / FPS
    rng = np.random.default_rng(5)
    centre = path_of(time, 300.0, speed) + NOISE * rng.standard_normal((len(time), 2))
    repeated = np.r_[False, np.diff(shown) == 0]
    return film((sight(0, centre[shown], 0 * time),), time), repeated


def test_images_that_fill_up_an_even_rate_are_left_out() -> None:
    shown = np.arange(50) // 5 * 5 + np.minimum(np.arange(50) % 5, 3)  # of five frames the last one again
    sightings, repeated = repeat(shown)
    kept, notices = drop_repeats(sightings, repeated)
    assert [notice.code for notice in notices] == ["repeated_images"]
    fast = np.abs(np.cos(2 * np.pi * 0.7 * sightings.time_s)) > 0.5  # at rest an image is a measurement
    fast[-1] = False  # of the last one nobody knows whether the tag moved on
    np.testing.assert_array_equal(kept.tags[0].seen[fast], ~repeated[fast])
    assert kept.tags[0].seen[~repeated].all()
    assert kept.video.duplicated == np.count_nonzero(~kept.tags[0].seen) >= 5


def test_a_camera_that_stalls_is_no_standstill() -> None:
    shown = np.where((np.arange(60) >= 20) & (np.arange(60) < 28), 20, np.arange(60))
    kept, _ = drop_repeats(*repeat(shown))
    np.testing.assert_array_equal(np.flatnonzero(~kept.tags[0].seen), np.arange(21, 28))


def test_a_scene_at_rest_is_measured_though_its_images_are_the_same() -> None:
    time = np.arange(90) / FPS
    moved = np.clip(time - 1, 0, 1)
    centre = np.stack([300 + 200 * (3 * moved**2 - 2 * moved**3), np.full_like(time, 300.0)], axis=1)
    repeated = np.r_[False, np.all(np.diff(centre, axis=0) == 0, axis=1)]
    assert np.count_nonzero(repeated) > 50
    kept, notices = drop_repeats(film((sight(0, centre, 0 * time),), time), repeated)
    assert kept.tags[0].seen.all()
    assert notices == ()


def test_an_image_in_which_a_tag_has_moved_is_a_new_one() -> None:
    sightings, _ = repeat(np.arange(30))
    suspected = np.isin(np.arange(30), [7, 12, 13])
    assert drop_repeats(sightings, suspected) == (sightings, ())


def test_where_a_swing_turns_round_a_coder_may_repeat_what_hardly_moves() -> None:
    # 33 px at 2.5 Hz: after each end two images show the one before
    time = np.arange(120) / 120.0
    path = 300 + 33 * np.cos(2 * np.pi * 2.5 * time)
    shown = np.arange(120)
    for end in range(24, 110, 24):
        shown[[end + 1, end + 2]] = end
    centre = np.column_stack([path[shown], np.full_like(time, 200.0)])
    sightings = film((sight(0, centre, 0 * time),), time)
    assert drop_repeats(sightings, np.r_[False, np.diff(shown) == 0]) == (sightings, ())


def test_nothing_repeated_changes_nothing() -> None:
    sightings, repeated = repeat(np.arange(30))
    assert drop_repeats(sightings, repeated) == (sightings, ())
