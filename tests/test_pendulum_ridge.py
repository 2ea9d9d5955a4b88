"""What a pendulum's fit says of l and k together: the ridge, stated priors, checks, and two payload masses."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from example_result import example
from pendulum_scenes import BAG, FLEXIBLE, MASS_KG, STANDING, Recording, modal_of, pick_and_place, record
from tagsway.errors import InputError, NotIdentifiableError
from tagsway.model import Estimate, Pendulum, Settings, TagTrack
from tagsway.pendulum import PendulumFit, combine_masses, fit_pendulum
from tagsway.pendulum.blocks import block_covariance
from tagsway.pendulum.checks import doubt_by_mode
from tagsway.pendulum.fit import Solution
from tagsway.pendulum.model import Unknown
from tagsway.pipeline.other_mass import read_other_mass
from tagsway.store.documents import write_result


def fit(recording: Recording, *, mass_kg: float | None = MASS_KG, **stated: bool | float) -> PendulumFit:
    rng = np.random.default_rng(0)
    return fit_pendulum(recording.track, recording.window, recording.modal, mass_kg=mass_kg, rng=rng, **stated)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def moved() -> PendulumFit:
    return fit(record(FLEXIBLE, pick_and_place(4.0), seed=1))


@pytest.fixture(scope="module")
def released() -> Recording:
    return record(FLEXIBLE, STANDING, seed=4, angle_rad=0.3)


def test_the_ridge_holds_the_frequency_and_is_lowest_at_the_best_fit(moved: PendulumFit) -> None:
    ridge, found = moved.ridge, moved.estimate
    assert ridge is not None
    assert found.length_m is not None
    square = 9.81 / ridge.length_m + ridge.stiffness_over_inertia_rad2_s2
    # statistics: f is known to a part in ten thousand, l and k/J alone are not; along the ridge it goes 0.2 % with them
    np.testing.assert_allclose(square, (2 * np.pi * FLEXIBLE.natural_frequency_hz) ** 2, rtol=3e-3)
    assert np.all(np.diff(ridge.length_m) > 0)
    assert ridge.length_m[np.argmin(ridge.delta_chi2)] == pytest.approx(found.length_m.value, rel=1e-4)
    assert np.all(np.diff(ridge.delta_chi2[ridge.length_m > found.length_m.value]) > 0)


def test_the_ridge_of_a_narrow_fit_is_the_parabola_of_its_standard_error(moved: PendulumFit) -> None:
    ridge, length = moved.ridge, moved.estimate.length_m
    assert ridge is not None
    assert length is not None
    score = (ridge.length_m - length.value) / length.std
    # discretisation: l is known to 0.3 %, over which the problem is straight to a few percent; the bootstrap may widen
    assert np.all(ridge.delta_chi2 > 0.9 * score**2 - 0.02)
    assert length.ci95[0] < length.value < length.ci95[1]
    assert (length.ci95[1] - length.ci95[0]) / (2 * 1.96 * length.std) == pytest.approx(1, abs=0.05)


def test_a_decay_alone_draws_a_long_ridge(released: Recording) -> None:
    ridge = fit(released).ridge
    assert ridge is not None
    assert np.ptp(np.log(ridge.length_m)) > 0.2


def test_a_stated_point_mass_lets_a_decay_tell_k_and_is_named(released: Recording) -> None:
    found = fit(released, point_mass=True)
    assert found.estimate.determined, found.estimate.reason
    for estimate, truth in (
        (found.estimate.length_m, FLEXIBLE.length_m),
        (found.estimate.stiffness_over_inertia_rad2_s2, FLEXIBLE.stiffness_over_inertia_rad2_s2),
    ):
        assert estimate is not None
        assert abs(estimate.value - truth) < 4 * estimate.std  # statistics
    assert "prior_stated" in {notice.code for notice in found.notices}
    assert "length_over_radius" in {prior.name for prior in found.estimate.priors}


def test_a_stated_length_that_the_motion_contradicts_is_noticed() -> None:
    found = fit(record(FLEXIBLE, pick_and_place(4.0), seed=1), length_m=0.055)
    assert "prior_disagrees" in {notice.code for notice in found.notices}


@pytest.mark.parametrize("length", [0.0, -1.0, float("nan"), float("inf")])
def test_a_length_that_is_not_positive_is_refused(released: Recording, length: float) -> None:
    with pytest.raises(InputError, match="length must be positive"):
        fit(released, length_m=length)


def test_a_spring_that_is_stated_to_push_back_cuts_the_intervals_of_a_free_payload_and_is_named() -> None:
    free = record(BAG, pick_and_place(3.0), seed=2)
    plain, held = fit(free).estimate, fit(free, nonnegative_stiffness=True)
    stiffness, length = held.estimate.stiffness_over_inertia_rad2_s2, held.estimate.length_m
    assert stiffness is not None
    assert length is not None
    assert plain.stiffness_over_inertia_rad2_s2 is not None
    assert plain.length_m is not None
    assert plain.stiffness_over_inertia_rad2_s2.ci95[0] < 0  # or there was nothing to cut
    assert stiffness.ci95[0] == pytest.approx(0, abs=1e-9)  # identity
    assert stiffness.value > 0
    assert stiffness.std < 0.8 * plain.stiffness_over_inertia_rad2_s2.std  # half a bell is 0.6 as wide
    assert length.ci95[0] <= BAG.length_m <= length.ci95[1]
    assert length.std < 0.8 * plain.length_m.std
    (prior,) = (prior for prior in held.estimate.priors if prior.name == "stiffness")
    assert prior.at_least
    assert "taken as stated: k ≥ 0" in {notice.message for notice in held.notices}


def test_a_spring_that_is_stated_to_push_back_changes_nothing_where_one_is_seen(moved: PendulumFit) -> None:
    held = fit(record(FLEXIBLE, pick_and_place(4.0), seed=1), nonnegative_stiffness=True).estimate
    for own, plain in (
        (held.length_m, moved.estimate.length_m),
        (held.stiffness_over_inertia_rad2_s2, moved.estimate.stiffness_over_inertia_rad2_s2),
    ):
        assert own is not None
        assert plain is not None
        assert own.value == pytest.approx(plain.value, abs=0.02 * plain.std)  # discretisation: the profile's points
        assert own.ci95 == pytest.approx(plain.ci95, abs=0.2 * plain.std)  # the same: up to 0.1 over seeds


def test_a_motion_that_contradicts_a_spring_which_pushes_back_is_refused_all_the_same() -> None:
    film = record(BAG, pick_and_place(3.0), seed=2)
    small = replace(film.track, pcp=_shrunk(film.track.pcp), tcp=_shrunk(film.track.tcp))
    found = fit(replace(film, track=small), nonnegative_stiffness=True).estimate
    assert not found.determined
    assert "below zero" in found.reason


def _shrunk(tag: TagTrack | None) -> TagTrack:
    assert tag is not None
    return replace(tag, position=0.8 * tag.position)


def test_every_prior_is_printed(moved: PendulumFit) -> None:
    priors = {prior.name: prior.std for prior in moved.estimate.priors}
    # Noise alone looks like dry friction now and then; its prior is told where it took part.
    rubbed = moved.estimate.coulomb_friction_rad_s2 is not None
    assert ("dry_friction" in priors) == rubbed
    priors.pop("dry_friction", None)
    assert priors == {
        "quadratic_drag": 0.1,
        "scale": 0.003,
        "relative_scale": 0.005,
        "vertical_scale": 0.002,
        "gravity_tilt": np.radians(0.5),
    }


def test_a_wider_scale_widens_l() -> None:
    film = record(FLEXIBLE, pick_and_place(4.0), seed=1)
    narrow, wide = fit(film, scale_std=0.001).estimate.length_m, fit(film, scale_std=0.01).estimate.length_m
    assert narrow is not None
    assert wide is not None
    assert wide.std > 3 * narrow.std


def test_the_fit_is_held_against_the_mode_and_the_thesis_way(moved: PendulumFit) -> None:
    deviation, other = moved.estimate.deviation, moved.estimate.comparison
    assert deviation is not None
    assert abs(deviation.natural_frequency_percent) < 0.1  # statistics
    assert other is not None
    # statistics: this payload is a point mass, but the way takes the camera's word and the arc's pivot
    assert other.length_m == pytest.approx(FLEXIBLE.length_m, rel=0.02)
    omega = 2 * np.pi * FLEXIBLE.natural_frequency_hz
    assert 9.81 / other.length_m + other.stiffness_over_inertia_rad2_s2 == pytest.approx(omega**2)  # identity
    assert other.stiffness_n_m_per_rad == pytest.approx(  # identity
        other.stiffness_over_inertia_rad2_s2 * MASS_KG * other.length_m**2
    )
    assert other.max_residual_m > other.rms_residual_m > 0


def test_a_decay_of_another_frequency_is_noticed() -> None:
    film = record(FLEXIBLE, pick_and_place(4.0), seed=1)
    wrong = replace(film.modal, natural_frequency_hz=Estimate.normal(2.55, 1e-3))
    found = fit(replace(film, modal=wrong))
    assert "pendulum_disagrees" in {notice.code for notice in found.notices}


def test_a_release_that_leaves_the_frequency_of_its_decay_is_as_unsure_as_it_is_apart(released: Recording) -> None:
    own = released.modal.natural_frequency_hz
    assert own is not None
    apart = replace(
        released, modal=replace(released.modal, natural_frequency_hz=Estimate.normal(1.004 * own.value, 1e-4))
    )
    lengths = [fit(one, point_mass=True).estimate.length_m for one in (released, apart)]
    assert lengths[0] is not None
    assert lengths[1] is not None
    assert lengths[1].value == pytest.approx(lengths[0].value, rel=1e-4)  # discretisation: where the fit starts
    assert lengths[1].std > lengths[0].std


def test_what_follows_the_frequency_is_in_doubt_by_the_gap_to_the_decay() -> None:
    frequency, length = Unknown.LOG_FREQUENCY, Unknown.LOG_LENGTH
    rest, covariance = np.zeros((3, 1)), np.zeros((len(Unknown), len(Unknown)))
    covariance[np.ix_([frequency, length], [frequency, length])] = [[1e-8, -1.5e-8], [-1.5e-8, 1e-5]]
    fitted = Solution(
        parameters=np.zeros(len(Unknown)), covariance=covariance, scattered=covariance, predicted=rest,
        angle_rad=rest[0], noise_m=1e-4, excess=1.0, rms_m=0.0, max_m=0.0, largest_pull=0.0, left_out=0.0, alone=1.0,
        tag_ratio=1.0,
    )  # fmt: skip
    modes = [replace(modal_of(FLEXIBLE), natural_frequency_hz=Estimate.normal(hz, 1e-4)) for hz in (1.004, 1.0002)]
    apart, near = (doubt_by_mode(fitted, mode) for mode in modes)
    grown = apart.scattered - covariance
    # identity: l follows f by C_lf / C_ff = -1.5, both by the whole gap
    assert grown[frequency, frequency] == pytest.approx(np.log(1.004) ** 2)
    assert grown[length, length] == pytest.approx((1.5 * np.log(1.004)) ** 2)
    assert near is fitted


def test_a_move_tells_its_lengths_whatever_the_frequency_of_its_decay(moved: PendulumFit) -> None:
    film = record(FLEXIBLE, pick_and_place(4.0), seed=1)
    own = film.modal.natural_frequency_hz
    assert own is not None
    apart = replace(film, modal=replace(film.modal, natural_frequency_hz=Estimate.normal(1.004 * own.value, 1e-4)))
    lengths = [one.estimate.length_m for one in (moved, fit(apart))]
    assert lengths[0] is not None
    assert lengths[1] is not None
    assert lengths[1].std == pytest.approx(lengths[0].std, rel=0.05)  # discretisation: where the fit starts


def frequency_of(length_m: float, stiffness: float, mass_kg: float) -> float:
    return Pendulum(
        length_m=length_m, tag_radius_m=length_m, stiffness_over_inertia_rad2_s2=stiffness / (mass_kg * length_m**2)
    ).natural_frequency_hz


def test_two_masses_tell_l_and_k() -> None:
    frequencies = [Estimate.normal(frequency_of(0.04585, 0.013, mass), 1e-4) for mass in (0.225, 0.4)]
    found, notice = combine_masses(frequencies[0], 0.225, frequencies[1], 0.4, file="other.json")
    assert found.length_m.value == pytest.approx(0.04585, rel=1e-9)  # identity
    assert found.stiffness_n_m_per_rad.value == pytest.approx(0.013, rel=1e-9)  # identity
    assert "0.5 mm" in notice.message


def test_half_a_millimetre_between_two_arms_moves_k_by_as_much_as_is_said() -> None:
    first = Estimate.normal(frequency_of(0.04585, 0.013, 0.225), 1e-6)
    second = Estimate.normal(frequency_of(0.04635, 0.013, 0.4), 1e-6)
    found, _ = combine_masses(first, 0.225, second, 0.4, file="other.json")
    shift = abs(0.013 / found.stiffness_n_m_per_rad.value - 1)
    assert 100 * shift == pytest.approx(found.stiffness_shift_percent, rel=1e-6)  # identity: of the value that is told
    assert abs(found.stiffness_n_m_per_rad.value - 0.013) < 2 * found.stiffness_n_m_per_rad.std
    # published: the notes on two masses give 8 to 23 %
    assert 5 < found.stiffness_shift_percent < 40


def test_masses_that_cannot_tell_are_refused() -> None:
    frequency = Estimate.normal(2.5, 1e-3)
    with pytest.raises(InputError, match="too near"):
        combine_masses(frequency, 0.2, frequency, 0.204, file="other.json")
    with pytest.raises(NotIdentifiableError, match="no common arm"):
        combine_masses(Estimate.normal(2.5, 1e-3), 0.2, Estimate.normal(0.5, 1e-3), 0.4, file="other.json")


def test_blocks_of_white_residuals_scatter_as_the_information_says() -> None:
    rng = np.random.default_rng(3)
    slopes, residual = rng.standard_normal((2, 1000, 2)), rng.standard_normal((2, 1000))
    information = np.einsum("cni,cnj->ij", slopes, slopes)
    # statistics: 24 blocks know a variance to about a third
    np.testing.assert_allclose(np.diag(block_covariance(slopes, residual, block=40)), np.diag(information), rtol=0.35)


def test_blocks_of_slow_residuals_scatter_more() -> None:
    rng = np.random.default_rng(4)
    slow = np.convolve(rng.standard_normal(1019), np.ones(20) / np.sqrt(20), mode="valid")
    slopes = np.ones((1, 1000, 1))
    assert block_covariance(slopes, slow[None], block=100)[0, 0] > 5 * 1000 * np.var(slow)


@pytest.mark.parametrize(("mass_kg", "fault"), [(None, "no mass"), (0.4, None)])
def test_another_result_gives_its_mass_and_frequency_or_says_what_it_lacks(
    tmp_path: Path, mass_kg: float | None, fault: str | None
) -> None:
    result, _ = example()
    settings = replace(result.source.settings, mass_kg=mass_kg)
    path = tmp_path / "other.json"
    write_result(path, replace(result, source=replace(result.source, settings=settings)))
    if fault is not None:
        with pytest.raises(InputError, match=fault):
            read_other_mass(path)
        return
    other = read_other_mass(path)
    assert other.mass_kg == mass_kg
    assert result.modal is not None
    assert other.frequency_hz == result.modal.natural_frequency_hz


def test_a_second_mass_without_the_first_is_refused() -> None:
    with pytest.raises(InputError, match="--with needs --mass"):
        Settings(other="other.json")
