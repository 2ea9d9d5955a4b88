"""Robust least squares of a decay on the raw samples: the estimator that decides."""

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student_t

from tagsway.modal.decay import (
    ALPHA,
    COSINE,
    DRAG,
    FRICTION,
    GAIN,
    OFFSET,
    OMEGA,
    PLACES,
    SINE,
    SLOPE,
    SOFTENING,
    Terms,
    envelope,
    predict,
)
from tagsway.modal.noise import find_colour, grid_places
from tagsway.modal.samples import DecayFit, Samples, Softening
from tagsway.modal.sway import MAD_TO_STD
from tagsway.modal.uncertainty import SOFT, count_independent, judge_fit
from tagsway.model import FloatArray

__all__ = ["DecayFit", "Samples", "Softening", "extend", "fit_decay", "fit_linear_part", "misfit", "solve"]

WORTH = 20.0
"""Square of the standard errors by which a further term must stand out: one false term in 100 000 is rare enough."""

MOST_LOOKS, ENOUGH = 50, 1e-6
"""A search ends where a step promises to lower the deviance by less: a thousandth of a standard error."""

FIRST_DAMPING, LEAST_DAMPING, LARGEST_DAMPING = 1e-3, 1e-12, 1e8
"""Of a step, in shares of the curvature along each parameter."""

EASE, PRESS = 0.1, 8.0
"""A step that keeps its promise eases the damping so much, one that does not help presses it; in between Nielsen's rule
leaves it about as it is."""


def fit_linear_part(samples: Samples, omega: float, alpha: float) -> tuple[FloatArray, float]:
    """Return all parameters of a plain decay with this pole, the linear ones by robust least squares.

    Parameters
    ----------
    samples : Samples
        At least 5.
    omega, alpha : float
        Pole in 1/s.

    Returns
    -------
    parameters : ndarray, shape (11 + 4 k,)
    scale : float
        Median absolute residual, as a standard deviation.
    """
    decay = np.exp(np.clip(-alpha * samples.time_s, -300, 30))
    turn = omega * samples.time_s
    columns = np.column_stack([decay * np.cos(turn), decay * np.sin(turn), np.ones(len(turn))])
    weight = 1 / samples.spread
    for _ in range(5):
        linear = np.linalg.lstsq(columns * weight[:, None], samples.value * weight, rcond=None)[0]
        residual = (samples.value - columns @ linear) / samples.spread
        scale = MAD_TO_STD * float(np.median(np.abs(residual)))
        if not scale > 0:
            break
        weight = (1 + (residual / (SOFT * scale)) ** 2) ** -0.25 / samples.spread
    p = np.zeros(PLACES)
    p[[OMEGA, ALPHA, COSINE, SINE, OFFSET]] = [omega, alpha, *linear]
    return p, scale


@np.errstate(over="ignore", invalid="ignore")  # a trial step may fly off: it is turned back
def solve(
    samples: Samples, start: FloatArray, terms: Terms, *, scale: float, prior: Softening | None = None
) -> tuple[FloatArray, float]:
    """Minimise the soft-L1 cost from a start value.

    Parameters
    ----------
    samples : Samples
        What is fitted.
    start : ndarray, shape (11 + 4 k,)
        Parameters near the solution.
    terms : Terms
        Which of them are free.
    scale : float
        Noise of the median sample.
    prior : Softening, optional
        Of the softening.

    Returns
    -------
    parameters : ndarray, shape (11 + 4 k,)
    deviance : float
        Twice the cost over the variance.

    Notes
    -----
    Levenberg's and Marquardt's steps. The cost bends less at a large residual than its slope over that of the square
    would have it: with its own second derivative the last steps are Newton's, three or four where the reweighted
    squares take ten. Far off, where that promises too much, the reweighted squares bound the cost from above.
    """
    free = terms.free
    known = prior if prior is not None and prior.std > 0 and terms.softening else None

    def look(p: FloatArray) -> tuple[FloatArray, FloatArray]:
        value, rows = predict(samples.time_s, p, terms, samples.drive)
        left, rows = (value - samples.value) / samples.spread / scale, rows[:, free] / samples.spread[:, None] / scale
        if known is not None:
            left = np.append(left, (p[SOFTENING] - known.mean) / known.std)
            rows = np.vstack([rows, np.eye(1, len(free), free.index(SOFTENING)) / known.std])
        return left, rows

    n = len(samples.value)

    def cost(left: FloatArray) -> float:
        # What is known before is no sample: it has no spikes.
        return _soft(left[:n]) + float(left[n:] @ left[n:])

    p, damping, bent = start.copy(), FIRST_DAMPING, True
    left, rows = look(p)
    deviance = cost(left)
    for _ in range(MOST_LOOKS):
        step, promised = _find_step(left, rows, n, damping=damping, bent=bent)
        trial = p.copy()
        trial[free] += step
        new_left, new_rows = look(trial)
        new = cost(new_left)
        if new <= deviance:
            kept = (deviance - new) / max(promised, 1e-300)
            if bent:
                damping = max(damping * max(EASE, 1 - (2 * kept - 1) ** 3), LEAST_DAMPING)
            p, left, rows, deviance, bent = trial, new_left, new_rows, new, True
        elif bent:
            bent = False
        else:
            damping *= PRESS
        if promised < ENOUGH * max(1.0, deviance / n) or damping > LARGEST_DAMPING:
            break
    return p, deviance


def _find_step(
    left: FloatArray, rows: FloatArray, samples: int, *, damping: float, bent: bool
) -> tuple[FloatArray, float]:
    """Return a step of the free parameters, and by how much it promises to lower the deviance.

    `bent` takes the cost's own second derivative, else the reweighted squares; of the rows the first are samples.
    """
    slope = (1 + (left / SOFT) ** 2) ** -0.5
    slope[samples:] = 1.0
    unit = np.linalg.norm(rows, axis=0)
    unit[unit == 0] = 1.0
    scaled = rows / unit
    curvature = (scaled * (slope**3 if bent else slope)[:, None]).T @ scaled
    downhill = -scaled.T @ (slope * left)
    held = damping * (np.diag(curvature) + 1e-12)
    step = np.linalg.solve(curvature + np.diag(held), downhill)
    return step / unit, float(step @ (downhill + held * step))


def _soft(reduced: FloatArray) -> float:
    return float(np.sum(2 * SOFT**2 * (np.sqrt(1 + (reduced / SOFT) ** 2) - 1)))


def fit_decay(
    samples: Samples, start: FloatArray, terms: Terms, *, scale: float, prior: Softening | None = None
) -> DecayFit:
    """Fit a decay and say how sure it is.

    Parameters
    ----------
    samples, start, terms, scale, prior
        As in `solve`; the scale is found anew from the residuals.

    Returns
    -------
    DecayFit

    Notes
    -----
    Soft-L1 on the samples as they are (a gap is a gap) leaves 1 % of spikes almost without effect.
    """
    dof = max(len(samples.value) - len(terms.free), 1)
    for _ in range(2):
        p, deviance = solve(samples, start, terms, scale=scale, prior=prior)
        left = samples.value - predict(samples.time_s, p, terms, samples.drive)[0]
        found = MAD_TO_STD * float(np.median(np.abs(left / samples.spread))) * np.sqrt(len(left) / dof)
        floor = 1e-9 * float(np.hypot(p[COSINE], p[SINE])) + 1e-300
        close = abs(found - scale) < 0.02 * scale
        start, scale = p, max(found, floor)
        if close:
            break
    return judge_fit(samples, p, terms, scale=scale, prior=prior, deviance=deviance)


FADED = 0.7
"""Part of the amplitude that may be left where a softening is to be found without an arc that tells it."""

TRIED = (SLOPE, DRAG, FRICTION, SOFTENING, GAIN)
"""Places of the terms that are looked for."""


def misfit(samples: Samples, fit: DecayFit, *, scale: float) -> float:
    """Return the robust -2 ln likelihood of a fit, but for a constant, were the noise of this scale."""
    return _soft(fit.residual / samples.spread / scale)


def extend(samples: Samples, fit: DecayFit, *, prior: Softening | None = None, straight: bool = False) -> DecayFit:
    """Add the terms that stand out of the noise: drift, drag, friction, a moving suspension, and softening.

    Parameters
    ----------
    samples : Samples
        What is fitted.
    fit : DecayFit
        With the terms that are sure.
    prior : Softening, optional
        As in `solve`.
    straight : bool
        The path was seen to be straight: no pendulum, no softening.

    Returns
    -------
    DecayFit
        The same where nothing more is seen.

    Notes
    -----
    Each step adds the one term that lowers the misfit most, of those whose parameter stands out of its error with the
    residual's colour paid for. All have one parameter, so an information criterion would order them alike.
    """
    barred = {SOFTENING} if straight else set()
    if samples.drive is None:
        barred.add(GAIN)
    if prior is None and not _fades(samples, fit):
        barred.add(SOFTENING)
    while len(samples.value) >= 4 * (len(fit.terms.free) + 1):
        trials = []
        for place in _promising(samples, fit, barred):
            more = fit_decay(samples, fit.parameters, fit.terms.with_place(place), scale=fit.scale, prior=prior)
            if _sensible(samples, more) and _stands_out(more, place):
                trials.append(more)
        if not trials:
            break
        scale = min(more.scale for more in trials)
        fit = min(trials, key=lambda more: misfit(samples, more, scale=scale))
    # A residual that swings with the sway much more than noise would: two terms may be missing.
    hidden = fit.inflation > 10
    return _prune(samples, fit, barred, prior) if hidden and len(samples.value) > 60 else fit


def _promising(samples: Samples, fit: DecayFit, barred: set[int]) -> list[int]:
    """Return the places of the terms that would stand out of white noise: a fit of the others is not worth its time.

    A score test: what of the residual lies along the term's derivative, outside of those that are fitted.
    """
    places = [k for k in TRIED if k not in fit.terms.free and k not in barred]
    left, outside, _ = _look_outside(samples, fit, places)
    gain = (left @ outside) ** 2 / np.maximum(np.sum(outside**2, axis=0), 1e-20)
    return [k for k, g in zip(places, gain, strict=True) if g > WORTH / 3]


def _look_outside(samples: Samples, fit: DecayFit, places: list[int]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the bounded residual, what of the derivatives at these places lies outside the fit's own, and those."""
    every = predict(samples.time_s, fit.parameters, fit.terms.with_place(SOFTENING), samples.drive)[1]
    every = every / samples.spread[:, None] / fit.scale
    every = every / np.maximum(np.linalg.norm(every, axis=0), 1e-300)
    basis = np.linalg.qr(every[:, fit.terms.free])[0]
    left = fit.residual / samples.spread / fit.scale
    bend = 1 + (left / SOFT) ** 2
    left = left / np.sqrt(bend) / float(np.mean(bend**-1.5))
    return left, every[:, places] - basis @ (basis.T @ every[:, places]), basis


def _may_hide_more(samples: Samples, fit: DecayFit, places: list[int]) -> bool:
    """Say whether all of these terms together might be worth their fit, which takes long: by one step towards it."""
    left, outside, basis = _look_outside(samples, fit, places)
    more = np.linalg.qr(outside)[0]
    along = more.T @ left
    rows = np.column_stack([basis, more])
    colour = find_colour(left - more @ along, grid_places(samples.time_s), rows)
    share = count_independent(colour, len(left)) / len(left)
    return bool(share * float(along @ along) > WORTH / 3)


def _prune(samples: Samples, fit: DecayFit, barred: set[int], prior: Softening | None) -> DecayFit:
    """Return the fit with every term but those that do not stand out, where that leaves clearly less.

    What two missing terms leave colours the residual, and so hides each of them from a search one by one.
    """
    terms, places = fit.terms, [k for k in TRIED if k not in fit.terms.free and k not in barred]
    if not (places and _may_hide_more(samples, fit, places)):
        return fit
    for place in places:
        terms = terms.with_place(place)
    more = fit_decay(samples, fit.parameters, terms, scale=fit.scale, prior=prior)
    while True:
        extra = [k for k in TRIED if k in more.terms.free and k not in fit.terms.free]
        ratio = {k: more.parameters[k] ** 2 / max(more.covariance[k, k], 1e-30) for k in extra}
        bad = [k for k in extra if k in (DRAG, FRICTION) and more.parameters[k] < 0] or [
            k for k in extra if not ratio[k] > _needed(more)
        ]
        if not bad:
            break
        worst = min(bad, key=lambda k: ratio[k])
        p = more.parameters.copy()
        p[worst] = 0.0
        more = fit_decay(samples, p, more.terms.without_place(worst), scale=more.scale, prior=prior)
    few = len(more.terms.free) - len(fit.terms.free)
    gain = misfit(samples, fit, scale=more.scale) - misfit(samples, more, scale=more.scale)
    share = more.freedom / len(samples.value)
    return more if few and _sensible(samples, more) and share * gain > few * WORTH else fit


def _stands_out(fit: DecayFit, place: int) -> bool:
    return bool(fit.parameters[place] ** 2 > _needed(fit) * fit.covariance[place, place])


def _needed(fit: DecayFit) -> float:
    """Return the square of the standard errors that is as rare as WORTH, the noise being known by so little."""
    return float(student_t.isf(norm.sf(np.sqrt(WORTH)), fit.error_freedom)) ** 2


def _sensible(samples: Samples, fit: DecayFit) -> bool:
    """All damping takes energy away, a softening beyond 0.3 is outside of the expansion, and a sway can be seen."""
    p = fit.parameters
    if (fit.terms.drag or fit.terms.friction) and p[ALPHA] < -2 * np.sqrt(fit.covariance[ALPHA, ALPHA]):
        return False
    if not np.hypot(p[COSINE], p[SINE]) < 2 * np.ptp(samples.value):
        return False
    return bool(p[DRAG] >= 0 and p[FRICTION] >= 0 and abs(p[SOFTENING]) < 0.3)


def _fades(samples: Samples, fit: DecayFit) -> bool:
    """Say whether the amplitude falls enough to show what depends on it: else a small swing is far extrapolated."""
    p = fit.parameters
    left = envelope(samples.time_s[-1:], p[ALPHA], p[DRAG], p[FRICTION])[0]
    return float(left[0]) < FADED
