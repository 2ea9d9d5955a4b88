"""Robust least squares of a decay on the raw samples: the estimator that decides."""

from dataclasses import dataclass, replace

import numpy as np

from tagsway.modal.decay import ALPHA, COSINE, DRAG, OFFSET, OMEGA, SINE, SLOPE, SOFTENING, Terms, predict
from tagsway.modal.noise import Colour, find_colour, grid_places
from tagsway.modal.sway import MAD_TO_STD
from tagsway.model import FloatArray

SOFT = 1.5
"""Where soft-L1 turns from squares to absolute values, in standard deviations: 97 % efficient on normal noise."""

WORTH = 20.0
"""Square of the standard errors by which a further term must stand out: one false term in 100 000 is rare enough."""


SCATTER_OF_SCALE = 3.0
"""Of a scale from a median absolute deviation, times the root of the samples: 2.6 of its standard errors (1.16)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """What is fitted.

    Parameters
    ----------
    time_s, value, spread : ndarray, shape (n,)
        Times from the window's start, values, and each one's relative standard error.
    stated : float
        Standard error of the median sample as its source states it; 0 where it states none.
    """

    time_s: FloatArray
    value: FloatArray
    spread: FloatArray
    stated: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Softening:
    """What geometry says of the softening before the fit: a normal prior."""

    mean: float
    std: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DecayFit:
    """A fitted decay.

    Parameters
    ----------
    parameters : ndarray, shape (8,)
        In the order of `tagsway.modal.decay`.
    terms : Terms
        Which of them were fitted.
    residual : ndarray, shape (n,)
        In the signal's unit.
    scale : float
        Standard deviation of the median sample's noise, spikes left aside.
    covariance : ndarray, shape (8, 8)
        With the residual's colour paid for; zero where nothing was fitted.
    bound : ndarray, shape (8, 8)
        Cramér-Rao bound for white noise of this scale.
    inflation : float
        The residual's power density at ω_d over that of white noise.
    freedom : float
        Degrees of freedom that the colour leaves.
    deviance : float
        Robust -2 ln likelihood but for a constant, at `scale` of the first model.
    """

    parameters: FloatArray
    terms: Terms
    residual: FloatArray
    scale: float
    covariance: FloatArray
    bound: FloatArray
    inflation: float
    freedom: float
    deviance: float


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
    parameters : ndarray, shape (8,)
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
    p = np.zeros(8)
    p[[OMEGA, ALPHA, COSINE, SINE, OFFSET]] = [omega, alpha, *linear]
    return p, scale


def solve(
    samples: Samples, start: FloatArray, terms: Terms, *, scale: float, prior: Softening | None = None
) -> tuple[FloatArray, float]:
    """Minimise the soft-L1 cost from a start value.

    Parameters
    ----------
    samples : Samples
        What is fitted.
    start : ndarray, shape (8,)
        Parameters near the solution.
    terms : Terms
        Which of them are free.
    scale : float
        Noise of the median sample.
    prior : Softening, optional
        Of the softening.

    Returns
    -------
    parameters : ndarray, shape (8,)
    deviance : float
        Twice the cost over the variance.
    """
    free = terms.free
    known = prior if prior is not None and prior.std > 0 and terms.softening else None

    def look(p: FloatArray) -> tuple[FloatArray, FloatArray]:
        value, rows = predict(samples.time_s, p, terms)
        left, rows = (value - samples.value) / samples.spread / scale, rows[:, free] / samples.spread[:, None] / scale
        if known is not None:
            left = np.append(left, (p[SOFTENING] - known.mean) / known.std)
            rows = np.vstack([rows, np.eye(1, len(free), free.index(SOFTENING)) / known.std])
        return left, rows

    # Levenberg-Marquardt on the iteratively reweighted squares; the columns' own lengths are the damping's scale.
    p, damping = start.copy(), 1e-3
    left, rows = look(p)
    deviance = _soft(left)
    for _ in range(100):
        weight = (1 + (left / SOFT) ** 2) ** -0.5
        unit = np.linalg.norm(rows, axis=0)
        unit[unit == 0] = 1.0
        scaled = rows / unit
        curvature = (scaled * weight[:, None]).T @ scaled
        step = -np.linalg.solve(curvature + damping * np.diag(np.diag(curvature) + 1e-12), scaled.T @ (weight * left))
        trial = p.copy()
        trial[free] += step / unit
        new_left, new_rows = look(trial)
        new = _soft(new_left)
        if not new <= deviance:
            damping *= 8
            if damping > 1e8:
                break
            continue
        done = deviance - new < 1e-9 * deviance or float(np.linalg.norm(step)) < 1e-5
        p, left, rows, deviance, damping = trial, new_left, new_rows, new, max(damping / 8, 1e-12)
        if done:
            break
    return p, deviance


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
    Soft-L1 on the samples as they are (a gap is a gap) leaves 1 % of spikes almost without effect. The covariance is
    the sandwich H⁻¹ (Jᵀ R J) H⁻¹ with R the autoregressive covariance of the bounded residuals, so that coloured noise
    is paid for at the frequencies where each parameter listens.

    Noise beyond what the tracker states comes from the video's compression, and a codec does not only add noise: it
    drags what moves. An oscillation with the sway's own phase and a constant amplitude of that excess is therefore
    added to the errors; no residual shows it, since the fit follows it.
    """
    dof = max(len(samples.value) - len(terms.free), 1)
    for _ in range(2):
        p, deviance = solve(samples, start, terms, scale=scale, prior=prior)
        left = samples.value - predict(samples.time_s, p, terms)[0]
        found = MAD_TO_STD * float(np.median(np.abs(left / samples.spread))) * np.sqrt(len(left) / dof)
        floor = 1e-9 * float(np.hypot(p[COSINE], p[SINE])) + 1e-300
        close = abs(found - scale) < 0.02 * scale
        start, scale = p, max(found, floor)
        if close:
            break
    return _with_errors(samples, p, terms, scale=scale, prior=prior, deviance=deviance)


def _with_errors(
    samples: Samples, p: FloatArray, terms: Terms, *, scale: float, prior: Softening | None, deviance: float
) -> DecayFit:
    value, every = predict(samples.time_s, p, terms)
    free = terms.free
    residual = samples.value - value
    rows = every[:, free] / samples.spread[:, None] / scale
    unit = np.linalg.norm(rows, axis=0)
    unit[unit == 0] = 1.0
    rows = rows / unit
    reduced = residual / samples.spread / scale
    bend = 1 + (reduced / SOFT) ** 2
    place = grid_places(samples.time_s)
    colour = find_colour(reduced / np.sqrt(bend), place, fitted=len(free))
    slope = float(np.mean(bend**-1.5))
    known = np.zeros((len(free), len(free)))
    if prior is not None and prior.std > 0 and terms.softening:
        k = free.index(SOFTENING)
        known[k, k] = (prior.std * unit[k]) ** -2
    information = rows.T @ rows
    bread = np.linalg.pinv(slope * information + known, rcond=1e-14)
    spread_of = bread @ (colour.meat(rows, place) + known) @ bread
    inflation = float(colour.density(p[OMEGA] * _step(samples.time_s, place)))
    whole = np.ix_(free, free)

    def scaled(matrix: FloatArray) -> FloatArray:
        return np.asarray(matrix / unit[:, None] / unit[None, :], dtype=float)

    dragged = bread @ rows.T @ (_dragged(samples, p, every, scale) / samples.spread[:, None] / scale)
    covariance, bound = np.zeros((8, 8)), np.zeros((8, 8))
    covariance[whole] = scaled(spread_of + dragged @ dragged.T)
    bound[whole] = scaled(np.linalg.pinv(information + known, rcond=1e-14))
    return DecayFit(
        parameters=p,
        terms=terms,
        residual=residual,
        scale=scale,
        covariance=covariance,
        bound=bound,
        inflation=inflation,
        freedom=max(_independent(colour, len(residual)) - len(free), 1.0),
        deviance=deviance,
    )


def _dragged(samples: Samples, p: FloatArray, jacobian: FloatArray, scale: float) -> FloatArray:
    """Return the oscillation that compression may have added, in phase with the sway and across it, shape (n, 2)."""
    size, surely = float(np.hypot(p[COSINE], p[SINE])), scale * (1 - SCATTER_OF_SCALE / np.sqrt(len(samples.value)))
    if not (samples.stated > 0 and surely > samples.stated and size > 0):
        return np.zeros((len(samples.value), 2))
    excess = np.sqrt(scale**2 - samples.stated**2)
    cosine, sine = jacobian[:, COSINE], jacobian[:, SINE]
    both = np.column_stack([p[COSINE] * cosine + p[SINE] * sine, p[COSINE] * sine - p[SINE] * cosine]) / size
    length = np.hypot(*both.T)[:, None]
    return np.asarray(excess * both / np.maximum(length, 1e-300), dtype=float)


def _step(time_s: FloatArray, place: np.ndarray) -> float:
    return float((time_s[-1] - time_s[0]) / max(int(place[-1]), 1))


def _independent(colour: Colour, n: int) -> float:
    """Return how many independent samples hold as much as these n: n (∫S)² / ∫S² by Bartlett."""
    density = colour.density(np.linspace(0, np.pi, 257))
    return n * float(np.mean(density)) ** 2 / float(np.mean(density**2))


def extend(samples: Samples, fit: DecayFit, *, prior: Softening | None = None, straight: bool = False) -> DecayFit:
    """Add the terms that stand out of the noise: drift, drag, and softening where geometry gives none.

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
    """
    for place in (SLOPE, SOFTENING, DRAG, SLOPE):
        few = len(samples.value) < 4 * (len(fit.terms.free) + 1)
        if few or place in fit.terms.free or (straight and place == SOFTENING):
            continue
        trial = replace(
            fit.terms,
            slope=fit.terms.slope or place == SLOPE,
            softening=fit.terms.softening or place == SOFTENING,
            drag=fit.terms.drag or place == DRAG,
        )
        more = fit_decay(samples, fit.parameters, trial, scale=fit.scale, prior=prior)
        # Drag takes energy away; and a softening beyond 0.3 is outside of the expansion.
        sensible = more.parameters[DRAG] >= 0 and abs(more.parameters[SOFTENING]) < 0.3
        if sensible and more.parameters[place] ** 2 > WORTH * more.covariance[place, place]:
            fit = more
    return fit
