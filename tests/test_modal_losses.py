"""A drag that no test can see: in the errors of the damping ratio, and not in its value until it is sure."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm, truncnorm

from pendulum_scenes import FLEXIBLE, Recording, pick_and_place, record
from tagsway.filters import clean_track
from tagsway.modal import find_window, identify_modes
from tagsway.modal.channels import Channel, doubt_fit, join_fits
from tagsway.modal.decay import ALPHA, DRAG, FRICTION, OMEGA
from tagsway.modal.least_squares import DecayFit, fit_decay
from tagsway.modal.losses import HiddenLosses, _hold_positive, _is_sound, weigh_losses
from tagsway.modal.plane import fit_plane
from tagsway.modal.sway import measure_sway
from tagsway.model import ModalEstimate

SEEDS = range(8)
SHORT_S = 1.2


def identify(recording: Recording) -> ModalEstimate:
    return identify_modes(recording.track, recording.window).estimate


def damping_of(drag_per_rad: float, seed: int) -> tuple[ModalEstimate, float]:
    pendulum = replace(FLEXIBLE, quadratic_drag_per_rad=drag_per_rad)
    omega = np.sqrt(9.81 / pendulum.length_m + pendulum.stiffness_over_inertia_rad2_s2)
    truth = pendulum.damping_over_inertia_rad_s / (2 * omega)
    return identify(record(pendulum, pick_and_place(2.0), seed=seed, decay_s=SHORT_S)), float(truth)


@pytest.mark.parametrize("drag_per_rad", [0.0, 0.03, 0.06])
def test_the_interval_holds_the_damping_of_a_small_swing_with_and_without_drag(drag_per_rad) -> None:
    inside = []
    for seed in SEEDS:
        found, truth = damping_of(drag_per_rad, seed)
        inside.append(found.damping_ratio.ci95[0] <= truth <= found.damping_ratio.ci95[1])
    # statistics: of 8 intervals of 95 %, 6 or more hold it in 99.4 % of all cases
    assert sum(inside) >= 6


def test_the_damping_at_the_swing_seen_stays_sharp_where_that_of_a_small_one_is_not() -> None:
    found, _ = damping_of(0.0, 0)
    assert found.operating_damping_ratio.std < 0.5 * found.damping_ratio.std


def test_without_a_tool_there_is_no_pendulum_and_no_drag_to_allow_for() -> None:
    recording = record(FLEXIBLE, pick_and_place(2.0), seed=1, decay_s=SHORT_S)
    alone = replace(recording.track, tcp=None, pcp=replace(recording.track.pcp, position=recording.track.pcp.position))
    with_tool = identify(recording)
    without = identify_modes(alone, recording.window).estimate
    assert without.damping_ratio.std < with_tool.damping_ratio.std


def test_no_value_changes_before_the_drag_is_sure() -> None:
    for seed in SEEDS:
        found, truth = damping_of(0.0, seed)
        # statistics: 4 standard errors of the swing seen, which with drag free are a hundred times larger
        assert abs(found.damping_ratio.value - truth) < 4 * found.operating_damping_ratio.std


def test_drag_that_no_pendulum_vouches_for_is_not_extrapolated() -> None:
    pendulum = replace(FLEXIBLE, quadratic_drag_per_rad=0.3)
    recording = record(pendulum, pick_and_place(2.0), seed=3, decay_s=4.0)
    held = identify(recording)
    alone = identify_modes(replace(recording.track, tcp=None), recording.window).estimate
    # alone, the mean swing's ratio is given, and its interval reaches down to the viscous part
    assert alone.damping_ratio.value == pytest.approx(alone.operating_damping_ratio.value)  # identity
    assert alone.damping_ratio.ci95[0] < held.damping_ratio.value < 0.6 * alone.damping_ratio.value


def weigh(drag_per_rad: float, seed: int) -> tuple[HiddenLosses, DecayFit]:
    recording = record(
        replace(FLEXIBLE, quadratic_drag_per_rad=drag_per_rad), pick_and_place(2.0), seed=seed, decay_s=1.2
    )
    sway = measure_sway(recording.track, recording.window)
    plane = fit_plane(sway, sway.time_s - recording.window.start_s, in_metres=True)
    hidden = weigh_losses(plane.samples, plane.fit, curvature=plane.sway.curvature, prior=plane.prior)
    assert hidden is not None
    return hidden, plane.fit


def test_an_angle_tells_of_hidden_losses_what_it_tells_of_the_decay() -> None:
    film = record(FLEXIBLE, pick_and_place(2.0), seed=0, decay_s=1.2)
    sway = measure_sway(film.track, film.window)
    begin = sway.time_s - film.window.start_s
    plane = fit_plane(sway, begin, in_metres=True)
    # A witness three times as sure as the way itself.
    sure = replace(plane.samples, value=plane.samples.value - 2 / 3 * plane.fit.residual)
    second = fit_decay(sure, plane.fit.parameters, plane.fit.terms, scale=plane.fit.scale / 3, prior=plane.prior)
    alone, both = (
        weigh_losses(plane.samples, plane.fit, curvature=plane.sway.curvature, prior=plane.prior, other=other)
        for other in (None, Channel(samples=sure, fit=second))
    )
    shrunk = both.sets[:, 2] / alone.sets[:, 2]
    assert np.all(shrunk < 0.8), "each set's rate should be known better"
    joined = join_fits(plane.samples, plane.fit, second, prior=plane.prior)
    # statistics: the losses take of the damping, hardly of the frequency
    assert abs(both.fit.parameters[OMEGA] / joined.parameters[OMEGA] - 1) < 1e-4


def test_a_fit_that_lost_its_way_is_not_joined_with_another() -> None:
    hidden, _ = weigh(0.0, seed=0)
    sound, places = hidden.fit, [DRAG, FRICTION]
    assert _is_sound(sound, places)
    for part in ("parameters", "covariance"):
        assert not _is_sound(replace(sound, **{part: np.nan * getattr(sound, part)}), places)
    assert not _is_sound(replace(sound, covariance=0 * sound.covariance), places)


def test_a_witness_of_the_same_swing_that_disagrees_widens_the_errors_by_the_gap() -> None:
    _, fit = weigh(0.0, seed=0)
    gap = np.zeros(len(fit.parameters))
    gap[OMEGA], gap[ALPHA] = 0.01 * fit.parameters[OMEGA], 0.5
    rate = float(fit.parameters[ALPHA])
    fit = replace(fit, rate_ci95=(rate - 0.01, rate + 0.02))
    doubted = doubt_fit(fit, replace(fit, parameters=fit.parameters + gap))
    widened = np.sqrt(np.diag(doubted.covariance - fit.covariance))
    assert widened[[OMEGA, ALPHA]] == pytest.approx(gap[[OMEGA, ALPHA]], rel=1e-9)  # identity
    assert doubted.rate_ci95 == pytest.approx((rate - np.hypot(0.01, 0.98), rate + np.hypot(0.02, 0.98)), abs=1e-4)
    # Another swing is no witness.
    gap[OMEGA] = 0.1 * fit.parameters[OMEGA]
    assert doubt_fit(fit, replace(fit, parameters=fit.parameters + gap)) is fit


@pytest.mark.parametrize("size", [1e-200, 1e200])
def test_a_search_that_ended_at_no_swing_tells_no_hidden_loss(size) -> None:
    film = record(FLEXIBLE, pick_and_place(2.0), seed=0, decay_s=SHORT_S)
    sway = measure_sway(film.track, film.window)
    plane = fit_plane(sway, sway.time_s - film.window.start_s, in_metres=True)
    assert weigh_losses(plane.samples, plane.fit, curvature=size, prior=plane.prior) is None


def test_no_loss_is_a_gain_whatever_the_noise_says() -> None:
    for seed in SEEDS:
        hidden, plain = weigh(0.0, seed)
        assert hidden.fit.parameters[DRAG] > 0
        assert hidden.fit.parameters[FRICTION] > 0
        # identity: what they take, the viscous part does not have
        assert hidden.fit.parameters[ALPHA] < plain.parameters[ALPHA] + 2 * np.sqrt(plain.covariance[ALPHA, ALPHA])


@pytest.mark.parametrize("ratio", [-3.0, -0.5, 0.0, 1.0, 6.0])
def test_a_loss_held_above_zero_has_the_moments_of_a_cut_normal_distribution(ratio) -> None:
    sigma, beside = 0.7, 0.3
    spread = np.array([[sigma**2, beside], [beside, 1.0]])
    mean, left, size = _hold_positive(np.array([ratio * sigma, 2.0]), spread, [0])
    cut = truncnorm(-ratio, np.inf, loc=ratio * sigma, scale=sigma)
    # identity: the first is cut, the second follows by regression on it
    slope = beside / sigma**2
    assert mean == pytest.approx([cut.mean(), 2.0 + slope * (cut.mean() - ratio * sigma)], rel=1e-6)
    assert left[0, 0] == pytest.approx(cut.var(), rel=1e-5)
    assert left[1, 1] == pytest.approx(1 - slope**2 * (sigma**2 - cut.var()), rel=1e-6)
    assert size == pytest.approx(np.log(2 * norm.sf(-ratio)), rel=1e-9)


def test_what_is_hidden_reaches_down_and_not_up() -> None:
    for seed in SEEDS:
        found, _ = damping_of(0.0, seed)
        low, high = found.damping_ratio.ci95
        assert 0 < low < found.damping_ratio.value < high
        assert high - found.damping_ratio.value < 0.5 * (found.damping_ratio.value - low)


def test_a_vibration_that_grows_keeps_its_own_interval() -> None:
    hidden, plain = weigh(0.0, 0)
    parameters = plain.parameters.copy()
    parameters[ALPHA] = -100 * np.sqrt(plain.covariance[ALPHA, ALPHA])
    sets = hidden.sets.copy()
    sets[:, 1] = parameters[ALPHA] - 1.0
    growing = replace(hidden, sets=sets)
    assert growing.decide(replace(plain, parameters=parameters)).rate_ci95 is None


def test_once_drag_is_sure_it_is_taken_off_the_damping_of_a_small_swing() -> None:
    sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
    from decays import film, find_mode

    _, payload, track = film(48)  # a camera with its errors sees a payload with drag
    found = identify_modes(track, find_window(track, clean_track(track))).estimate
    truth = find_mode(payload)[1]
    assert found.damping_ratio.value < found.operating_damping_ratio.value  # identity: drag damps large swings more
    assert found.damping_ratio.ci95[0] <= truth <= found.damping_ratio.ci95[1]
