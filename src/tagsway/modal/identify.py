"""From a window of a track to its first mode, every estimator beside the one that decides."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student_t

from tagsway.errors import NotIdentifiableError
from tagsway.modal.bound import to_modal
from tagsway.modal.decay import ALPHA, ARC, COSINE, DRAG, OFFSET, OMEGA, PROJECTION, SINE, SLOPE, SOFTENING, Terms
from tagsway.modal.decay import envelope as find_envelope
from tagsway.modal.least_squares import DecayFit, Samples, Softening, extend, fit_decay
from tagsway.modal.peaks import Peaks, find_peaks, measure_decay_rate, measure_period
from tagsway.modal.significance import require_oscillation
from tagsway.modal.spectrum import find_peaks_of, find_spectrum, find_spectrum_peak
from tagsway.modal.start import find_start
from tagsway.modal.sway import Sway, check_window, measure_sway
from tagsway.model import (
    GRAVITY_M_S2,
    BackbonePoint,
    Bound,
    DecayCurve,
    Estimate,
    Estimates,
    EstimatorResult,
    FloatArray,
    ModalEstimate,
    ModeEstimate,
    Notice,
    SpectrumCurve,
    Track,
    Window,
)

GRAVITY_SHARE = (0.9, 0.1)
"""Share of gravity in ω_n², and its standard deviation, where a track without a scale cannot tell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ModalFit:
    """What the free decay told, and the curves that show it.

    Parameters
    ----------
    estimate : ModalEstimate
        The numbers.
    decay : DecayCurve
        Along the main axis, in the track's length unit.
    spectrum : SpectrumCurve
        Zero-padded, Hann window.
    notices : tuple of Notice
        What is odd or weak.
    """

    estimate: ModalEstimate
    decay: DecayCurve
    spectrum: SpectrumCurve
    notices: tuple[Notice, ...]


def identify_modes(track: Track, window: Window, *, sway_axis: str | None = None) -> ModalFit:
    """Identify natural frequency and damping from the free decay in a window.

    Parameters
    ----------
    track : Track
        Raw: the fit is made for noise, spikes and gaps.
    window : Window
        The free vibration, inside the record.
    sway_axis : str, optional
        "x", "z" or degrees from x towards z; by default the main axis of the sway.

    Returns
    -------
    ModalFit

    Raises
    ------
    InputError
        Where the window does not lie inside the record.
    NotIdentifiableError
        Where no damped oscillation stands out of the noise.

    Notes
    -----
    Do not use it for a forced or a growing vibration, or for two close modes, whose beat looks like odd damping.
    """
    check_window(window, track.time_s)
    sway = measure_sway(track, window, sway_axis=sway_axis)
    samples = Samples(time_s=sway.time_s - window.start_s, value=sway.value, spread=sway.spread)
    fit = fit_sway(sway, samples, in_metres=track.length_unit == "m")
    require_oscillation(fit, samples, where=f"between {window.start_s:g} and {window.end_s:g} s")
    peaks = find_peaks(samples.time_s, _centred(samples, fit), 2 * np.pi / fit.parameters[OMEGA])
    estimates = _compare(samples, fit, peaks)
    modal = _estimate(track, window, sway, samples, fit, estimates)
    decay = _decay_curve(window, sway, samples, fit, peaks)
    spectrum = _spectrum(samples, fit)
    return ModalFit(estimate=modal, decay=decay, spectrum=spectrum, notices=_notices(modal, fit, sway))


def fit_sway(sway: Sway, samples: Samples, *, in_metres: bool) -> DecayFit:
    """Fit a decay to a sway, with the softening that its arc implies.

    Parameters
    ----------
    sway : Sway
        For its curvature.
    samples : Samples
        The same, from the window's start.
    in_metres : bool
        Whether gravity can be compared with the arc's radius.

    Returns
    -------
    DecayFit

    Raises
    ------
    NotIdentifiableError
        Where there is nothing to fit.

    Notes
    -----
    Over a decay that hardly decays, the frequency at the amplitude seen and the softening cannot be told apart by the
    samples. The arc gives the amplitude as an angle, and so the softening: κ q0² / 16, with κ = g / (r ω_n²), at
    most 1, for the share of gravity in ω_n². It enters as a prior of 10 %. A straight path has no softening.
    """
    start = find_start(samples)
    if start is None:
        raise NotIdentifiableError("nothing swings: too few samples of the product, or it does not move")
    p, scale = start
    shape = ARC if sway.planar else PROJECTION
    fit = fit_decay(samples, p, Terms(shape=shape), scale=scale)
    prior = None
    if sway.planar and sway.curvature > 0:
        for _ in range(2):
            prior = _softening_of_arc(sway, fit, in_metres=in_metres)
            first = fit.parameters.copy()
            first[SOFTENING] = first[SOFTENING] or prior.mean
            fit = fit_decay(samples, first, replace(fit.terms, softening=True), scale=fit.scale, prior=prior)
    return extend(samples, fit, prior=prior, straight=sway.planar and prior is None)


def _softening_of_arc(sway: Sway, fit: DecayFit, *, in_metres: bool) -> Softening:
    angle = sway.curvature * float(np.hypot(fit.parameters[COSINE], fit.parameters[SINE]))
    share, spread = GRAVITY_SHARE
    if in_metres:
        share = min(1.0, GRAVITY_M_S2 * sway.curvature / float(fit.parameters[OMEGA]) ** 2)
        spread = 0.1 * share
    arc = 2 * sway.curvature_std / sway.curvature
    mean = share * angle**2 / 16
    return Softening(mean=mean, std=mean * float(np.hypot(spread / share, arc)))


def _centred(samples: Samples, fit: DecayFit) -> FloatArray:
    p = fit.parameters
    return np.asarray(samples.value - p[OFFSET] - p[SLOPE] * samples.time_s, dtype=float)


def _of(fit: DecayFit, value: float, gradient: FloatArray, *, low: float = -np.inf) -> Estimate:
    """Return an estimate by the delta method, with Student's interval for the freedom that is left."""
    std = float(np.sqrt(max(float(gradient @ fit.covariance @ gradient), 0.0)))
    half = float(student_t.ppf(0.975, fit.freedom)) * std
    ends = float(max(value - half, low)), float(max(value + half, low))
    return Estimate(value=float(max(value, low)), std=std, ci95=ends)


def _frequency_at(fit: DecayFit, square: float) -> tuple[float, FloatArray]:
    """Return the undamped frequency at a squared relative amplitude, and its derivatives."""
    value, jacobian = to_modal(fit.parameters)
    soft = fit.parameters[SOFTENING]
    factor = 1 - soft * square - 0.75 * (soft * square) ** 2
    gradient = jacobian[0] * factor
    gradient[SOFTENING] -= value[0] * square * (1 + 1.5 * soft * square)
    return float(value[0]) * factor, gradient


def _damping_at(fit: DecayFit, relative: float) -> tuple[float, FloatArray]:
    """Return ζ at a relative amplitude, and its derivatives."""
    value, jacobian = to_modal(fit.parameters)
    natural = float(2 * np.pi * value[0])
    gradient = jacobian[1].copy()
    gradient[DRAG] += relative / natural
    gradient[OMEGA] -= fit.parameters[DRAG] * relative / natural**2
    return float(value[1] + fit.parameters[DRAG] * relative / natural), gradient


def _estimate(
    track: Track, window: Window, sway: Sway, samples: Samples, fit: DecayFit, estimates: Estimates
) -> ModalEstimate:
    p = fit.parameters
    jacobian = to_modal(p)[1]
    covariance = jacobian @ fit.covariance @ jacobian.T
    bound = np.sqrt(np.maximum(np.diag(jacobian @ fit.bound @ jacobian.T), 0.0))
    frequency, damping = estimates.maximum_likelihood.natural_frequency_hz, estimates.maximum_likelihood.damping_ratio
    assert frequency is not None
    assert damping is not None
    relative = find_envelope(samples.time_s, p[ALPHA], p[DRAG])[0]
    metres = track.length_unit == "m"
    amplitude = _amplitude(sway, fit)
    return ModalEstimate(
        natural_frequency_hz=frequency,
        damping_ratio=damping,
        covariance=(
            (float(covariance[0, 0]), float(covariance[0, 1])),
            (float(covariance[1, 0]), float(covariance[1, 1])),
        ),
        amplitude_m=amplitude if metres else None,
        operating_frequency_hz=_of(fit, *_frequency_at(fit, float(np.mean(relative)) ** 2), low=0.0),
        noise_m=fit.scale if metres else None,
        cycles=float(p[OMEGA] / (2 * np.pi) * (window.end_s - window.start_s)),
        bound=Bound(natural_frequency_hz=float(bound[0]), damping_ratio=float(bound[1])),
        estimates=estimates,
        modes=(
            ModeEstimate(
                natural_frequency_hz=frequency,
                damping_ratio=damping,
                amplitude_m=amplitude.value if metres else None,
            ),
        ),
        backbone=_backbone(sway, fit, float(relative[-1])) if metres else (),
    )


def _amplitude(sway: Sway, fit: DecayFit) -> Estimate:
    p = fit.parameters
    way = float(np.hypot(p[COSINE], p[SINE]))
    gradient = np.zeros(8)
    gradient[[COSINE, SINE]] = p[COSINE] / way, p[SINE] / way
    angle = sway.curvature * way
    if angle > 0:
        # Beyond a right angle the bob comes back over the main axis: the farthest point is the radius.
        value = float(np.sin(min(angle, np.pi / 2))) / sway.curvature
        return _of(fit, value, gradient * max(float(np.cos(angle)), 0.0), low=0.0)
    return _of(fit, way, gradient, low=0.0)


def _backbone(sway: Sway, fit: DecayFit, last: float) -> tuple[BackbonePoint, ...]:
    if not (fit.terms.softening or fit.terms.drag) or not last < 1:
        return ()
    p = fit.parameters
    way = float(np.hypot(p[COSINE], p[SINE]))
    return tuple(
        BackbonePoint(
            amplitude_m=float(abs(sway.chord(np.array(way * relative)))),
            frequency_hz=_of(fit, *_frequency_at(fit, relative**2), low=0.0),
            damping_ratio=_of(fit, *_damping_at(fit, relative), low=0.0),
        )
        for relative in (float(x) for x in np.linspace(1.0, last, 5))
    )


def _compare(samples: Samples, fit: DecayFit, peaks: Peaks) -> Estimates:
    """Return all estimators; each rival's error holds how far it is off on the fitted curve itself."""
    (frequency, damping), jacobian = to_modal(fit.parameters)
    damped = float(fit.parameters[OMEGA]) / (2 * np.pi)
    up = float(np.hypot(fit.parameters[OMEGA], fit.parameters[ALPHA]) / fit.parameters[OMEGA])
    clean = _centred(samples, fit) - fit.residual
    clean_peaks = find_peaks(samples.time_s, clean, 1 / damped)

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

    periods = _with_bias(frequency_of(peaks), frequency_of(clean_peaks), frequency)
    decrement = _with_bias(damping_of(peaks), damping_of(clean_peaks), damping)
    return Estimates(
        maximum_likelihood=EstimatorResult(
            natural_frequency_hz=_of(fit, frequency, jacobian[0], low=0.0),
            damping_ratio=_of(fit, damping, jacobian[1], low=0.0),
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
    return Estimate(value=found.value, std=std, ci95=(max(middle - half, 0.0), middle + half))


def _spectral(samples: Samples, fit: DecayFit, clean: FloatArray, up: float, truth: float) -> Estimate | None:
    curve = find_spectrum(samples.time_s, _centred(samples, fit))
    span = float(samples.time_s[-1] - samples.time_s[0])
    tops = find_peaks_of(curve, lowest_hz=1 / span, count=1)
    if not tops:
        return None
    peak = find_spectrum_peak(samples.time_s, _centred(samples, fit), near_hz=tops[0])
    rival = find_spectrum_peak(samples.time_s, clean, near_hz=tops[0])
    noise = up * peak.unit_std_hz * fit.scale * float(np.sqrt(fit.inflation))
    return _with_bias(
        Estimate.normal(up * peak.frequency_hz, noise, low=0.0),
        Estimate.normal(up * rival.frequency_hz, noise, low=0.0),
        truth,
    )


def _spectrum(samples: Samples, fit: DecayFit) -> SpectrumCurve:
    curve = find_spectrum(samples.time_s, _centred(samples, fit))
    shown = curve.frequency_hz <= max(10 * fit.parameters[OMEGA] / (2 * np.pi), curve.frequency_hz[-1] / 20)
    return SpectrumCurve(frequency_hz=curve.frequency_hz[shown], amplitude=curve.amplitude[shown])


def _decay_curve(window: Window, sway: Sway, samples: Samples, fit: DecayFit, peaks: Peaks) -> DecayCurve:
    p = fit.parameters
    measured = sway.chord(_centred(samples, fit))
    fitted = sway.chord(_centred(samples, fit) - fit.residual)
    way = float(np.hypot(p[COSINE], p[SINE])) * find_envelope(samples.time_s, p[ALPHA], p[DRAG])[0]
    if sway.curvature > 0:
        way = np.minimum(way, np.pi / 2 / sway.curvature)
    return DecayCurve(
        time_s=sway.time_s,
        sway=measured,
        fit=fitted,
        envelope=sway.chord(way),
        residual=measured - fitted,
        peak_time_s=peaks.time_s + window.start_s,
        peak_sway=sway.chord(peaks.value),
    )


def _notices(modal: ModalEstimate, fit: DecayFit, sway: Sway) -> tuple[Notice, ...]:
    found = []
    damping, frequency = modal.damping_ratio, modal.natural_frequency_hz
    assert damping is not None
    assert frequency is not None
    low, high = damping.ci95
    if not (high - low) < damping.value:
        found.append(
            Notice(
                code="damping_uncertain",
                message=f"the record is too short or too noisy for the damping ratio: {low:.2g} to {high:.2g} (95 %)",
            )
        )
    if modal.cycles < 3:
        found.append(
            Notice(
                code="few_cycles", message=f"only {modal.cycles:.1f} cycles of free vibration were seen: film longer"
            )
        )
    if fit.inflation > 2:
        found.append(
            Notice(
                code="coloured_residual",
                message="what the fit leaves is not white noise (it swings with the sway): the errors are "
                f"{np.sqrt(fit.inflation):.1f} times larger for it",
            )
        )
    angle = sway.curvature * float(np.hypot(*fit.parameters[[COSINE, SINE]]))
    if angle > 1.0:
        found.append(
            Notice(
                code="large_swing",
                message=f"the swing reaches {np.degrees(angle):.0f} degrees: the small-amplitude frequency is "
                "extrapolated; release it at a smaller angle",
            )
        )
    operating = modal.operating_frequency_hz
    if operating is not None and abs(operating.value / frequency.value - 1) > 0.005:
        found.append(
            Notice(
                code="frequency_depends_on_amplitude",
                message=f"the frequency depends on the amplitude: {operating.value:.4g} Hz at the mean amplitude, "
                f"{frequency.value:.4g} Hz for a small swing; a shaper is designed for the former",
            )
        )
    if fit.terms.drag:
        law = _damping_at(fit, 1.0)[0], damping.value
        found.append(
            Notice(
                code="damping_depends_on_amplitude",
                message=f"the damping falls with the amplitude, as drag does: the ratio is {law[0]:.2g} at the window's "
                f"start, {law[1]:.2g} extrapolated to a small swing",
            )
        )
    for name, rival in (("FFT", modal.estimates.fft), ("the periods", modal.estimates.periods)):
        other = rival.natural_frequency_hz
        if other is None or operating is None:
            continue
        apart = min(abs(other.value - operating.value), abs(other.value - frequency.value))
        if apart > max(4 * float(np.hypot(other.std, frequency.std)), 0.002 * frequency.value):
            found.append(
                Notice(
                    code="estimators_disagree",
                    message=f"{name} gives {other.value:.5g} Hz, least squares {operating.value:.5g} Hz: the decay is "
                    "not that of one mode; look at the residual",
                )
            )
    return tuple(found)
