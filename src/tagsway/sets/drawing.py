"""The shaper and the figures of one subset: by a worker, on this machine or another."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tagsway.errors import InputError
from tagsway.model import FloatArray, Shaper
from tagsway.report.subset import draw_png, plot_decays, plot_factors, plot_scatter
from tagsway.shapers import choose_shaper, design_shaper, residual_curve
from tagsway.store.measurements import MeasuredModes


@dataclass(frozen=True, slots=True, kw_only=True)
class SubsetTask:
    """What is drawn of a subset.

    Parameters
    ----------
    name : str
        Of the subset.
    frequency_hz, rejected_hz : ndarray
        Of the measurements that were kept, and of those that were rejected.
    measured : MeasuredModes or None
        For the shaper; None where no measurement tells a mode.
    few_hz : ndarray, shape (n,)
        Of the measurements that are drawn against the factors.
    factors : mapping of str to sequence of length n
        That vary in the subset.
    decays : sequence of (ndarray, ndarray)
        Time and sway of each.
    unit : str
        Of the sway.
    """

    name: str
    frequency_hz: FloatArray
    rejected_hz: FloatArray
    measured: MeasuredModes | None
    few_hz: FloatArray
    factors: Mapping[str, Sequence[object]]
    decays: Sequence[tuple[FloatArray, FloatArray]]
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnSubset:
    """The figures of a subset as PNG, by what they show, and its shaper or why there is none."""

    pictures: tuple[tuple[str, bytes], ...]
    shaper: Shaper | None
    no_shaper: str


def draw_subset(task: SubsetTask) -> DrawnSubset:
    """Return the figures and the shaper of a subset; the same task gives the same bytes."""
    shaper, reason = recommend_shaper(task.measured)
    curve = None
    if shaper is not None and task.measured is not None:
        mode = task.measured.mode
        half = max(0.25, 1.3 * float(np.max(np.abs(task.measured.frequency_hz / mode.frequency_hz - 1))))
        frequency = mode.frequency_hz * np.linspace(max(1 - half, 0.02), 1 + half, 401)
        curve = residual_curve(shaper, frequency, mode.damping_ratio)
    drawn = {
        "frequency": plot_scatter(
            task.frequency_hz, curve, shaper=shaper, title=task.name, rejected_hz=task.rejected_hz
        )
    }
    if task.factors:
        drawn["factors"] = plot_factors(task.few_hz, task.factors, title=task.name)
    if task.decays:
        drawn["decays"] = plot_decays(task.decays, unit=task.unit, title=task.name)
    pictures = tuple((what, draw_png(figure)) for what, figure in drawn.items())
    return DrawnSubset(pictures=pictures, shaper=shaper, no_shaper=reason)


def recommend_shaper(measured: MeasuredModes | None) -> tuple[Shaper | None, str]:
    """Return the shortest shaper that keeps V under 5 % over the spread between measurements, or why there is none.

    Of a single measurement, whose spread is not known, it is a ZV.
    """
    if measured is None:
        return None, "no measurement has a frequency and a damping ratio"
    source = f"{measured.source}: median of {len(measured.frequency_hz)}"
    try:
        if measured.spread is None or not measured.spread.natural_frequency_std_percent > 0:
            return design_shaper("zv", measured.mode, source=source), ""
        return choose_shaper(measured.mode, spread=measured.spread, source=source), ""
    except InputError as fault:
        return None, str(fault)
