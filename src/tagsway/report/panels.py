"""The panels of a figure: one dress for all of them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tagsway.model import Estimate, FloatArray
from tagsway.report.style import BLUE, INK, RULE, shown_range, thin

MAX_POINTS = 15_000
"""Samples of a line that are drawn: a dozen for each column of pixels."""


def make_panels(
    axes: Sequence[Axes] | None, heights: tuple[int, ...], *, height_inch: float, alone: int = 0
) -> tuple[Figure, Sequence[Axes]]:
    """Return the axes handed in, or a new figure of panels above one another; all but the last `alone` share x."""
    if axes is not None:
        if len(axes) != len(heights):
            raise ValueError(f"this figure has {len(heights)} panels, but {len(axes)} axes were given")
        figure = axes[0].get_figure(root=True)
        if figure is None:
            raise ValueError("these axes belong to no figure")
        return figure, axes
    figure = Figure(figsize=(8, height_inch), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    panels: list[Axes] = []
    for row in range(len(heights)):
        shared = panels[0] if 0 < row < len(heights) - alone else None
        panels.append(figure.add_subplot(grid[row, 0], sharex=shared))
    for panel in panels[: len(heights) - alone - 1]:
        panel.tick_params(labelbottom=False)
    return figure, panels


def draw_line(panel: Axes, x: FloatArray, y: FloatArray, style: str, **options: Any) -> None:
    """Draw a line or a cloud of points over x, of a long record only as much as can be seen."""
    panel.plot(*thin(x, y, most=MAX_POINTS), style, **options)


def name_panel(panel: Axes, title: str | None, y: str, *, x: str | None = None, legend: bool = False) -> None:
    """Give a panel its labels with units, a light grid, and a legend above it, each entry once."""
    panel.set_ylabel(y)
    if x is not None:
        panel.set_xlabel(x)
    if title is not None:
        panel.set_title(title, loc="left", fontweight="bold", color=INK, pad=24)  # the legend stands below it
    panel.spines[["top", "right"]].set_visible(False)
    panel.grid(color=RULE, lw=0.7)
    panel.set_axisbelow(True)
    entries = dict(zip(*reversed(panel.get_legend_handles_labels()), strict=True))
    if legend and entries:
        panel.legend(
            entries.values(),
            entries.keys(),
            loc="lower left",
            bbox_to_anchor=(0, 1),
            ncols=len(entries),
            frameon=False,
            fontsize="small",
            borderaxespad=0.3,
            borderpad=0,
            columnspacing=1.2,
            handletextpad=0.5,
        )


def frame_panel(panel: Axes, whole: Sequence[FloatArray], cut: Sequence[FloatArray]) -> None:
    """Show all of some curves and the bulk of others, and say how many samples lie outside."""
    shown = shown_range(whole, cut)
    if shown is None:
        return
    panel.set_ylim(*shown)
    outside = sum(int(np.sum((values < shown[0]) | (values > shown[1]))) for values in cut)
    if outside:
        text = f"{outside} sample{'' if outside == 1 else 's'} outside"
        panel.text(0.995, 1.01, text, transform=panel.transAxes, ha="right", va="bottom", size="small", color="#5c6570")


def mark_frequency(panel: Axes, frequency_hz: Estimate, label: str) -> None:
    """Draw a frequency as a line, and its 95 % interval as a band."""
    panel.axvline(frequency_hz.value, color=BLUE, ls="--", lw=1.2, label=label)
    low, high = frequency_hz.ci95
    if np.isfinite(low) and np.isfinite(high):
        panel.axvspan(low, high, color=BLUE, alpha=0.2, lw=0, label="its 95 % interval")
