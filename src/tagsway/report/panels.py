"""The panels of a figure: one dress for all of them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.transforms import blended_transform_factory

from tagsway.model import Estimate, FloatArray
from tagsway.report.style import BLUE, INK, RULE, shown_range, thin

MAX_POINTS = 15_000
"""Samples of a line that are drawn: a dozen for each column of pixels."""


LEFT_INCH, RIGHT_INCH, TOP_INCH, BOTTOM_INCH, GAP_INCH = 1.1, 0.2, 0.6, 0.55, 0.3
"""Around and between panels: a layout that is solved for each figure anew costs more than all its drawing."""

LABEL_INCH = 0.45
"""From the left edge to where the words beside the panels end."""


def make_panels(
    axes: Sequence[Axes] | None,
    heights: tuple[int, ...],
    *,
    height_inch: float,
    width_inch: float = 8.0,
    alone: int = 0,
) -> tuple[Figure, Sequence[Axes]]:
    """Return the axes handed in, or a new figure of panels above one another; all but the last `alone` share x."""
    if axes is not None:
        if len(axes) != len(heights):
            raise ValueError(f"this figure has {len(heights)} panels, but {len(axes)} axes were given")
        figure = axes[0].get_figure(root=True)
        if figure is None:
            raise ValueError("these axes belong to no figure")
        return figure, axes
    figure = Figure(figsize=(width_inch, height_inch))
    FigureCanvasAgg(figure)
    labelled = [row for row in range(len(heights)) if row >= len(heights) - alone - 1]
    gaps = [GAP_INCH + BOTTOM_INCH if row in labelled else GAP_INCH for row in range(len(heights) - 1)]
    room = height_inch - TOP_INCH - BOTTOM_INCH - sum(gaps)
    panels: list[Axes] = []
    top = height_inch - TOP_INCH
    for row, share in enumerate(heights):
        height = room * share / sum(heights)
        shared = panels[0] if 0 < row < len(heights) - alone else None
        place = (LEFT_INCH, top - height, width_inch - LEFT_INCH - RIGHT_INCH, height)
        box = tuple(np.array(place) / [width_inch, height_inch, width_inch, height_inch])
        panels.append(figure.add_axes(box, sharex=shared))
        beside = blended_transform_factory(figure.transFigure, panels[-1].transAxes)
        panels[-1].yaxis.set_label_coords(LABEL_INCH / width_inch, 0.5, transform=beside)
        if row not in labelled:
            panels[-1].tick_params(labelbottom=False)
        top -= height + (gaps[row] if row < len(gaps) else 0.0)
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


def mark_frequency(panel: Axes, frequency_hz: Estimate, label: str, *, interval: str = "its 95 % interval") -> None:
    """Draw a frequency as a line, and its 95 % interval as a band, each with its name in the legend."""
    panel.axvline(frequency_hz.value, color=BLUE, ls="--", lw=1.2, label=label)
    low, high = frequency_hz.ci95
    if np.isfinite(low) and np.isfinite(high):
        panel.axvspan(low, high, color=BLUE, alpha=0.2, lw=0, label=interval or None)


def literal(text: str) -> str:
    """Return a name as it is drawn: a dollar sign would begin a formula, a line below hide it from the legend."""
    return f"{' ' if text.startswith('_') else ''}{text}".replace("$", r"\$")
