"""The figure of a design: what every candidate takes, how the chosen one moves, and what happens beyond the band."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tagsway.design import Advice, describe
from tagsway.report.figures import save_figure
from tagsway.report.style import BLUE, GREEN, GREY, INK, ORANGE, RULE, VERMILION

MOST_MM = 80.0
"""Above it a placement is simply a miss."""

MOST_ROWS = 36
"""Candidates that are drawn, the best first; all of them are in candidates.csv."""

STYLES = ((BLUE, "-"), (GREY, "--"), (VERMILION, "-."))


def plot_design(advice: Advice) -> Figure:
    """Draw the candidates' motion times, the chosen motion's height over its way, and placements beyond the band.

    Parameters
    ----------
    advice : Advice
        Of `design_move`.

    Returns
    -------
    Figure
        A new one.
    """
    count = len(advice.candidates[:MOST_ROWS]) + (advice.optimised is not None)
    figure = Figure(figsize=(10, 4.2 + 0.2 * count), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 2, height_ratios=(0.2 * count + 0.6, 3.4))
    _draw_times(figure.add_subplot(grid[0, :]), advice)
    _draw_paths(figure.add_subplot(grid[1, 0]), advice)
    _draw_beyond(figure.add_subplot(grid[1, 1]), advice)
    figure.suptitle(describe(advice.chosen), x=0.01, ha="left", fontweight="bold", color=INK)
    return figure


def write_design(advice: Advice, path: Path) -> None:
    """Write the figure as a PNG, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    save_figure(plot_design(advice), path)


def _draw_times(panel: Axes, advice: Advice) -> None:
    rows = [
        (
            f"{c.name} {'+'.join(c.axes)}".strip(),
            c.motion_time_s,
            GREEN if c.legal else GREY,
            "" if c.legal else f"breaks {c.verdict.broken}",
        )
        for c in advice.candidates[:MOST_ROWS]
    ]
    if advice.optimised is not None:
        rows.insert(0, ("optimised", advice.optimised.move.motion_time_s, ORANGE, "made for the payload"))
    names, times, colours, words = zip(*rows, strict=True)
    bars = panel.barh(range(len(rows)), times, color=colours, height=0.7)
    labels = [f"{time:.3f} {word}" for time, word in zip(times, words, strict=True)]
    panel.bar_label(bars, labels, padding=4, size="small", color=INK)
    panel.set_yticks(range(len(rows)), names, size="small")
    panel.set_ylim(len(rows) - 0.4, -0.6)
    left_out = len(advice.candidates) - MOST_ROWS
    more = f"; {left_out} more in candidates.csv" if left_out > 0 else ""
    panel.set_xlabel(f"motion time (s); grey: breaks a limit{more}")
    panel.set_xlim(0, 1.3 * max(times))
    panel.spines[["top", "right", "left"]].set_visible(False)
    panel.grid(axis="x", color=RULE, lw=0.7)
    panel.set_axisbelow(True)


def _draw_paths(panel: Axes, advice: Advice) -> None:
    planned = advice.chosen.planned
    worst = len(planned.moves) > 1
    motions = [
        ("worst place" if worst and move.to_m == advice.worst_place_m else "chosen", trajectory)
        for move, trajectory in zip(planned.moves, planned.trajectories, strict=True)
    ]
    if advice.optimised is not None:
        motions.append(("optimised", advice.optimised.move.trajectory))
    for name, trajectory in motions:
        points = trajectory(np.linspace(0, trajectory.duration_s, 400))
        along = np.linalg.norm(points[:, :2] - points[0, :2], axis=1)
        colour, dashes = STYLES[("chosen", "worst place", "optimised").index(name)]
        panel.plot(1e3 * along, 1e3 * (points[:, 2] - points[0, 2]), color=colour, ls=dashes, lw=1.3, label=name)
    panel.set_xlabel("way (mm)")
    panel.set_ylabel("height (mm)")
    handles, labels = panel.get_legend_handles_labels()
    unique = dict(zip(labels, handles, strict=True))
    panel.legend(unique.values(), unique.keys(), frameon=False, fontsize="small")
    panel.spines[["top", "right"]].set_visible(False)
    panel.grid(color=RULE, lw=0.6)


def _draw_beyond(panel: Axes, advice: Advice) -> None:
    beyond, spread = advice.beyond, advice.task.payload
    for i, (name, row) in enumerate(zip(beyond.names, beyond.placement_m, strict=True)):
        optimised = advice.optimised is not None and i == len(beyond.names) - 1
        colour, dashes = STYLES[2] if optimised else STYLES[min(i, 1)]
        panel.plot(beyond.deviation_percent, 1e3 * row, color=colour, ls=dashes, lw=1.3, label=name)
    half = spread.band_percent
    panel.axvspan(-half, half, color=GREEN, alpha=0.12, lw=0)
    panel.axhline(1e3 * advice.task.limits.placement_window_m, color=INK, ls=":", lw=1)
    panel.set_ylim(0, min(MOST_MM, 1.05e3 * float(beyond.placement_m.max()) + 1))
    panel.set_xlabel("natural frequency off the design's (%); shaded: the spread")
    panel.set_ylabel("placement error (mm); dotted: the window")
    panel.legend(frameon=False, fontsize="small")
    panel.spines[["top", "right"]].set_visible(False)
    panel.grid(color=RULE, lw=0.6)
