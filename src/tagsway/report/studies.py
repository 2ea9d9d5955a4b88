"""Simulated moves and the studies of them, drawn."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tagsway.model import FloatArray, LimitRow, StudyRow
from tagsway.report.figures import save_figure
from tagsway.report.style import BLUE, GREY, INK, RULE, VERMILION

STYLES: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "unshaped": {"color": GREY, "ls": "-", "marker": "o"},
        "x": {"color": BLUE, "ls": "--", "marker": "s"},
        "x,z": {"color": VERMILION, "ls": "-.", "marker": "^"},
    }
)
OTHER: Mapping[str, Any] = MappingProxyType({"color": INK, "ls": ":", "marker": "d"})


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionCurve:
    """One simulated move as it is drawn.

    Parameters
    ----------
    name : str
        Its shaping.
    time_s : ndarray, shape (n,)
        Not falling.
    tool_m : ndarray, shape (n, 2)
        x and z.
    product_m, product_m_s2 : ndarray, shape (n, 2, m)
        Of every sample.
    nominal : int
        The sample that is drawn as a line; the others are its band.
    """

    name: str
    time_s: FloatArray
    tool_m: FloatArray
    product_m: FloatArray
    product_m_s2: FloatArray
    nominal: int


def plot_motions(curves: Sequence[MotionCurve]) -> Figure:
    """Draw where the product goes beside its tool, its acceleration, and its path: a line each, a band of samples."""
    figure = Figure(figsize=(10, 9.5), layout="constrained")
    FigureCanvasAgg(figure)
    away, push, path = figure.subplots(3, 1, height_ratios=(1, 1, 1.1))
    for curve in curves:
        style = _line(curve.name)
        sway = 1e3 * (curve.product_m[:, 0] - curve.tool_m[:, 0, None])
        _band(away, curve, sway, style)
        _band(push, curve, curve.product_m_s2[:, 0], style)
        path.plot(*(1e3 * curve.tool_m.T), color=style["color"], lw=0.8, ls=":")
        path.plot(*(1e3 * curve.product_m[:, :, curve.nominal].T), **style)
    _dress(away, "time (s)", "product minus tool, x (mm)")
    _dress(push, "time (s)", "product's x'' (m/s²)")
    _dress(path, "x (mm)", "z (mm); dotted: the tool")
    path.set_aspect("equal", adjustable="datalim")
    push.sharex(away)
    if any(curve.product_m.shape[2] > 1 for curve in curves):
        words = "line: the payload as it was measured or stated; band: all samples of its spread"
        away.set_title(words, loc="left", size="small", color=INK)
    away.legend(loc="upper right", frameon=False, ncols=3)
    return figure


def plot_study(rows: Sequence[StudyRow], limits: Sequence[LimitRow] = ()) -> Figure:
    """Draw motion time, overshoot and PCP acceleration of each shaping over what the study varies."""
    varies = len({row.max_acceleration_m_s2 for row in rows}) > 1
    figure = Figure(figsize=(10, 9.5), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(3, 1, sharex=True)
    quantities: tuple[tuple[str, Callable[[StudyRow], float | None], str], ...] = (
        ("motion time (s)", lambda row: row.motion_time_s, ""),
        ("overshoot (%)", lambda row: row.overshoot_percent, "overshoot_percent"),
        ("PCP |x''| (m/s²)", lambda row: row.pcp_acceleration_m_s2, "pcp_acceleration_m_s2"),
    )
    for panel, (label, value_of, quantity) in zip(panels, quantities, strict=True):
        for name in dict.fromkeys(row.shaping for row in rows):
            own = [row for row in rows if row.shaping == name]
            at = [row.max_acceleration_m_s2 if varies else row.frequency_hz[0] for row in own]
            values = np.array([np.nan if (value := value_of(row)) is None else value for row in own])
            style = {**STYLES.get(name, OTHER), "ms": 3 if len(own) > 20 else 5, "lw": 1.4}
            panel.plot(at, values, label=_label(name), **style)
            if not quantity:
                never = [row.trajectory_time_s if row.motion_time_s is None else np.nan for row in own]
                panel.plot(at, never, ls="", marker="x", ms=4, color=style["color"])
        for most in {found.limit for found in limits if found.quantity == quantity}:
            panel.axhline(most, color=INK, lw=0.8, ls=":")
        _dress(panel, "", label)
    panels[-1].set_xlabel("acceleration that the move is planned with (m/s²)" if varies else "natural frequency (Hz)")
    panels[0].legend(loc="best", frameon=False, ncols=3)
    panels[0].set_title(
        "crosses: the trajectory's time of moves that never settle", loc="left", size="small", color=INK
    )
    return figure


def write_study_figure(figure: Figure, path: Path) -> None:
    """Write a figure as a PNG, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    save_figure(figure, path)


def _band(panel: Axes, curve: MotionCurve, values: FloatArray, style: Mapping[str, Any]) -> None:
    if values.shape[1] > 1:
        low, high = values.min(axis=1), values.max(axis=1)
        panel.fill_between(curve.time_s, low, high, color=style["color"], alpha=0.2, lw=0)
    panel.plot(curve.time_s, values[:, curve.nominal], label=_label(curve.name), **style)


def _label(name: str) -> str:
    return name if name == "unshaped" else f"{name} shaped"


def _line(name: str) -> dict[str, Any]:
    style = {key: value for key, value in STYLES.get(name, OTHER).items() if key != "marker"}
    return {**style, "lw": 1.4}


def _dress(panel: Axes, x: str, y: str) -> None:
    panel.set_xlabel(x)
    panel.set_ylabel(y)
    panel.spines[["top", "right"]].set_visible(False)
    panel.grid(color=RULE, lw=0.7)
    panel.set_axisbelow(True)
