"""Many measurements in one picture: how their frequency scatters, and what a shaper leaves on each."""

import warnings
from collections.abc import Mapping, Sequence
from io import BytesIO
from math import ceil
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tagsway.files import whole_file
from tagsway.model import FactorEffect, FloatArray, ResidualCurve, Shaper
from tagsway.report.figures import save_figure
from tagsway.report.panels import literal, make_panels, name_panel
from tagsway.report.style import BLUE, GREY, INK, VERMILION

MOST_BINS = 40

GOLDEN = 0.6180339887
"""Multiples of it, modulo 1, spread points evenly, however many there are."""

MOST_NAMES = 8
"""Of a factor, that are written below its axis."""


def plot_scatter(
    frequency_hz: FloatArray,
    curve: ResidualCurve | None,
    *,
    shaper: Shaper | None = None,
    title: str = "Natural frequency",
    rejected_hz: FloatArray | None = None,
    axes: Sequence[Axes] | None = None,
) -> Figure:
    """Draw the histogram of the natural frequency over the residual curve of a shaper.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
        Of each measurement that was kept.
    curve : ResidualCurve or None
        What the shaper leaves over the frequency; None where none could be designed.
    shaper : Shaper, optional
        Named in the legend.
    title : str
        Above it.
    rejected_hz : ndarray, shape (m,), optional
        Of those that were rejected: drawn as crosses on the axis.
    axes : sequence of one Axes, optional
        To draw into.

    Returns
    -------
    Figure
        That of the axes.
    """
    figure, (panel,) = make_panels(axes, (1,), height_inch=3.8)
    if len(frequency_hz):
        bins = np.histogram_bin_edges(frequency_hz, bins=min(MOST_BINS, ceil(2 * len(frequency_hz) ** (1 / 3))))
        label = f"{len(frequency_hz)} measurements"
        panel.hist(frequency_hz, bins=list(bins), color=BLUE, alpha=0.6, edgecolor="white", label=label)
        panel.yaxis.set_major_locator(MaxNLocator(integer=True))
    if rejected_hz is not None and len(rejected_hz):
        zeros = np.zeros(len(rejected_hz))
        panel.plot(rejected_hz, zeros, "x", color=VERMILION, ms=7, mew=1.5, clip_on=False, label="rejected")
    name_panel(panel, literal(title), "measurements", x="natural frequency (Hz)")
    if curve is not None:
        beside = panel.twinx()
        name = "residual vibration" if shaper is None else f"{shaper.type.upper()} shaper"
        beside.plot(curve.frequency_hz, 100 * curve.residual, color=INK, lw=1.4, label=name)
        beside.axhline(5, color=GREY, ls=":", lw=1.2, label="5 %")
        beside.set_ylim(bottom=0)
        beside.set_ylabel("residual vibration V (% of the swing)")
        beside.spines["top"].set_visible(False)
        panel.set_xlim(curve.frequency_hz[0], curve.frequency_hz[-1])
        _join_legends(panel, beside)
    else:
        _join_legends(panel)
    return figure


def plot_factors(
    frequency_hz: FloatArray,
    factors: Mapping[str, Sequence[object]],
    *,
    effects: Sequence[FactorEffect] = (),
    title: str = "Natural frequency",
) -> Figure:
    """Draw the natural frequency against each factor, a panel each.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
        Of each measurement.
    factors : mapping of str to sequence, each of length n
        Numbers or words.
    effects : sequence of FactorEffect
        On it, in Hz: drawn in black with 95 %, over the measurements less what the other factors do to them.
    title : str
        Above the first panel.

    Returns
    -------
    Figure
        A new one.
    """
    count = len(factors)
    figure, panels = make_panels(None, (1,) * count, height_inch=1.0 + 2.4 * count, alone=count)
    shifts = {name: _shifts(values, [one for one in effects if one.factor == name]) for name, values in factors.items()}
    explained = np.sum(list(shifts.values()), axis=0)
    for number, (panel, (name, values)) in enumerate(zip(panels, factors.items(), strict=True)):
        alike_hz = frequency_hz - explained + shifts[name]
        own = [effect for effect in effects if effect.factor == name]
        named = any(effect.level is not None for effect in own)
        if not named and all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values):
            places: FloatArray = np.asarray(values, dtype=float)
            _draw_slope(panel, places, float(np.mean(frequency_hz)), own)
        else:
            words = sorted({str(value) for value in values}, key=_by_number)
            places = np.asarray([words.index(str(value)) for value in values], dtype=float)
            _draw_levels(panel, places, words, float(np.mean(frequency_hz)), own)
            places = places + 0.3 * ((np.arange(len(places)) * GOLDEN) % 1 - 0.5)
            step = max(1, len(words) // MOST_NAMES)
            panel.set_xticks(range(0, len(words), step), [literal(word) or "-" for word in words[::step]])
        panel.plot(places, alike_hz, "o", color=BLUE, ms=4, alpha=0.5)
        label = "f$_n$, the others alike (Hz)" if effects and count > 1 else "f$_n$ (Hz)"
        name_panel(panel, literal(title) if number == 0 else None, label, x=literal(name))
    return figure


def plot_decays(
    decays: Sequence[tuple[FloatArray, FloatArray]], *, unit: str = "mm", title: str = "Free decays"
) -> Figure:
    """Draw all fitted free decays over each other, each from its own begin.

    Parameters
    ----------
    decays : sequence of (ndarray, ndarray)
        Time in s and sway of each.
    unit : str
        Of the sway.
    title : str
        Above it.

    Returns
    -------
    Figure
        A new one.
    """
    figure, (panel,) = make_panels(None, (1,), height_inch=3.8)
    for time_s, sway in decays:
        panel.plot(time_s, sway, color=BLUE, lw=0.8, alpha=max(0.1, min(0.8, 8 / len(decays))))
    name_panel(panel, literal(title), f"sway ({unit})", x="time from the window's begin (s)")
    return figure


def write_figure(figure: Figure, path: Path) -> None:
    """Write a figure as a PNG, whole or not at all; its folder is made."""
    with whole_file(path) as part:
        part.write_bytes(draw_png(figure))


def draw_png(figure: Figure) -> bytes:
    """Return a figure as a PNG; the same figure gives the same bytes."""
    png = BytesIO()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from")  # a name in a script that the font lacks: boxes
        save_figure(figure, png)
    return png.getvalue()


def _shifts(values: Sequence[object], effects: Sequence[FactorEffect]) -> FloatArray:
    """Return by how much a factor moves each measurement from their mean, as far as its effects are told."""
    moved: FloatArray = np.zeros(len(values))
    for one in effects:
        if one.level is None:
            moved += one.effect.value * np.asarray(values, dtype=float)
        else:
            moved += one.effect.value * np.array([str(value) == one.level for value in values])
    moved -= moved.mean()
    return moved


def _draw_slope(panel: Axes, places: FloatArray, level_hz: float, effects: Sequence[FactorEffect]) -> None:
    for one in effects:
        ends = np.array([places.min(), places.max()])
        away = ends - places.mean()
        low, high = (level_hz + away * slope for slope in one.effect.ci95)
        panel.fill_between(ends, np.minimum(low, high), np.maximum(low, high), color=GREY, alpha=0.3, lw=0)
        panel.plot(ends, level_hz + away * one.effect.value, color=INK, lw=1.4)


def _draw_levels(
    panel: Axes, places: FloatArray, words: Sequence[str], level_hz: float, effects: Sequence[FactorEffect]
) -> None:
    """Draw each level's mean with the others alike; its interval is that of its difference from the first."""
    if not effects:
        return
    shares = {one.level: float(np.mean(places == words.index(str(one.level)))) for one in effects}
    first = level_hz - sum(shares[one.level] * one.effect.value for one in effects)
    panel.plot([words.index(str(effects[0].reference))], [first], "D", color=INK, ms=6, zorder=4)
    for one in effects:
        at, half = words.index(str(one.level)), (one.effect.ci95[1] - one.effect.ci95[0]) / 2
        panel.errorbar([at], [first + one.effect.value], [half], fmt="D", color=INK, ms=6, capsize=4, lw=1.4, zorder=4)


def _by_number(word: str) -> tuple[float, str]:
    try:
        return float(word), ""
    except ValueError:
        return np.inf, word


def _join_legends(*panels: Axes) -> None:
    """Name what several axes of one panel show in one row above it."""
    handles = [handle for panel in panels for handle in panel.get_legend_handles_labels()[0]]
    if handles:
        panels[0].legend(
            handles=handles,
            loc="lower left",
            bbox_to_anchor=(0, 1),
            ncols=len(handles),
            frameon=False,
            fontsize="small",
            borderpad=0,
        )
