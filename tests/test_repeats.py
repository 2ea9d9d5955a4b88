"""Outliers, scatter and random effects: against published numbers and exact identities."""

import io

import numpy as np
import pytest

from tagsway.errors import InputError, NotIdentifiableError
from tagsway.repeats import (
    between_repeat_spread,
    deviation_percent,
    factor_share,
    fit_random_effects,
    grubbs_limit,
    reject_beyond_sigma,
    reject_by_esd,
    reject_by_grubbs,
    summarise_repeats,
)

# Rosner's 54 values, as the NIST/SEMATECH e-Handbook of Statistical Methods has them, 1.3.5.17.3.
ROSNER = np.loadtxt(
    io.StringIO(
        """
    -0.25 0.68 0.94 1.15 1.20 1.26 1.26 1.34 1.38 1.43 1.49 1.49 1.55 1.56 1.58 1.65 1.69 1.70 1.76 1.77 1.81 1.91 1.94
    1.96 1.99 2.06 2.09 2.10 2.14 2.15 2.23 2.24 2.26 2.35 2.37 2.40 2.47 2.54 2.62 2.64 2.90 2.92 2.92 2.93 3.21 3.26
    3.30 3.59 3.68 4.30 4.64 5.34 5.42 6.01
""".replace("\n", " ")
    )
)

# Thirteen trials of BCG vaccine: cases and others among the vaccinated and the controls (Colditz et al., 1994).
BCG = np.loadtxt(
    io.StringIO(
        """
    4 119 11 128  6 300 29 274  3 228 11 209  62 13536 248 12619  33 5036 47 5761  180 1361 372 1079  8 2537 10 619
    505 87886 499 87892  29 7470 45 7232  17 1699 65 1600  186 50448 141 27197  5 2493 3 2338  27 16886 29 17825
""".replace("\n", " ")
    )
).reshape(-1, 4)


@pytest.mark.parametrize(
    ("n", "limit"), [(3, 1.155), (4, 1.481), (5, 1.715), (6, 1.887), (7, 2.020), (9, 2.215), (10, 2.290), (20, 2.709)]
)
def test_grubbs_limits_are_those_of_the_table(n, limit) -> None:
    assert grubbs_limit(n) == pytest.approx(limit, abs=1e-3)  # published value: its last digit


def test_rosners_example_has_three_outliers() -> None:
    kept = reject_by_esd(ROSNER, most=10).kept
    np.testing.assert_array_equal(np.sort(ROSNER[~kept]), [5.34, 5.42, 6.01])


@pytest.mark.parametrize(("step", "limit"), [(0, 3.159), (1, 3.151), (2, 3.144), (3, 3.136), (9, 3.085)])
def test_rosners_limits_are_those_of_the_handbook(step, limit) -> None:
    assert grubbs_limit(len(ROSNER) - step) == pytest.approx(limit, abs=6e-4)  # published value


def test_two_outliers_hide_each_other_from_grubbs_and_not_from_esd() -> None:
    values = np.array([0.2, -0.1, 0.1, 0.0, -0.2, 9.0, 9.1])
    assert reject_by_grubbs(values).kept.all()
    assert np.flatnonzero(~reject_by_esd(values, most=2).kept).tolist() == [5, 6]


def take_off_plainly(values: np.ndarray, most: int) -> np.ndarray:
    """Rosner's test as it is written: mean and deviation of all that is left, at each step."""
    left, order, outliers = list(range(len(values))), [], 0
    for step in range(most):
        distance = np.abs(values[left] - np.mean(values[left])) / np.std(values[left], ddof=1)
        passed = distance.max() > grubbs_limit(len(left))
        order.append(left.pop(int(np.argmax(distance))))
        outliers = step + 1 if passed else outliers
    kept = np.ones(len(values), dtype=bool)
    kept[order[:outliers]] = False
    return kept


@pytest.mark.parametrize("far", [0.0, 1e-3, 1e3, 1e9])
def test_outliers_of_any_size_are_taken_off_as_by_the_plain_test(far) -> None:
    rng = np.random.default_rng(0)
    for n in (5, 20, 60):
        values = 2.4 + 1e-3 * np.round(rng.normal(size=n), 1)  # some alike
        values[: n // 6] += far * rng.normal(size=n // 6)
        most = n // 3
        np.testing.assert_array_equal(reject_by_esd(values, most=most).kept, take_off_plainly(values, most))


@pytest.mark.parametrize("n", range(1, 13))
def test_three_sigma_is_powerless_up_to_ten(n) -> None:
    values = np.zeros(n)
    values[0] = 1e9
    rejection = reject_beyond_sigma(values)
    assert rejection.kept.all() == (n <= 10)
    assert bool(rejection.notices) == (n <= 10)


def test_five_to_ten_repeats_lose_a_fault_of_ten_sigma_and_few_good_ones() -> None:
    rng = np.random.default_rng(1)
    for n in (5, 7, 10):
        clean = rng.normal(size=(2000, n))
        false = np.mean([not reject_by_esd(row).kept.all() for row in clean])
        assert false == pytest.approx(0.05, abs=0.02)  # statistics: 4 standard errors
        clean[:, 0] += 10
        assert np.mean([not reject_by_esd(row).kept[0] for row in clean[:500]]) > 0.85


@pytest.mark.parametrize("reject", [reject_beyond_sigma, reject_by_esd, reject_by_grubbs])
def test_what_is_no_number_is_left_out_and_the_same_values_are_all_kept(reject) -> None:
    same = np.full(20, 0.1)
    assert reject(same).kept.all()
    same[3] = np.nan
    assert np.flatnonzero(~reject(same).kept).tolist() == [3]
    assert not reject(np.full(4, np.nan)).kept.any()
    assert not reject(np.empty(0)).kept.size


def test_the_deviation_of_damping_ratios_over_two_decades_is_that_of_the_tables() -> None:
    assert deviation_percent(np.array([1e-4, np.nan, 5e-3, 2e-2])) == pytest.approx(99.005, abs=5e-4)
    summary = summarise_repeats(np.array([2.0, 3.0, np.nan, 2.2]))
    assert (summary.n, summary.median) == (3, 2.2)
    assert summary.deviation_percent == pytest.approx(20.0)  # identity
    assert summarise_repeats(np.array([-1.0, 1.0])).deviation_percent is None
    with pytest.raises(NotIdentifiableError):
        summarise_repeats(np.array([np.nan]))


@pytest.mark.parametrize("method", ["reml", "dersimonian-laird"])
@pytest.mark.parametrize("spread", [0.02, 1.0])
def test_with_equal_errors_the_between_variance_is_that_of_the_analysis_of_variance(method, spread) -> None:
    y = 2.47 + spread * np.random.default_rng(4).normal(size=9)
    effects = fit_random_effects(y, np.full(9, 0.01), method=method)
    assert effects.between_std.value == pytest.approx(np.sqrt(np.var(y, ddof=1) - 1e-4), rel=1e-7)  # identity
    assert effects.mean.value == pytest.approx(y.mean(), rel=1e-12)
    assert effects.mean.std == pytest.approx(np.std(y, ddof=1) / 3, rel=1e-7)
    assert effects.within_std == pytest.approx(0.01, rel=1e-12)


def test_the_trials_of_bcg_vaccine_differ_as_published() -> None:
    a, b, c, d = BCG.T
    y, variance = np.log(a / (a + b) / (c / (c + d))), 1 / a - 1 / (a + b) + 1 / c - 1 / (c + d)
    effects = fit_random_effects(y, np.sqrt(variance))
    tau = effects.between_std
    # published values: the metafor package's example, dat.bcg
    assert tau.value**2 == pytest.approx(0.3132, abs=5e-5)
    assert 2 * tau.value * tau.std == pytest.approx(0.1664, abs=5e-5)
    assert tau.ci95[0] ** 2 == pytest.approx(0.1197, abs=5e-5)
    assert tau.ci95[1] ** 2 == pytest.approx(1.1115, abs=5e-5)
    assert effects.mean.value == pytest.approx(-0.7145, abs=5e-5)
    assert effects.heterogeneity == pytest.approx(152.2330, abs=5e-5)
    moments = fit_random_effects(y, np.sqrt(variance), method="dersimonian-laird")
    assert moments.between_std.value**2 == pytest.approx(0.3088, abs=5e-5)


def test_repeats_that_differ_by_their_errors_alone_have_a_spread_that_may_be_zero() -> None:
    rng = np.random.default_rng(2)
    std = rng.uniform(0.5, 2, 30)
    effects = fit_random_effects(5 + std * rng.normal(size=30), std)
    assert effects.between_std.ci95[0] == 0
    assert effects.p_value > 0.01


def test_the_interval_of_the_spread_holds_the_truth() -> None:
    rng = np.random.default_rng(3)
    inside = []
    for _ in range(250):
        std = rng.uniform(0.1, 0.6, 12)
        effects = fit_random_effects(2.5 + 0.4 * rng.normal(size=12) + std * rng.normal(size=12), std)
        low, high = effects.between_std.ci95
        inside.append(low <= 0.4 <= high)
    assert np.mean(inside) == pytest.approx(0.95, abs=0.042)  # statistics: 3 standard errors of 250 trials


def test_the_shapers_spread_is_the_one_between_repeats() -> None:
    y, std = np.array([2.3, 2.5, 2.7, np.nan]), np.array([1e-3, 1e-3, 1e-3, 1e-3])
    spread = between_repeat_spread(fit_random_effects(y, std), source="set")
    assert spread.natural_frequency_std_percent == pytest.approx(8.0, rel=1e-4)
    assert spread.n == 3


@pytest.mark.parametrize(
    ("values", "std", "error"),
    [([1.0], [0.1], NotIdentifiableError), ([1.0, 2.0], [0.0, 0.1], InputError), ([1.0, 2.0], [0.1], InputError)],
)
def test_repeats_that_cannot_be_compared_are_refused(values, std, error) -> None:
    with pytest.raises(error):
        fit_random_effects(np.array(values), np.array(std))


def test_the_share_of_a_factor_has_an_interval_that_holds_it() -> None:
    rng = np.random.default_rng(5)
    inside = []
    for _ in range(600):
        held = rng.normal(size=25)
        varied = rng.normal(size=25) + rng.normal(size=25)
        low, high = factor_share(varied, held).ci95
        inside.append(low <= 0.5 <= high)
    assert np.mean(inside) == pytest.approx(0.95, abs=0.027)  # statistics: 3 standard errors of 600 trials
    share = factor_share(2 * np.arange(5.0), np.arange(5.0))
    assert share.value == pytest.approx(0.75)  # identity: a quarter of the variance is left
    with pytest.raises(NotIdentifiableError):
        factor_share(np.arange(5.0), np.ones(5))
