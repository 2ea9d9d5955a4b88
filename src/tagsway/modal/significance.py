"""Whether a fitted decay is one, or noise that happens to look so."""

from dataclasses import replace

import numpy as np

from tagsway.errors import NotIdentifiableError
from tagsway.modal.decay import ALPHA, OMEGA
from tagsway.modal.least_squares import DecayFit, Samples
from tagsway.modal.modes import amplitude_significance

NEEDED = 6.5
"""Standard errors by which the amplitude must exceed nothing: the search over poles and windows eats about five."""

NEEDED_COLOURED = 8.0
"""The same over many cycles where the residual is coloured: its colour is estimated too."""

NEEDED_CYCLES = 1.2
"""A bend and a half can be drawn through anything."""


def require_oscillation(fit: DecayFit, samples: Samples, *, where: str) -> None:
    """Raise NotIdentifiableError where the fitted decay does not stand out of what it leaves.

    Parameters
    ----------
    fit : DecayFit
        Of these samples.
    samples : Samples
        What was fitted.
    where : str
        For the message.
    """
    seen = cycles_seen(fit, samples)
    score, needed = significance(fit), NEEDED
    if fit.freedom < 0.5 * len(samples.time_s):
        # Smooth wandering fits a swing or two well by chance, and ever less often more of them.
        needed = NEEDED_COLOURED * (1 + 10 * (NEEDED_CYCLES / max(seen, NEEDED_CYCLES)) ** 4)
    if not score > needed:
        raise NotIdentifiableError(
            f"nothing swings {where}: no damped oscillation stands out of the noise ({score:.1f} standard errors, "
            f"{needed:.1f} are needed): film a release that leaves a visible sway"
        )
    if not seen >= NEEDED_CYCLES:
        raise NotIdentifiableError(
            f"nothing swings {where}: {seen:.1f} cycles before the motion is over, "
            f"at least {NEEDED_CYCLES:g} are needed"
        )


def significance(fit: DecayFit) -> float:
    """Return the first mode's amplitude over its standard error, the residual's colour paid for.

    Without what errs for all samples together: a codec holds back what swings, a scale stretches it, and neither makes
    a swing of nothing.
    """
    own = fit.covariance - fit.common @ fit.common.T
    return amplitude_significance(replace(fit, covariance=own))


def cycles_seen(fit: DecayFit, samples: Samples) -> float:
    """Return the periods until the window ends or a tenth of the amplitude is left."""
    span = float(samples.time_s[-1] - samples.time_s[0])
    rate = float(fit.parameters[ALPHA])
    lasting = min(span, np.log(10) / rate) if rate > 0 else span
    return float(fit.parameters[OMEGA]) / (2 * np.pi) * lasting
