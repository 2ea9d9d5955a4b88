"""The air's drag on a payload that is too small to be seen, and too large to be left out of the errors."""

from dataclasses import replace

import numpy as np

from tagsway.modal.decay import COSINE, DRAG, OMEGA, SINE, predict
from tagsway.modal.least_squares import fit_decay
from tagsway.modal.samples import DecayFit, Samples, Softening
from tagsway.model import FloatArray

DRAG_STD_PER_RAD = 0.05
"""Quadratic drag of a payload in air, as a term of ζ per radian of swing and 4/3π: bags and boxes of 0.1 to 1 kg."""


MOST_EVIDENCE = 100.0
"""Log of the odds beyond which nothing changes any more."""


def allow_for_drag(samples: Samples, fit: DecayFit, *, curvature: float, prior: Softening | None) -> DecayFit:
    """Return a fit in which the drag that no test has shown may still be there.

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

    Returns
    -------
    DecayFit
        With drag, whose error says whether it was seen. The fit itself where drag is one of its terms already, or the
        swing in radians is not known.

    Notes
    -----
    A decay of a few periods looks the same with a little more drag and a little less viscous damping. Fitted without
    drag, ζ for a small swing is then off by 4/3π d A, many times its error; fitted with it, ζ is needlessly unsure of
    a payload that has none. So both are held to be as likely beforehand, no drag and one of 0 ± s with s = 0.05 a
    radian, and averaged with the weights that the data give them [1]_: for drag, with d̂ ± σ where it is free,

        w / (1 - w) = σ (σ² + s²)^-1/2 exp(d̂² s² / 2 σ² (σ² + s²))

    The prior enters as one more measurement, y = ŷ - K d̂ with K = C e (σ² + s²)⁻¹. What the two differ by is a part of
    the errors.

    References
    ----------
    .. [1] J. A. Hoeting et al., Statistical Science 14 (1999) 382-417.
    """
    if fit.terms.drag or not curvature > 0:
        return fit
    loose = fit_decay(samples, fit.parameters, fit.terms.with_place(DRAG), scale=fit.scale, prior=prior)
    variance = float(loose.covariance[DRAG, DRAG])
    if not (np.all(np.isfinite(loose.parameters)) and 0 < variance < np.inf):
        return fit
    swing_rad = float(np.hypot(loose.parameters[COSINE], loose.parameters[SINE])) * curvature
    std = 4 / (3 * np.pi) * DRAG_STD_PER_RAD * float(loose.parameters[OMEGA]) * swing_rad
    gain: FloatArray = loose.covariance[:, DRAG] / (variance + std**2)
    parameters = loose.parameters - gain * loose.parameters[DRAG]
    keep = np.eye(len(parameters))
    keep[:, DRAG] -= gain
    covariance = keep @ loose.covariance @ keep.T + std**2 * np.outer(gain, gain)
    share = std**2 / (variance + std**2)
    odds = np.sqrt(1 - share) * np.exp(min(0.5 * share * loose.parameters[DRAG] ** 2 / variance, MOST_EVIDENCE))
    weight = float(odds / (1 + odds))
    change = parameters - fit.parameters
    averaged = fit.parameters + weight * change
    return replace(
        loose,
        parameters=averaged,
        residual=samples.value - predict(samples.time_s, averaged, loose.terms, samples.drive)[0],
        covariance=(1 - weight) * fit.covariance
        + weight * covariance
        + weight * (1 - weight) * np.outer(change, change),
        dragged=(1 - weight) * fit.dragged + weight * keep @ loose.dragged,
    )
