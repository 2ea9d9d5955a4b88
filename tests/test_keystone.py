"""The keystone: a scene of known truth, filmed, identified, shaped, and simulated again.

The scene's simulator (Lagrange's equations by DOP853) is not the one that the fit uses (momentum form by Runge-Kutta).
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scenes import small_scene, unmodelled_scene
from tagsway.model import Estimate, Mode, Move, Settings
from tagsway.pipeline import Measurement, identify
from tagsway.pipeline.shaping import plan_shaped_move
from tagsway.scene import Scene, Truth, render_scene, simulate_scene
from tagsway.scene.model import Waypoints
from tagsway.shapers import residual_vibration

SETTINGS = Settings(tcp_tag_size_m=0.03, pcp_tag_size_m=0.03, mass_kg=0.225)


def film(scene: Scene, folder: Path) -> tuple[Measurement, Truth]:
    truth = render_scene(scene, folder / "scene.mp4")
    return identify(folder / "scene.mp4", SETTINGS), truth


@pytest.fixture(scope="module")
def known(tmp_path_factory) -> tuple[Measurement, Truth]:
    return film(small_scene(), tmp_path_factory.mktemp("known"))


@pytest.fixture(scope="module")
def unmodelled(tmp_path_factory) -> tuple[Measurement, Truth]:
    return film(unmodelled_scene(), tmp_path_factory.mktemp("unmodelled"))


def inside(estimate: Estimate | None, truth: float, *, stds: float = 3.0) -> bool:
    """Tell whether the truth lies within k of the stated standard errors (statistics)."""
    assert estimate is not None
    return abs(estimate.value - truth) <= stds * estimate.std


def test_frequency_and_damping_are_recovered_within_their_errors(known) -> None:
    measurement, truth = known
    modal = measurement.result.modal
    assert inside(modal.natural_frequency_hz, truth.natural_frequency_hz)
    assert inside(modal.damping_ratio, truth.damping_ratio)
    assert modal.natural_frequency_hz.value == pytest.approx(truth.natural_frequency_hz, rel=0.002)
    assert modal.damping_ratio.value == pytest.approx(truth.damping_ratio, rel=0.1)


def test_the_stated_error_is_near_what_the_noise_allows(known) -> None:
    modal = known[0].result.modal
    # The bound is that of white noise; what a codec drags and the softening's prior come on top.
    assert 0.9 <= modal.natural_frequency_hz.std / modal.bound.natural_frequency_hz <= 2


def test_the_pendulum_is_recovered_within_its_errors(known) -> None:
    measurement, truth = known
    pendulum = measurement.result.pendulum
    assert pendulum.determined, pendulum.reason
    assert inside(pendulum.length_m, truth.length_m)
    assert inside(pendulum.tag_radius_m, truth.tag_radius_m)
    assert inside(pendulum.stiffness_over_inertia_rad2_s2, truth.stiffness_over_inertia_rad2_s2)
    assert pendulum.length_m.value == pytest.approx(truth.length_m, rel=0.03)
    assert pendulum.tag_radius_m.value == pytest.approx(truth.tag_radius_m, rel=0.01)
    assert pendulum.point_mass is True


def test_the_shaped_move_leaves_what_the_shaper_promises(known) -> None:
    measurement, truth = known
    shaper = measurement.result.shaper
    # A gentle level move: so small a swing (0.03 rad) is linear to 1e-4, and V is then the ratio itself.
    move = Move(
        from_m=(-0.1, 0, 0), to_m=(0.1, 0, 0), profile="bang-bang", max_acceleration_m_s2=0.35, shaped_axes=("x",)
    )
    unshaped, shaped = (left_over(small_scene(), move, used) for used in (None, shaper))
    mode = Mode(natural_frequency_hz=truth.natural_frequency_hz, damping_ratio=truth.damping_ratio)
    promised = residual_vibration(shaper, mode)
    assert promised < 0.01
    assert shaped / unshaped == pytest.approx(promised, abs=1e-3)  # 1e-3: the swing that is not linear


def left_over(scene: Scene, move: Move, shaper) -> float:
    """Return the swing that a move leaves, counted from its end."""
    planned = plan_shaped_move(move, shaper)
    position = planned.sampled.position_m
    time = np.arange(len(position)) * planned.sampled.sample_time_s
    path = Waypoints(time_s=tuple(time), x_m=tuple(position[:, 0]), z_m=tuple(position[:, 2]))
    end = scene.tool.start_s + planned.sampled.moving_s
    period = 1 / scene.payload.pendulum().natural_frequency_hz
    moving = replace(scene, move=None, trajectory=path, duration_s=end + 2 * period)
    motion = simulate_scene(moving, end + np.linspace(0, period, 400))
    return float(np.ptp(motion.angle_rad)) / 2


def test_what_the_fit_does_not_model_does_not_make_it_confident(unmodelled) -> None:
    measurement, truth = unmodelled
    result = measurement.result
    # The second body's mode is 1 % of the sway and within 1.5 s of decay: statistics with a bias of that size.
    assert result.modal.natural_frequency_hz.value == pytest.approx(truth.natural_frequency_hz, rel=0.01)
    assert not result.pendulum.determined
    length = result.pendulum.length_m
    assert length is None or abs(length.value - truth.length_m) < 3 * length.std  # statistics
    assert "pendulum_unmodelled" in {warning.code for warning in result.warnings}
    assert result.status == "degraded"
    assert {"coloured_residual", "few_cycles"} & {warning.code for warning in result.warnings}


def test_the_run_from_track_csv_is_the_run_from_the_video(known, tmp_path) -> None:
    from tagsway.store.tracks import track_csv

    measurement = known[0]
    (tmp_path / "track.csv").write_text(track_csv(measurement.track, measurement.clean))
    again = identify(tmp_path / "track.csv", SETTINGS)
    for part in ("window_s", "modal", "pendulum", "indicators"):
        assert getattr(again.result, part) == getattr(measurement.result, part), part
    assert again.result.shaper.impulses == measurement.result.shaper.impulses
