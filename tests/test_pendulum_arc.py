"""The arc of the product's tag: centre and radius from geometry alone."""

import numpy as np
import pytest

from tagsway.errors import NotIdentifiableError
from tagsway.model import FloatArray
from tagsway.pendulum import Arc, fit_circle, fit_rotation

CENTRE_M, RADIUS_M = np.array([0.003, -0.012]), 0.046


def arc_points(swing_rad: float, seed: int, *, noise_m: float = 7e-5) -> tuple[FloatArray, FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    angle = swing_rad * np.sin(np.linspace(0, 30, 400))
    points = CENTRE_M + RADIUS_M * np.column_stack([np.sin(angle), -np.cos(angle)])
    return points + noise_m * rng.standard_normal(points.shape), np.full_like(points, noise_m), angle


def score(arc: Arc) -> float:
    return (arc.radius_m - RADIUS_M) / arc.radius_std_m


@pytest.mark.parametrize("swing", [0.4, 0.8, 1.5])
def test_a_circle_has_its_centre_and_radius_within_the_error(swing: float) -> None:
    scores = []
    for seed in range(20):
        arc = fit_circle(*arc_points(swing, seed)[:2])
        scores.append(score(arc))
        np.testing.assert_allclose(arc.centre_m, CENTRE_M, atol=5 * arc.radius_std_m)  # statistics
    assert 0.57 < np.sqrt(np.mean(np.square(scores))) < 1.45  # statistics: 20 standard normal numbers, 99.8 %


def test_a_circle_without_noise_is_exact() -> None:
    points, _, _ = arc_points(0.3, 0, noise_m=0.0)
    arc = fit_circle(points, np.full_like(points, 1e-4))
    assert arc.radius_m == pytest.approx(RADIUS_M, rel=1e-6)  # identity, as far as the optimiser goes


def test_the_tags_rotation_tells_the_radius_of_a_swing_too_small_for_a_circle() -> None:
    rng = np.random.default_rng(3)
    points, std, angle = arc_points(0.12, 3)
    turned = fit_rotation(points, std, angle + 0.4 + 2e-3 * rng.standard_normal(len(angle)), np.full_like(angle, 2e-3))
    assert abs(score(turned)) < 4  # statistics
    assert turned.radius_std_m < 0.3 * fit_circle(points, std).radius_std_m


def test_spikes_and_missing_samples_hardly_move_it() -> None:
    points, std, angle = arc_points(0.8, 4)
    points[::37] += 0.02
    points[5:60] = np.nan
    assert fit_circle(points, std).radius_m == pytest.approx(RADIUS_M, rel=2e-3)  # statistics
    turned = fit_rotation(points, std, angle, np.full_like(angle, 2e-3))
    assert turned.radius_m == pytest.approx(RADIUS_M, rel=2e-3)  # statistics


def test_too_few_samples_are_refused() -> None:
    points, std, angle = arc_points(0.8, 5)
    with pytest.raises(NotIdentifiableError, match="only 5 samples show both tags"):
        fit_circle(points[:5], std[:5])
    with pytest.raises(NotIdentifiableError, match="only 0 samples"):
        fit_rotation(points, std, np.full_like(angle, np.nan), np.full_like(angle, np.nan))
