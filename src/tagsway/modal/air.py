"""The air's drag on a payload that is too small to be seen, and too large to be left out of the errors."""

from dataclasses import dataclass, replace

import numpy as np

from tagsway.modal.decay import COSINE, DRAG, OMEGA, SINE, predict
from tagsway.modal.least_squares import fit_decay
from tagsway.modal.samples import DecayFit, Samples, Softening
from tagsway.model import FloatArray

DRAG_STD_PER_RAD = 0.05
"""Quadratic drag of a payload in air, as a term of ζ per radian of swing and 4/3π: bags and boxes of 0.1 to 1 kg."""


SURELY = 0.95
"""Weight of a decay with drag from which on its values are taken."""

REACH = 4.0
"""Times its weight, that the decay with drag counts in the errors: two values apart have wider tails than a normal
distribution of the same variance, and from a weight of 1/20 on the interval of 95 % must reach to the other one."""

MOST_EVIDENCE = 100.0
"""Log of the odds beyond which nothing changes any more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HiddenDrag:
    """A decay with drag, beside one without.

    Parameters
    ----------
    fit : DecayFit
        With drag, under its prior.
    weight : float
        Of it; the rest is that of the decay without.
    """

    fit: DecayFit
    weight: float

    @property
    def sure(self) -> bool:
        """Whether its values are to be taken."""
        return self.weight > SURELY

    def widen(self, plain: DecayFit) -> DecayFit:
        """Return a decay without drag whose errors reach to the one with it."""
        change = self.fit.parameters - plain.parameters
        covariance = self.fit.covariance + np.outer(change, change)
        share = min(1.0, REACH * self.weight)
        return replace(plain, covariance=(1 - share) * plain.covariance + share * covariance)


def weigh_drag(samples: Samples, fit: DecayFit, *, curvature: float, prior: Softening | None) -> HiddenDrag | None:
    """Return the decay with the drag that no test has shown, and how likely it is there.

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
    HiddenDrag or None
        None where drag is one of the terms already, or the swing in radians is not known.

    Notes
    -----
    A decay of a few periods looks the same with a little more drag and a little less viscous damping. Fitted without
    drag, ζ for a small swing is then off by 4/3π d A, many times its error; fitted with it, ζ is needlessly unsure of
    a payload that has none. So both are held to be as likely beforehand, no drag and one of 0 ± s with s = 0.05 a
    radian, and weighed by what the data say [1]_: for drag, with d̂ ± σ where it is free,

        w / (1 - w) = σ (σ² + s²)^-1/2 exp(d̂² s² / 2 σ² (σ² + s²))

    The prior enters as one more measurement, y = ŷ - K d̂ with K = C e (σ² + s²)⁻¹. Values are those of the decay
    without drag until w is large; the errors are those of both, about these values.

    References
    ----------
    .. [1] J. A. Hoeting et al., Statistical Science 14 (1999) 382-417.
    """
    if fit.terms.drag or not curvature > 0:
        return None
    loose = fit_decay(samples, fit.parameters, fit.terms.with_place(DRAG), scale=fit.scale, prior=prior)
    variance = float(loose.covariance[DRAG, DRAG])
    if not (np.all(np.isfinite(loose.parameters)) and 0 < variance < np.inf):
        return None
    swing_rad = float(np.hypot(loose.parameters[COSINE], loose.parameters[SINE])) * curvature
    std = 4 / (3 * np.pi) * DRAG_STD_PER_RAD * float(loose.parameters[OMEGA]) * swing_rad
    gain: FloatArray = loose.covariance[:, DRAG] / (variance + std**2)
    parameters = loose.parameters - gain * loose.parameters[DRAG]
    keep = np.eye(len(parameters))
    keep[:, DRAG] -= gain
    share = std**2 / (variance + std**2)
    odds = np.sqrt(1 - share) * np.exp(min(0.5 * share * loose.parameters[DRAG] ** 2 / variance, MOST_EVIDENCE))
    held = replace(
        loose,
        parameters=parameters,
        residual=samples.value - predict(samples.time_s, parameters, loose.terms, samples.drive)[0],
        covariance=keep @ loose.covariance @ keep.T + std**2 * np.outer(gain, gain),
        dragged=keep @ loose.dragged,
    )
    return HiddenDrag(fit=held, weight=float(odds / (1 + odds)))
