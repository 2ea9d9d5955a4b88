"""Shapers side by side: what each leaves, and what it costs."""

from collections.abc import Sequence
from math import ceil
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tagsway.model import ResidualCurve, Shaper
from tagsway.report.figures import save_figure
from tagsway.report.style import BLUE, GREEN, INK, RULE, VERMILION

COLUMNS = 5

MOST_RESIDUAL_PERCENT = 30.0
"""Above it every shaper is the wrong one; below it they differ."""

TOLERANCE_PERCENT = 5.0


def plot_candidates(shapers: Sequence[Shaper], curves: Sequence[ResidualCurve]) -> Figure:
    """Draw what each shaper costs, and what it leaves over the payload's frequency: a small panel for each.

    Parameters
    ----------
    shapers : sequence of Shaper
        Of the same mode, in the order in which they shall stand.
    curves : sequence of ResidualCurve
        Of each shaper, over the same frequencies.

    Returns
    -------
    Figure
        A new one.
    """
    count = len(shapers)
    rows = ceil(count / COLUMNS)
    table_inch, panel_inch = 1.0 + 0.24 * count, 1.75
    figure = Figure(figsize=(10, table_inch + 0.5 + panel_inch * rows), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 1, height_ratios=(table_inch, 0.5 + panel_inch * rows))
    above, below = figure.add_subfigure(grid[0, 0]), figure.add_subfigure(grid[1, 0])
    price, width = above.subplots(1, 2, sharey=True)
    bands = [None if s.insensitivity_5_percent is None else 100 * s.insensitivity_5_percent for s in shapers]
    _draw_bars(price, "time that it adds to a move (ms)", [1e3 * shaper.duration_s for shaper in shapers], BLUE)
    _draw_bars(width, "band in which V ≤ 5 % (% of the frequency)", bands, GREEN)
    price.set_yticks(range(count), [shaper.type for shaper in shapers])
    price.invert_yaxis()
    above.suptitle("What each shaper costs, and what it forgives", x=0.01, ha="left", fontweight="bold", color=INK)
    panels = np.atleast_1d(below.subplots(rows, COLUMNS, sharex=True, sharey=True)).ravel()
    for panel, shaper, curve in zip(panels, shapers, curves, strict=False):
        _draw_residual(panel, shaper, curve)
    for panel in panels[count:]:
        panel.set_visible(False)
    for panel in panels[max(count - COLUMNS, 0) : count]:
        panel.tick_params(labelbottom=True)
    below.suptitle(
        "What it leaves: residual vibration V in % of the swing", x=0.01, ha="left", fontweight="bold", color=INK
    )
    below.supxlabel("frequency (Hz); dotted: the design's, dashed: V = 5 %", size="medium")
    return figure


def write_candidates(shapers: Sequence[Shaper], curves: Sequence[ResidualCurve], path: Path) -> None:
    """Write the figure as a PNG, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    save_figure(plot_candidates(shapers, curves), path)


def _draw_bars(panel: Axes, label: str, values: Sequence[float | None], colour: str) -> None:
    """Draw a bar for each value, with its number; "-" where there is none."""
    lengths = [0.0 if value is None else value for value in values]
    bars = panel.barh(range(len(values)), lengths, color=colour, height=0.65)
    texts = ["-" if value is None else f"{value:.1f}" for value in values]
    panel.bar_label(bars, texts, padding=4, size="small", color=INK)
    panel.set_xlabel(label)
    panel.set_xlim(0, 1.15 * max(*lengths, 1.0))
    panel.spines[["top", "right", "left"]].set_visible(False)
    panel.tick_params(axis="y", length=0)
    panel.grid(axis="x", color=RULE, lw=0.7)
    panel.set_axisbelow(True)


def _draw_residual(panel: Axes, shaper: Shaper, curve: ResidualCurve) -> None:
    percent = 100 * curve.residual
    panel.plot(curve.frequency_hz, percent, color=INK, lw=1.3)
    panel.fill_between(
        curve.frequency_hz,
        0,
        np.minimum(percent, TOLERANCE_PERCENT),
        where=percent <= TOLERANCE_PERCENT + 1e-6,
        color=GREEN,
        alpha=0.35,
        lw=0,
    )
    for mode in shaper.modes:
        panel.axvline(mode.frequency_hz, color=BLUE, ls=":", lw=1)
    panel.axhline(TOLERANCE_PERCENT, color=VERMILION, ls="--", lw=0.8)
    panel.set_ylim(0, MOST_RESIDUAL_PERCENT)
    panel.set_xlim(curve.frequency_hz[0], curve.frequency_hz[-1])
    panel.set_title(shaper.type, loc="left", size="small", color=INK)
    panel.spines[["top", "right"]].set_visible(False)
    panel.grid(color=RULE, lw=0.6)
    panel.tick_params(labelsize="small")
