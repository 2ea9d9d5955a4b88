"""How sure a fitted decay is: the residual's colour, the bound, and what a codec drags."""

import numpy as np

from tagsway.modal.decay import ALPHA, COSINE, GAIN, OMEGA, SINE, SOFTENING, Terms, predict, respond
from tagsway.modal.noise import Colour, find_colour, grid_places
from tagsway.modal.samples import DecayFit, Samples, Softening
from tagsway.model import FloatArray

SOFT = 1.5
"""Where soft-L1 turns from squares to absolute values, in standard deviations: 97 % efficient on normal noise."""

DRAG = np.array([1.0, 4 / np.pi])
"""Amplitudes of a codec's drag in the sway's own phase and across it, over its standard error. What lags by a constant
width errs by a square wave across the phase, whose fundamental is 4 / π of it. In phase it was seen to reach 1, though
a dozen decays each in H.264, HEVC and MPEG-4 Part 2 had 0.1 to 0.4 of it, rms."""

SCATTER_OF_SCALE = 3.0
"""Of a scale from a median absolute deviation, times the root of the samples: 2.6 of its standard errors (1.16)."""


def judge_fit(
    samples: Samples, p: FloatArray, terms: Terms, *, scale: float, prior: Softening | None, deviance: float
) -> DecayFit:
    """Return a fit with its errors.

    Parameters
    ----------
    samples : Samples
        What was fitted.
    p : ndarray, shape (11 + 4 k,)
        Parameters at the minimum.
    terms : Terms
        Which of them were free.
    scale : float
        Noise of the median sample.
    prior : Softening or None
        As it was used.
    deviance : float
        At the minimum.

    Returns
    -------
    DecayFit

    Notes
    -----
    The covariance is the sandwich H⁻¹ (Jᵀ R J) H⁻¹ with R the autoregressive covariance of the bounded residuals, so
    that coloured noise is paid for at the frequencies where each parameter listens.

    Noise beyond the images' own comes from the video's compression, and a codec does not only add noise: it holds back
    what moves, like a backlash. Oscillations with the sway's frequency and a constant amplitude of that excess, or of
    what the tracker states of it, are therefore added to the errors; no residual shows them: the fit follows them.
    So is what a small swing's frequency would change by with a softening that the decay shows, but no arc explains.
    """
    value, every = predict(samples.time_s, p, terms, samples.drive)
    free, residual, size = terms.free, samples.value - value, len(p)
    rows, unit = _in_units(every[:, free] / samples.spread[:, None] / scale)
    reduced = residual / samples.spread / scale
    bend = 1 + (reduced / SOFT) ** 2
    place = grid_places(samples.time_s)
    colour = find_colour(reduced / np.sqrt(bend), place, rows)
    known = _known(terms, prior, unit)
    bread = np.linalg.pinv(float(np.mean(bend**-1.5)) * rows.T @ rows + known, rcond=1e-14)
    meat = colour.meat(rows, place) + known
    if samples.drive is not None and terms.driven:
        meat += _meat_of_drive(samples, p, rows / samples.spread[:, None] / scale)
    pulled = bread @ rows.T @ (_common(samples, p, every, scale) / samples.spread[:, None] / scale)
    if prior is not None and prior.doubt and terms.softening:
        unseen = bread @ rows.T @ (prior.doubt * every[:, SOFTENING] / samples.spread / scale)
        unseen[free.index(SOFTENING)] = -prior.doubt * unit[free.index(SOFTENING)]
        pulled = np.column_stack([pulled, unseen])
    turn = float(p[OMEGA]) * _step(samples.time_s, place)
    return DecayFit(
        parameters=p,
        terms=terms,
        residual=residual,
        scale=scale,
        covariance=_spread(bread @ meat @ bread + pulled @ pulled.T, unit, terms, size),
        common=np.eye(size)[:, free] @ (pulled / unit[:, None]),
        bound=_spread(np.linalg.pinv(rows.T @ rows + known, rcond=1e-14), unit, terms, size),
        inflation=float(colour.density(turn)),
        freedom=max(count_independent(colour, len(residual)) - len(free), 1.0),
        error_freedom=max(colour.freedom_at(turn) - len(free), 1.0),
        deviance=deviance,
    )


def _in_units(rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return columns of length 1, and the lengths that they had."""
    unit: FloatArray = np.linalg.norm(rows, axis=0)
    unit[unit == 0] = 1.0
    return rows / unit, unit


def _known(terms: Terms, prior: Softening | None, unit: FloatArray) -> FloatArray:
    """Return what a prior knows of the free parameters, in their units."""
    known = np.zeros((len(unit), len(unit)))
    if prior is not None and prior.std > 0 and terms.softening:
        k = terms.free.index(SOFTENING)
        known[k, k] = (prior.std * unit[k]) ** -2
    return known


def _spread(covariance: np.ndarray, unit: FloatArray, terms: Terms, size: int) -> FloatArray:
    """Return the covariance of all parameters from that of the free ones in their units."""
    whole = np.zeros((size, size))
    whole[np.ix_(terms.free, terms.free)] = covariance / np.outer(unit, unit)
    return whole


def _common(samples: Samples, p: FloatArray, jacobian: FloatArray, scale: float) -> FloatArray:
    """Return what one standard error of each thing that errs for all samples together does to them, a codec's first."""
    dragged = _dragged(samples, p, jacobian, scale)
    return dragged if samples.common is None else np.column_stack([dragged, samples.common])


def _dragged(samples: Samples, p: FloatArray, jacobian: FloatArray, scale: float) -> FloatArray:
    """Return the oscillation that compression may have added, in phase with the sway and across it, shape (n, 2)."""
    size, surely = float(np.hypot(p[COSINE], p[SINE])), scale * (1 - SCATTER_OF_SCALE / np.sqrt(len(samples.value)))
    shown = np.sqrt(scale**2 - samples.stated**2) if surely > samples.stated > 0 else 0.0
    excess = max(shown, samples.pulled)
    if not (excess > 0 and size > 0):
        return np.zeros((len(samples.value), 2))
    cosine, sine = jacobian[:, COSINE], jacobian[:, SINE]
    both = np.column_stack([p[COSINE] * cosine + p[SINE] * sine, p[COSINE] * sine - p[SINE] * cosine]) / size
    length = np.hypot(*both.T)[:, None]
    return np.asarray(excess * DRAG * both / np.maximum(length, 1e-300), dtype=float)


def _meat_of_drive(samples: Samples, p: FloatArray, rows: FloatArray) -> FloatArray:
    """Return Jᵀ K Kᵀ J σ² with K what the sway makes of the drive: its noise rings at f_n, and the fit follows it.

    The transpose of a causal filter is the same filter run backwards.
    """
    back = samples.time_s[-1] - samples.time_s[::-1]
    heard = np.column_stack([respond(back, c, p[OMEGA], p[ALPHA])[0] for c in rows[::-1].T])
    return np.asarray((p[GAIN] * samples.drive_std) ** 2 * heard.T @ heard, dtype=float)


def _step(time_s: FloatArray, place: np.ndarray) -> float:
    return float((time_s[-1] - time_s[0]) / max(int(place[-1]), 1))


def count_independent(colour: Colour, n: int) -> float:
    """Return how many independent samples hold as much as these n: n (∫S)² / ∫S² by Bartlett."""
    density = colour.density(np.linspace(0, np.pi, 257))
    return n * float(np.mean(density)) ** 2 / float(np.mean(density**2))
