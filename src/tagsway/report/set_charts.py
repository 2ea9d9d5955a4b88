"""The interactive charts of a set's page."""

from collections.abc import Mapping, Sequence

import numpy as np

from tagsway.report.set_words import Record, effect_over_span
from tagsway.report.subset import GOLDEN
from tagsway.report.traces import Chart, make_axis, make_layout

MOST_POINTS = 5000
"""Of the overview."""


def chart_measurements(rows: Sequence[Record]) -> Chart:
    """Return the natural frequency of each measurement, a line a subset; rejected ones as crosses."""
    rows = [row for row in rows if row["natural_frequency_hz"] is not None]
    rows = rows[:: max(1, len(rows) // MOST_POINTS)]
    subsets = sorted({row["subset"] for row in rows}, reverse=True)
    place = {name: number for number, name in enumerate(subsets)}
    data = []
    for rejected, name, colour, symbol in ((False, "used", "@blue", "circle"), (True, "rejected", "@orange", "x")):
        own = [(number, row) for number, row in enumerate(rows) if bool(row["rejected_by"]) is rejected]
        if not own:
            continue
        lift = [0.5 * ((number * GOLDEN) % 1) - 0.25 for number, _ in own]
        data.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": name,
                "x": [round(row["natural_frequency_hz"], 6) for _, row in own],
                "y": [round(place[row["subset"]] + up, 3) for (_, row), up in zip(own, lift, strict=True)],
                "text": [row["file"] for _, row in own],
                "marker": {"color": colour, "symbol": symbol, "size": 6, "opacity": 0.6},
                "hovertemplate": "%{text}: %{x:.4f} Hz<extra></extra>",
            }
        )
    layout = make_layout("natural frequency", "Hz") | {"hovermode": "closest"}
    layout["yaxis"] = {**make_axis(), "tickvals": list(range(len(subsets))), "ticktext": subsets, "zeroline": False}
    return {"data": data, "layout": layout}


def chart_effects(effects: Sequence[Record], spans: Mapping[str, tuple[float, float]]) -> Chart | None:
    """Return the effects on the natural frequency with their 95 % intervals; None where there is none."""
    own = [row for row in effects if row["quantity"] == "natural_frequency_hz" and not row["remark"]]
    if not own:
        return None
    drawn = [effect_over_span(row, spans) for row in reversed(own)]
    values = np.array([effect.value for effect, _ in drawn])
    low, high = (np.array([effect.ci95[end] for effect, _ in drawn]) for end in (0, 1))
    trace = {
        "type": "scatter",
        "mode": "markers",
        "x": values.round(6).tolist(),
        "y": list(range(len(drawn))),
        "text": [words for _, words in drawn],
        "marker": {"color": "@blue", "size": 9},
        "error_x": {
            "type": "data",
            "symmetric": False,
            "array": (high - values).round(6).tolist(),
            "arrayminus": (values - low).round(6).tolist(),
            "color": "@blue",
        },
        "hovertemplate": "%{text}: %{x:.4f} Hz<extra></extra>",
        "showlegend": False,
    }
    layout = make_layout("effect on the natural frequency", "Hz") | {"hovermode": "closest"}
    layout["yaxis"] = {**make_axis(), "tickvals": list(range(len(drawn))), "ticktext": [words for _, words in drawn]}
    ends = {"x0": 0, "x1": 0, "yref": "paper", "y0": 0, "y1": 1}
    layout["shapes"] = [{"type": "line", "xref": "x", **ends, "line": {"color": "@grey", "width": 1.2, "dash": "dash"}}]
    return {"data": [trace], "layout": layout}
