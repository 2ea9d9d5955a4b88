"""A sway across the filmed plane: its ellipse turns, and the camera takes that for damping and frequency."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tagsway.filters import clean_track
from tagsway.modal import find_window, identify_modes
from tagsway.modal.bound import to_modal
from tagsway.modal.least_squares import Samples
from tagsway.modal.plane import fit_plane, fit_sway
from tagsway.modal.precession import find_precession
from tagsway.modal.sway import Sway, measure_sway
from tagsway.model import FloatArray, TagTrack, Track, Window

RADIUS_M = 0.08
ZETA = 0.005
RATE_HZ = 120.0


def swing(
    across_rad: float, *, spin_rad: float = 0.0, turns: float = 1.0, seed: int = 0, noise_m: float = 5e-5
) -> Track:
    """Film a point on a thread: from 0.4 rad at rest, and across from an angle with a speed; seen from the front."""
    omega = np.sqrt(9.81 / RADIUS_M)

    def slope(_: float, state: FloatArray) -> FloatArray:
        place, rate = state.reshape(2, 3)
        force = -9.81 / RADIUS_M * np.array([0.0, 0.0, 1.0]) - 2 * ZETA * omega * rate
        return np.concatenate([rate, force - place * (force @ place) - place * (rate @ rate)])

    time = np.arange(round(4 * RATE_HZ)) / RATE_HZ
    begin = np.array([np.sin(0.4), np.sin(across_rad), 0.0])
    begin[2] = -np.sqrt(1 - begin @ begin)
    push = np.array([0.0, spin_rad * omega, 0.0])
    state = np.concatenate([begin, push - begin * (begin @ push)])
    path = solve_ivp(slope, (0, time[-1]), state, method="DOP853", t_eval=time, rtol=1e-10, atol=1e-12).y[:3].T
    rng = np.random.default_rng(seed)

    def tag(position: FloatArray, angle: FloatArray) -> TagTrack:
        return TagTrack(
            position=position + noise_m * rng.standard_normal(position.shape),
            position_std=np.full(position.shape, noise_m),
            angle_rad=angle + 2e-3 * rng.standard_normal(len(angle)),
            angle_std_rad=np.full(len(angle), 2e-3),
        )

    return Track(
        frame=np.arange(len(time)),
        time_s=time,
        length_unit="m",
        tcp=tag(np.zeros((len(time), 2)), np.zeros(len(time))),
        pcp=tag(RADIUS_M * path[:, [0, 2]], turns * np.arctan2(path[:, 0], -path[:, 2])),
    )


def whole(track: Track) -> Window:
    return Window(start_s=0.0, end_s=float(track.time_s[-1]))


def measured(track: Track) -> tuple[Sway, Samples]:
    sway = measure_sway(track, whole(track))
    return sway, Samples(time_s=sway.time_s, value=sway.value, spread=sway.spread, stated=sway.stated_std)


@pytest.mark.parametrize(("across_rad", "spin_rad"), [(0.08, 0.06), (-0.06, 0.1)])
def test_a_sway_across_is_found_and_leaves_frequency_and_damping_alone(across_rad, spin_rad) -> None:
    found = identify_modes(track := swing(across_rad, spin_rad=spin_rad), whole(track))
    assert "sways_across" in {notice.code for notice in found.notices}
    frequency, ratio = found.estimate.natural_frequency_hz, found.estimate.damping_ratio
    truth = np.sqrt(9.81 / RADIUS_M) / (2 * np.pi)
    # statistics: 3 standard errors
    assert abs(frequency.value - truth) < 3 * frequency.std
    assert ratio.ci95[0] <= ZETA <= ratio.ci95[1]


def test_its_size_and_the_arm_are_told_where_a_plane_fit_takes_it_for_damping() -> None:
    sway, samples = measured(swing(0.08, spin_rad=0.06))
    _, plane, _ = fit_sway(sway, samples, in_metres=True)
    cleared = fit_plane(sway, samples.time_s, in_metres=True)
    assert cleared.across is not None
    # statistics: 3 standard errors; across goes 0.08 cos - 0.06 sin
    assert cleared.across.across_rad == pytest.approx(0.1, abs=3 * cleared.across.across_std_rad)
    assert 1 / cleared.across.curvature == pytest.approx(RADIUS_M, rel=0.003)  # discretisation: third order in angle
    wrong, right = (abs(to_modal(fit.parameters)[0][1] - ZETA) for fit in (plane, cleared.fit))
    # published value: Ω of 3/8 a c ω turns the ellipse by a tenth of a rad, some 5 % of what the damping takes
    assert wrong > 4e-4
    assert right < wrong / 5


def test_a_plane_swing_has_none_and_keeps_its_values() -> None:
    sway, samples = measured(swing(0.0))
    _thin, plane, _ = fit_sway(sway, samples, in_metres=True)
    both = fit_plane(sway, samples.time_s, in_metres=True)
    assert both.across is not None
    assert not both.across.seen
    # discretisation: the same minimum, found anew
    assert to_modal(both.fit.parameters)[0] == pytest.approx(to_modal(plane.parameters)[0], rel=1e-4)
    assert np.all(np.diag(both.fit.covariance) >= 0.99 * np.diag(plane.covariance)), "what may be hidden widens"


def test_a_tag_that_turns_more_than_its_arc_is_no_sway_across() -> None:
    sway, samples = measured(swing(0.0, turns=1.1))
    across = fit_plane(sway, samples.time_s, in_metres=True).across
    assert across is not None
    assert not across.seen


def test_it_is_found_without_a_rotation_with_spikes_and_with_a_gap() -> None:
    track = swing(0.08, spin_rad=0.06)
    track.pcp.angle_rad[:] = np.nan
    track.pcp.position[::37] += 0.02
    track.pcp.position[100:160] = np.nan
    sway, samples = measured(track)
    assert fit_plane(sway, samples.time_s, in_metres=True).across.seen


@pytest.mark.parametrize(
    ("spikes_m", "sway_axis"), [([(0.1, -0.1)], None), ([(0.3, 0.3)] * 3, None), ([], "30"), ([], "-20")]
)
def test_a_plane_swing_stays_one_with_gross_spikes_and_on_a_stated_axis(spikes_m, sway_axis) -> None:
    track = swing(0.0)
    plain = identify_modes(track, whole(track)).estimate
    for k, spike in enumerate(spikes_m):
        track.pcp.position[100 + 70 * k] += spike
    found = identify_modes(track, whole(track), sway_axis=sway_axis)
    assert "sways_across" not in {notice.code for notice in found.notices}
    # statistics: half a standard error
    for name in ("natural_frequency_hz", "damping_ratio"):
        was, now = getattr(plain, name), getattr(found.estimate, name)
        assert now.value == pytest.approx(was.value, abs=0.5 * was.std)


def test_a_straight_path_has_none() -> None:
    track = swing(0.0, noise_m=5e-3)
    sway, samples = measured(track)
    _, fit, _ = fit_sway(sway, samples, in_metres=True)
    assert sway.curvature == 0
    assert find_precession(sway, samples.time_s, fit) is None


def test_what_noise_hides_is_in_the_errors() -> None:
    sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
    from decays import film, find_mode

    kind, payload, track = film(23)  # 3.4 degrees across, an arm of 19 mm and 0.1 mm of noise
    found = identify_modes(track, find_window(track, clean_track(track)))
    frequency, truth = find_mode(payload)
    assert kind == "out of plane"
    assert "sways_across" not in {notice.code for notice in found.notices}
    assert found.estimate.damping_ratio.ci95[0] <= truth <= found.estimate.damping_ratio.ci95[1]
    low, high = found.estimate.natural_frequency_hz.ci95
    assert low <= frequency <= high


def test_a_product_above_its_tool_has_the_same_errors() -> None:
    track = swing(0.04, spin_rad=0.03, noise_m=1e-4)
    assert track.tcp is not None
    upside_down = replace(track, pcp=_mirrored(track.pcp), tcp=_mirrored(track.tcp))
    here, there = (identify_modes(one, whole(one)).estimate for one in (track, upside_down))
    for one, other in (
        (here.natural_frequency_hz, there.natural_frequency_hz),
        (here.damping_ratio, there.damping_ratio),
    ):
        assert one is not None
        assert other is not None
        assert other.std == pytest.approx(one.std, rel=1e-3)  # identity, but for where the searches end


def _mirrored(tag: TagTrack) -> TagTrack:
    return replace(tag, position=tag.position * [1, -1], angle_rad=-tag.angle_rad)
