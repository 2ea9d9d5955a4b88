"""Draw the documents' figures anew: python docs/draw_figures.py [FOLDER], by default docs/pictures."""

import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

sys.path.insert(0, str(Path(__file__).parent))

from rows import mode_of
from tagsway.model import DesignMode, Move
from tagsway.report.figures import save_figure
from tagsway.report.panels import name_panel
from tagsway.report.style import BLUE, GREEN, GREY, INK, ORANGE, VERMILION
from tagsway.shapers import (
    apply_to_command,
    design_multimode,
    design_shaper,
    frequency_response,
    given_shaper,
    sensitivity_curves,
    step_response,
    zero_delay_prices,
)
from tagsway.store.moves import read_move
from tagsway.trajectories import find_ratio_curves, plan_move, slow_down

HERE = Path(__file__).parent

UNSHAPED: Mapping[str, Any] = MappingProxyType({"color": GREY, "lw": 1.2, "label": "unshaped"})

DASH_DOT_DOT = (0, (6, 1.5, 1.5, 1.5, 1.5, 1.5))


def draw_ratios() -> Figure:
    """Figures 6.3 and 6.4 of document 1: what a ZV makes of a move that accelerates longer or shorter than it lasts."""
    move = replace(read_move(HERE.parent / "sample_data" / "move.toml"), max_acceleration_m_s2=5.0)
    shaper = design_shaper("zv", DesignMode(frequency_hz=2.4727, damping_ratio=3.5146e-4))
    columns = find_ratio_curves(move, shaper)
    figure, grid = _make_grid(4, len(columns), 11, 11)
    rows = (("x (mm)", 1e3), ("x velocity (m/s)", 1.0), ("x acceleration (m/s²)", 1.0))
    for column, curves in enumerate(columns):
        lines = (
            (curves.unshaped, UNSHAPED),
            (curves.shaped_x, {"color": BLUE, "lw": 2.2, "label": "x shaped, z held"}),
            (curves.shaped_xz, {"color": VERMILION, "lw": 1.2, "ls": "--", "label": "x and z shaped"}),
        )
        for values, style in lines:
            for order, (_, scale) in enumerate(rows):
                grid[order, column].plot(curves.time_s, scale * values[order, :, 0], **style)
            grid[3, column].plot(1e3 * values[0, :, 0], 1e3 * values[0, :, 2], **style)
        for order, (name, _) in enumerate(rows):
            _dress(grid[order, column], "time (s)", "" if column else name)
        _dress(grid[3, column], "x (mm)", "" if column else "z (mm)")
        grid[0, column].set_title(f"τ = {curves.ratio.ratio:g}, planned at {curves.max_acceleration_m_s2:.3g} m/s²")
    for row in (0, 3):
        for panel in grid[row, 1:]:
            panel.sharey(grid[row, 0])
    _add_legend(figure, grid[0, 0])
    return figure


def draw_prefilters() -> Figure:
    """Document 4's prefilters at 1 Hz with a damping ratio of 0.1: steps, gains and sensitivities."""
    design = DesignMode(frequency_hz=1.0, damping_ratio=0.1)
    mode = mode_of(design.frequency_hz, design.damping_ratio)
    time, frequency, ratio = np.linspace(0, 4, 1601), np.linspace(0, 4, 1601), np.linspace(0.01, 2, 800)
    figure, ((step, gain), (over_frequency, over_damping)) = _make_grid(2, 2, 11, 8)
    step.plot(time, step_response(given_shaper([0.0], [1.0]), mode, time).position, **UNSHAPED)
    for kind, colour, dash in (
        ("zv", BLUE, "-"),
        ("zvd", VERMILION, "-"),
        ("fir", INK, "--"),
        ("fir-zv", GREEN, "-."),
        ("fir-zvd", ORANGE, DASH_DOT_DOT),
    ):
        shaper = design_shaper(kind, design)
        style: dict[str, Any] = {"color": colour, "ls": dash, "lw": 1.5, "label": kind}
        step.plot(time, step_response(shaper, mode, time).position, **style)
        gain.plot(frequency, frequency_response(shaper, frequency).gain, **style)
        curves = sensitivity_curves(shaper, mode, ratio)
        over_frequency.plot(curves.ratio, 100 * curves.over_frequency, **style)
        over_damping.plot(curves.ratio, 100 * curves.over_damping, **style)
    for panel, title, x, y in (
        (step, "Step response", "time (s)", "position (steps)"),
        (gain, "Frequency response", "frequency (Hz)", "gain (-)"),
        (over_frequency, "Sensitivity to the frequency", "actual / designed $f_n$ (-)", "residual vibration (%)"),
        (over_damping, "Sensitivity to the damping", "actual / designed ζ (-)", "residual vibration (%)"),
    ):
        _dress(panel, x, y, title=title)
    _add_legend(figure, step)
    return figure


def draw_zero_delay() -> Figure:
    """Document 2's three ways to shape a quintic move of 0.734 s with a ZVD at 2.55 Hz, and what each leaves."""
    duration_s, sample_time_s = 0.734, 1e-3
    design, error = DesignMode(frequency_hz=2.55, damping_ratio=0.04), np.linspace(-0.2, 0.2, 81)
    quick = plan_move(Move(from_m=(0, 0, 0), to_m=(1, 0, 0), profile="quintic", max_acceleration_m_s2=100.0))
    trajectory = slow_down(quick, quick.duration_s / duration_s)
    ways = (
        (given_shaper([0.0], [1.0]), UNSHAPED),
        (design_shaper("zvd", design), {"color": BLUE, "ls": "-", "label": "IS (ZVD)"}),
        (design_shaper("ztd-zvd", design, move_duration_s=duration_s), {"color": ORANGE, "ls": "--", "label": "ZTD"}),
        (
            design_shaper("mztd-zvd", design, move_duration_s=duration_s),
            {"color": VERMILION, "ls": "-.", "label": "MZTD"},
        ),
    )

    def command(time_s: Any) -> Any:
        return trajectory(time_s)[..., 0]

    prices = zero_delay_prices(
        command,
        duration_s,
        mode_of(design.frequency_hz, design.damping_ratio),
        [shaper for shaper, _ in ways[1:]],
        sample_time_s=sample_time_s,
        frequency_error=error.tolist(),
    )
    figure, ((velocity, residual),) = _make_grid(1, 2, 11, 4.6)
    for (shaper, style), price in zip(ways, prices, strict=True):
        time, position = apply_to_command(command, duration_s, shaper, sample_time_s)
        velocity.plot(time, np.gradient(position, time), **style)
        residual.plot(100 * error, 1e3 * price.residual, **style)
    velocity.axvline(duration_s, color=INK, lw=0.8, ls=":")
    _dress(velocity, "time (s)", "velocity (m/s)", title="A move of 1 m in 0.734 s (dotted)")
    _dress(residual, "actual over designed frequency − 1 (%)", "swing after the end (mm)", title="What the move leaves")
    _add_legend(figure, velocity)
    return figure


def draw_steps() -> Figure:
    """Figures 14 to 16 of document 3: steps of the first mode with the design 0 to 20 % below the plant."""
    # the document's designs, 35.424 and 36.405 rad/s, are 10 % below its plant
    plants = [mode_of(rad_s / 0.9 / (2 * np.pi), 0.05) for rad_s in (35.424, 36.405)]
    time = np.linspace(0, 0.7, 2801)
    figure, ((left, right),) = _make_grid(1, 2, 11, 4.6)
    for panel, kinds in ((left, ("zvd",)), (right, ("zvd", "ei"))):
        panel.axhspan(0.95, 1.05, color=GREY, alpha=0.2, lw=0, label="±5 %")
        for percent, colour, dash in (
            (0, INK, "-"),
            (5, BLUE, "--"),
            (10, GREEN, "-."),
            (15, ORANGE, DASH_DOT_DOT),
            (20, VERMILION, ":"),
        ):
            modes = [
                DesignMode(frequency_hz=(1 - percent / 100) * plant.natural_frequency_hz, damping_ratio=0.05)
                for plant, _ in zip(plants, kinds, strict=False)
            ]
            answer = step_response(design_multimode(kinds, modes), plants[0], time)
            label = f"{percent} % low"
            panel.plot(answer.time_s, answer.position, color=colour, ls=dash, lw=1.5, label=label)
        _dress(panel, "time (s)", "position (steps)", title="-".join(kinds).upper())
    right.sharey(left)
    _add_legend(figure, left)
    return figure


FIGURES: Mapping[str, Callable[[], Figure]] = MappingProxyType(
    {"ratios": draw_ratios, "prefilters": draw_prefilters, "zero-delay": draw_zero_delay, "steps": draw_steps}
)
"""By the name of the file."""


def _make_grid(rows: int, columns: int, width_inch: float, height_inch: float) -> tuple[Figure, Any]:
    figure = Figure(figsize=(width_inch, height_inch), layout=ConstrainedLayoutEngine(w_pad=0.1, h_pad=0.06))
    return figure, figure.subplots(rows, columns, squeeze=False)


def _dress(panel: Axes, x: str, y: str, *, title: str | None = None) -> None:
    name_panel(panel, None, y, x=x)
    if title is not None:
        panel.set_title(title, loc="left", fontweight="bold", color=INK)


def _add_legend(figure: Figure, panel: Axes) -> None:
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)


def main(folder: Path) -> None:
    """Draw them all into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in FIGURES.items():
        save_figure(draw(), folder / f"{name}.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "pictures")
