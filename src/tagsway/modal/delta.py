"""From a fit's parameters to what is reported, errors and all."""

from dataclasses import replace

import numpy as np
from scipy.stats import t as student_t

from tagsway.modal.bound import to_modal
from tagsway.modal.decay import ALPHA, DRAG, FRICTION, OFFSET, OMEGA, SLOPE, SOFTENING, envelope, slowed_by
from tagsway.modal.least_squares import DecayFit, Samples
from tagsway.model import Estimate, FloatArray

FARTHEST = 2.0
"""Damping at the mean swing, over its viscous part, beyond which that part is a guess."""


def small_swing_damping(fit: DecayFit, time_s: FloatArray, *, held: bool) -> Estimate:
    """Return ζ for a small swing; for the mean one, where drag leaves little to the rest and nothing vouches for it.

    Parameters
    ----------
    fit : DecayFit
        Of the decay.
    time_s : ndarray, shape (n,)
        Of its samples.
    held : bool
        Whether a tool was seen to hold what swings: then it is the pendulum of the model, however far its viscous part
        lies outside of what was seen.

    Returns
    -------
    Estimate
        Of the viscous part, α / ω_n; else of the whole at the mean swing, with an error that reaches down to it.
    """
    value, jacobian = to_modal(fit.parameters)
    viscous = estimate_of(fit, float(value[1]), jacobian[1])
    if fit.rate_ci95 is not None:
        low, high = (rate / float(np.hypot(fit.parameters[OMEGA], rate)) for rate in fit.rate_ci95)
        viscous = replace(viscous, ci95=(min(low, viscous.value), max(high, viscous.value)))
    if held or not sees(fit, DRAG):
        return viscous
    relative = float(np.mean(envelope(time_s, *fit.parameters[[ALPHA, DRAG, FRICTION]])[0]))
    seen = estimate_of(fit, *damping_at(fit, relative), low=0.0)
    if not seen.value > FARTHEST * max(viscous.value, 0.0):
        return viscous
    std = float(np.hypot(seen.std, (seen.value - viscous.value) / 1.5))
    return Estimate.normal(seen.value, std, low=0.0)


def sees(fit: DecayFit, place: int) -> bool:
    """Tell whether a term is fitted and stands out of its error."""
    return bool(place in fit.terms.free and abs(fit.parameters[place]) > 3 * np.sqrt(fit.covariance[place, place]))


def centre(samples: Samples, fit: DecayFit) -> FloatArray:
    """Return the samples counted from the fitted equilibrium, drift and all.

    Parameters
    ----------
    samples : Samples
        What was fitted.
    fit : DecayFit
        Of these samples.

    Returns
    -------
    ndarray, shape (n,)
    """
    p = fit.parameters
    return np.asarray(samples.value - p[OFFSET] - p[SLOPE] * samples.time_s, dtype=float)


def estimate_of(fit: DecayFit, value: float, gradient: FloatArray, *, low: float = -np.inf) -> Estimate:
    """Return an estimate by the delta method, with Student's interval for how well the noise is known."""
    std = float(np.sqrt(max(float(gradient @ fit.covariance @ gradient), 0.0)))
    half = float(student_t.ppf(0.975, fit.error_freedom)) * std
    ends = float(max(value - half, low)), float(max(value + half, low))
    return Estimate(value=float(max(value, low)), std=std, ci95=ends)


def frequency_at(fit: DecayFit, square: float) -> tuple[float, FloatArray]:
    """Return the undamped frequency at a squared relative amplitude, and its derivatives."""
    value, jacobian = to_modal(fit.parameters)
    slowed, by_soft = slowed_by(fit.parameters, fit.terms, square)
    gradient = jacobian[0] * (1 - slowed)
    gradient[SOFTENING] -= value[0] * by_soft
    return float(value[0]) * (1 - slowed), gradient


def damping_at(fit: DecayFit, relative: float) -> tuple[float, FloatArray]:
    """Return ζ at a relative amplitude, and its derivatives: viscous, drag and friction together."""
    value, jacobian = to_modal(fit.parameters)
    natural = float(2 * np.pi * value[0])
    gradient = jacobian[1].copy()
    extra = fit.parameters[DRAG] * relative + fit.parameters[FRICTION] / relative
    gradient[DRAG] += relative / natural
    gradient[FRICTION] += 1 / (relative * natural)
    gradient[OMEGA] -= extra / natural**2
    return float(value[1] + extra / natural), gradient
