"""The four sample videos: what is identified, against the truth that lies beside each."""

import tomllib
from pathlib import Path

import pytest

from tagsway.model import Estimate, Settings
from tagsway.pipeline import Measurement, identify
from tagsway.scene import Truth, read_truth, truth_path

SAMPLES = Path(__file__).parents[1] / "sample_data"


@pytest.fixture(scope="module", params=["flexible", "stiff", "released", "bag"])
def sample(request) -> tuple[str, Measurement, Truth]:
    video = SAMPLES / f"{request.param}.mp4"
    truth = read_truth(truth_path(video))
    tags = tomllib.loads((SAMPLES / f"{request.param}.toml").read_text())["tags"]
    settings = Settings(
        tcp_tag_size_m=tags["tcp"]["size_m"], pcp_tag_size_m=tags["pcp"]["size_m"], mass_kg=truth.mass_kg
    )
    return request.param, identify(video, settings), truth


def holds(estimate: Estimate | None, truth: float) -> bool:
    """Tell whether the stated 95 % interval holds the truth."""
    assert estimate is not None
    return estimate.ci95[0] <= truth <= estimate.ci95[1]


def test_frequency_and_damping(sample) -> None:
    name, measurement, truth = sample
    modal = measurement.result.modal
    assert modal.natural_frequency_hz.value == pytest.approx(truth.natural_frequency_hz, rel=0.002)
    assert holds(modal.natural_frequency_hz, truth.natural_frequency_hz)
    assert holds(modal.damping_ratio, truth.damping_ratio)
    if name != "bag":  # its drag makes the damping depend on the swing: its interval alone is asked for
        assert modal.damping_ratio.value == pytest.approx(truth.damping_ratio, rel=0.1)


def test_radius_and_length(sample) -> None:
    name, measurement, truth = sample
    pendulum = measurement.result.pendulum
    assert pendulum.tag_radius_m.value == pytest.approx(truth.tag_radius_m, rel=0.01)
    assert holds(pendulum.tag_radius_m, truth.tag_radius_m)
    assert holds(pendulum.pivot_offset_x_m, truth.pivot_offset_m[0])
    assert holds(pendulum.pivot_offset_m, truth.pivot_offset_m[1])
    # A release by hand does not tell the length from the spring (see `tagsway.pendulum.verdict`).
    assert pendulum.determined is (name != "released")
    if name != "released":
        assert pendulum.length_m.value == pytest.approx(truth.length_m, rel=0.03)
        assert holds(pendulum.length_m, truth.length_m)
        assert holds(pendulum.stiffness_over_inertia_rad2_s2, truth.stiffness_over_inertia_rad2_s2)
        assert holds(pendulum.damping_over_inertia_rad_s, truth.damping_over_inertia_rad_s)
        assert pendulum.point_mass is (name != "bag")


def test_every_tag_is_seen_in_every_frame(sample) -> None:
    _, measurement, truth = sample
    assert measurement.result.video.frames == len(truth.frame)
    assert measurement.result.tags.tcp.detected == 1.0
    assert measurement.result.tags.pcp.detected == 1.0
    assert measurement.result.status == "ok"
