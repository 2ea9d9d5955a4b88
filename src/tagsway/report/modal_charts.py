"""The charts of what sways: the decay, its spectrum, the estimators, the backbone, and what the move excites."""

import numpy as np

from tagsway.model import (
    DecayCurve,
    Estimate,
    ExcitationCurve,
    FloatArray,
    ModalEstimate,
    SpectrumCurve,
)
from tagsway.model.curves import AmplitudeCurve, BackboneCurve
from tagsway.model.result import EstimatorDetails
from tagsway.report.estimators import ForestPanel, forest_panels
from tagsway.report.style import (
    SPECTRUM_SPAN,
    LengthUnit,
    drawn_length,
    excitation_parts,
    excitation_range,
    excitation_span,
    excitation_unit,
    shown_range,
    thin,
    to_decibel,
)
from tagsway.report.traces import (
    MAX_POINTS,
    Chart,
    Panel,
    Trace,
    make_axis,
    make_band,
    make_layout,
    make_trace,
    mark_frequency,
    mark_place,
    rounded,
    stack_panels,
)
from tagsway.report.words import format_estimate

STANDINGS = (("decides", "@blue", "diamond"), ("for comparison", "@ink", "circle"), ("disagrees", "@orange", "x"))
"""How an estimator stands to the one that decides, with colour and symbol."""


def chart_decay(curve: DecayCurve, unit: LengthUnit) -> Chart:
    """Return the decay with its fit, envelope and peaks, and what is left below."""
    scale, name = drawn_length(unit)
    time, fit, envelope = curve.time_s, scale * curve.fit, scale * curve.envelope
    traces = [
        make_trace(time, scale * curve.sway, "measured", "@grey", markers=3.5, unit=name),
        make_trace(time, fit, "fit", "@orange", unit=name),
        make_trace(time, envelope, "envelope", "@ink", dash="dash", width=1.2, unit=name),
        make_trace(time, -envelope, "envelope", "@ink", dash="dash", width=1.2, unit=name, legend=False),
        make_trace(
            curve.peak_time_s, scale * curve.peak_sway, "peaks", "@blue", markers=7, symbol="circle-open", unit=name
        ),
    ]
    residual = scale * curve.residual
    rest = [make_trace(time, residual, "measured − fit", "@ink", markers=2.5, unit=name, legend=False)]
    shown = shown_range([fit, envelope, -envelope], [scale * curve.sway])
    panels = [
        Panel(title=f"sway ({name})", traces=traces, share=3, shown=shown),
        Panel(title=f"measured − fit<br>({name})", traces=rest, shown=shown_range([], [residual])),
    ]
    return stack_panels(panels, x="time", x_unit="s")


def chart_spectrum(curve: SpectrumCurve, natural_frequency_hz: Estimate | None) -> Chart:
    """Return the decay's spectrum, with f_n and its 95 % interval."""
    frequency, decibel = curve.frequency_hz, to_decibel(curve.amplitude)
    shown = None
    if natural_frequency_hz is not None:
        shown = (0.0, SPECTRUM_SPAN * natural_frequency_hz.value)
        near = frequency <= shown[1]
        parts = [thin(frequency[side], decibel[side], most=MAX_POINTS // 2) for side in (near, ~near)]
        frequency, decibel = (np.concatenate(part) for part in zip(*parts, strict=True))
    trace = make_trace(frequency, decibel, "decay", "@ink", unit="dB", legend=False)
    panel = Panel(title="amplitude (dB, 0 = largest)", traces=[trace], shown=(-80.0, 5.0))
    chart = stack_panels([panel], x="frequency", x_unit="Hz", shown=shown)
    mark_frequency(chart, natural_frequency_hz)
    return chart


def chart_excitation(curve: ExcitationCurve, unit: LengthUnit, frequency_hz: Estimate | None) -> Chart:
    """Return the spectra of tool and product: whole, after the move, and late."""
    name, span = excitation_unit(unit), excitation_span(curve, frequency_hz)
    near = curve.frequency_hz <= span
    colours = (("@grey", "solid", 1.5), ("@green", "dash", 1.5), ("@orange", "solid", 1.5))
    panels: list[Panel] = []
    for who, parts in excitation_parts(curve):
        traces = [
            make_trace(curve.frequency_hz[near], part[near], words, colour, dash=dash, width=width, unit=name)
            for (words, part), (colour, dash, width) in zip(parts, colours, strict=True)
        ]
        for trace in traces:
            trace["showlegend"] = not panels
        shown = excitation_range([part[near] for _, part in parts])
        panels.append(Panel(title=f"{who}<br>({name})", traces=traces, shown=shown, log=shown is not None))
    chart = stack_panels(panels, x="frequency", x_unit="Hz", shown=(0.0, span))
    mark_frequency(chart, frequency_hz)
    if curve.bandwidth_hz < span:
        chart["layout"]["shapes"].append(make_band(curve.bandwidth_hz, span, "@rule"))
    return chart


def chart_backbone(curve: BackboneCurve, modal: ModalEstimate | None) -> Chart:
    """Return frequency and ζ against the amplitude: the nonlinear decay's line, and the points of plain decays."""
    panels: list[Panel] = []
    for title, unit, values, intervals in (
        ("frequency (Hz)", "Hz", "frequency_hz", "frequency_ci95_hz"),
        ("damping ratio ζ", "", "damping_ratio", "damping_ci95"),
    ):
        fit = make_trace(
            1e3 * curve.fit.amplitude_m, getattr(curve.fit, values), "one nonlinear decay", "@orange", unit=unit
        )
        points = _points(curve.pieces, getattr(curve.pieces, values), getattr(curve.pieces, intervals), unit)
        fit["showlegend"] = points["showlegend"] = not panels
        panels.append(Panel(title=title, traces=[fit, points] if len(curve.pieces.amplitude_m) else [fit]))
    chart = stack_panels(panels, x="amplitude of the sway", x_unit="mm")
    if modal is not None and modal.amplitude_m is not None:
        mark_place(chart, 1e3 * modal.amplitude_m.value, "@blue", dash="dot", words="mean swing")
    return chart


def _points(curve: AmplitudeCurve, value: FloatArray, ci95: FloatArray, unit: str) -> Trace:
    trace = make_trace(1e3 * curve.amplitude_m, value, "plain decays, piece by piece", "@ink", markers=7, unit=unit)
    above, below = rounded(ci95[:, 1] - value), rounded(value - ci95[:, 0])
    bars = {"type": "data", "symmetric": False, "array": above, "arrayminus": below}
    return {**trace, "error_y": {**bars, "color": "@ink", "thickness": 1.2}}


def chart_estimators(modal: ModalEstimate, details: EstimatorDetails | None) -> Chart:
    """Return all estimators with their 95 % intervals, a panel for the frequency and one for ζ below it."""
    layout = make_layout("", "")
    layout |= {"hovermode": "closest", "margin": {"l": 12, "r": 12, "t": 36, "b": 48}}
    data: list[Trace] = []
    for suffix, domain, panel in zip(("", "2"), ((0.57, 1.0), (0.0, 0.38)), forest_panels(modal, details), strict=True):
        title = {"text": panel.title, "standoff": 6, "font": {"size": 12.5}}
        layout[f"xaxis{suffix}"] = {**make_axis(), "title": title, "anchor": f"y{suffix}", "nticks": 6}
        if panel.shown is not None:
            layout[f"xaxis{suffix}"]["range"] = list(panel.shown)
        names = {"categoryorder": "array", "categoryarray": [row.name for row in panel.rows]}
        ends = {"domain": list(domain), "range": [len(panel.rows) - 0.5, -0.5], "ticks": ""}
        layout[f"yaxis{suffix}"] = {**make_axis(), **ends, **names, "type": "category", "anchor": f"x{suffix}"}
        if panel.best is not None and np.all(np.isfinite(panel.best.ci95)):
            place = {"xref": f"x{suffix}", "yref": f"y{suffix} domain"}
            layout["shapes"].append({**make_band(*panel.best.ci95, "@band"), **place})
        data += [
            {**_forest(panel, standing, colour, symbol), "xaxis": f"x{suffix}", "yaxis": f"y{suffix}"}
            for standing, colour, symbol in STANDINGS
            if any(row.standing == standing for row in panel.rows)
        ]
    first = {trace["name"]: index for index, trace in reversed(list(enumerate(data)))}
    return {
        "data": [{**trace, "showlegend": first[trace["name"]] == index} for index, trace in enumerate(data)],
        "layout": layout,
    }


def _forest(panel: ForestPanel, standing: str, colour: str, symbol: str) -> Trace:
    """Return the markers of one standing, with their intervals."""
    rows = [row for row in panel.rows if row.standing == standing]
    value = np.array([row.estimate.value for row in rows])
    # an interval without an end runs out of the panel
    ends = np.nan_to_num([row.estimate.ci95 for row in rows], posinf=1e6, neginf=-1e6)
    bars = {"array": (ends[:, 1] - value).tolist(), "arrayminus": (value - ends[:, 0]).tolist()}
    return {
        "type": "scatter",
        "mode": "markers",
        "x": value.tolist(),
        "y": [row.name for row in rows],
        "name": standing,
        "legendgroup": standing,
        "text": [f"{format_estimate(row.estimate, panel.unit)}<br>{row.remark}" for row in rows],
        "hovertemplate": "%{y}: %{text}<extra></extra>",
        "marker": {"color": colour, "size": 9, "symbol": symbol},
        "error_x": {"type": "data", "symmetric": False, **bars, "color": colour, "thickness": 1.6},
    }
