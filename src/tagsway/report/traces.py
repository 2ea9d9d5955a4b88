"""Lines, panels and marks as plotly.js reads them: what the page's charts are made of."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tagsway.model import Estimate, FloatArray
from tagsway.report.style import thin

MAX_POINTS = 3000
"""Samples of a line that are drawn; longer ones are thinned."""

Chart = dict[str, Any]
Trace = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """One of the panels that share a horizontal axis."""

    title: str
    traces: Sequence[Trace]
    share: float = 1.0
    shown: tuple[float, float] | None = None
    log: bool = False


def rounded(values: FloatArray, *, digits: int = 4) -> list[float | None]:
    """Return numbers to a ten-thousandth of their range or finer, None for what is not finite."""
    finite = values[np.isfinite(values)]
    span = float(np.ptp(finite)) or float(np.max(np.abs(finite))) if finite.size else 0.0
    decimals = digits - int(np.floor(np.log10(span))) if span > 0 else digits
    numbers: list[float | None] = (np.round(values, decimals) + 0.0).tolist()
    for gap in np.flatnonzero(~np.isfinite(values)):
        numbers[gap] = None
    return numbers


def make_trace(x: FloatArray, y: FloatArray, name: str, colour: str, **style: Any) -> Trace:
    """Return a line; style keys: dash, width, markers (size), symbol, unit, axis name for the hover, legend."""
    x, y = thin(x, y, most=MAX_POINTS)
    markers = style.get("markers")
    trace: Trace = {
        "type": "scatter",
        "mode": "markers" if markers else "lines",
        "x": rounded(x, digits=5),
        "y": rounded(y),
        "name": name,
        "legendgroup": name,
        "showlegend": style.get("legend", True),
        "hovertemplate": f"%{{y:.4~g}} {style.get('unit', '')}",
    }
    if markers:
        trace["marker"] = {"color": colour, "size": markers, "symbol": style.get("symbol", "circle")}
        if style.get("symbol", "").endswith("-open"):
            trace["marker"]["line"] = {"width": 1.2}
    else:
        trace["line"] = {"color": colour, "width": style.get("width", 1.5), "dash": style.get("dash", "solid")}
        trace["line"]["simplify"] = False  # a smooth curve would show corners
    return trace


def stack_panels(panels: Sequence[Panel], *, x: str, x_unit: str, shown: tuple[float, float] | None = None) -> Chart:
    """Return panels above one another over one horizontal axis."""
    gap = 0.05
    total, room = sum(panel.share for panel in panels), 1 - gap * (len(panels) - 1)
    data, top = [], 1.0
    layout = make_layout(x, x_unit)
    for index, panel in enumerate(panels):
        height = room * panel.share / total
        suffix = "" if index == 0 else str(index + 1)
        axis: dict[str, Any] = {
            "title": {"text": panel.title, "standoff": 8, "font": {"size": 12.5}},
            "domain": [max(top - height, 0.0), top],
        }
        if panel.log:
            axis |= {"type": "log", "exponentformat": "power", "dtick": 1}
        if panel.shown is not None:
            axis["range"] = [float(np.log10(end)) if panel.log else end for end in panel.shown]
        layout[f"yaxis{suffix}"] = {**make_axis(), **axis}
        data += [{**trace, "yaxis": f"y{suffix}"} for trace in panel.traces]
        top -= height + gap
    layout["xaxis"]["anchor"] = "y" if len(panels) == 1 else f"y{len(panels)}"
    if shown is not None:
        layout["xaxis"]["range"] = list(shown)
    return {"data": data, "layout": layout}


def make_axis() -> dict[str, Any]:
    """Return an axis in the page's dress."""
    return {
        "gridcolor": "@rule",
        "zeroline": False,
        "linecolor": "@rule",
        "automargin": True,
        "ticks": "outside",
        "tickcolor": "@rule",
    }


def make_layout(x: str, x_unit: str) -> dict[str, Any]:
    """Return the layout of a chart over one horizontal axis."""
    return {
        "autosize": True,
        "margin": {"l": 64, "r": 12, "t": 36, "b": 48},
        "font": {"color": "@text", "size": 12.5, "family": "system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif"},
        "paper_bgcolor": "@paper",
        "plot_bgcolor": "@paper",
        "hovermode": "x unified",
        "hoverlabel": {"bgcolor": "@paper", "bordercolor": "@rule", "font": {"color": "@ink"}},
        "legend": {"orientation": "h", "x": 0, "y": 1.0, "yanchor": "bottom", "xanchor": "left"},
        "xaxis": {
            **make_axis(),
            "title": {"text": f"{x} ({x_unit})", "font": {"size": 12.5}},
            "unifiedhovertitle": {"text": f"%{{x}} {x_unit}"},
        },
        "shapes": [],
    }


def make_band(low: float, high: float, colour: str) -> dict[str, Any]:
    """Return a shape that tints all panels between two values of the horizontal axis."""
    ends = {"x0": low, "x1": high, "yref": "paper", "y0": 0, "y1": 1}
    return {"type": "rect", "xref": "x", **ends, "fillcolor": colour, "line": {"width": 0}, "layer": "below"}


def mark_place(chart: Chart, at: float, colour: str, *, dash: str = "dash", words: str = "") -> None:
    """Draw an upright line through all panels, and words beside its upper end."""
    ends = {"x0": at, "x1": at, "yref": "paper", "y0": 0, "y1": 1}
    line = {"color": colour, "width": 1.5, "dash": dash}
    chart["layout"]["shapes"].append({"type": "line", "xref": "x", **ends, "line": line})
    if words:
        place = {"x": at, "xref": "x", "xanchor": "left", "xshift": 4, "y": 1, "yref": "paper", "yanchor": "top"}
        text = {"text": words, "showarrow": False, "font": {"color": colour, "size": 12}, "bgcolor": "@paper"}
        chart["layout"].setdefault("annotations", []).append({**place, **text})


def mark_frequency(chart: Chart, frequency_hz: Estimate | None) -> None:
    """Draw a frequency as a line and its 95 % interval as a band."""
    if frequency_hz is None:
        return
    low, high = frequency_hz.ci95
    if np.isfinite(low) and np.isfinite(high):
        chart["layout"]["shapes"].append(make_band(low, high, "@band"))
    mark_place(chart, frequency_hz.value, "@blue")
