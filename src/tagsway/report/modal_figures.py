"""The figures of what sways: the estimators beside each other, the backbone, and what the move excites."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from tagsway.model import Estimate, Excitation, ExcitationCurve, ModalEstimate
from tagsway.model.curves import BackboneCurve
from tagsway.model.result import EstimatorDetails
from tagsway.report.estimators import ForestPanel, ForestRow, estimator_lines, forest_panels
from tagsway.report.panels import make_panels, mark_frequency, name_panel
from tagsway.report.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    RULE,
    VERMILION,
    LengthUnit,
    excitation_parts,
    excitation_range,
    excitation_span,
    excitation_unit,
)
from tagsway.report.words import format_estimate, format_percent

MUTED = "#5c6570"

STANDINGS = {"decides": (BLUE, "D"), "for comparison": (INK, "o"), "disagrees": (VERMILION, "X")}
"""Colour and marker of an estimator, by how it stands to the one that decides."""


def plot_excitation(
    curve: ExcitationCurve,
    *,
    unit: LengthUnit = "m",
    frequency_hz: Estimate | None = None,
    excitation: Excitation | None = None,
    axes: Sequence[Axes] | None = None,
) -> Figure:
    """Draw the spectra of the horizontal acceleration of tool and product: whole, after the move, and late.

    Parameters
    ----------
    curve : ExcitationCurve
        The spectra.
    unit : {"m", "px", "m/s2", "rad"}
        The track's length unit.
    frequency_hz : Estimate, optional
        Of the payload at its operating amplitude, drawn as a line; the axis then ends at six times it.
    excitation : Excitation, optional
        How much of the move falls on that, said in the title.
    axes : sequence of Axes, optional
        To draw into: of tool and product; of the product alone where the tool was never seen.

    Returns
    -------
    Figure
        That of the axes.
    """
    tags = excitation_parts(curve)
    figure, panels = make_panels(axes, (1,) * len(tags), height_inch=1.6 + 2.0 * len(tags))
    span = excitation_span(curve, frequency_hz)
    near = curve.frequency_hz <= span
    for panel, (who, parts) in zip(panels, tags, strict=True):
        styles = ((GREY, "-", 1.6), (GREEN, "--", 1.3), (VERMILION, "-", 1.2))
        for (words, part), (colour, dash, width) in zip(parts, styles, strict=True):
            panel.plot(curve.frequency_hz[near], part[near], dash, color=colour, lw=width, label=words)
        shown = excitation_range([part[near] for _, part in parts])
        if shown is not None:
            panel.set_yscale("log")
            panel.yaxis.set_minor_locator(NullLocator())
            panel.set_ylim(*shown)
        panel.set_xlim(0, span)
        if curve.bandwidth_hz < span:
            panel.axvspan(curve.bandwidth_hz, span, color=RULE, lw=0, label="beyond what was seen")
        if frequency_hz is not None:
            mark_frequency(panel, frequency_hz, f"payload, {frequency_hz.value:.4g} Hz", interval="")
        name_panel(panel, None, f"{who}\n({excitation_unit(unit)})")
    title = "What the move excites"
    if excitation is not None:
        title += f": at the payload's frequency {format_percent(excitation.share_of_peak.value)} of its peak"
    name_panel(panels[0], title, panels[0].get_ylabel(), legend=True)
    panels[-1].set_xlabel("frequency of the horizontal acceleration (Hz)")
    return figure


def plot_backbone(
    curve: BackboneCurve, *, modal: ModalEstimate | None = None, axes: Sequence[Axes] | None = None
) -> Figure:
    """Draw frequency and ζ against the amplitude: a line for the nonlinear decay, points for plain ones.

    Parameters
    ----------
    curve : BackboneCurve
        Of both.
    modal : ModalEstimate, optional
        For the mean swing, at which the shaper is designed.
    axes : sequence of two Axes, optional
        To draw into.

    Returns
    -------
    Figure
        That of the axes.
    """
    figure, panels = make_panels(axes, (1, 1), height_inch=4.8)
    fit, pieces = curve.fit, curve.pieces
    for panel, line, value, ci95 in (
        (panels[0], (fit.frequency_hz, fit.frequency_ci95_hz), pieces.frequency_hz, pieces.frequency_ci95_hz),
        (panels[1], (fit.damping_ratio, fit.damping_ci95), pieces.damping_ratio, pieces.damping_ci95),
    ):
        panel.plot(1e3 * fit.amplitude_m, line[0], color=VERMILION, lw=1.6, label="one nonlinear decay")
        panel.fill_between(1e3 * fit.amplitude_m, line[1][:, 0], line[1][:, 1], color=VERMILION, alpha=0.2, lw=0)
        if len(value):
            bars = np.abs(ci95.T - value)
            style: dict[str, Any] = {"fmt": "o", "color": INK, "ms": 5, "capsize": 3, "lw": 1.2}
            panel.errorbar(1e3 * pieces.amplitude_m, value, bars, label="plain decays, piece by piece", **style)
        if modal is not None and modal.amplitude_m is not None:
            swing = 1e3 * modal.amplitude_m.value
            panel.axvline(swing, color=BLUE, ls=":", lw=1.4, label="mean swing: the shaper's design")
        panel.ticklabel_format(axis="y", useOffset=False)
    name_panel(panels[0], "Backbone: what the amplitude changes", "undamped\nfrequency (Hz)", legend=True)
    name_panel(panels[1], None, "damping ratio ζ", x="amplitude of the sway (mm)")
    return figure


def plot_estimators(
    modal: ModalEstimate, *, details: EstimatorDetails | None = None, axes: Sequence[Axes] | None = None
) -> Figure:
    """Draw every estimator's frequency and ζ with its 95 % interval, against the one that decides.

    Parameters
    ----------
    modal : ModalEstimate
        With the estimators and the bound.
    details : EstimatorDetails, optional
        How the others were made.
    axes : sequence of two Axes, optional
        To draw into.

    Returns
    -------
    Figure
        That of the axes.
    """
    lines = estimator_lines(modal, details)
    if axes is None:
        figure, _ = make_panels(None, (), height_inch=1.6 + 0.42 * len(lines), width_inch=11.5)
        bottom, top = 0.6 / figure.get_figheight(), 1 - 0.75 / figure.get_figheight()
        axes = [figure.add_axes((left, bottom, 0.205, top - bottom)) for left in (0.25, 0.63)]
    else:
        figure, _ = make_panels(axes, (1, 1), height_inch=0)
    places = {line.name: row for row, line in enumerate(lines)}
    for panel, content in zip(axes, forest_panels(modal, details), strict=True):
        _draw_forest(panel, content, places)
    for line, row in zip(lines, range(len(lines)), strict=True):
        beside: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points", "ha": "right"}
        axes[0].annotate(line.name, (0, row), (-10, 1), va="bottom", color=INK, **beside)
        axes[0].annotate(line.remark, (0, row), (-10, -1), va="top", color=MUTED, size="x-small", **beside)
    name_panel(axes[0], "All estimators, with 95 % intervals", "", legend=False)
    name_panel(axes[1], None, "", legend=False)
    handles = {
        label: handle for panel in axes for handle, label in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    axes[0].legend(
        handles.values(), handles.keys(), loc="lower left", bbox_to_anchor=(0, 1), ncols=len(handles), frameon=False,
        fontsize="small", borderaxespad=0.3, borderpad=0, columnspacing=1.2, handletextpad=0.5,
    )  # fmt: skip
    return figure


def _draw_forest(panel: Axes, content: ForestPanel, places: dict[str, int]) -> None:
    panel.set_ylim(len(places) - 0.5, -0.5)
    panel.set_yticks([])
    panel.set_xlabel(content.title)
    panel.ticklabel_format(axis="x", useOffset=False)
    panel.locator_params(axis="x", nbins=3)
    if content.shown is not None:
        panel.set_xlim(*content.shown)
    if content.best is not None and np.all(np.isfinite(content.best.ci95)):
        panel.axvspan(*content.best.ci95, color=BLUE, alpha=0.2, lw=0, label="best fit at this swing, 95 %")
    for row in content.rows:
        _draw_row(panel, row, places[row.name], content)


def _draw_row(panel: Axes, row: ForestRow, place: int, content: ForestPanel) -> None:
    """Draw an interval and its value, an arrow where it runs out of the panel, and its number beside the panel."""
    colour, marker = STANDINGS[row.standing]
    low, high = panel.get_xlim()
    left, right = (float(np.clip(end, low, high)) for end in row.estimate.ci95)
    panel.plot([left, right], [place, place], color=colour, lw=1.6, solid_capstyle="butt")
    for end, inside, arrow in ((row.estimate.ci95[0], left, "<"), (row.estimate.ci95[1], right, ">")):
        shape = "|" if end == inside else arrow
        panel.plot([inside], [place], shape, color=colour, ms=6, mew=1.4, clip_on=False)
    if low <= row.estimate.value <= high:
        panel.plot([row.estimate.value], [place], marker, color=colour, ms=6, label=row.standing)
    text = format_estimate(row.estimate, content.unit)
    beside: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points", "va": "center"}
    panel.annotate(text, (1, place), (12, 0), color=colour, size="small", **beside)
