"""Conditions over each other, drawn: their moves from the start on, and each indicator of each measurement."""

from collections.abc import Callable, Sequence
from itertools import cycle
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tagsway.model import AlignedMove, ConditionCurves, FloatArray
from tagsway.report.comparison_words import QUANTITIES
from tagsway.report.figures import save_figure
from tagsway.report.panels import literal, make_panels, name_panel
from tagsway.report.style import BLUE, GREEN, GREY, INK, ORANGE, RULE, VERMILION
from tagsway.report.traces import Chart, Panel, make_trace, mark_place, stack_panels

DRAWN = ("motion_time_s", "overshoot_percent", "max_pcp_acceleration_m_s2", "residual_rms_m_s2")
"""Quantities that are drawn as points."""

BANDS = 6.0
"""Half the height of the panel that shows the settling, in bands of ±2 %."""

LIT = 8
"""Lines over each other from which on they are drawn lighter."""


class Look(NamedTuple):
    """How a condition is drawn: colours of a figure and of the page, dashes of both, a mark."""

    colour: str
    page_colour: str
    dash: str | tuple[int, tuple[int, int]]
    page_dash: str
    mark: str


LOOKS = (
    Look(GREY, "@grey", "-", "solid", "o"),
    Look(BLUE, "@blue", "--", "dash", "s"),
    Look(VERMILION, "@orange", "-.", "dashdot", "^"),
    Look(GREEN, "@green", ":", "dot", "D"),
    Look(ORANGE, "@text", (0, (5, 1)), "longdash", "v"),
    Look(INK, "@ink", (0, (1, 1)), "longdashdot", "P"),
)


class View(NamedTuple):
    """One panel of the moves: what it shows and how it is called."""

    label: str
    unit: str
    of: Callable[[AlignedMove], FloatArray]


VIEWS = (
    View("product minus tool (mm)", "mm", lambda move: 1e3 * move.sway_m),
    View("product beyond its rest (mm)", "mm", lambda move: 1e3 * move.beyond_m),
    View("product's x'' (m/s²)", "m/s²", lambda move: move.acceleration_m_s2),
)
SETTLING = 1
"""Which of them shows the settling."""


def plot_moves(curves: Sequence[ConditionCurves], *, title: str) -> Figure:
    """Draw the moves of all conditions over each other, each from its start: every repeat, and their median.

    Parameters
    ----------
    curves : sequence of ConditionCurves
        Of one group.
    title : str
        Above them.

    Returns
    -------
    Figure
        A new one: sway, settling with its band of ±2 %, and acceleration; an upright line is where the tool stands.
    """
    figure, panels = make_panels(None, (1, 1, 1), height_inch=8.0)
    for curve, look in zip(curves, cycle(LOOKS), strict=False):
        for panel, view in zip(panels, VIEWS, strict=True):
            for move in curve.moves:
                alpha = 0.9 if curve.middle is None else max(0.15, min(0.5, LIT * 0.4 / len(curve.moves)))
                width = 1.4 if curve.middle is None else 0.7
                panel.plot(move.time_s, view.of(move), color=look.colour, ls=look.dash, lw=width, alpha=alpha)
            if curve.middle is not None:
                panel.plot(curve.middle.time_s, view.of(curve.middle), color=look.colour, ls=look.dash, lw=1.8)
            panel.plot([], [], color=look.colour, ls=look.dash, lw=1.8, label=literal(_called(curve)))
            panel.axvline(_end_of(curve), color=look.colour, ls=look.dash, lw=0.9)
    band = 1e3 * max((curve.band_m for curve in curves), default=0.0)
    panels[SETTLING].axhspan(-band, band, color=GREEN, alpha=0.15, lw=0)
    if band > 0:
        panels[SETTLING].set_ylim(-BANDS * band, BANDS * band)
    for number, (panel, view) in enumerate(zip(panels, VIEWS, strict=True)):
        last = number == len(VIEWS) - 1
        words = "time from the start of the move (s)" if last else None
        name_panel(panel, literal(title) if number == 0 else None, view.label, x=words, legend=number == 0)
    panels[0].set_xlim(0, _reach(curves))
    return figure


def plot_indicators(curves: Sequence[ConditionCurves], *, over: str | None = None) -> Figure:
    """Draw each measurement's indicators by condition, and over the groups where there are several.

    Parameters
    ----------
    curves : sequence of ConditionCurves
        Of all groups.
    over : str, optional
        What the groups are levels of.

    Returns
    -------
    Figure
        A new one. A short bar is the median; what never settled stands at the upper edge.
    """
    shown = [name for name in DRAWN if any(np.isfinite(curve.points[name]).any() for curve in curves)]
    groups = list(dict.fromkeys(curve.group for curve in curves))
    names = list(dict.fromkeys(curve.condition for curve in curves))
    figure, panels = make_panels(None, (1,) * max(len(shown), 1), height_inch=0.9 + 1.9 * max(len(shown), 1))
    for panel, name in zip(panels, shown, strict=False):
        _draw_points(panel, curves, name, groups, names)
        quantity = QUANTITIES[name]
        head = "Each measurement, and its condition's median" if panel is panels[0] else None
        label = f"{quantity.label}\n({quantity.unit})"
        name_panel(panel, head, label, legend=panel is panels[0] and len(groups) > 1)
    ticks = groups if len(groups) > 1 else [f"{n} (n {_count(curves, n)})" for n in names]
    panels[-1].set_xticks(range(len(ticks)), [literal(tick) for tick in ticks])
    panels[-1].set_xlabel(literal(over or ""))
    panels[-1].set_xlim(-0.6, len(ticks) - 0.4)
    return figure


def write_comparison_figure(figure: Figure, path: Path) -> None:
    """Write a figure as a PNG, whole or not at all; its folder is made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    save_figure(figure, path)


def chart_moves(curves: Sequence[ConditionCurves]) -> Chart:
    """Return the moves of all conditions over each other, for the page."""
    band = 1e3 * max((curve.band_m for curve in curves), default=0.0)
    panels = []
    for number, view in enumerate(VIEWS):
        traces = []
        for curve, look in zip(curves, cycle(LOOKS), strict=False):
            lines = [*((move, 0.8, 0.35) for move in curve.moves if curve.middle is not None)]
            lines += [(curve.middle, 2.0, 1.0)] if curve.middle is not None else [(m, 1.6, 1.0) for m in curve.moves]
            for place, (move, width, opacity) in enumerate(lines):
                told = number == 0 and place == len(lines) - 1
                style = {"dash": look.page_dash, "width": width, "unit": view.unit, "legend": told}
                trace = make_trace(move.time_s, view.of(move), _called(curve), look.page_colour, **style)
                trace |= {"opacity": opacity} | ({} if place == len(lines) - 1 else {"hoverinfo": "skip"})
                if place < len(lines) - 1:
                    del trace["hovertemplate"]
                traces.append(trace)
        shown = (-BANDS * band, BANDS * band) if number == SETTLING and band > 0 else None
        panels.append(Panel(title=view.label, traces=traces, shown=shown))
    chart = stack_panels(panels, x="time from the start of the move", x_unit="s", shown=(0.0, _reach(curves)))
    for curve, look in zip(curves, cycle(LOOKS), strict=False):
        mark_place(chart, _end_of(curve), look.page_colour, dash=look.page_dash)
    ends = {"xref": "paper", "x0": 0, "x1": 1, "yref": "y2", "y0": -band, "y1": band}
    fill = {"fillcolor": "@window", "line": {"width": 0}, "layer": "below"}
    chart["layout"]["shapes"].append({"type": "rect", **ends, **fill})
    return chart


def _draw_points(
    panel: Axes, curves: Sequence[ConditionCurves], name: str, groups: Sequence[str], names: Sequence[str]
) -> None:
    several = len(groups) > 1
    finite = [curve.points[name][np.isfinite(curve.points[name])] for curve in curves]
    top = 1.12 * max((float(values.max()) for values in finite if len(values)), default=1.0)
    for condition, look in zip(names, cycle(LOOKS), strict=False):
        places, medians = [], []
        for curve in (curve for curve in curves if curve.condition == condition):
            values = curve.points[name][~np.isnan(curve.points[name])]
            if not len(values):
                continue
            offset = 0.0 if not several else 0.24 * (names.index(condition) - (len(names) - 1) / 2) / max(len(names), 1)
            place = (groups.index(curve.group) if several else names.index(condition)) + offset
            spread = np.linspace(-0.06, 0.06, len(values)) if len(values) > 1 else np.zeros(1)
            panel.plot(place + spread, np.minimum(values, top), look.mark, color=look.colour, ms=4, alpha=0.6)
            places.append(place)
            medians.append(min(float(np.median(values)), top))
        panel.hlines(medians, np.array(places) - 0.11, np.array(places) + 0.11, color=look.colour, lw=2.0)
        if several:
            panel.plot(places, medians, color=look.colour, ls=look.dash, lw=1.1, label=literal(condition))
    panel.set_ylim(bottom=0, top=1.06 * top)
    if any(np.isinf(curve.points[name]).any() for curve in curves):
        panel.axhline(top, color=RULE, lw=1.0)
        panel.text(0.995, top, "never settled", transform=panel.get_yaxis_transform(), ha="right", va="bottom", size=8)


def _called(curve: ConditionCurves) -> str:
    return f"{curve.condition} (n {len(curve.points['trajectory_time_s'])})"


def _count(curves: Sequence[ConditionCurves], condition: str) -> int:
    return sum(len(curve.points["trajectory_time_s"]) for curve in curves if curve.condition == condition)


def _end_of(curve: ConditionCurves) -> float:
    return float(np.median(curve.points["trajectory_time_s"])) if len(curve.points["trajectory_time_s"]) else 0.0


def _reach(curves: Sequence[ConditionCurves]) -> float:
    """Return to when moves are drawn: the end of the one that is watched longest."""
    return max((float(move.time_s[-1]) for curve in curves for move in curve.moves), default=1.0)
