"""Whether a swing is one: what a codec holds back, and poles that no payload has."""

from dataclasses import replace

import numpy as np
import pytest

from tagsway.errors import NotIdentifiableError
from tagsway.modal.decay import ALPHA, COSINE, OMEGA, PLACES, Terms, predict
from tagsway.modal.least_squares import DecayFit, Samples, fit_decay
from tagsway.modal.significance import require_oscillation, significance
from tagsway.modal.start import find_start


def fit_swing(*, amplitude_m: float, pulled_m: float) -> tuple[DecayFit, Samples]:
    """Seven cycles at 3 Hz in noise of 0.03 mm."""
    time = np.arange(250) / 100.0
    noise = 3e-5 * np.random.default_rng(4).standard_normal(len(time))
    value = amplitude_m * np.exp(-0.15 * time) * np.cos(2 * np.pi * 3 * time) + noise
    samples = Samples(time_s=time, value=value, spread=np.ones(len(time)), stated=1e-5, pulled=pulled_m)
    begun = find_start(samples)
    assert begun is not None
    return fit_decay(samples, begun[0], Terms(), scale=begun[1]), samples


def test_a_swing_of_many_times_the_noise_is_one_though_a_codec_pulls_at_it() -> None:
    fit, samples = fit_swing(amplitude_m=4.5e-4, pulled_m=2e-4)
    size = float(fit.parameters[COSINE])
    # what a codec holds back stays in the amplitude's error
    assert np.sqrt(fit.covariance[COSINE, COSINE]) > 0.2 * size
    require_oscillation(fit, samples, where="here")
    assert significance(fit) == pytest.approx(significance(fit_swing(amplitude_m=4.5e-4, pulled_m=0.0)[0]), rel=0.2)


def test_noise_is_no_swing_whatever_a_codec_did() -> None:
    with pytest.raises(NotIdentifiableError, match="nothing swings"):
        require_oscillation(*fit_swing(amplitude_m=0.0, pulled_m=2e-4), where="here")


def test_a_fit_that_strayed_to_a_pole_of_no_payload_is_answered_with_numbers() -> None:
    # such as a fit of a rest comes to: the envelope dies within a sample, the frequency is negative
    p = np.zeros(PLACES)
    p[[OMEGA, ALPHA, COSINE]] = -9e6, 2e7, 1e-3
    value, jacobian = predict(np.arange(40) / 150.0, p, replace(Terms(), drag=True))
    assert np.isfinite(value).all()
    assert np.isfinite(jacobian).all()
