"""From a sway to its decay in the plane that is filmed."""

from dataclasses import dataclass, replace

import numpy as np

from tagsway.errors import NotIdentifiableError
from tagsway.modal.blocks import average_blocks, drop_stop, first_omega
from tagsway.modal.decay import (
    ALPHA,
    COSINE,
    DRAG,
    FRICTION,
    OMEGA,
    PLACES,
    SINE,
    SOFTENING,
    SQUARE,
    Terms,
    envelope,
    slowed_by,
)
from tagsway.modal.delta import sees
from tagsway.modal.least_squares import DecayFit, Samples, Softening, fit_decay
from tagsway.modal.modes import choose_modes
from tagsway.modal.precession import Precession, find_precession
from tagsway.modal.start import find_start
from tagsway.modal.sway import Sway
from tagsway.model import GRAVITY_M_S2, FloatArray, Notice

SHARE_STD = 0.2
"""Of gravity's share of ω_n², which the arc's radius gives for a point mass only: a real body's is smaller."""

CONTRADICTED = 5.0
"""Of the prior's standard errors, between the softening that a decay shows and the one that its arc implies."""

GRAVITY_SHARE = (0.9, 0.2)
"""Share of gravity in ω_n², and its standard deviation, where a track without a scale cannot tell."""

UNSEEN_STD = 5.0
"""Standard errors of a curvature: below three an arc passes for a straight line, and it may be two more."""

ROUNDS = 2
"""Of fits in which what a sway across adds is taken off: a third one changes nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaneFit:
    """A sway in the plane, and its decay.

    Parameters
    ----------
    sway : Sway
        Without what one across the plane adds.
    every, samples : Samples
        All of it, and those that were fitted: averages where there are many in a period.
    fit : DecayFit
        Of these.
    prior : Softening or None
        What the arc told before.
    across : Precession or None
        The sway across; None where the path is straight.
    """

    sway: Sway
    every: Samples
    samples: Samples
    fit: DecayFit
    prior: Softening | None
    across: Precession | None

    def find_notices(self) -> tuple[Notice, ...]:
        """Return what is to be said of a sway across the plane."""
        if self.across is None or not self.across.seen:
            return ()
        size, std = np.degrees([self.across.across_rad, self.across.across_std_rad])
        message = (
            f"the payload sways across the filmed plane, too: by {size:.2g} ± {std:.1g} degrees; its ellipse turns, "
            "which would pass for damping and frequency, and was taken off the sway before the fit"
        )
        return (Notice(code="sways_across", message=message),)


def fit_plane(sway: Sway, time_s: FloatArray, *, in_metres: bool, held: bool = False) -> PlaneFit:
    """Fit a decay to a sway, without what a sway across the plane adds to it.

    Parameters
    ----------
    sway : Sway
        As it was measured.
    time_s : ndarray, shape (n,)
        Of its samples, from the window's start.
    in_metres : bool
        Whether gravity can be compared with the arc's radius.
    held : bool
        Whether a tool was seen to hold what swings: then it is a pendulum, though its arc be not seen.

    Returns
    -------
    PlaneFit

    Raises
    ------
    NotIdentifiableError
        Where there is nothing to fit.
    """
    measured, across, every = sway, None, _samples_of(sway, time_s)
    samples, fit, prior = fit_sway(sway, every, in_metres=in_metres, held=held)
    for _ in range(ROUNDS):
        found = find_precession(measured, time_s, fit)
        if found is None or (across is not None and not found.seen):
            break
        across, sway = found, found.clear(measured)
        every = _samples_of(sway, time_s)
        if not found.seen:
            samples, fit = _fit_all(every, fit, prior)
            break
        samples, fit, prior = fit_sway(sway, every, in_metres=in_metres, held=held)
    if across is not None and across.seen and fit.terms.further and prior is not None and in_metres:
        # What beats with a swing across goes along no arc: its softening may be as large as gravity alone makes it.
        most = 2 * _softening_of_weight(fit, np.inf, in_metres=True).mean
        prior = replace(prior, doubt=max(most - prior.mean, abs(prior.doubt)))
        fit = fit_decay(samples, fit.parameters, fit.terms, scale=fit.scale, prior=prior)
    return PlaneFit(sway=sway, every=every, samples=samples, fit=fit, prior=prior, across=across)


def _samples_of(sway: Sway, time_s: FloatArray) -> Samples:
    return Samples(
        time_s=time_s,
        value=sway.value,
        spread=sway.spread,
        stated=sway.stated_std,
        pulled=sway.pulled_std,
        drive=sway.drive,
        drive_std=sway.drive_std,
        common=sway.common,
    )


def fit_sway(
    sway: Sway, samples: Samples, *, in_metres: bool, held: bool = False
) -> tuple[Samples, DecayFit, Softening | None]:
    """Fit a decay to a sway, with the softening that its arc implies.

    Parameters
    ----------
    sway : Sway
        For its curvature.
    samples : Samples
        The same, from the window's start.
    in_metres : bool
        Whether gravity can be compared with the arc's radius.
    held : bool
        Whether a tool was seen to hold what swings.

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
    a prior of ±0.2. A straight path has no softening, but what hangs from a tool has one where its arc is too short to
    be seen: at most that of the curvature that may hide. Of a single coordinate the overtone tells q0², where it shows;
    else what hangs from a tool has at most that of a body which gravity alone turns back.
    """
    start = find_start(samples)
    if start is None:
        raise NotIdentifiableError("nothing swings: too few samples of the product, or it does not move")
    p, scale = start
    thin = average_blocks(samples, None, omega=float(p[OMEGA]))
    fit, prior = _fit_first(sway, thin, p, scale, in_metres=in_metres, held=held)
    if thin is not samples:
        thin = average_blocks(samples, fit, omega=float(fit.parameters[OMEGA]))
        fit = fit_decay(thin, fit.parameters, fit.terms, scale=fit.scale, prior=prior)
    first = fit
    fit = choose_modes(thin, fit, prior=prior, straight=sway.planar and prior is None)
    if fit.terms.square:
        # What else moves hides an overtone until it is fitted along.
        prior = _find_softening(sway, fit, in_metres=in_metres)
        fit = fit_decay(thin, fit.parameters, fit.terms, scale=fit.scale, prior=prior)
    if prior is not None and abs(fit.parameters[SOFTENING] - prior.mean) > CONTRADICTED * prior.std:
        # What is held is not extrapolated with, but the errors hold what contradicts it.
        doubt = float(fit.parameters[SOFTENING]) - prior.mean
        prior = Softening(mean=prior.mean, std=1e-3 * prior.mean, held=True, doubt=doubt)
        fit = _hold_softening(thin, first, prior)
    if not sway.planar and fit.terms.softening and not fit.terms.square:
        fit = _try_arc(thin, fit)
    if thin is not samples or fit.terms.friction:
        thin, fit = _fit_all(samples, fit, prior)
    return thin, fit, prior


def _fit_all(samples: Samples, fit: DecayFit, prior: Softening | None) -> tuple[Samples, DecayFit]:
    """Return all samples of a fit that is close, averaged and without what friction has stopped, and their fit."""
    thin = drop_stop(average_blocks(samples, fit, omega=first_omega(fit)), fit)
    return thin, fit_decay(thin, fit.parameters, fit.terms, scale=fit.scale, prior=prior)


def _hold_softening(samples: Samples, first: DecayFit, prior: Softening) -> DecayFit:
    """Return the fit with a softening held: one that is not the arc's is no pendulum's to extrapolate with."""
    p = _change_softening(samples, first, prior.mean)
    return choose_modes(samples, fit_decay(samples, p, first.terms, scale=first.scale, prior=prior), prior=prior)


def _change_softening(samples: Samples, fit: DecayFit, softening: float) -> FloatArray:
    """Return a fit's parameters with another softening, at the frequency that was seen: a long record counts cycles."""
    p = fit.parameters.copy()
    square = float(np.mean(envelope(samples.time_s, *p[[ALPHA, DRAG, FRICTION]])[0] ** 2))
    seen = p[OMEGA] * (1 - slowed_by(p, fit.terms, square)[0])
    p[SOFTENING] = softening
    p[OMEGA] = seen / (1 - slowed_by(p, replace(fit.terms, softening=True), square)[0])
    return p


def _try_arc(samples: Samples, fit: DecayFit) -> DecayFit:
    """Return the better fit: one coordinate may be a projection or, from an encoder, the angle itself."""
    arc = choose_modes(samples, fit_decay(samples, fit.parameters[:PLACES], Terms(softening=True), scale=fit.scale))
    return arc if arc.scale < fit.scale else fit


def _fit_first(
    sway: Sway, samples: Samples, p: FloatArray, scale: float, *, in_metres: bool, held: bool
) -> tuple[DecayFit, Softening | None]:
    """Return a single mode, with the softening of its arc and what is known of that."""
    fit = fit_decay(samples, p, Terms(projected=not sway.planar, curvature=sway.curvature), scale=scale)
    if sway.projected:
        told = fit_decay(samples, fit.parameters, replace(fit.terms, square=True), scale=fit.scale)
        fit = told if _shows_square(told) or (held and in_metres) else fit
    hidden = held and in_metres and sway.planar and sway.curvature_std > 0
    if not (sway.curvature > 0 or fit.terms.square or hidden):
        return fit, None
    for _ in range(ROUNDS):
        prior = _find_softening(sway, fit, in_metres=in_metres)
        first = _change_softening(samples, fit, float(fit.parameters[SOFTENING]) or prior.mean)
        fit = fit_decay(samples, first, replace(fit.terms, softening=True), scale=fit.scale, prior=prior)
    return fit, prior


def _shows_square(fit: DecayFit) -> bool:
    return bool(fit.parameters[SQUARE] > 0 and sees(fit, SQUARE))


def _find_softening(sway: Sway, fit: DecayFit, *, in_metres: bool) -> Softening:
    p = fit.parameters
    if fit.terms.square and not _shows_square(fit):
        square = max(float(p[SQUARE]), 0.0) + 2 * float(fit.covariance[SQUARE, SQUARE]) ** 0.5
        return _softening_of_weight(fit, square, in_metres=in_metres)
    if not (fit.terms.square or sway.curvature > 0):
        unseen = UNSEEN_STD * sway.curvature_std * float(np.hypot(p[COSINE], p[SINE]))
        return _softening_of_weight(fit, unseen**2, in_metres=in_metres)
    return _softening_of_arc(sway, fit, in_metres=in_metres)


def _softening_of_weight(fit: DecayFit, square: float, *, in_metres: bool) -> Softening:
    """Return what is known of a swing that hides: no more than this square of it, nor than gravity alone makes."""
    p, most = fit.parameters, square / 16
    if in_metres:
        most = min(most, (float(np.hypot(p[COSINE], p[SINE])) * float(p[OMEGA]) ** 2 / GRAVITY_M_S2) ** 2 / 16)
    return Softening(mean=most / 2, std=most / 2)


def _softening_of_arc(sway: Sway, fit: DecayFit, *, in_metres: bool) -> Softening:
    size = float(np.hypot(fit.parameters[COSINE], fit.parameters[SINE]))
    curvature, arc = sway.curvature, 2 * sway.curvature_std / max(sway.curvature, 1e-300)
    if fit.terms.square:
        square = max(float(fit.parameters[SQUARE]), 0.0)
        curvature, arc = square**0.5 / size, float(fit.covariance[SQUARE, SQUARE]) ** 0.5 / max(square, 1e-300)
    share, spread = GRAVITY_SHARE
    if in_metres:
        share = min(1.0, GRAVITY_M_S2 * curvature / float(fit.parameters[OMEGA]) ** 2)
        spread = SHARE_STD
    mean = share * (curvature * size) ** 2 / 16
    return Softening(mean=mean, std=mean * float(np.hypot(spread / share, arc)))
