"""The losses of a payload that are too small to be seen, and too large to be left out of the errors."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq
from scipy.special import log_ndtr, ndtr
from scipy.stats import t as student_t

from tagsway.modal.channels import Channel, join_fits
from tagsway.modal.decay import ALPHA, COSINE, DRAG, FRICTION, OMEGA, SINE, SOFTENING, predict
from tagsway.modal.samples import DecayFit, Samples, Softening
from tagsway.modal.uncertainty import SOFT, judge_fit
from tagsway.model import NORMAL_95, FloatArray

DRAG_STD_PER_RAD = 0.05
"""Quadratic drag of a payload in air, as a term of ζ per radian of swing and 4/3π: bags and boxes of 0.1 to 1 kg."""

DEAD_BAND_STD_RAD = 0.002
"""Dry friction over the stiffness: a payload comes to rest within a tenth of a degree of where it hangs."""

ODDS = {DRAG: 1.0, FRICTION: 1 / 3}
"""Beforehand, that a loss is there rather than not: drag may well be, and of four payloads in a gripper one rubs."""

OUTER = (0.025, 0.975)
"""Of what is likely, below the ends of an interval."""

RAREST = 1e-3
"""Chance below which a vibration does not fall."""

SURELY = 0.95
"""Weight of the decays with further losses from which on their values are taken."""

MOST_EVIDENCE = 100.0
"""Log of the odds beyond which nothing changes any more."""

SWINGS_RAD = (1e-9, 10.0)
"""Outside, the search has ended at what is no pendulum's swing: no loss is told from it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HiddenLosses:
    """A decay with losses that no test has shown, beside one without.

    Parameters
    ----------
    fit : DecayFit
        With them, under their priors: the mean of all such decays.
    weight : float
        Of them all; the rest is that of the decay without.
    sets : ndarray, shape (k, 3)
        Of each set of losses: its weight, the viscous rate α under it, and that one's standard error.
    """

    fit: DecayFit
    weight: float
    sets: FloatArray

    @property
    def sure(self) -> bool:
        """Whether its values are to be taken."""
        return self.weight > SURELY

    def decide(self, plain: DecayFit) -> DecayFit:
        """Return the decay with further losses where they are sure, else the one without; with the errors of all.

        Below and above the interval of α lie 2.5 % each of all decays that do not grow, by their weights: what is lost
        to drag or friction is not lost to the viscous part, so that it reaches further down than up. The errors are as
        large as a normal distribution's with an interval so wide. A vibration that grows is no payload's: it stays.
        """
        own = float(np.sqrt(plain.covariance[ALPHA, ALPHA]))
        weight, rate, std = np.vstack([[1 - self.weight, plain.parameters[ALPHA], own], self.sets]).T
        # How well the noise is known, as for every other interval.
        std = np.maximum(std * float(student_t.ppf(OUTER[1], plain.error_freedom)) / NORMAL_95, 1e-12 * abs(rate[0]))
        growing = ndtr(-rate / std)
        falling = float(weight @ (1 - growing))
        if not falling > RAREST:
            return plain

        def find_end(share: float) -> float:
            most = float(np.max(rate + 10 * std))
            return float(brentq(lambda at: weight @ (ndtr((at - rate) / std) - growing) - share * falling, 0.0, most))

        interval = find_end(OUTER[0]), find_end(OUTER[1])
        if self.sure:
            return replace(self.fit, rate_ci95=interval)
        change = self.fit.parameters - plain.parameters
        every = self.fit.covariance + np.outer(change, change)
        more = float(every[ALPHA, ALPHA]) - own**2
        wanted = (interval[1] - interval[0]) / 2 / NORMAL_95
        share = float(np.clip((wanted**2 - own**2) / more, 0.0, 1.0)) if more > 0 else 0.0
        return replace(plain, covariance=(1 - share) * plain.covariance + share * every, rate_ci95=interval)


def weigh_losses(
    samples: Samples, fit: DecayFit, *, curvature: float, prior: Softening | None, other: Channel | None = None
) -> HiddenLosses | None:
    """Return the decay with the drag and the dry friction that no test has shown, and how likely they are there.

    Parameters
    ----------
    samples : Samples
        What was fitted.
    fit : DecayFit
        With the terms that stand out of the noise.
    curvature : float
        Of the payload's path, in 1 / length: the swing in radians is the amplitude times it; 0 where it is not known.
    prior : Softening or None
        As it was used.
    other : Channel, optional
        A second channel of the same vibration.

    Returns
    -------
    HiddenLosses or None
        None where both are terms already, or the swing in radians is not known.

    Notes
    -----
    A decay of a few periods looks the same with a little more drag and a little less viscous damping, or with drag and
    friction whose parts of the damping fall and rise with the amplitude. Fitted without them, ζ for a small swing
    is off by many times its error; fitted with them, ζ is needlessly unsure of a payload that has none. So each set of
    losses V that are not fitted, the empty one too, is held to be as likely beforehand (friction by its odds),
    each loss half-normal of width s, and weighed by what the data say [1]_: with û and its
    precision P where all are free,

        Z_V / Z_0 = |1 + S P_VV|^-1/2 exp(½ bᵀ (P_VV + S⁻¹)⁻¹ b) ∏ 2 Φ(m_i / σ_i),      b = P_V û

    where m and σ are the mean and the errors that are left, each loss in its turn held above 0: no loss is a gain.
    Values are those of the decay without until the others' weight is large; the errors are those of all, about these
    values.

    References
    ----------
    .. [1] J. A. Hoeting et al., Statistical Science 14 (1999) 382-417.
    """
    absent = [place for place in (DRAG, FRICTION) if place not in fit.terms.free]
    if not absent or not curvature > 0:
        return None
    loose = _fit_near(samples, fit, absent, prior)
    if other is not None:
        second = _fit_near(other.samples, other.fit, absent, prior)
        if not (_is_sound(loose, absent) and _is_sound(second, absent)):
            return None
        loose = join_fits(samples, loose, second, prior=prior)
    std = _find_widths(loose, absent, curvature)
    return None if std is None else _average_sets(samples, loose, absent, std)


def _is_sound(fit: DecayFit, places: list[int]) -> bool:
    """Whether a fit that was loosened at these places has not lost its way."""
    own = fit.covariance[np.ix_(places, places)]
    numbers = np.concatenate([fit.parameters, fit.covariance.ravel()])
    return bool(np.all(np.isfinite(numbers)) and np.all(np.diag(own)))


def _average_sets(samples: Samples, loose: DecayFit, places: list[int], std: FloatArray) -> HiddenLosses:
    """Return the mean of all sets of losses at these places, of such widths beforehand, from the fit with all free."""
    value, covariance = loose.parameters[places] / std, loose.covariance[np.ix_(places, places)] / np.outer(std, std)
    weights, means, spreads = _weigh_sets(value, covariance, [ODDS[place] for place in places])
    weight = float(np.sum(weights))
    mean = weights @ means / weight
    away = means - mean
    every = np.einsum("k,kij->ij", weights / weight, spreads + away[:, :, None] * away[:, None, :])
    # By how much all parameters follow one width of each loss, and what is left unsure of them were the losses known.
    gain: FloatArray = loose.covariance[:, places] / std @ np.linalg.pinv(covariance, hermitian=True)
    left = loose.covariance - gain @ covariance @ gain.T
    parameters = loose.parameters + gain @ (mean - value)
    of_rate = left[ALPHA, ALPHA] + np.einsum("i,kij,j->k", gain[ALPHA], spreads, gain[ALPHA])
    rates = parameters[ALPHA] + away @ gain[ALPHA]
    return HiddenLosses(
        fit=replace(
            loose,
            parameters=parameters,
            residual=samples.value - predict(samples.time_s, parameters, loose.terms, samples.drive)[0],
            covariance=left + gain @ every @ gain.T,
        ),
        weight=weight,
        sets=np.column_stack([weights, rates, np.sqrt(np.maximum(of_rate, 1e-300))]),
    )


def _find_widths(fit: DecayFit, places: list[int], curvature: float) -> FloatArray | None:
    """Return how large these losses may be beforehand; None where the fit to be loosened has lost its way."""
    p = fit.parameters
    if not _is_sound(fit, places):
        return None
    swing_rad, omega = float(np.hypot(p[COSINE], p[SINE])) * curvature, float(p[OMEGA])
    if not (SWINGS_RAD[0] < swing_rad < SWINGS_RAD[1] and omega > 0):
        return None
    width = {
        DRAG: 4 / (3 * np.pi) * DRAG_STD_PER_RAD * omega * swing_rad,
        FRICTION: 2 / np.pi * DEAD_BAND_STD_RAD * omega / swing_rad,
    }
    return np.array([width[place] for place in places])


def _fit_near(samples: Samples, fit: DecayFit, places: list[int], prior: Softening | None) -> DecayFit:
    """Return the fit with further terms after one step from a fit without: they are small, or they would be seen."""
    terms = fit.terms
    for place in places:
        terms = terms.with_place(place)
    judged = judge_fit(samples, fit.parameters, terms, scale=fit.scale, prior=prior, deviance=fit.deviance)
    free = terms.free
    rows = predict(samples.time_s, fit.parameters, terms, samples.drive)[1][:, free]
    rows = rows / samples.spread[:, None] / fit.scale
    reduced = fit.residual / samples.spread / fit.scale
    bend = 1 + (reduced / SOFT) ** 2
    pull = rows.T @ (reduced / np.sqrt(bend)) / float(np.mean(bend**-1.5))
    if prior is not None and prior.std > 0 and terms.softening:
        pull[free.index(SOFTENING)] += (prior.mean - fit.parameters[SOFTENING]) / prior.std**2
    p = fit.parameters.copy()
    p[free] += judged.bound[np.ix_(free, free)] @ pull
    return replace(judged, parameters=p)


def _weigh_sets(
    value: FloatArray, covariance: FloatArray, odds: Sequence[float]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return weight, mean and covariance of each set of losses but the empty one, whose weight is the rest.

    Parameters
    ----------
    value : ndarray, shape (k,)
        Of the losses, where all are free, over the widths of their priors.
    covariance : ndarray, shape (k, k)
        Of these.
    odds : sequence of float
        Of each loss, beforehand.
    """
    precision = np.linalg.pinv(covariance, hermitian=True)
    pull, size = precision @ value, len(value)
    log_odds, means, spreads = [], [], []
    for chosen in ([0],) if size == 1 else ([0], [1], [0, 1]):
        block = np.ix_(chosen, chosen)
        left = np.linalg.inv(precision[block] + np.eye(len(chosen)))
        mean, spread = np.zeros(size), np.zeros((size, size))
        mean[chosen], spread[block] = left @ pull[chosen], left
        fits = 0.5 * float(pull[chosen] @ mean[chosen] + np.linalg.slogdet(left)[1])
        mean, spread, signs = _hold_positive(mean, spread, chosen)
        log_odds.append(min(fits + signs + float(np.sum(np.log(np.take(odds, chosen)))), MOST_EVIDENCE))
        means.append(mean)
        spreads.append(spread)
    posterior = np.exp(log_odds)
    return posterior / (1 + np.sum(posterior)), np.array(means), np.array(spreads)


def _hold_positive(mean: FloatArray, spread: FloatArray, places: Sequence[int]) -> tuple[FloatArray, FloatArray, float]:
    """Return mean and covariance of a normal distribution of losses, none of which is a gain, and the log of its size.

    Loss after loss: each is cut off at 0, the others follow it, and the result is taken for normal again.
    """
    size = 0.0
    for place in places:
        sigma = float(np.sqrt(spread[place, place]))
        ratio = float(mean[place]) / sigma
        log_share = float(log_ndtr(ratio))
        hazard = float(np.exp(-0.5 * ratio**2 - 0.5 * np.log(2 * np.pi) - log_share))
        with_it = spread[:, place] / sigma
        mean = mean + with_it * hazard
        spread = spread - np.outer(with_it, with_it) * (hazard * (hazard + ratio))
        size += np.log(2) + log_share
    return mean, spread, size
