"""The page's interactive charts, as plain dictionaries that plotly.js draws.

Colours are names such as ``@blue``: the page's script puts in those of a light or a dark page. Long records are thinned
and numbers rounded to what a screen can show.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tagsway.model import (
    BackbonePoint,
    Curves,
    DecayCurve,
    Estimate,
    FloatArray,
    PendulumCurve,
    ResidualCurve,
    Result,
    Shaper,
    SpectrumCurve,
    TrackCurve,
    TrajectoryCurve,
    Window,
)
from tagsway.report.style import (
    LengthUnit,
    drawn_acceleration,
    drawn_length,
    length_unit,
    shaped_frequency,
    shown_range,
    sideways_axis,
    thin,
    to_decibel,
)

MAX_POINTS = 3000
"""Samples of a line that are drawn; longer ones are thinned."""

SPECTRUM_SPAN = 6
"""How many times f_n the spectrum's axis reaches at first."""

Chart = dict[str, Any]
Trace = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Panel:
    """One of the panels that share a horizontal axis."""

    title: str
    traces: Sequence[Trace]
    share: float = 1.0
    shown: tuple[float, float] | None = None


def make_charts(result: Result, curves: Curves) -> dict[str, Chart]:
    """Return the charts that this result has curves for, by name.

    Parameters
    ----------
    result : Result
        For what is marked in the charts.
    curves : Curves
        What is drawn.

    Returns
    -------
    dict
        Chart by name, each with ``data`` and ``layout`` as plotly.js reads them; JSON can hold it (no NaN).
    """
    unit = length_unit(result)
    charts = {"track": _track(curves.track, unit, result.window)}
    natural = None if result.modal is None else result.modal.natural_frequency_hz
    if curves.decay is not None:
        charts["decay"] = _decay(curves.decay, unit)
    if curves.spectrum is not None:
        charts["spectrum"] = _spectrum(curves.spectrum, natural)
    if result.modal is not None and len(result.modal.backbone) > 1:
        charts["backbone"] = _backbone(result.modal.backbone)
    if curves.pendulum is not None:
        charts["pendulum"] = _pendulum(curves.pendulum, unit)
    if curves.residual is not None:
        charts["residual"] = _residual(curves.residual, shaped_frequency(result), result.shaper)
    if curves.trajectory is not None:
        charts["move"], charts["path"] = _move(curves.trajectory), _path(curves.trajectory)
    return charts


def share_abscissae(charts: dict[str, Chart]) -> tuple[dict[str, Chart], list[list[float | None]]]:
    """Return the charts with each distinct ``x`` replaced by its place in a list, and the list.

    Most lines of a page stand over the same times; written once, the page is a third smaller.
    """
    places: dict[tuple[float | None, ...], int] = {}
    slim = {
        name: {**chart, "data": [{**t, "x": places.setdefault(tuple(t["x"]), len(places))} for t in chart["data"]]}
        for name, chart in charts.items()
    }
    return slim, [list(x) for x in places]


def rounded(values: FloatArray, *, digits: int = 4) -> list[float | None]:
    """Return numbers to a ten-thousandth of their range or finer, None for what is not finite."""
    finite = values[np.isfinite(values)]
    span = float(np.ptp(finite)) or float(np.max(np.abs(finite))) if finite.size else 0.0
    decimals = digits - int(np.floor(np.log10(span))) if span > 0 else digits
    numbers: list[float | None] = (np.round(values, decimals) + 0.0).tolist()
    for gap in np.flatnonzero(~np.isfinite(values)):
        numbers[gap] = None
    return numbers


def _trace(x: FloatArray, y: FloatArray, name: str, colour: str, **style: Any) -> Trace:
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


def _stack(panels: Sequence[_Panel], *, x: str, x_unit: str, shown: tuple[float, float] | None = None) -> Chart:
    """Return panels above one another over one horizontal axis."""
    gap = 0.05
    total, room = sum(panel.share for panel in panels), 1 - gap * (len(panels) - 1)
    data, top = [], 1.0
    layout = _layout(x, x_unit)
    for index, panel in enumerate(panels):
        height = room * panel.share / total
        suffix = "" if index == 0 else str(index + 1)
        axis: dict[str, Any] = {
            "title": {"text": panel.title, "standoff": 8, "font": {"size": 12.5}},
            "domain": [max(top - height, 0.0), top],
        }
        if panel.shown is not None:
            axis["range"] = list(panel.shown)
        layout[f"yaxis{suffix}"] = {**_axis(), **axis}
        data += [{**trace, "yaxis": f"y{suffix}"} for trace in panel.traces]
        top -= height + gap
    layout["xaxis"]["anchor"] = "y" if len(panels) == 1 else f"y{len(panels)}"
    if shown is not None:
        layout["xaxis"]["range"] = list(shown)
    return {"data": data, "layout": layout}


def _axis() -> dict[str, Any]:
    return {
        "gridcolor": "@rule",
        "zeroline": False,
        "linecolor": "@rule",
        "automargin": True,
        "ticks": "outside",
        "tickcolor": "@rule",
    }


def _layout(x: str, x_unit: str) -> dict[str, Any]:
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
            **_axis(),
            "title": {"text": f"{x} ({x_unit})", "font": {"size": 12.5}},
            "unifiedhovertitle": {"text": f"%{{x}} {x_unit}"},
        },
        "shapes": [],
    }


def _band(low: float, high: float, colour: str) -> dict[str, Any]:
    ends = {"x0": low, "x1": high, "yref": "paper", "y0": 0, "y1": 1}
    return {"type": "rect", "xref": "x", **ends, "fillcolor": colour, "line": {"width": 0}, "layer": "below"}


def _mark(chart: Chart, frequency_hz: Estimate | None) -> None:
    """Draw a frequency as a line and its 95 % interval as a band."""
    if frequency_hz is None:
        return
    low, high = frequency_hz.ci95
    if np.isfinite(low) and np.isfinite(high):
        chart["layout"]["shapes"].append(_band(low, high, "@band"))
    at = {"x0": frequency_hz.value, "x1": frequency_hz.value, "yref": "paper", "y0": 0, "y1": 1}
    line = {"color": "@blue", "width": 1.5, "dash": "dash"}
    chart["layout"]["shapes"].append({"type": "line", "xref": "x", **at, "line": line})


def _track(curve: TrackCurve, unit: LengthUnit, window: Window | None) -> Chart:
    scale, name = drawn_length(unit)
    time, panels = curve.time_s, []
    tags = [
        ("tool (TCP)", "@blue", "dash", curve.tcp, curve.tcp_clean, curve.tcp_acceleration),
        ("product (PCP)", "@orange", "solid", curve.pcp, curve.pcp_clean, curve.pcp_acceleration),
    ]
    tags = [tag for tag in tags if np.any(np.isfinite(tag[3])) or np.any(np.isfinite(tag[4]))]
    for axis, letter in enumerate("xz"):
        traces = [
            _trace(time, scale * raw[:, axis], f"{who}, raw", "@grey", markers=3, unit=name, legend=axis == 0)
            for who, _, _, raw, _, _ in tags
        ]
        traces += [
            _trace(time, scale * clean[:, axis], who, colour, dash=dash, unit=name, legend=axis == 0)
            for who, colour, dash, _, clean, _ in tags
        ]
        whole = [scale * tag[4][:, axis] for tag in tags]
        shown = shown_range(whole, [scale * tag[3][:, axis] for tag in tags])
        panels.append(_Panel(title=f"{letter} ({name})", traces=traces, share=1.5 - 0.5 * axis, shown=shown))
    per_second = drawn_acceleration(unit)
    traces = [_trace(time, a[:, 0], who, c, dash=d, unit=per_second, legend=False) for who, c, d, _, _, a in tags]
    panels.append(_Panel(title=f"x acceleration<br>({per_second})", traces=traces))
    chart = _stack(panels, x="time", x_unit="s")
    if window is not None:
        chart["layout"]["shapes"].append(_band(window.start_s, window.end_s, "@window"))
    return chart


def _decay(curve: DecayCurve, unit: LengthUnit) -> Chart:
    scale, name = drawn_length(unit)
    time, fit, envelope = curve.time_s, scale * curve.fit, scale * curve.envelope
    traces = [
        _trace(time, scale * curve.sway, "measured", "@grey", markers=3.5, unit=name),
        _trace(time, fit, "fit", "@orange", unit=name),
        _trace(time, envelope, "envelope", "@ink", dash="dash", width=1.2, unit=name),
        _trace(time, -envelope, "envelope", "@ink", dash="dash", width=1.2, unit=name, legend=False),
        _trace(
            curve.peak_time_s, scale * curve.peak_sway, "peaks", "@blue", markers=7, symbol="circle-open", unit=name
        ),
    ]
    residual = scale * curve.residual
    rest = [_trace(time, residual, "measured − fit", "@ink", markers=2.5, unit=name, legend=False)]
    shown = shown_range([fit, envelope, -envelope], [scale * curve.sway])
    panels = [
        _Panel(title=f"sway ({name})", traces=traces, share=3, shown=shown),
        _Panel(title=f"measured − fit<br>({name})", traces=rest, shown=shown_range([], [residual])),
    ]
    return _stack(panels, x="time", x_unit="s")


def _spectrum(curve: SpectrumCurve, natural_frequency_hz: Estimate | None) -> Chart:
    frequency, decibel = curve.frequency_hz, to_decibel(curve.amplitude)
    shown = None
    if natural_frequency_hz is not None:
        shown = (0.0, SPECTRUM_SPAN * natural_frequency_hz.value)
        near = frequency <= shown[1]
        parts = [thin(frequency[side], decibel[side], most=MAX_POINTS // 2) for side in (near, ~near)]
        frequency, decibel = (np.concatenate(part) for part in zip(*parts, strict=True))
    trace = _trace(frequency, decibel, "decay", "@ink", unit="dB", legend=False)
    panel = _Panel(title="amplitude (dB, 0 = largest)", traces=[trace], shown=(-80.0, 5.0))
    chart = _stack([panel], x="frequency", x_unit="Hz", shown=shown)
    _mark(chart, natural_frequency_hz)
    return chart


def _backbone(points: Sequence[BackbonePoint]) -> Chart:
    amplitude = np.array([1e3 * point.amplitude_m for point in points])
    panels = []
    for title, unit, estimates in (
        ("frequency (Hz)", "Hz", [point.frequency_hz for point in points]),
        ("damping ratio", "", [point.damping_ratio for point in points]),
    ):
        value, error = np.array([e.value for e in estimates]), np.array([e.std for e in estimates])
        trace = _trace(amplitude, value, title, "@blue", markers=7, unit=unit, legend=False)
        trace["error_y"] = {"type": "data", "array": rounded(error), "color": "@blue", "thickness": 1.2}
        panels.append(_Panel(title=title, traces=[trace]))
    return _stack(panels, x="amplitude", x_unit="mm")


def _pendulum(curve: PendulumCurve, unit: LengthUnit) -> Chart:
    scale, name = drawn_length(unit)
    time, panels, difference = curve.time_s, [], []
    for axis, letter in enumerate("xz"):
        measured, simulated = scale * curve.measured[:, axis], scale * curve.simulated[:, axis]
        traces = [
            _trace(time, measured, "measured", "@grey", markers=3.5, unit=name, legend=axis == 0),
            _trace(time, simulated, "simulated", "@orange", unit=name, legend=axis == 0),
        ]
        shown = shown_range([simulated], [measured])
        panels.append(_Panel(title=f"{letter} ({name})", traces=traces, share=1.6 - 0.6 * axis, shown=shown))
        difference.append(measured - simulated)
    traces = [
        _trace(time, difference[0], "difference in x", "@blue", markers=3, unit=name),
        _trace(time, difference[1], "difference in z", "@ink", markers=3, symbol="x-thin-open", unit=name),
    ]
    panels.append(_Panel(title=f"difference<br>({name})", traces=traces, shown=shown_range([], difference)))
    return _stack(panels, x="time", x_unit="s")


def _residual(curve: ResidualCurve, frequency_hz: Estimate | None, shaper: Shaper | None) -> Chart:
    frequency = curve.frequency_hz
    traces = [_trace(frequency, 100 * curve.residual, "residual vibration V", "@ink", width=2, unit="%")]
    ends = frequency[[0, -1]] if len(frequency) else frequency
    traces.append(_trace(ends, np.full(len(ends), 5.0), "5 %", "@grey", dash="dot", unit="%"))
    if shaper is not None and shaper.residual is not None and shaper.modes:
        at, left = np.array([shaper.modes[0].frequency_hz]), np.array([100 * shaper.residual.at_mode])
        traces.append({**_trace(at, left, "design", "@orange", markers=10, unit="%"), "cliponaxis": False})
    chart = _stack([_Panel(title="V (% of the swing)", traces=traces)], x="frequency", x_unit="Hz")
    chart["layout"]["yaxis"]["rangemode"] = "tozero"
    _mark(chart, frequency_hz)
    spread = None if shaper is None or shaper.residual is None else shaper.residual.spread
    if spread is not None and frequency_hz is not None:
        half = 1.96 * spread.natural_frequency_std_percent / 100 * frequency_hz.value
        band = _band(frequency_hz.value - half, frequency_hz.value + half, "@window")
        chart["layout"]["shapes"].append(band)
    return chart


def _move(curve: TrajectoryCurve) -> Chart:
    side, letter = sideways_axis(curve)
    panels: list[_Panel] = []
    for axis, name in ((side, letter), (2, "z")):
        for unit, before, after in (
            ("mm", 1e3 * curve.unshaped_m, 1e3 * curve.shaped_m),
            ("m/s²", curve.unshaped_m_s2, curve.shaped_m_s2),
        ):
            first = not panels
            traces = [
                _trace(curve.time_s, before[:, axis], "before shaping", "@blue", dash="dash", unit=unit, legend=first),
                _trace(curve.time_s, after[:, axis], "after shaping", "@orange", width=2, unit=unit, legend=first),
            ]
            title = f"{name} (mm)" if unit == "mm" else f"{name} accel.<br>(m/s²)"
            panels.append(_Panel(title=title, traces=traces))
    return _stack(panels, x="time", x_unit="s")


def _path(curve: TrajectoryCurve) -> Chart:
    side, letter = sideways_axis(curve)
    traces = []
    for position, name, style in (
        (curve.unshaped_m, "before shaping", {"colour": "@blue", "dash": "dash"}),
        (curve.shaped_m, "after shaping", {"colour": "@orange", "width": 2}),
    ):
        step = max(1, len(position) // MAX_POINTS)
        x, z = 1e3 * position[::step, side], 1e3 * position[::step, 2]
        trace = _trace(x[:0], z[:0], name, unit="mm", **style)
        traces.append({**trace, "x": rounded(x), "y": rounded(z)})
    chart = _stack([_Panel(title="z (mm)", traces=traces)], x=letter, x_unit="mm")
    chart["layout"]["hovermode"] = "closest"
    return chart
