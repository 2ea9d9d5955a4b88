"""Two sets of repeats against each other: numbers by hand and by scipy's own tests."""

import numpy as np
import pytest
from scipy import stats

from tagsway.errors import InputError
from tagsway.repeats import adjust_holm, compare_repeats, rate_gain, share_interval

INFINITE = float("inf")


def test_difference_interval_and_p_are_those_of_welch_s_test() -> None:
    rng = np.random.default_rng(1)
    for n, m in ((2, 3), (5, 4), (12, 25)):
        a, b = rng.normal(1.13, 0.02, n), rng.normal(1.18, 0.06, m)
        found, known = compare_repeats(a, b), stats.ttest_ind(b, a, equal_var=False)
        interval = known.confidence_interval(0.95)
        assert found.test == "welch"
        assert found.difference == pytest.approx(np.mean(b) - np.mean(a))  # identity
        assert found.p_value == pytest.approx(known.pvalue)
        assert found.ci95 == pytest.approx((interval.low, interval.high))
        assert found.median_difference == pytest.approx(np.median(b) - np.median(a))


def test_the_rank_test_is_exact_for_few_repeats_with_and_without_ties() -> None:
    apart = compare_repeats(np.array([1.0, 1.1, 1.2, 1.3]), np.array([2.0, 2.1, 2.2, 2.3]))
    assert apart.rank_p_value == pytest.approx(2 / 70)  # identity: of 70 ways to deal them, these two are as far apart
    tied = compare_repeats(np.array([1.0, 1.0, 1.0]), np.array([2.0, 2.0, 2.0]))
    assert tied.rank_p_value == pytest.approx(2 / 20)


def test_what_never_settled_is_longer_than_all_that_did_and_has_no_mean() -> None:
    found = compare_repeats(np.array([INFINITE] * 5), np.array([1.1, 1.2, 1.15, 1.12, 1.18]))
    assert found.test == "mann-whitney"
    assert found.p_value == pytest.approx(2 / 252)  # identity
    assert found.difference is None
    assert found.ci95 is None
    assert found.median_difference is None
    some = compare_repeats(np.array([1.4, 1.5, INFINITE]), np.array([1.1, 1.2, 1.15]))
    assert some.median_difference == pytest.approx(-0.35)


def test_one_pair_has_a_difference_and_no_test() -> None:
    found = compare_repeats(np.array([1.0, np.nan]), np.array([1.2]))
    assert (found.n_reference, found.n) == (1, 1)
    assert found.difference == pytest.approx(0.2)
    assert found.ratio_percent == pytest.approx(120)
    assert (found.test, found.p_value, found.ci95, found.ratio_ci95) == (None, None, None, None)


def test_repeats_that_are_all_the_same_give_no_difference() -> None:
    found = compare_repeats(np.full(6, 0.965), np.full(6, 0.965))
    assert (found.difference, found.p_value, found.test) == (0.0, 1.0, "mann-whitney")
    nothing = compare_repeats(np.array([np.nan]), np.array([1.0, 2.0]))
    assert (nothing.n_reference, nothing.difference, nothing.p_value) == (0, None, None)


def test_repeats_of_one_population_are_called_different_at_the_stated_rate() -> None:
    rng = np.random.default_rng(7)
    p = [compare_repeats(rng.normal(1, 0.1, 4), rng.normal(1, 0.02, 6)).p_value for _ in range(600)]
    assert np.mean(np.array(p) < 0.05) == pytest.approx(0.05, abs=0.027)  # statistics: 3 of its errors


def test_the_interval_of_a_ratio_holds_the_truth_as_often_as_it_says() -> None:
    rng = np.random.default_rng(8)
    inside = 0
    for _ in range(400):
        found = compare_repeats(rng.normal(4.0, 0.4, 5), rng.normal(1.0, 0.2, 5))
        inside += found.ratio_ci95 is not None and found.ratio_ci95[0] <= 25 <= found.ratio_ci95[1]
    assert inside / 400 == pytest.approx(0.95, abs=0.033)  # statistics


def test_a_ratio_to_what_may_be_nothing_has_no_interval() -> None:
    assert compare_repeats(np.array([-0.1, 0.12, 0.01]), np.array([1.0, 1.1, 1.05])).ratio_ci95 is None


def test_holm_corrects_for_the_number_of_tests() -> None:
    adjusted = adjust_holm(np.array([0.01, np.nan, 0.04, 0.03, 0.005]))
    np.testing.assert_allclose(adjusted, [0.03, np.nan, 0.06, 0.06, 0.02])  # by hand: 4·.005, 3·.01, 2·.03, then ≥


def test_picks_gained_are_those_of_the_mean_times_with_an_interval_that_holds_the_truth() -> None:
    gained, std, interval = rate_gain(np.array([2.0, 2.0]), np.array([1.5]), rest_s=1.0)
    assert gained == pytest.approx(60 / 2.5 - 60 / 3)  # identity
    assert (std, interval) == (None, None)
    rng = np.random.default_rng(9)
    inside = 0
    for _ in range(400):
        _, _, interval = rate_gain(rng.normal(1.3, 0.05, 5), rng.normal(1.1, 0.02, 5))
        assert interval is not None
        inside += interval[0] <= 60 / 1.1 - 60 / 1.3 <= interval[1]
    assert inside / 400 == pytest.approx(0.95, abs=0.033)  # statistics
    with pytest.raises(InputError, match="expected a time"):
        rate_gain(np.array([0.0]), np.array([1.0]))


def test_the_share_that_keeps_a_limit_has_an_exact_interval() -> None:
    assert share_interval(10, 10) == pytest.approx((0.025**0.1, 1.0))  # identity: Clopper and Pearson in closed form
    assert share_interval(0, 5)[0] == 0
