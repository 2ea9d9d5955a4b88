"""A second witness of the same vibration: the tag's own rotation."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2, norm

from tagsway.modal.decay import ALPHA, COSINE, OFFSET, OMEGA, SINE, SOFTENING, predict
from tagsway.modal.least_squares import DecayFit, Samples, Softening, fit_decay, fit_linear_part
from tagsway.modal.modes import amplitude_significance
from tagsway.model import FloatArray, Notice

CLEAR = 10.0
"""Standard errors by which the second channel's amplitude must exceed nothing to be of use."""

UNLIKELY = 1e-4
"""Probability below which two channels do not show one vibration."""

SAME_SWING = 0.05
"""Of the frequency, within which two channels that contradict each other speak of one swing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """A second channel, the decay of the same terms that was fitted to it alone, and whether both show one swing."""

    samples: Samples
    fit: DecayFit
    agrees: bool = True


def fit_channel(
    samples: Samples, fit: DecayFit, other: Samples | None, *, prior: Softening | None
) -> tuple[Channel | None, tuple[Notice, ...]]:
    """Fit a second channel of the same vibration.

    Parameters
    ----------
    samples : Samples
        First channel.
    fit : DecayFit
        Of it.
    other : Samples or None
        Second channel, in a unit of its own, from the same start.
    prior : Softening or None
        That both fits use.

    Returns
    -------
    Channel or None
        None where it tells little.
    tuple of Notice
        Where the channels contradict each other; the first's values are then to be kept as they are.
    """
    if other is None or len(other.value) < 0.5 * len(samples.value):
        return None, ()
    start = fit_linear_part(other, float(fit.parameters[OMEGA]), float(fit.parameters[ALPHA]))
    first = np.where(np.isin(np.arange(len(fit.parameters)), fit.terms.shared), fit.parameters, 0.0)
    first[[COSINE, SINE, OFFSET]] = start[0][[COSINE, SINE, OFFSET]]
    # The angle's amplitude is the swing itself, whatever of the way is seen.
    terms = replace(fit.terms, curvature=1.0, square=False, projected=False)
    second = fit_decay(other, first, terms, scale=max(start[1], 1e-12), prior=prior)
    if not amplitude_significance(second) > CLEAR:
        return None, ()
    shared = fit.terms.shared
    block = np.ix_(shared, shared)
    apart = second.parameters[shared] - fit.parameters[shared]
    both = fit.covariance[block] + second.covariance[block]
    if prior is not None and SOFTENING in shared:
        # The prior is in both, so that it cannot set them apart.
        both[shared.index(SOFTENING), shared.index(SOFTENING)] += prior.std**2
    distance = float(apart @ np.linalg.pinv(both, hermitian=True) @ apart)
    if not chi2.sf(distance, len(shared)) > UNLIKELY:
        held = ", and its errors hold the gap" if _is_one_swing(fit, second) else ""
        notice = Notice(
            code="angle_disagrees",
            message="the tag's rotation does not swing as its position does "
            f"({second.parameters[OMEGA] / (2 * np.pi):.5g} against {fit.parameters[OMEGA] / (2 * np.pi):.5g} Hz): "
            f"the payload yaws, sways across or has a second body; the position decides{held}",
        )
        return Channel(samples=other, fit=second, agrees=False), (notice,)
    return Channel(samples=other, fit=second), ()


def doubt_fit(fit: DecayFit, second: DecayFit) -> DecayFit:
    """Return a fit whose pole is as unsure as another witness of the same swing is apart from it."""
    pole = [OMEGA, ALPHA]
    apart = second.parameters[pole] - fit.parameters[pole]
    if not _is_one_swing(fit, second):
        return fit
    column = np.zeros((len(fit.parameters), 1))
    column[pole, 0] = apart
    interval, rate = fit.rate_ci95, float(fit.parameters[ALPHA])
    if interval is not None:
        low, high = (float(np.hypot(rate - end, norm.ppf(0.975) * apart[1])) for end in interval)
        interval = (rate - low, rate + high)
    return replace(
        fit,
        covariance=fit.covariance + column @ column.T,
        common=np.column_stack([fit.common, column]),
        rate_ci95=interval,
    )


def _is_one_swing(fit: DecayFit, second: DecayFit) -> bool:
    return bool(abs(second.parameters[OMEGA] - fit.parameters[OMEGA]) < SAME_SWING * fit.parameters[OMEGA])


def join_fits(samples: Samples, fit: DecayFit, second: DecayFit, *, prior: Softening | None) -> DecayFit:
    """Return the fit of the first channel at the joint minimum of both.

    Parameters
    ----------
    samples : Samples
        First channel.
    fit, second : DecayFit
        Of each channel alone, with the same terms.
    prior : Softening or None
        That both fits use.

    Returns
    -------
    DecayFit

    Notes
    -----
    The channels share the poles and what damps or softens them; amplitude, phase, offset and drift are each one's own.
    Two least squares that share some parameters have their joint minimum where their two quadratic forms add, so the
    second fit enters the first as a measurement of the shared parameters, with the prior counted once.
    """
    shared = fit.terms.shared
    block = np.ix_(shared, shared)
    moved = second.common[shared]
    known, mean = np.zeros((len(shared), len(shared))), np.zeros(len(shared))
    if prior is not None and prior.std > 0 and SOFTENING in shared:
        k = shared.index(SOFTENING)
        known[k, k], mean[k] = prior.std**-2, prior.mean
    own = fit.covariance - fit.common @ fit.common.T
    news = _information(second.covariance[block] - moved @ moved.T, known)
    values = second.parameters[shared]
    gain = _gain(own, news, shared)
    p = fit.parameters + gain @ (news @ (values - fit.parameters[shared]) + known @ (values - mean))
    keep = np.eye(len(p))
    keep[:, shared] -= gain @ news
    joint = keep @ own
    # What a codec drags, or a sway across adds, it does in both.
    common = keep @ fit.common + gain @ news @ moved
    of_bound = _information(second.bound[block], known)
    bound = fit.bound - _gain(fit.bound, of_bound, shared) @ of_bound @ fit.bound[shared]
    return replace(
        fit,
        parameters=p,
        residual=samples.value - predict(samples.time_s, p, fit.terms, samples.drive)[0],
        covariance=0.5 * (joint + joint.T) + common @ common.T,
        common=common,
        bound=0.5 * (bound + bound.T),
    )


def _gain(covariance: FloatArray, news: FloatArray, shared: list[int]) -> FloatArray:
    """Return C Hᵀ (I + N H C Hᵀ)⁻¹: what information N on the shared parameters moves."""
    inner = np.eye(len(shared)) + news @ covariance[np.ix_(shared, shared)]
    return np.asarray(np.linalg.solve(inner.T, covariance[:, shared].T).T, dtype=float)


def _information(covariance: FloatArray, known: FloatArray) -> FloatArray:
    """Return the information of a fit without its prior's, in units that keep it well conditioned."""
    unit = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    information = np.linalg.pinv(covariance / np.outer(unit, unit), hermitian=True) - known * np.outer(unit, unit)
    size, axes = np.linalg.eigh(information)
    return np.asarray((axes * np.maximum(size, 0.0)) @ axes.T / np.outer(unit, unit), dtype=float)
