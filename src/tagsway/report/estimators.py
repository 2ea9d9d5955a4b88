"""The estimators beside each other: what each says, how it was made, and whether it disagrees."""

from typing import Literal, NamedTuple

import numpy as np

from tagsway.model import Bound, Estimate, EstimatorResult, ModalEstimate
from tagsway.model.result import EstimatorDetails

FREQUENCY_SHARE, DAMPING_SHARE = 0.02, 0.1
"""Of frequency and of ζ, below which a difference changes no shaper, however small the errors are."""

WIDEST = 5.0
"""Times the median reach, beyond which an estimator runs out of the panel instead of flattening the others."""


NO_CYCLES = "decrement over n cycles"
BOUND = "Cramér-Rao bound"


class EstimatorLine(NamedTuple):
    """What one estimator says; `rival` where it is held against the one that decides."""

    name: str
    remark: str
    frequency_hz: Estimate | None
    damping_ratio: Estimate | None
    rival: bool = True


Standing = Literal["decides", "for comparison", "disagrees"]


class ForestRow(NamedTuple):
    """One estimate in a panel."""

    name: str
    remark: str
    estimate: Estimate
    standing: Standing


class ForestPanel(NamedTuple):
    """What is drawn of one quantity: rows from above, what they are held against, and the values shown."""

    title: str
    unit: str
    rows: list[ForestRow]
    best: Estimate | None
    shown: tuple[float, float] | None


def estimator_lines(modal: ModalEstimate, details: EstimatorDetails | None = None) -> list[EstimatorLine]:
    """Return all estimators in the order in which they are shown: first those that decide, last the bound.

    Parameters
    ----------
    modal : ModalEstimate
        Of one measurement.
    details : EstimatorDetails, optional
        How the others were made, and two more of them.

    Returns
    -------
    list of EstimatorLine
        The bound stands as an interval around the maximum-likelihood value, where that is known.
    """
    every, best = modal.estimates, modal.estimates.maximum_likelihood
    operating = (modal.operating_frequency_hz, modal.operating_damping_ratio)
    lines = [_line("maximum likelihood", "for a small swing; this one decides", best, rival=False)]
    if operating[0] is not None:
        lines.append(EstimatorLine("the same at this swing", "the shaper is designed for it", *operating, rival=False))
    lines.append(_line("log decrement", "regression over all peaks", every.log_decrement))
    if details is not None:
        cycles = details.decrement_cycles
        name, how = NO_CYCLES, "too few peaks"
        if cycles:
            name, how = f"decrement over {cycles} cycles", "first and last swing alone"
        lines.append(_line(name, how, details.decrement_over_cycles))
    lines.append(_line("peak periods", "mean distance of the peaks", every.periods))
    how = "zero-padded"
    if details is not None:
        fineness = f"resolution {details.spectrum_resolution_hz:.2g} Hz, padded bin {details.spectrum_bin_hz:.2g} Hz"
        how = f"{details.spectrum_window} window, {fineness}"
    lines.append(_line("Fourier transform", how, every.fft))
    if details is not None:
        lines.append(_line("half-power width", "widened by the record's length", details.half_power))
    if modal.bound is not None:
        lines.append(_bound_line(best, modal.bound))
    return lines


def reference_of(modal: ModalEstimate) -> EstimatorResult:
    """Return what the others are held against: the best estimate at the swing that they see, too."""
    best = modal.estimates.maximum_likelihood
    return EstimatorResult(
        natural_frequency_hz=modal.operating_frequency_hz or best.natural_frequency_hz,
        damping_ratio=modal.operating_damping_ratio or best.damping_ratio,
    )


def disagrees(one: Estimate | None, best: Estimate | None, *, share: float) -> bool:
    """Return whether two 95 % intervals do not meet although a difference of this share would matter."""
    if one is None or best is None:
        return False
    apart = one.ci95[0] > best.ci95[1] or one.ci95[1] < best.ci95[0]
    return apart and abs(one.value - best.value) > share * abs(best.value)


def find_disagreements(modal: ModalEstimate, details: EstimatorDetails | None = None) -> list[str]:
    """Return the names of the estimators whose frequency or ζ disagrees with the one that decides."""
    rows = [row for panel in forest_panels(modal, details) for row in panel.rows]
    return list(dict.fromkeys(row.name for row in rows if row.standing == "disagrees"))


def forest_panels(modal: ModalEstimate, details: EstimatorDetails | None = None) -> tuple[ForestPanel, ForestPanel]:
    """Return what is drawn of frequency and ζ, each row with its standing."""
    lines, best = estimator_lines(modal, details), reference_of(modal)
    frequencies = [(line, line.frequency_hz) for line in lines]
    ratios = [(line, line.damping_ratio) for line in lines]
    return (
        _panel("undamped frequency (Hz)", "Hz", frequencies, best.natural_frequency_hz, FREQUENCY_SHARE),
        _panel("damping ratio ζ", "", ratios, best.damping_ratio, DAMPING_SHARE),
    )


def _panel(
    title: str,
    unit: str,
    column: list[tuple[EstimatorLine, Estimate | None]],
    best: Estimate | None,
    share: float,
) -> ForestPanel:
    rows = []
    for line, one in column:
        apart = line.rival and disagrees(one, best, share=share)
        standing: Standing = "disagrees" if apart else "for comparison" if line.rival else "decides"
        if one is not None:
            rows.append(ForestRow(line.name, line.remark, one, standing))
    return ForestPanel(title, unit, rows, best, _shown(rows, best))


def _shown(rows: list[ForestRow], best: Estimate | None) -> tuple[float, float] | None:
    """Return the values that a panel shows around the best one.

    An interval that reaches much farther than the rest runs out of it; a value that disagrees never does.
    """
    if best is None or not rows:
        return None
    ends = np.array([row.estimate.ci95 for row in rows])
    reach = np.maximum(best.value - ends[:, 0], ends[:, 1] - best.value)
    kept = reach[np.isfinite(reach) & (reach <= WIDEST * float(np.median(reach)))]
    apart = [abs(row.estimate.value - best.value) for row in rows if row.standing == "disagrees"]
    half = 1.15 * max([*kept, *apart], default=0.0) or 0.01 * abs(best.value) or 1.0
    return best.value - half, best.value + half


def _line(name: str, remark: str, one: EstimatorResult, *, rival: bool = True) -> EstimatorLine:
    return EstimatorLine(name, remark, one.natural_frequency_hz, one.damping_ratio, rival)


def _bound_line(best: EstimatorResult, bound: Bound) -> EstimatorLine:
    frequency, damping = best.natural_frequency_hz, best.damping_ratio
    return EstimatorLine(
        BOUND,
        "no unbiased estimator can do better",
        None if frequency is None else Estimate.normal(frequency.value, bound.natural_frequency_hz, low=0.0),
        None if damping is None else Estimate.normal(damping.value, bound.damping_ratio, low=0.0),
        rival=False,
    )
