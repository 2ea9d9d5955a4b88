"""From a window of a track to its first mode, every estimator beside the one that decides."""

from dataclasses import dataclass, replace

import numpy as np

from tagsway.modal.backbone import draw_backbone, fit_pieces, mean_amplitude
from tagsway.modal.blocks import average_blocks, first_omega
from tagsway.modal.bound import to_modal
from tagsway.modal.channels import doubt_fit, fit_channel, join_fits
from tagsway.modal.comparison import compare_estimators, describe_estimators, draw_spectrum
from tagsway.modal.decay import (
    ALPHA,
    COSINE,
    DRAG,
    FRICTION,
    OMEGA,
    SINE,
    SQUARE,
    predict,
)
from tagsway.modal.decay import envelope as find_envelope
from tagsway.modal.delta import centre, damping_at, estimate_of, frequency_at
from tagsway.modal.least_squares import DecayFit, Samples
from tagsway.modal.losses import weigh_losses
from tagsway.modal.modes import find_rival, mode_energy
from tagsway.modal.notices import find_notices, reject_linear
from tagsway.modal.peaks import Peaks, find_peaks
from tagsway.modal.plane import fit_plane
from tagsway.modal.significance import require_oscillation
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
    measured = measure_sway(track, window, sway_axis=sway_axis)
    begin = measured.time_s - window.start_s
    plane = fit_plane(measured, begin, in_metres=track.length_unit == "m", held=track.tcp is not None)
    sway, every, samples, fit, prior = plane.sway, plane.every, plane.samples, plane.fit, plane.prior
    require_oscillation(fit, samples, where=f"between {window.start_s:g} and {window.end_s:g} s")
    other, contradictions = fit_channel(samples, fit, _angle_samples(sway, begin, samples, fit), prior=prior)
    curvature = _swing_per_length(sway, fit, track)
    joined = other if other is not None and other.agrees else None
    hidden = weigh_losses(samples, fit, curvature=curvature, prior=prior, other=joined)
    fit = fit if joined is None else join_fits(samples, fit, joined.fit, prior=prior)
    fit = fit if hidden is None else hidden.decide(fit)
    fit = fit if other is None or other.agrees else doubt_fit(fit, other.fit)
    rival = find_rival(samples, plane.fit, prior=prior)
    fit = fit if rival is None else doubt_fit(fit, rival)
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
        notices=(
            *find_notices(modal, fit, sway, held=prior is not None and prior.held),
            *reject_linear(samples, fit),
            *plane.find_notices(),
            *contradictions,
        ),
    )


def _swing_per_length(sway: Sway, fit: DecayFit, track: Track) -> float:
    """Return the path's curvature, at least that of a body which gravity alone holds; 0 where no tool holds one."""
    if track.tcp is None:
        return 0.0
    shown = abs(sway.curvature)
    if fit.terms.square:
        shown = max(float(fit.parameters[SQUARE]), 0.0) ** 0.5 / float(np.hypot(*fit.parameters[[COSINE, SINE]]))
    if track.length_unit != "m" or not (sway.planar or fit.terms.square):
        return shown
    return max(shown, float(fit.parameters[OMEGA]) ** 2 / GRAVITY_M_S2)


def _angle_samples(sway: Sway, time_s: FloatArray, fitted: Samples, fit: DecayFit) -> Samples | None:
    inside = time_s <= fitted.time_s[-1] if fit.terms.friction else np.ones(len(time_s), dtype=bool)
    seen = inside & np.isfinite(sway.angle_rad) & np.isfinite(sway.angle_std_rad) & (sway.angle_std_rad > 0)
    if np.count_nonzero(seen) < max(8, 0.5 * np.count_nonzero(inside)):
        return None
    std = sway.angle_std_rad[seen]
    typical = float(np.median(std))
    way, turned = sway.value[seen], sway.angle_rad[seen]
    # Seen from behind, or with the product above its tool, the tag turns against its way.
    sign = float(np.sign(np.dot(way - np.median(way), turned - np.median(turned))) or 1.0)
    angle = Samples(
        time_s=time_s[seen],
        value=turned,
        spread=np.clip(std / typical, 0.3, 30.0),
        stated=min(sway.angle_stated_std, typical),
        pulled=sway.angle_pulled_std,
        drive=None if sway.drive is None else sway.drive[seen],
        drive_std=sway.drive_std,
        common=None if sway.common is None else sign * sway.curvature * sway.common[seen],
    )
    return average_blocks(angle, None, omega=first_omega(fit))


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
