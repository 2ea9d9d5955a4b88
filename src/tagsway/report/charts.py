"""The page's interactive charts, as plain dictionaries that plotly.js draws.

Colours are names such as ``@blue``: the page's script puts in those of a light or a dark page. Long records are thinned
and numbers rounded to what a screen can show.
"""

from collections.abc import Sequence

import numpy as np

from tagsway.model import (
    Curves,
    Estimate,
    Event,
    PendulumCurve,
    ResidualCurve,
    Result,
    RidgeCurve,
    Shaper,
    TrackCurve,
    TrajectoryCurve,
    Window,
)
from tagsway.report.modal_charts import (
    chart_backbone,
    chart_decay,
    chart_estimators,
    chart_excitation,
    chart_spectrum,
)
from tagsway.report.style import (
    LIKELY_COST,
    LengthUnit,
    drawn_acceleration,
    drawn_length,
    length_unit,
    shaped_frequency,
    shown_range,
    sideways_axis,
)
from tagsway.report.traces import (
    MAX_POINTS,
    Chart,
    Panel,
    make_band,
    make_trace,
    mark_frequency,
    mark_place,
    rounded,
    stack_panels,
)


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
    charts = {"track": _track(curves.track, unit, result.window, result.events)}
    modal = result.modal
    if curves.decay is not None:
        charts["decay"] = chart_decay(curves.decay, unit)
    if curves.spectrum is not None:
        charts["spectrum"] = chart_spectrum(curves.spectrum, None if modal is None else modal.natural_frequency_hz)
    if modal is not None and modal.natural_frequency_hz is not None:
        charts["estimators"] = chart_estimators(modal, result.estimator_details)
    if curves.backbone is not None:
        charts["backbone"] = chart_backbone(curves.backbone, modal)
    if curves.excitation is not None:
        charts["excitation"] = chart_excitation(curves.excitation, unit, shaped_frequency(result))
    if curves.pendulum is not None:
        charts["pendulum"] = _pendulum(curves.pendulum, unit)
    if curves.ridge is not None:
        charts["ridge"] = _ridge(curves.ridge, None if result.pendulum is None else result.pendulum.length_m)
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


def _track(curve: TrackCurve, unit: LengthUnit, window: Window | None, events: Sequence[Event]) -> Chart:
    scale, name = drawn_length(unit)
    time, panels = curve.time_s, []
    tags = [
        ("tool (TCP)", "@blue", "dash", curve.tcp, curve.tcp_clean, curve.tcp_acceleration),
        ("product (PCP)", "@orange", "solid", curve.pcp, curve.pcp_clean, curve.pcp_acceleration),
    ]
    tags = [tag for tag in tags if np.any(np.isfinite(tag[3])) or np.any(np.isfinite(tag[4]))]
    for axis, letter in enumerate("xz"):
        traces = [
            make_trace(time, scale * raw[:, axis], f"{who}, raw", "@grey", markers=3, unit=name, legend=axis == 0)
            for who, _, _, raw, _, _ in tags
        ]
        traces += [
            make_trace(time, scale * clean[:, axis], who, colour, dash=dash, unit=name, legend=axis == 0)
            for who, colour, dash, _, clean, _ in tags
        ]
        whole = [scale * tag[4][:, axis] for tag in tags]
        shown = shown_range(whole, [scale * tag[3][:, axis] for tag in tags])
        panels.append(Panel(title=f"{letter} ({name})", traces=traces, share=1.5 - 0.5 * axis, shown=shown))
    per_second = drawn_acceleration(unit)
    traces = [make_trace(time, a[:, 0], who, c, dash=d, unit=per_second, legend=False) for who, c, d, _, _, a in tags]
    panels.append(Panel(title=f"x acceleration<br>({per_second})", traces=traces))
    chart = stack_panels(panels, x="time", x_unit="s")
    if window is not None:
        chart["layout"]["shapes"].append(make_band(window.start_s, window.end_s, "@window"))
    for event in events:
        mark_place(chart, event.time_s.value, "@orange", words=event.words)
    return chart


def _pendulum(curve: PendulumCurve, unit: LengthUnit) -> Chart:
    scale, name = drawn_length(unit)
    time, panels, difference = curve.time_s, [], []
    for axis, letter in enumerate("xz"):
        measured, simulated = scale * curve.measured[:, axis], scale * curve.simulated[:, axis]
        traces = [
            make_trace(time, measured, "measured", "@grey", markers=3.5, unit=name, legend=axis == 0),
            make_trace(time, simulated, "simulated", "@orange", unit=name, legend=axis == 0),
        ]
        shown = shown_range([simulated], [measured])
        panels.append(Panel(title=f"{letter} ({name})", traces=traces, share=1.6 - 0.6 * axis, shown=shown))
        difference.append(measured - simulated)
    traces = [
        make_trace(time, difference[0], "difference in x", "@blue", markers=3, unit=name),
        make_trace(time, difference[1], "difference in z", "@ink", markers=3, symbol="x-thin-open", unit=name),
    ]
    panels.append(Panel(title=f"difference<br>({name})", traces=traces, shown=shown_range([], difference)))
    return stack_panels(panels, x="time", x_unit="s")


def _ridge(curve: RidgeCurve, length_m: Estimate | None) -> Chart:
    length, cost = 1e3 * curve.length_m, curve.delta_chi2
    ends = length[[0, -1]] if len(length) else length
    spring = make_trace(length, curve.stiffness_over_inertia_rad2_s2, "best k/J of each l", "@ink", unit="rad²/s²")
    chi2 = make_trace(length, cost, "what it costs, Δχ²", "@orange", width=2)
    likely = make_trace(ends, np.full(len(ends), LIKELY_COST), "95 %", "@grey", dash="dot")
    panels = [Panel(title="k/J<br>(rad²/s²)", traces=[spring]), Panel(title="Δχ²", traces=[chi2, likely])]
    chart = stack_panels(panels, x="length l", x_unit="mm")
    if length_m is not None:
        low, high = length_m.ci95
        chart["layout"]["shapes"].append(make_band(1e3 * low, 1e3 * high, "@window"))
    return chart


def _residual(curve: ResidualCurve, frequency_hz: Estimate | None, shaper: Shaper | None) -> Chart:
    frequency = curve.frequency_hz
    traces = [make_trace(frequency, 100 * curve.residual, "residual vibration V", "@ink", width=2, unit="%")]
    ends = frequency[[0, -1]] if len(frequency) else frequency
    traces.append(make_trace(ends, np.full(len(ends), 5.0), "5 %", "@grey", dash="dot", unit="%"))
    if shaper is not None and shaper.residual is not None and shaper.modes:
        at, left = np.array([shaper.modes[0].frequency_hz]), np.array([100 * shaper.residual.at_mode])
        traces.append({**make_trace(at, left, "design", "@orange", markers=10, unit="%"), "cliponaxis": False})
    chart = stack_panels([Panel(title="V (% of the swing)", traces=traces)], x="frequency", x_unit="Hz")
    chart["layout"]["yaxis"]["rangemode"] = "tozero"
    mark_frequency(chart, frequency_hz)
    spread = None if shaper is None or shaper.residual is None else shaper.residual.spread
    if spread is not None and frequency_hz is not None:
        half = 1.96 * spread.natural_frequency_std_percent / 100 * frequency_hz.value
        band = make_band(frequency_hz.value - half, frequency_hz.value + half, "@window")
        chart["layout"]["shapes"].append(band)
    return chart


def _move(curve: TrajectoryCurve) -> Chart:
    side, letter = sideways_axis(curve)
    panels: list[Panel] = []
    for axis, name in ((side, letter), (2, "z")):
        for unit, before, after in (
            ("mm", 1e3 * curve.unshaped_m, 1e3 * curve.shaped_m),
            ("m/s²", curve.unshaped_m_s2, curve.shaped_m_s2),
        ):
            first = not panels
            traces = [
                make_trace(
                    curve.time_s, before[:, axis], "before shaping", "@blue", dash="dash", unit=unit, legend=first
                ),
                make_trace(curve.time_s, after[:, axis], "after shaping", "@orange", width=2, unit=unit, legend=first),
            ]
            title = f"{name} (mm)" if unit == "mm" else f"{name} accel.<br>(m/s²)"
            panels.append(Panel(title=title, traces=traces))
    return stack_panels(panels, x="time", x_unit="s")


def _path(curve: TrajectoryCurve) -> Chart:
    side, letter = sideways_axis(curve)
    traces = []
    for position, name, style in (
        (curve.unshaped_m, "before shaping", {"colour": "@blue", "dash": "dash"}),
        (curve.shaped_m, "after shaping", {"colour": "@orange", "width": 2}),
    ):
        step = max(1, len(position) // MAX_POINTS)
        x, z = 1e3 * position[::step, side], 1e3 * position[::step, 2]
        trace = make_trace(x[:0], z[:0], name, unit="mm", **style)
        traces.append({**trace, "x": rounded(x), "y": rounded(z)})
    chart = stack_panels([Panel(title="z (mm)", traces=traces)], x=letter, x_unit="mm")
    chart["layout"]["hovermode"] = "closest"
    return chart
