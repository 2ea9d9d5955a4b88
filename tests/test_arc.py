"""The arc of the product's tag: its pivot and radius from geometry alone."""

from dataclasses import replace

import numpy as np
import pytest

from pendulum_scenes import FLEXIBLE, OFFSET_M, STANDING, record, with_pcp
from tagsway.errors import NotIdentifiableError
from tagsway.model import Estimate, FloatArray, TagTrack
from tagsway.pendulum import Arc, fit_arc, fit_pendulum
from tagsway.pendulum.shortfall import find_shortfall

CENTRE_M, RADIUS_M = np.array([0.003, -0.012]), 0.046
NOISE_M, NOISE_RAD = 7e-5, 2e-3


def film(
    swing_rad: float,
    seed: int,
    *,
    noise: float = 1.0,
    turn: FloatArray | float = 0.0,
    zero: float = 0.4,
    stretch: float = 0.0,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return positions and the tag's angle with their noise, on a tool that turns."""
    rng = np.random.default_rng(seed)
    angle = swing_rad * np.sin(np.linspace(0, 30, 400))
    turned = turn * np.ones_like(angle)
    pivot = np.column_stack(
        [
            np.cos(turned) * CENTRE_M[0] - np.sin(turned) * CENTRE_M[1],
            np.sin(turned) * CENTRE_M[0] + np.cos(turned) * CENTRE_M[1],
        ]
    )
    points = pivot + RADIUS_M * np.column_stack([np.sin(angle), -np.cos(angle) * (1 + stretch)])
    return (
        points + noise * NOISE_M * rng.standard_normal(points.shape),
        np.full_like(points, NOISE_M),
        angle + zero + noise * NOISE_RAD * rng.standard_normal(len(angle)),
        np.full_like(angle, NOISE_RAD),
    )


def scores(arc: Arc) -> FloatArray:
    """Deviations of x, z and r in their own standard errors, those of the noise alone."""
    miss = np.array([*(arc.centre_m - CENTRE_M), arc.radius_m - RADIUS_M])
    return np.asarray(miss / np.sqrt(np.diag(arc.covariance_m2)))


@pytest.mark.parametrize(("swing", "turns"), [(0.1, True), (0.4, True), (0.4, False), (1.3, True)])
def test_the_stated_intervals_hold_the_pivot_and_the_radius_in_95_of_100_films(swing: float, turns: bool) -> None:
    found = []
    for seed in range(80):
        stretch = 0.002 * np.random.default_rng(1000 + seed).standard_normal()
        points, std, angle, angle_std = film(swing, seed, stretch=stretch)
        found.append(scores(fit_arc(points, std, angle, angle_std) if turns else fit_arc(points, std)))
    inside = np.mean(np.abs(found) < 1.96, axis=0)
    # statistics: of 80 films at least 88 % (three standard deviations of the count)
    assert np.all(inside >= 0.88), inside
    assert np.all(np.std(found, axis=0) > 0.75)


def test_the_intervals_hold_a_turning_of_which_a_coder_takes_a_share() -> None:
    stated, ignored = [], []
    for seed in range(40):
        points, std, angle, angle_std = film(0.2, seed)
        coded = TagTrack(position=points, position_std=std, angle_rad=angle, angle_std_rad=angle_std, image_share=0.3)
        short = find_shortfall(coded)
        taken = angle + np.random.default_rng(1000 + seed).standard_normal() * short
        stated.append(scores(fit_arc(points, std, taken, angle_std, angle_short_rad=short)))
        ignored.append(scores(fit_arc(points, std, taken, angle_std)))
    # statistics: of 40 films, three standard deviations of the count
    assert np.all(np.mean(np.abs(stated) < 1.96, axis=0) >= 0.84)
    assert np.std(stated, axis=0)[2] > 0.7
    assert np.std(ignored, axis=0)[2] > 1.5


def test_only_a_coder_takes_from_a_turning_and_nothing_where_the_tag_was_not_seen() -> None:
    points, std, angle, angle_std = film(0.2, 0)
    angle[100:150] = np.nan
    plain = TagTrack(position=points, position_std=std, angle_rad=angle, angle_std_rad=angle_std)
    assert not np.any(find_shortfall(plain))
    short = find_shortfall(replace(plain, image_share=0.3))
    assert not np.any(short[100:150])
    assert np.std(short[np.isfinite(angle)]) == pytest.approx(0.3 * NOISE_RAD)  # identity
    still = replace(plain, angle_rad=np.zeros(len(angle)), image_share=0.3)
    assert not np.any(find_shortfall(still))


def test_without_noise_it_is_exact() -> None:
    points, std, angle, angle_std = film(0.3, 0, noise=0.0)
    for arc in (fit_arc(points, std), fit_arc(points, std, angle, angle_std)):
        assert arc.radius_m == pytest.approx(RADIUS_M, rel=1e-6)  # identity, as far as the optimiser goes
        np.testing.assert_allclose(arc.centre_m, CENTRE_M, atol=1e-7)


def test_both_witnesses_together_are_never_worse_than_one() -> None:
    for swing in (0.1, 0.3, 1.0):
        points, std, angle, angle_std = film(swing, 3)
        both, circle = fit_arc(points, std, angle, angle_std), fit_arc(points, std)
        assert both.radius_std_m < 1.02 * circle.radius_std_m
    points, std, angle, angle_std = film(0.12, 3)
    assert fit_arc(points, std, angle, angle_std).radius_std_m < 0.3 * fit_arc(points, std).radius_std_m


def test_noise_of_the_angle_does_not_shorten_the_radius() -> None:
    rng = np.random.default_rng(5)
    radii = []
    for seed in range(40):
        points, std, angle, _ = film(0.1, seed)
        noisy = angle + 0.02 * rng.standard_normal(len(angle))
        radii.append(fit_arc(points, std, noisy, np.full_like(angle, 0.02)).radius_m)
    # statistics: regression of x on the angle would be short by the noise's variance over the angle's, 8 %
    assert np.mean(radii) == pytest.approx(RADIUS_M, abs=4 * np.std(radii) / np.sqrt(len(radii)))
    assert np.std(radii) < 0.02 * RADIUS_M


def test_a_tool_that_turns_takes_its_pivot_along() -> None:
    turn = 0.3 * np.sin(np.linspace(0, 4, 400))
    points, std, angle, angle_std = film(0.6, 7, turn=turn)
    arc = fit_arc(points, std, angle, angle_std, tool_turn_rad=turn)
    assert np.all(np.abs(scores(arc)) < 4)  # statistics
    ignored = fit_arc(points, std, angle, angle_std)
    assert np.linalg.norm(arc.centre_m - CENTRE_M) < 0.3 * np.linalg.norm(ignored.centre_m - CENTRE_M)


def test_spikes_and_missing_samples_hardly_move_it() -> None:
    points, std, angle, angle_std = film(0.8, 4)
    points[::37] += 0.02
    angle[::41] += 1.0
    points[5:60] = np.nan
    angle[80:120] = np.nan
    assert fit_arc(points, std).radius_m == pytest.approx(RADIUS_M, rel=3e-3)  # statistics
    assert fit_arc(points, std, angle, angle_std).radius_m == pytest.approx(RADIUS_M, rel=3e-3)  # statistics


def test_a_tag_that_slips_is_noticed_with_both_radii_and_a_rigid_one_is_not() -> None:
    for seed in range(20):
        points, std, angle, angle_std = film(0.6, seed)
        rigid = fit_arc(points, std, angle, angle_std)
        assert len(rigid.witnesses) == 2
        assert rigid.disagreement() is None
    slipped = fit_arc(points, std, 0.4 + 0.9 * (angle - 0.4), angle_std)
    notice = slipped.disagreement()
    assert notice is not None
    assert notice.code == "arc_witnesses_disagree"
    assert slipped.radius_m == pytest.approx(RADIUS_M, rel=5e-3)  # statistics: the circle's


def test_too_few_samples_are_refused_and_angles_may_be_missing() -> None:
    points, std, angle, _ = film(0.8, 5)
    with pytest.raises(NotIdentifiableError, match="only 5 samples show both tags"):
        fit_arc(points[:5], std[:5])
    nothing = np.full_like(angle, np.nan)
    assert fit_arc(points, std, nothing, nothing).radius_m == fit_arc(points, std).radius_m  # identity


def test_identical_points_tell_no_radius() -> None:
    points, std, angle, angle_std = film(0.0, 6, noise=0.0)
    assert not fit_arc(points, std, angle, angle_std).known
    assert not fit_arc(points, std).known


def covers(estimate: Estimate | None, truth: float) -> bool:
    assert estimate is not None
    return estimate.ci95[0] <= truth <= estimate.ci95[1]


def test_a_hand_release_tells_the_radius_and_the_pivot_though_not_the_length() -> None:
    for seed in range(4):
        scene = record(FLEXIBLE, STANDING, seed=seed, angle_rad=0.3)
        found = fit_pendulum(scene.track, scene.window, scene.modal, rng=np.random.default_rng(0)).estimate
        assert found.length_m is None
        for estimate, truth in (
            (found.tag_radius_m, FLEXIBLE.tag_radius_m),
            (found.pivot_offset_m, OFFSET_M[1]),
            (found.pivot_offset_x_m, OFFSET_M[0]),
        ):
            assert estimate is not None
            assert abs(estimate.value - truth) < 4 * estimate.std  # statistics
        # The scale's 0.3 % is in it, and not much more.
        assert 0.003 < found.tag_radius_m.std / found.tag_radius_m.value < 0.01


def test_the_arc_stands_where_no_pendulum_follows_and_where_the_tag_slips() -> None:
    scene = record(FLEXIBLE, STANDING, seed=3, angle_rad=0.6)
    slipping = with_pcp(scene, angle_rad=0.85 * scene.track.pcp.angle_rad)
    found = fit_pendulum(slipping, scene.window, scene.modal, rng=np.random.default_rng(0))
    assert "arc_witnesses_disagree" in {notice.code for notice in found.notices}
    assert covers(found.estimate.tag_radius_m, FLEXIBLE.tag_radius_m)
