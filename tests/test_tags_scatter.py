import math
from pathlib import Path

import numpy as np
import pytest

from tag_images import make_pose, photograph, see_tag
from tagsway.tags.follow import follow_tags
from tagsway.tags.scatter import Scatter
from tagsway.video.reading import read_clock, read_frames
from tagsway.video.writing import Codec, write_video


def scatter_of(places: np.ndarray, *, stated: float, time_s: np.ndarray | None = None) -> float:
    scatter = Scatter()
    times = np.arange(len(places)) / 200 if time_s is None else time_s
    for time, place in zip(times, places, strict=True):
        scatter.add(float(time), np.full(3, place), np.full(3, stated))
    return float(scatter.excess[0]) * stated


def test_white_noise_is_measured() -> None:
    rng = np.random.default_rng(0)
    found = [scatter_of(rng.normal(scale=0.02, size=200), stated=0.005**2) for _ in range(40)]
    # statistics: about a dozen independent squares each, so 6 % for the mean of 40
    assert 0.8 < np.mean(found) / 0.02**2 < 1.2


def test_images_that_are_known_to_be_noisier_than_others_say_nothing_of_these() -> None:
    rng = np.random.default_rng(7)
    std = np.where(np.arange(400) % 4, 0.03, 0.003)  # three of four images
    found = []
    for _ in range(40):
        scatter = Scatter()
        for k, place in enumerate(std * rng.normal(size=400)):
            scatter.add(k / 200, np.full(3, place), np.full(3, std[k] ** 2))
        found.append(scatter.excess[0])
    # statistics: as above; the places of the quiet images alone, held against the whole, would have 75
    assert 0.8 < np.mean(found) < 1.4


def test_noise_that_neighbours_share_is_seen_farther_apart() -> None:
    rng = np.random.default_rng(4)
    found = []
    for _ in range(40):
        fresh, shared = rng.normal(size=400), np.zeros(400)
        for k in range(1, 400):
            shared[k] = 0.6 * shared[k - 1] + math.sqrt(1 - 0.6**2) * fresh[k]
        found.append(scatter_of(0.02 * shared, stated=0.005**2))
    # statistics as above; differences of neighbours alone see a fifth of it
    assert 0.3 < np.mean(found) / 0.02**2 < 1.0


def test_a_jerky_motion_is_not_taken_for_shared_noise() -> None:
    noise = np.random.default_rng(6).normal(scale=0.01, size=300)
    pushed = np.cumsum(np.cumsum(np.where((np.arange(300) // 25) % 2, 0.1, -0.1)))
    assert scatter_of(pushed + noise, stated=0.01**2) < 4 * 0.01**2


def test_uneven_times_of_a_fast_motion_are_not_taken_for_noise() -> None:
    rng = np.random.default_rng(5)
    time = np.cumsum(rng.uniform(0.003, 0.007, size=300))
    noise = rng.normal(scale=0.003, size=300)
    assert scatter_of(40 * np.sin(2 * math.pi * 2.0 * time) + noise, stated=0.003**2, time_s=time) < 2 * 0.003**2


def test_fast_motion_at_a_phones_rate_is_not_taken_for_noise() -> None:
    time = np.arange(300) / 60
    noise = np.random.default_rng(1).normal(scale=0.003, size=300)
    assert scatter_of(40 * np.sin(2 * math.pi * 2.0 * time) + noise, stated=0.003**2, time_s=time) < 2 * 0.003**2


def test_too_few_frames_say_nothing() -> None:
    assert scatter_of(np.arange(6.0) ** 4, stated=1.0) == 0


def test_a_jerk_is_forgotten() -> None:
    noise = np.random.default_rng(2).normal(scale=0.01, size=300)
    jerked = noise + 5.0 * (np.arange(300) > 100)
    assert scatter_of(jerked, stated=0.01**2) < 2 * 0.01**2


@pytest.mark.parametrize(("codec", "quality"), [("raw", 0), ("h264", 18)])
def test_errors_of_a_moving_tag_are_honest_in_compressed_video(tmp_path: Path, codec: Codec, quality: float) -> None:
    rng = np.random.default_rng(3)
    poses = []
    for k in range(160):
        angle = 0.25 * math.sin(2 * math.pi * 2.3 * k / 200)
        poses.append(make_pose((120 + 200 * math.sin(angle), 200 * math.cos(angle) - 95), 40, angle))
    wall = np.clip(120 + 10 * rng.normal(size=(30, 30)), 0, 255).repeat(8, axis=0).repeat(8, axis=1)
    path = tmp_path / ("clip.avi" if codec == "raw" else "clip.mp4")
    images = (photograph(see_tag(pose, wall.shape, onto=wall), 3.0, rng) for pose in poses)
    write_video(path, images, fps_hz=200, codec=codec, quality=quality)
    with read_frames(path, read_clock(path), full_range=False) as frames:
        (tag,) = follow_tags(frames, family="tag36h11", tag_ids=[0]).tags
    error = (tag.centre_px - np.array([pose[:2, 2] for pose in poses]))[16:]
    normalised = error**2 / np.diagonal(tag.covariance_px2, axis1=1, axis2=2)[16:]
    # statistics: 288 squares that share an estimate of three dozen frames are known to 15 %: three times that
    assert 0.55 < np.mean(normalised) < 1.45
