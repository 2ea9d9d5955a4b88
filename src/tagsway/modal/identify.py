"""From a window of a track to its first mode, every estimator beside the one that decides."""

from dataclasses import dataclass, replace

import numpy as np

from tagsway.errors import NotIdentifiableError
from tagsway.modal.backbone import draw_backbone, fit_pieces, mean_amplitude
from tagsway.modal.blocks import average_blocks, first_omega
from tagsway.modal.bound import to_modal
from tagsway.modal.channels import join_channel
from tagsway.modal.comparison import compare_estimators, describe_estimators, draw_spectrum
from tagsway.modal.decay import (
    ALPHA,
    ARC,
    COSINE,
    DRAG,
    FRICTION,
    OMEGA,
    PLACES,
    PROJECTION,
    SINE,
    SOFTENING,
    Terms,
    predict,
)
from tagsway.modal.decay import envelope as find_envelope
from tagsway.modal.delta import centre, damping_at, estimate_of, frequency_at
from tagsway.modal.least_squares import DecayFit, Samples, Softening, fit_decay
from tagsway.modal.losses import weigh_losses
from tagsway.modal.modes import choose_modes, mode_energy
from tagsway.modal.notices import find_notices
from tagsway.modal.peaks import Peaks, find_peaks
from tagsway.modal.significance import require_oscillation
from tagsway.modal.start import find_start
from tagsway.modal.sway import MAD_TO_STD, Sway, check_window, measure_sway
from tagsway.model import (
    GRAVITY_M_S2,
    BackbonePoint,
    Bound,
    DecayCurve,
    Estimate,
    Estimates,
    EstimatorDetails,
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

CONTRADICTED = 5.0
"""Of the prior's standard errors, between the softening that a decay shows and the one that its arc implies."""

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
    pieces : tuple of BackbonePoint
        Plain decays fitted piece by piece, to be drawn beside the backbone; largest amplitude first, in metres.
    details : EstimatorDetails
        How fine the spectrum is, the decrement over n cycles, and the half-power width.
    notices : tuple of Notice
        What is odd or weak.
    """

    estimate: ModalEstimate
    decay: DecayCurve
    spectrum: SpectrumCurve
    pieces: tuple[BackbonePoint, ...]
    details: EstimatorDetails
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
    Do not use it for a forced or a growing vibration. Where the tool still moves, its measured motion is an input.
    """
    check_window(window, track.time_s)
    sway = measure_sway(track, window, sway_axis=sway_axis)
    begin = sway.time_s - window.start_s
    every = Samples(
        time_s=begin,
        value=sway.value,
        spread=sway.spread,
        stated=sway.stated_std,
        pulled=sway.pulled_std,
        drive=sway.drive,
        drive_std=sway.drive_std,
    )
    samples, fit, prior = fit_sway(sway, every, in_metres=track.length_unit == "m")
    hidden = weigh_losses(samples, fit, curvature=_swing_per_length(sway, fit, track), prior=prior)
    require_oscillation(fit, samples, where=f"between {window.start_s:g} and {window.end_s:g} s")
    fit, contradictions = join_channel(samples, fit, _angle_samples(sway, begin, fit), prior=prior)
    if hidden is not None:
        fit = hidden.fit if hidden.sure else hidden.widen(fit)
    period = float(2 * np.pi / fit.parameters[OMEGA])
    peaks = find_peaks(samples.time_s, centre(samples, fit), period)
    on_curve = find_peaks(samples.time_s, centre(samples, fit) - fit.residual, period)
    estimates = compare_estimators(samples, fit, peaks, on_curve=on_curve, held=track.tcp is not None)
    details = describe_estimators(samples, fit, peaks, on_curve=on_curve)
    pieces = fit_pieces(sway, samples, fit)
    residual = every.value - predict(begin, fit.parameters, fit.terms, every.drive)[0]
    noise = MAD_TO_STD * float(np.median(np.abs(residual / every.spread)))
    modal = _estimate(track, window, sway, samples, fit, estimates, noise)
    return ModalFit(
        estimate=modal,
        decay=_decay_curve(window, sway, every, fit, peaks),
        spectrum=draw_spectrum(samples, fit),
        pieces=pieces if track.length_unit == "m" else (),
        details=details,
        notices=(*find_notices(modal, fit, sway, held=prior is not None and prior.held), *contradictions),
    )


def _swing_per_length(sway: Sway, fit: DecayFit, track: Track) -> float:
    """Return the path's curvature, at least that of a body which gravity alone holds; 0 where no tool holds one."""
    if track.tcp is None:
        return 0.0
    if track.length_unit != "m" or not sway.planar:
        return abs(sway.curvature)
    return max(abs(sway.curvature), float(fit.parameters[OMEGA]) ** 2 / GRAVITY_M_S2)


def _angle_samples(sway: Sway, time_s: FloatArray, fit: DecayFit) -> Samples | None:
    seen = np.isfinite(sway.angle_rad) & np.isfinite(sway.angle_std_rad) & (sway.angle_std_rad > 0)
    if np.count_nonzero(seen) < max(8, 0.5 * len(time_s)):
        return None
    std = sway.angle_std_rad[seen]
    typical = float(np.median(std))
    angle = Samples(
        time_s=time_s[seen],
        value=sway.angle_rad[seen],
        spread=np.clip(std / typical, 0.3, 30.0),
        stated=min(sway.angle_stated_std, typical),
        pulled=sway.angle_pulled_std,
        drive=None if sway.drive is None else sway.drive[seen],
        drive_std=sway.drive_std,
    )
    return average_blocks(angle, None, omega=first_omega(fit))


def fit_sway(sway: Sway, samples: Samples, *, in_metres: bool) -> tuple[Samples, DecayFit, Softening | None]:
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
    Samples
        Those that were fitted: averages where there are many in a period.
    DecayFit
        Of them, the largest mode first.
    Softening or None
        What the arc told before.

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
    thin = average_blocks(samples, None, omega=float(p[OMEGA]))
    fit, prior = _fit_first(sway, thin, p, scale, in_metres=in_metres)
    if thin is not samples:
        thin = average_blocks(samples, fit, omega=float(fit.parameters[OMEGA]))
        fit = fit_decay(thin, fit.parameters, fit.terms, scale=fit.scale, prior=prior)
    first = fit
    fit = choose_modes(thin, fit, prior=prior, straight=sway.planar and prior is None)
    if prior is not None and abs(fit.parameters[SOFTENING] - prior.mean) > CONTRADICTED * prior.std:
        # A softening that is not the arc's is no pendulum's: nothing is extrapolated with it.
        prior = Softening(mean=prior.mean, std=1e-3 * prior.mean, held=True)
        p = first.parameters.copy()
        p[SOFTENING] = prior.mean
        fit = choose_modes(thin, fit_decay(thin, p, first.terms, scale=first.scale, prior=prior), prior=prior)
    if not sway.planar and fit.terms.softening:
        # One coordinate may be a projection or, from an encoder, the angle itself: their overtones differ.
        arc = fit_decay(thin, fit.parameters[:PLACES], Terms(shape=ARC, softening=True), scale=fit.scale)
        fit = min(fit, choose_modes(thin, arc), key=_deviation)
    if thin is not samples:
        thin = average_blocks(samples, fit, omega=first_omega(fit))
        fit = fit_decay(thin, fit.parameters, fit.terms, scale=fit.scale, prior=prior)
    return thin, fit, prior


def _deviation(fit: DecayFit) -> float:
    return fit.scale


def _fit_first(
    sway: Sway, samples: Samples, p: FloatArray, scale: float, *, in_metres: bool
) -> tuple[DecayFit, Softening | None]:
    """Return a single mode, with the softening of its arc and what is known of that."""
    shape = ARC if sway.planar else PROJECTION
    fit = fit_decay(samples, p, Terms(shape=shape, curvature=sway.curvature), scale=scale)
    if not (sway.planar and sway.curvature > 0):
        return fit, None
    for _ in range(2):
        prior = _softening_of_arc(sway, fit, in_metres=in_metres)
        first = fit.parameters.copy()
        first[SOFTENING] = first[SOFTENING] or prior.mean
        fit = fit_decay(samples, first, replace(fit.terms, softening=True), scale=fit.scale, prior=prior)
    return fit, prior


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
    track: Track,
    window: Window,
    sway: Sway,
    samples: Samples,
    fit: DecayFit,
    estimates: Estimates,
    noise: float,
) -> ModalEstimate:
    p = fit.parameters
    jacobian = to_modal(p)[1]
    covariance = jacobian @ fit.covariance @ jacobian.T
    bound = np.sqrt(np.maximum(np.diag(jacobian @ fit.bound @ jacobian.T), 0.0))
    frequency, damping = estimates.maximum_likelihood.natural_frequency_hz, estimates.maximum_likelihood.damping_ratio
    assert frequency is not None
    relative = find_envelope(samples.time_s, p[ALPHA], p[DRAG], p[FRICTION])[0]
    metres = track.length_unit == "m"
    amplitude = mean_amplitude(sway, fit, relative, metres=metres)
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
        noise_m=noise if metres else None,
        cycles=float(p[OMEGA] / (2 * np.pi) * (window.end_s - window.start_s)),
        bound=Bound(natural_frequency_hz=float(bound[0]), damping_ratio=float(bound[1])),
        estimates=estimates,
        modes=_modes(sway, samples, fit, estimates, amplitude, metres=metres),
        backbone=draw_backbone(sway, fit, float(relative[-1])) if metres else (),
        amplitude_m_s2=amplitude if track.length_unit == "m/s2" else None,
        amplitude_rad=amplitude if track.length_unit == "rad" else None,
    )


def _modes(
    sway: Sway, samples: Samples, fit: DecayFit, estimates: Estimates, amplitude: Estimate, *, metres: bool
) -> tuple[ModeEstimate, ...]:
    first = estimates.maximum_likelihood
    if first.natural_frequency_hz is None or first.damping_ratio is None:
        return ()
    modes = [
        ModeEstimate(
            natural_frequency_hz=first.natural_frequency_hz,
            damping_ratio=first.damping_ratio,
            amplitude_m=amplitude.value if metres else None,
        )
    ]
    for mode in range(1, fit.terms.further + 1):
        value, jacobian = to_modal(fit.parameters, mode=mode)
        way = np.sqrt(2 * mode_energy(fit, mode, float(samples.time_s[-1])))
        modes.append(
            ModeEstimate(
                natural_frequency_hz=estimate_of(fit, float(value[0]), jacobian[0], low=0.0),
                damping_ratio=estimate_of(fit, float(value[1]), jacobian[1], low=0.0),
                amplitude_m=float(abs(sway.chord(way))) if metres else None,
            )
        )
    return tuple(modes)


def _decay_curve(window: Window, sway: Sway, samples: Samples, fit: DecayFit, peaks: Peaks) -> DecayCurve:
    p = fit.parameters
    value = predict(samples.time_s, p, fit.terms, samples.drive)[0]
    measured = sway.chord(centre(samples, fit))
    fitted = sway.chord(centre(replace(samples, value=value), fit))
    relative = find_envelope(samples.time_s, p[ALPHA], p[DRAG], p[FRICTION])[0]
    way = float(np.hypot(p[COSINE], p[SINE])) * relative
    if sway.curvature > 0 and not sway.angular:
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
