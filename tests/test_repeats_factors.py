"""What factors do: known effects come back, what was not varied apart is not answered."""

import numpy as np
import pytest

from tagsway.errors import InputError, NotIdentifiableError
from tagsway.model import FactorModel
from tagsway.repeats import fit_factor_effects


def effect_of(model: FactorModel, factor: str, level: str | None = None) -> tuple[float, float]:
    (found,) = [e for e in model.effects if e.factor == factor and e.level == level]
    return found.effect.value, found.effect.std


def reasons(model: FactorModel) -> dict[str, str]:
    return {one.factor: one.reason for one in model.unanswered}


def test_effects_without_scatter_come_back_exactly() -> None:
    gripper, vacuum = ["b", "a", "c"] * 8, [500.0, 500, 500, 600, 600, 600, 700, 700, 700, 500, 500, 600] * 2
    y = [2.0 + {"a": 0.0, "b": 0.3, "c": -0.1}[g] + 1e-3 * v for g, v in zip(gripper, vacuum, strict=True)]
    model = fit_factor_effects(np.array(y), {"gripper": gripper, "vacuum_mbar": vacuum, "robot": ["x"] * 24})
    assert effect_of(model, "gripper", "b") == pytest.approx((0.3, 0), abs=1e-12)  # identity
    assert effect_of(model, "gripper", "c") == pytest.approx((-0.1, 0), abs=1e-12)
    assert effect_of(model, "vacuum_mbar") == pytest.approx((1e-3, 0), abs=1e-14)
    assert {(e.factor, e.level, e.reference, e.n) for e in model.effects} == {
        ("gripper", "b", "a", 8), ("gripper", "c", "a", 8), ("vacuum_mbar", None, None, 24),
    }  # fmt: skip
    assert not model.unanswered, "a factor that does not vary is not spoken of"


def test_two_groups_differ_with_the_standard_error_of_two_means() -> None:
    rng = np.random.default_rng(0)
    a, b = 0.01 * rng.normal(size=30), 0.1 * rng.normal(size=20)
    model = fit_factor_effects(np.r_[a, b], {"cup": ["a"] * 30 + ["b"] * 20})
    value, std = effect_of(model, "cup", "b")
    assert value == pytest.approx(b.mean() - a.mean(), rel=1e-12)  # identity
    # identity: the jackknife of a mean of n is s²/(n - 1) · n/(n - 1) · (n - 1)/n per group, up to (G - 1)/G = 49/50
    expected = sum(np.sum((x - x.mean()) ** 2) / (len(x) - 1) ** 2 for x in (a, b)) * 49 / 50
    assert std == pytest.approx(np.sqrt(expected), rel=1e-12)


@pytest.mark.parametrize("unequal", [1.0, 6.0])
def test_intervals_hold_the_effect_where_levels_scatter_unequally(unequal) -> None:
    rng = np.random.default_rng(1)
    cup = np.array(["a"] * 10 + ["b"] * 15)
    speed = rng.uniform(1, 2, 25)
    inside = []
    for _ in range(800):
        y = 0.2 * (cup == "b") + 0.5 * speed + rng.normal(size=25) * np.where(cup == "b", unequal, 1.0)
        low, high = fit_factor_effects(y, {"cup": list(cup), "speed": list(speed)}).effects[0].effect.ci95
        inside.append(low <= 0.2 <= high)
    # statistics: 3 standard errors of 800 trials; the jackknife may be somewhat too wide
    assert 0.95 - 0.023 <= np.mean(inside) <= 0.99


def test_samples_nested_in_a_gripper_are_the_repeats() -> None:
    rng = np.random.default_rng(2)
    sample = np.repeat(np.arange(12), 10)
    gripper = np.where(sample < 6, "a", "b")
    inside, naive = [], []
    for _ in range(300):
        y = rng.normal(size=12)[sample] + 0.1 * rng.normal(size=120)
        model = fit_factor_effects(y, {"gripper": list(gripper), "sample": list(sample)}, labels=frozenset({"sample"}))
        assert model.grouped_by == "sample"
        assert "nested in gripper" in reasons(model)["sample"]
        low, high = model.effects[0].effect.ci95
        inside.append(low <= 0 <= high)
        low, high = fit_factor_effects(y, {"gripper": list(gripper)}).effects[0].effect.ci95
        naive.append(low <= 0 <= high)
    assert 0.95 - 0.038 <= np.mean(inside) <= 1.0  # statistics: 3 standard errors of 300 trials
    assert np.mean(naive) < 0.6, "120 repeats of 12 samples are not 120 samples"


@pytest.mark.parametrize(
    ("factors", "confounded"),
    [
        ({"gripper": ["a", "b"] * 10, "vacuum": [500, 600] * 10, "speed": [1, 1, 2, 2] * 5}, {"gripper", "vacuum"}),
        (
            {"a": [0, 0, 1, 1] * 5, "b": [0, 1, 0, 1] * 5, "sum": [0, 1, 1, 2] * 5, "speed": [1, 2, 3, 4, 5] * 4},
            {"a", "b", "sum"},
        ),
        (
            {"a": list(np.arange(20.0)), "b": list(np.arange(20.0) + [0.1, -0.1] * 10), "speed": [1, 1, 2, 2] * 5},
            {"a", "b"},
        ),
    ],
)
def test_factors_that_were_not_varied_apart_are_noticed_and_not_answered(factors, confounded) -> None:
    y = np.random.default_rng(3).normal(size=20)
    model = fit_factor_effects(y, factors)
    assert set(reasons(model)) == confounded
    assert all("confounded with" in reason for reason in reasons(model).values())
    assert {effect.factor for effect in model.effects} == {"speed"}


def test_a_level_seen_once_is_not_answered_and_spoils_nothing() -> None:
    y = np.r_[np.random.default_rng(4).normal(size=20), 99.0]
    model = fit_factor_effects(y, {"cup": ["a", "b"] * 10 + ["c"]})
    assert [(one.level, "rests on one measurement" in one.reason) for one in model.unanswered] == [("c", True)]
    value, std = effect_of(model, "cup", "b")
    assert value == pytest.approx(y[1:20:2].mean() - y[0:20:2].mean())  # identity
    assert 0 < std < 2


def test_factors_that_interact_are_noticed() -> None:
    rng = np.random.default_rng(5)
    a, b = np.array([0, 0, 1, 1] * 10), np.array([0, 1, 0, 1] * 10)
    factors = {"a": [str(v) for v in a], "b": [str(v) for v in b]}
    noise = 0.1 * rng.normal(size=40)
    added, interacting = (fit_factor_effects(a + b + more * a * b + noise, factors) for more in (0, 1))
    assert interacting.lack_of_fit_p < 1e-6 < 0.01 < added.lack_of_fit_p
    assert fit_factor_effects(noise, {"speed": list(np.arange(40.0))}).lack_of_fit_p is None


def test_what_is_not_stated_everywhere_or_names_each_measurement_is_left_out_with_the_reason() -> None:
    y = np.random.default_rng(6).normal(size=12)
    factors = {
        "cup": ["a", "b"] * 6,
        "humidity": [40.0, np.nan] + [50.0] * 10,
        "operator": ["x"] * 11 + [""],
        "product": list(range(12)),
        "robot": [None] * 12,
    }
    model = fit_factor_effects(y, factors, labels=frozenset({"product"}))
    assert reasons(model) == {
        "humidity": "not stated for 1 of 12 measurements",
        "operator": "not stated for 1 of 12 measurements",
        "product": "names each measurement",
    }
    assert [effect.factor for effect in model.effects] == ["cup"]


def test_numbers_that_are_names_have_levels_in_the_order_of_their_values() -> None:
    y = np.arange(30.0) % 3
    model = fit_factor_effects(y, {"sample": [2, 9, 10] * 10}, labels=frozenset({"sample"}))
    assert [(e.level, e.reference, e.effect.value) for e in model.effects] == [
        ("9", "2", pytest.approx(1)),
        ("10", "2", pytest.approx(2)),
    ]


@pytest.mark.parametrize(
    ("values", "factors", "error"),
    [
        ([1.0, 2, 3, 4, 5], {"a": ["x", "y"]}, InputError),
        ([1.0, 2, 3, 4, 5], {"a": ["x"] * 5}, NotIdentifiableError),
        ([1.0, 2, 3, 4], {"a": ["x", "y"] * 2}, NotIdentifiableError),
        ([1.0, 2, np.nan, np.nan, np.nan], {"a": ["x", "y", "x", "y", "x"]}, NotIdentifiableError),
        ([], {"a": []}, NotIdentifiableError),
        ([1.0, 2, 3, 4, 5], {}, NotIdentifiableError),
    ],
)
def test_too_little_is_refused(values, factors, error) -> None:
    with pytest.raises(error):
        fit_factor_effects(np.array(values), factors)
