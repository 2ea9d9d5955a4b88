"""Long, fast records in fewer samples, without loss."""

from dataclasses import replace

import numpy as np

from tagsway.modal.decay import ALPHA, DRAG, FRICTION, OMEGA, PLACES, envelope, predict
from tagsway.modal.noise import grid_places
from tagsway.modal.samples import DecayFit, Samples
from tagsway.modal.uncertainty import SOFT
from tagsway.model import FloatArray

ENOUGH = 3000
"""Samples that are fitted as they are."""

PER_PERIOD = 32
"""Blocks that are left in a period: what an average over one hides of the noise's share at f_n is below 0.2 %."""

STOPPING = 0.08
"""Friction's loss over the amplitude, over ω_d, beyond which a decay is no slow one: eight widths of the dead band."""

FEWEST_CYCLES = 3.0
"""That are left before friction stops the motion, or all of it is fitted."""


def average_blocks(samples: Samples, fit: DecayFit | None, *, omega: float) -> Samples:
    """Return averages over blocks of samples, where there are many in a period.

    Parameters
    ----------
    samples : Samples
        What is to be fitted.
    fit : DecayFit or None
        A fit to averages of these samples that is close; without, plain averages are taken, which flatten the sway.
    omega : float
        ω_d in rad/s.

    Returns
    -------
    Samples
        The same where they are few.

    Notes
    -----
    An average flattens an oscillation, and spreads a spike. So not the samples are averaged but what a fit leaves of
    them, bounded as the fit's cost bounds it and over its mean slope: the model at the block's mean time plus that
    average is one step of the fit to the samples themselves.
    """
    time = samples.time_s
    step = float(np.median(np.diff(time)))
    count = min(int(2 * np.pi / omega / step / PER_PERIOD), max(1, len(time) // (ENOUGH // 2)))
    if len(time) <= ENOUGH or count < 2:
        return samples
    _, block = np.unique(grid_places(time) // count, return_inverse=True)

    def mean(value: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(block, value * weight) / np.bincount(block, weight), dtype=float)

    weight = samples.spread**-2.0
    when = mean(time)
    drive = None if samples.drive is None else mean(samples.drive)
    if fit is None:
        value = mean(samples.value)
    else:
        model = predict(time, fit.parameters, fit.terms, samples.drive)[0]
        left = (samples.value - model) / samples.spread
        scale = float(np.median(np.abs(left))) / 0.6745
        bend = 1 + (left / (SOFT * max(scale, 1e-300))) ** 2
        bounded = left / np.sqrt(bend) / float(np.mean(bend**-1.5)) * samples.spread
        value = predict(when, fit.parameters, fit.terms, drive)[0] + mean(bounded)
    spread = np.asarray(np.bincount(block, weight) ** -0.5, dtype=float)
    typical = float(np.median(spread))
    return replace(
        samples,
        drive_std=samples.drive_std / float(np.sqrt(len(time) / len(when))),
        time_s=when,
        value=value,
        spread=spread / typical,
        stated=samples.stated * typical,
        drive=drive,
        common=None if samples.common is None else np.column_stack([mean(one) for one in samples.common.T]),
    )


def drop_stop(samples: Samples, fit: DecayFit) -> Samples:
    """Return the samples before dry friction stops the motion: there its loss is no small part of a swing any more.

    Parameters
    ----------
    samples : Samples
        All of them.
    fit : DecayFit
        That is close.

    Returns
    -------
    Samples
        The same where friction is no term, or leaves few swings before.
    """
    omega, alpha, drag, friction = fit.parameters[[OMEGA, ALPHA, DRAG, FRICTION]]
    swings = STOPPING * omega * envelope(samples.time_s, alpha, drag, friction)[0] > friction
    count = int(np.argmin(swings)) if not np.all(swings) else len(swings)
    last_s = float(samples.time_s[max(count - 1, 0)])
    if not fit.terms.friction or omega * last_s < 2 * np.pi * FEWEST_CYCLES:
        return samples
    return samples.part(slice(count))


def first_omega(fit: DecayFit) -> float:
    """Return ω_d of the first mode, or of the fastest one that was fitted."""
    return float(max(fit.parameters[[OMEGA, *range(PLACES, len(fit.parameters), 4)]]))
