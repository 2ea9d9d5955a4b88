import math

import numpy as np
import pytest

from tag_images import bound_centre, make_pose, photograph, see_tag
from tagsway.model import Sighting
from tagsway.tags.align import Aligner, _find_shutter
from tagsway.tags.pose import CORNERS, find_homography, measure_scale, project
from tagsway.tags.template import make_template

SHAPE = (130, 140)


def shifted(pose: np.ndarray, right: float, down: float) -> np.ndarray:
    return np.array([[1, 0, right], [0, 1, down], [0, 0, 1.0]]) @ pose


def look(pose: np.ndarray, *, noise: float = 2.0, seed: int = 0, **how) -> np.ndarray:
    return photograph(see_tag(pose, SHAPE, **how), noise, np.random.default_rng(seed))


def align(image: np.ndarray, pose: np.ndarray, *, tag_id: int = 0, family: str = "tag36h11") -> Sighting | None:
    return Aligner(family, tag_id).align(image, pose)


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.5, -2.5, math.pi])
@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.1, -0.05)])
def test_place_angle_and_corners_come_out_as_drawn(angle: float, tilt: tuple[float, float]) -> None:
    pose = make_pose((70.3, 64.8), 60, angle, tilt)
    seen = align(look(pose), shifted(pose, 1.5, -1.0))
    assert seen is not None
    # statistics: the bound is 0.0016 px here, and six times that is no accident
    assert np.abs(seen.centre_px - pose[:2, 2]).max() < 0.01
    assert np.abs(seen.corners_px - project(pose, CORNERS)).max() < 0.05
    local = pose[:2, :2] - np.outer(pose[:2, 2], pose[2, :2])
    drawn = math.atan2(-local[1, 0], local[0, 0])
    assert abs(math.remainder(seen.angle_rad - drawn, 2 * math.pi)) < 6 * seen.angle_std_rad + 1e-5
    np.testing.assert_allclose(seen.homography, pose, atol=0.05)
    assert seen.homography[2, 2] == 1


@pytest.mark.parametrize("family", ["tag25h9", "tag16h5", "tagCircle21h7", "tagStandard41h12"])
def test_every_family_is_measured(family: str) -> None:
    pose = make_pose((70.3, 64.8), 60, 0.2)
    seen = align(look(pose, family=family, tag_id=3, background=200), shifted(pose, 1, 1), family=family, tag_id=3)
    assert seen is not None
    assert np.abs(seen.centre_px - pose[:2, 2]).max() < 0.015


@pytest.mark.parametrize("error", [(5.0, 0.0), (0.0, -5.0), (3.5, 3.5)])
def test_five_pixels_of_wrong_prediction_are_made_good(error: tuple[float, float]) -> None:
    pose = make_pose((70.3, 64.8), 60, 0.1)
    seen = align(look(pose), shifted(pose, *error))
    assert seen is not None
    assert np.abs(seen.centre_px - pose[:2, 2]).max() < 0.01


def test_another_id_is_not_taken_for_this_one() -> None:
    pose = make_pose((70.3, 64.8), 60, 0.1)
    image = look(pose, tag_id=7)
    assert align(image, pose, tag_id=7) is not None
    assert all(align(image, pose, tag_id=other) is None for other in range(40) if other != 7)


def test_a_tag_turned_by_a_quarter_is_not_taken_for_upright() -> None:
    pose = make_pose((70.3, 64.8), 60, math.pi / 2)
    assert align(look(pose), make_pose((70.3, 64.8), 60, 0.0)) is None


@pytest.mark.parametrize("kind", ["flat", "black", "noise", "stripes", "negative"])
def test_what_is_no_tag_is_not_one(kind: str) -> None:
    rng = np.random.default_rng(1)
    pose = make_pose((70.3, 64.8), 60, 0.1)
    images = {
        "flat": np.full(SHAPE, 128, np.uint8),
        "black": np.zeros(SHAPE, np.uint8),
        "noise": rng.integers(0, 255, SHAPE).astype(np.uint8),
        "stripes": np.tile((np.arange(SHAPE[1]) // 7 % 2 * 200).astype(np.uint8), (SHAPE[0], 1)),
        "negative": 255 - look(pose),
    }
    assert align(images[kind], pose) is None


@pytest.mark.parametrize(
    "pose",
    [
        np.full((3, 3), np.nan),
        np.zeros((3, 3)),
        np.eye(3),
        make_pose((5.0, 60.0), 60),
        make_pose((-500.0, 60.0), 60),
        make_pose((70.0, 64.0), 2),
        make_pose((70.0, 64.0), 1e6),
        make_pose((70.0, 64.0), 60) @ np.diag([-1.0, 1.0, 1.0]),
    ],
)
def test_an_impossible_prediction_finds_nothing(pose: np.ndarray) -> None:
    with np.errstate(all="ignore"):
        assert align(look(make_pose((70.3, 64.8), 60)), pose) is None


@pytest.mark.parametrize(("gain", "offset"), [(0.2, 10), (1.0, 40), (0.5, 120)])
def test_the_light_does_not_matter(gain: float, offset: float) -> None:
    pose = make_pose((70.3, 64.8), 60, 0.1)
    dark, white = 10 * gain + offset, 200 * gain + offset
    seen = align(look(pose, noise=1, dark=dark, white=white), pose)
    assert seen is not None
    assert np.abs(seen.centre_px - pose[:2, 2]).max() < 0.02


def test_a_hand_over_a_corner_shows_in_the_error() -> None:
    pose = make_pose((70.3, 64.8), 60, 0.1)
    aligner = Aligner("tag36h11", 0)
    for seed in range(40):
        clear = aligner.align(look(pose, seed=seed), pose)
    covered = look(pose, seed=99)
    covered[30:50, 36:58] = 90
    seen = aligner.align(covered, pose)
    assert clear is not None
    if seen is not None:
        error = seen.centre_px - pose[:2, 2]
        assert error @ np.linalg.solve(seen.covariance_px2, error) < 25
        assert seen.correlation < clear.correlation - 0.01


@pytest.mark.parametrize(
    ("side", "noise", "blur", "motion"),
    [
        (60, 3, 0.5, (0.0, 0.0)),
        (60, 8, 0.5, (0.0, 0.0)),
        (60, 3, 1.0, (0.0, 0.0)),
        (40, 3, 0.5, (4.0, 1.5)),
        pytest.param(60, 8, 0.5, (5.0, 1.5), marks=pytest.mark.slow),
        (20, 3, 0.5, (0.0, 0.0)),
        pytest.param(150, 3, 0.5, (0.0, 0.0), marks=pytest.mark.slow),
    ],
)
def test_the_centre_is_at_the_bound_and_its_error_is_honest(
    side: float, noise: float, blur: float, motion: tuple[float, float]
) -> None:
    rng = np.random.default_rng(7)
    size, repeats = int(1.6 * side) + 40, 240
    aligner = Aligner("tag36h11", 0)
    errors, normalised, turns = [], [], []
    for k in range(repeats):
        if k % 24 == 0:
            angle = rng.uniform(-0.3, 0.3)
            pose = make_pose((size / 2 + rng.uniform(), size / 2 + rng.uniform()), side, angle)
            image = see_tag(pose, (size, size), blur_px=blur, motion_px=motion)
        if k == 0:  # the same everywhere
            bound = bound_centre(pose, (size, size), noise, blur_px=blur, motion_px=motion)
        start = shifted(pose, *rng.normal(scale=0.2, size=2))
        travel = (2 * motion[0], 2 * motion[1])
        seen = aligner.align(photograph(image, noise, rng), start, travel_px=travel)
        assert seen is not None
        if k >= 5:  # the first ones learn blur and shutter
            errors.append(seen.centre_px - pose[:2, 2])
            normalised.append(errors[-1] @ np.linalg.solve(seen.covariance_px2, errors[-1]) / 2)
            turns.append((seen.angle_rad - angle) / seen.angle_std_rad)
    # statistics: an rms of 2 × 235 values is known to 3.3 %, so 1.15 is the bound's 1.0 and four and a half of that
    assert np.sqrt(np.mean(np.square(errors))) / bound < 1.15
    assert 0.8 < np.sqrt(np.mean(normalised)) < 1.2
    assert 0.8 < np.sqrt(np.mean(np.square(turns))) < 1.2


@pytest.mark.parametrize("side", [60.0, 60.3, 64.0])
def test_a_tag_in_line_with_the_pixels_has_no_bias(side: float) -> None:
    rng = np.random.default_rng(2)
    aligner = Aligner("tag36h11", 0)
    errors = []
    for _ in range(40):
        pose = make_pose((70 + rng.uniform(), 64 + rng.uniform()), side)
        seen = aligner.align(photograph(see_tag(pose, SHAPE), 0.5, rng), pose)
        assert seen is not None
        errors.append(seen.centre_px - pose[:2, 2])
    assert np.sqrt(np.mean(np.square(errors))) < 0.0015  # discretisation: a hundredth of what pixels beating would give


def test_homography_and_corners_are_each_others_inverse() -> None:
    pose = make_pose((70.3, 64.8), 60, 0.7, (0.1, 0.05))
    np.testing.assert_allclose(find_homography(project(pose, CORNERS)), pose, atol=1e-4)  # identity, in float32 corners
    assert measure_scale(make_pose((70.3, 64.8), 60, 0.7)) == pytest.approx(30)
    assert math.isnan(measure_scale(pose @ np.diag([-1.0, 1.0, 1.0])))


def test_the_share_of_a_motion_that_blurs_is_found_between_the_ones_tried() -> None:
    rng = np.random.default_rng(0)
    pose, travel = make_pose((80.3, 80.6), 60, 0.1), (6.0, 0.5)
    template = make_template("tag36h11", 0, scale_px=30.0, blur_px=0.5)
    for share in (0.25, 0.5, 0.7):
        image = see_tag(pose, (160, 160), motion_px=(share * travel[0], share * travel[1]))
        found = _find_shutter(photograph(image, 2, rng), pose, template, travel)
        assert found == pytest.approx(share, abs=0.05)  # discretisation: a parabola through three shares 0.2 apart
