"""From a window of a track to its first mode, every estimator beside the one that decides."""

from dataclasses import dataclass, replace

import numpy as np

from tagsway.errors import NotIdentifiableError
from tagsway.modal.bound import to_modal
from tagsway.modal.comparison import compare_estimators, draw_spectrum
from tagsway.modal.decay import ALPHA, ARC, COSINE, DRAG, OMEGA, PROJECTION, SINE, SOFTENING, Terms
from tagsway.modal.decay import envelope as find_envelope
from tagsway.modal.delta import centre, damping_at, estimate_of, frequency_at
from tagsway.modal.least_squares import DecayFit, Samples, Softening, extend, fit_decay
from tagsway.modal.notices import find_notices
from tagsway.modal.peaks import Peaks, find_peaks
from tagsway.modal.significance import require_oscillation
from tagsway.modal.start import find_start
from tagsway.modal.sway import Sway, check_window, measure_sway
from tagsway.model import (
    GRAVITY_M_S2,
    SCALE_STD,
    BackbonePoint,
    Bound,
    DecayCurve,
    Estimate,
    Estimates,
    FloatArray,
    ModalEstimate,
    ModeEstimate,
    Notice,
    SpectrumCurve,
    Track,
    Window,
)

SHARE_STD = 0.2
"""Of gravity's share of ω_n², which the arc's radius gives for a point mass only: a real body's is smaller."""

GRAVITY_SHARE = (0.9, 0.2)
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
    samples = Samples(time_s=sway.time_s - window.start_s, value=sway.value, spread=sway.spread, stated=sway.stated_std)
    fit = fit_sway(sway, samples, in_metres=track.length_unit == "m")
    require_oscillation(fit, samples, where=f"between {window.start_s:g} and {window.end_s:g} s")
    peaks = find_peaks(samples.time_s, centre(samples, fit), 2 * np.pi / fit.parameters[OMEGA])
    estimates = compare_estimators(samples, fit, peaks)
    modal = _estimate(track, window, sway, samples, fit, estimates)
    decay = _decay_curve(window, sway, samples, fit, peaks)
    spectrum = draw_spectrum(samples, fit)
    return ModalFit(estimate=modal, decay=decay, spectrum=spectrum, notices=find_notices(modal, fit, sway))


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
    most 1, for the share of gravity in ω_n² were the body a point mass. A real body's is g / (l ω_n²): so it enters as
    a prior of ±0.2. A straight path has no softening.
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
        spread = SHARE_STD
    arc = 2 * sway.curvature_std / sway.curvature
    mean = share * angle**2 / 16
    return Softening(mean=mean, std=mean * float(np.hypot(spread / share, arc)))


def _estimate(
    track: Track, window: Window, sway: Sway, samples: Samples, fit: DecayFit, estimates: Estimates
) -> ModalEstimate:
    p = fit.parameters
    jacobian = to_modal(p)[1]
    covariance = jacobian @ fit.covariance @ jacobian.T
    bound = np.sqrt(np.maximum(np.diag(jacobian @ fit.bound @ jacobian.T), 0.0))
    frequency, damping = estimates.maximum_likelihood.natural_frequency_hz, estimates.maximum_likelihood.damping_ratio
    assert frequency is not None
    relative = find_envelope(samples.time_s, p[ALPHA], p[DRAG])[0]
    metres = track.length_unit == "m"
    amplitude = _mean_amplitude(sway, fit, relative, metres=metres)
    return ModalEstimate(
        natural_frequency_hz=frequency,
        damping_ratio=damping,
        covariance=(
            (float(covariance[0, 0]), float(covariance[0, 1])),
            (float(covariance[1, 0]), float(covariance[1, 1])),
        ),
        amplitude_m=amplitude if metres else None,
        operating_frequency_hz=estimate_of(fit, *frequency_at(fit, float(np.mean(relative)) ** 2), low=0.0),
        operating_damping_ratio=None
        if damping is None
        else estimate_of(fit, *damping_at(fit, float(np.mean(relative))), low=0.0),
        noise_m=fit.scale if metres else None,
        cycles=float(p[OMEGA] / (2 * np.pi) * (window.end_s - window.start_s)),
        bound=Bound(natural_frequency_hz=float(bound[0]), damping_ratio=float(bound[1])),
        estimates=estimates,
        modes=()
        if damping is None
        else (
            ModeEstimate(
                natural_frequency_hz=frequency,
                damping_ratio=damping,
                amplitude_m=amplitude.value if metres else None,
            ),
        ),
        backbone=_backbone(sway, fit, float(relative[-1])) if metres else (),
    )


def _mean_amplitude(sway: Sway, fit: DecayFit, relative: FloatArray, *, metres: bool) -> Estimate:
    """Return the mean amplitude over the window; in metres with the error of the scale, which no residual shows."""
    start = _amplitude(sway, fit)
    way = float(np.hypot(fit.parameters[COSINE], fit.parameters[SINE]))
    share = float(np.mean(np.abs(sway.chord(way * relative)))) / max(float(np.abs(sway.chord(np.array(way)))), 1e-300)
    scale = SCALE_STD * start.value if metres else 0.0
    return Estimate.normal(share * start.value, share * float(np.hypot(start.std, scale)), low=0.0)


def _amplitude(sway: Sway, fit: DecayFit) -> Estimate:
    p = fit.parameters
    way = float(np.hypot(p[COSINE], p[SINE]))
    gradient = np.zeros(8)
    gradient[[COSINE, SINE]] = p[COSINE] / way, p[SINE] / way
    angle = sway.curvature * way
    if angle > 0:
        # Beyond a right angle the bob comes back over the main axis: the farthest point is the radius.
        value = float(np.sin(min(angle, np.pi / 2))) / sway.curvature
        return estimate_of(fit, value, gradient * max(float(np.cos(angle)), 0.0), low=0.0)
    return estimate_of(fit, way, gradient, low=0.0)


def _backbone(sway: Sway, fit: DecayFit, last: float) -> tuple[BackbonePoint, ...]:
    if not (fit.terms.softening or fit.terms.drag) or not last < 1:
        return ()
    p = fit.parameters
    way = float(np.hypot(p[COSINE], p[SINE]))
    return tuple(
        BackbonePoint(
            amplitude_m=float(abs(sway.chord(np.array(way * relative)))),
            frequency_hz=estimate_of(fit, *frequency_at(fit, relative**2), low=0.0),
            damping_ratio=estimate_of(fit, *damping_at(fit, relative), low=0.0),
        )
        for relative in (float(x) for x in np.linspace(1.0, last, 5))
    )


def _decay_curve(window: Window, sway: Sway, samples: Samples, fit: DecayFit, peaks: Peaks) -> DecayCurve:
    p = fit.parameters
    measured = sway.chord(centre(samples, fit))
    fitted = sway.chord(centre(samples, fit) - fit.residual)
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
