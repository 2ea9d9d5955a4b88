"""The search for a decay's parameters ends at the least soft-L1 cost, from near and far, among spikes."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from tagsway.modal.decay import PLACES, SOFTENING, Terms, predict
from tagsway.modal.least_squares import Samples, Softening, solve
from tagsway.modal.uncertainty import SOFT

TRUTH = np.pad([15.0, 0.3, 4.0, -3.0, 0.5, 0.02, 0.05], (0, PLACES - 7))
TERMS = Terms(softening=True, drag=True)
NOISE = 0.05


def make_samples(*, spikes: int = 0) -> Samples:
    rng = np.random.default_rng(3)
    time = np.arange(0, 4, 0.01)
    value = predict(time, TRUTH, TERMS)[0] + NOISE * rng.normal(size=len(time))
    value[rng.choice(len(time), spikes, replace=False)] += 5.0
    return Samples(time_s=time, value=value, spread=np.ones(len(time)))


def find_least(samples: Samples, prior: Softening | None = None) -> np.ndarray:
    """Return what SciPy's own search ends at; a prior is a residual that no soft loss plays down."""
    free = TERMS.free

    def left(p: np.ndarray) -> np.ndarray:
        whole = np.zeros(PLACES)
        whole[free] = p
        reduced = (predict(samples.time_s, whole, TERMS)[0] - samples.value) / NOISE
        soft = np.sqrt(2) * SOFT * np.sqrt(np.sqrt(1 + (reduced / SOFT) ** 2) - 1) * np.sign(reduced)
        return soft if prior is None else np.append(soft, (whole[SOFTENING] - prior.mean) / prior.std)

    return least_squares(left, TRUTH[free], x_scale="jac", xtol=1e-12, ftol=1e-12, gtol=1e-12).x


def standard_errors(samples: Samples) -> np.ndarray:
    rows = predict(samples.time_s, TRUTH, TERMS)[1][:, TERMS.free] / NOISE
    return np.sqrt(np.diag(np.linalg.inv(rows.T @ rows)))


@pytest.mark.parametrize("spikes", [0, 20])
@pytest.mark.parametrize("off", [1.001, 1.02], ids=["near", "far"])
def test_a_search_ends_at_the_least_cost(spikes, off) -> None:
    samples = make_samples(spikes=spikes)
    start = TRUTH * np.pad([off, 2, 0.7, 1.3, 1], (0, PLACES - 5))
    found, deviance = solve(samples, start, TERMS, scale=NOISE)
    # Discretisation: a step that promises less than a millionth of the deviance is the last one.
    away = (found[TERMS.free] - find_least(samples)) / standard_errors(samples)
    assert np.abs(away).max() < 0.01
    assert deviance < solve(samples, TRUTH, TERMS, scale=NOISE)[1] + 1e-5


def test_what_is_known_before_pulls_as_much_as_it_should() -> None:
    samples, prior = make_samples(spikes=5), Softening(mean=0.01, std=1e-4)
    found, _ = solve(samples, TRUTH, TERMS, scale=NOISE, prior=prior)
    least = find_least(samples, prior)
    # Discretisation, as above; the prior, seven of the samples' own errors away, is the smaller error here.
    assert np.abs((found[TERMS.free] - least) / standard_errors(samples)).max() < 0.01
    assert found[SOFTENING] == pytest.approx(prior.mean, abs=3 * prior.std)


def test_the_last_steps_are_newtons(monkeypatch) -> None:
    looks = []

    def count(*given):
        looks.append(given)
        return predict(*given)

    monkeypatch.setattr("tagsway.modal.least_squares.predict", count)
    # Among spikes, where weights that follow the residuals would come nearer by a constant share only.
    solve(make_samples(spikes=20), TRUTH, TERMS, scale=NOISE)
    assert len(looks) <= 6
