"""The estimators that were asked for, beside the one that decides."""

from dataclasses import replace

import numpy as np

from tagsway.modal.bound import to_modal
from tagsway.modal.decay import ALPHA, OMEGA
from tagsway.modal.delta import centre, estimate_of, small_swing_damping
from tagsway.modal.least_squares import DecayFit, Samples
from tagsway.modal.peaks import Peaks, measure_decay_rate, measure_decrement, measure_period
from tagsway.modal.spectrum import find_peaks_of, find_spectrum, find_spectrum_peak, measure_half_power
from tagsway.model import Estimate, Estimates, EstimatorDetails, EstimatorResult, FloatArray, SpectrumCurve


def describe_estimators(samples: Samples, fit: DecayFit, peaks: Peaks, *, on_curve: Peaks) -> EstimatorDetails:
    """Return how fine the spectrum is, and the two estimators that are only shown for comparison.

    Parameters
    ----------
    samples : Samples
        What was fitted.
    fit : DecayFit
        Of these samples.
    peaks, on_curve : Peaks
        Of the same, and of the fitted curve.

    Returns
    -------
    EstimatorDetails
    """
    span = float(samples.time_s[-1] - samples.time_s[0])
    curve = find_spectrum(samples.time_s, centre(samples, fit))
    (frequency, damping), _ = to_modal(fit.parameters)
    nothing = EstimatorResult(natural_frequency_hz=None, damping_ratio=None)
    half = measure_half_power(samples.time_s, centre(samples, fit), near_hz=frequency)
    clean = measure_half_power(samples.time_s, centre(samples, fit) - fit.residual, near_hz=frequency)
    cycles, rate = measure_decrement(peaks, noise=fit.scale)
    of_curve = measure_decrement(on_curve, noise=fit.scale)[1]
    return EstimatorDetails(
        spectrum_window="Hann",
        spectrum_resolution_hz=2 / span,
        spectrum_bin_hz=float(curve.frequency_hz[1]),
        half_power=nothing
        if half is None or clean is None
        else EstimatorResult(
            natural_frequency_hz=_with_bias(
                Estimate.normal(half[0], half[2]), Estimate.normal(clean[0], half[2]), frequency
            ),
            damping_ratio=_with_bias(
                Estimate.normal(half[1], half[2] / half[0]), Estimate.normal(clean[1], half[2] / half[0]), damping
            ),
        ),
        decrement_cycles=cycles,
        decrement_over_cycles=EstimatorResult(
            natural_frequency_hz=None,
            damping_ratio=_with_bias(_of_decrement(rate), _of_decrement(of_curve), damping),
        ),
    )


def _of_decrement(rate: Estimate | None) -> Estimate | None:
    """Return ζ = δ / √((2π)² + δ²)."""
    if rate is None:
        return None
    return Estimate.normal(rate.value / float(np.hypot(2 * np.pi, rate.value)), rate.std / (2 * np.pi))


def _from_zero(estimate: Estimate) -> Estimate:
    """Return an estimate of what cannot be negative."""
    low, high = estimate.ci95
    return replace(estimate, value=max(estimate.value, 0.0), ci95=(max(low, 0.0), high))


def compare_estimators(
    samples: Samples, fit: DecayFit, peaks: Peaks, *, on_curve: Peaks, held: bool = True
) -> Estimates:
    """Return all estimators; each rival's error holds how far it is off on the fitted curve itself."""
    (frequency, damping), jacobian = to_modal(fit.parameters)
    damped = float(fit.parameters[OMEGA]) / (2 * np.pi)
    up = float(np.hypot(fit.parameters[OMEGA], fit.parameters[ALPHA]) / fit.parameters[OMEGA])
    clean = centre(samples, fit) - fit.residual
    # A vibration that grows is not a free decay: it has no damping ratio.
    decay_rate = small_swing_damping(fit, samples.time_s, held=held)

    def frequency_of(found: Peaks) -> Estimate | None:
        period = measure_period(found)
        if period is None:
            return None
        value = up / period.value
        return Estimate.normal(value, value * period.std / period.value, low=0.0)

    def damping_of(found: Peaks) -> Estimate | None:
        rate = measure_decay_rate(found, noise=fit.scale)
        if rate is None:
            return None
        decrement = rate.value / damped
        value = decrement / np.hypot(2 * np.pi, decrement)
        scale = (1 - value**2) / float(np.hypot(2 * np.pi * damped, rate.value))
        half = (rate.ci95[1] - rate.value) * scale
        return Estimate(
            value=max(float(value), 0.0),
            std=rate.std * scale,
            ci95=(max(float(value) - half, 0.0), max(float(value) + half, 0.0)),
        )

    periods = _with_bias(frequency_of(peaks), frequency_of(on_curve), frequency)
    decrement = _with_bias(damping_of(peaks), damping_of(on_curve), damping)
    return Estimates(
        maximum_likelihood=EstimatorResult(
            natural_frequency_hz=estimate_of(fit, frequency, jacobian[0], low=0.0),
            damping_ratio=None if decay_rate.ci95[1] < 0 else _from_zero(decay_rate),
        ),
        fft=EstimatorResult(natural_frequency_hz=_spectral(samples, fit, clean, up, frequency), damping_ratio=None),
        log_decrement=EstimatorResult(natural_frequency_hz=periods, damping_ratio=decrement),
        periods=EstimatorResult(natural_frequency_hz=periods, damping_ratio=None),
    )


def _with_bias(found: Estimate | None, on_clean: Estimate | None, truth: float) -> Estimate | None:
    if found is None:
        return None
    bias = 0.0 if on_clean is None else on_clean.value - truth
    wider = float(np.hypot(1.0, bias / found.std)) if found.std > 0 else 1.0
    std = float(np.hypot(found.std, bias))
    low, high = found.ci95
    middle, half = 0.5 * (low + high), max(0.5 * (high - low) * wider, 1.96 * std)
    return Estimate(value=found.value, std=std, ci95=(max(middle - half, 0.0), max(middle + half, 0.0)))


def _spectral(samples: Samples, fit: DecayFit, clean: FloatArray, up: float, truth: float) -> Estimate | None:
    curve = find_spectrum(samples.time_s, centre(samples, fit))
    span = float(samples.time_s[-1] - samples.time_s[0])
    tops = find_peaks_of(curve, lowest_hz=1 / span, count=1)
    if not tops:
        return None
    peak = find_spectrum_peak(samples.time_s, centre(samples, fit), near_hz=tops[0])
    rival = find_spectrum_peak(samples.time_s, clean, near_hz=tops[0])
    noise = up * peak.unit_std_hz * fit.scale * float(np.sqrt(fit.inflation))
    return _with_bias(
        Estimate.normal(up * peak.frequency_hz, noise, low=0.0),
        Estimate.normal(up * rival.frequency_hz, noise, low=0.0),
        truth,
    )


def draw_spectrum(samples: Samples, fit: DecayFit) -> SpectrumCurve:
    """Return the decay's spectrum up to ten times its frequency.

    Parameters
    ----------
    samples : Samples
        What was fitted.
    fit : DecayFit
        Of these samples.

    Returns
    -------
    SpectrumCurve
        Amplitude in the signal's unit.
    """
    curve = find_spectrum(samples.time_s, centre(samples, fit))
    shown = curve.frequency_hz <= max(10 * fit.parameters[OMEGA] / (2 * np.pi), curve.frequency_hz[-1] / 20)
    return SpectrumCurve(frequency_hz=curve.frequency_hz[shown], amplitude=curve.amplitude[shown])
