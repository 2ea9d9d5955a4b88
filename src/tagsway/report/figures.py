"""Figures for a folder: one picture for each part of the evidence.

Each ``plot_…`` draws one curve into a figure of its own, or into axes that are handed in, and returns the figure. None
shows anything, none uses pyplot, so nothing stays behind when the figure is let go.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tagsway.files import whole_file
from tagsway.model import (
    Curves,
    DecayCurve,
    Estimate,
    Event,
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
from tagsway.report.modal_figures import plot_backbone, plot_estimators, plot_excitation
from tagsway.report.panels import draw_line, frame_panel, make_panels, mark_frequency, name_panel
from tagsway.report.pendulum_figures import plot_ridge
from tagsway.report.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    VERMILION,
    LengthUnit,
    drawn_acceleration,
    drawn_length,
    length_unit,
    shaped_frequency,
    sideways_axis,
    to_decibel,
)
from tagsway.report.words import format_estimate


def plot_track(
    curve: TrackCurve,
    *,
    unit: LengthUnit = "m",
    window: Window | None = None,
    events: Sequence[Event] = (),
    axes: Sequence[Axes] | None = None,
) -> Figure:
    """Draw the raw and the cleaned track of tool and product: x, z and the horizontal acceleration over time.

    Parameters
    ----------
    curve : TrackCurve
        Raw and cleaned track.
    unit : {"m", "px"}
        Its length unit; metres are drawn in mm.
    window : Window, optional
        The free vibration, drawn as a band.
    events : sequence of Event
        What happened to the grip, drawn as lines.
    axes : sequence of three Axes, optional
        To draw into.

    Returns
    -------
    Figure
        That of the axes.
    """
    figure, (upper, middle, lower) = make_panels(axes, (3, 2, 2), height_inch=6.4)
    scale, name = drawn_length(unit)
    for axis, panel in enumerate((upper, middle)):
        for raw, clean, colour, dash, who in (
            (curve.tcp, curve.tcp_clean, BLUE, "--", "tool (TCP)"),
            (curve.pcp, curve.pcp_clean, VERMILION, "-", "product (PCP)"),
        ):
            if np.any(np.isfinite(raw[:, axis])):
                draw_line(panel, curve.time_s, scale * raw[:, axis], ".", color=GREY, ms=2, label="raw")
                draw_line(panel, curve.time_s, scale * clean[:, axis], dash, color=colour, lw=1.2, label=who)
        shown, cut = (curve.tcp_clean, curve.pcp_clean), (curve.tcp, curve.pcp)
        frame_panel(panel, [scale * s[:, axis] for s in shown], [scale * c[:, axis] for c in cut])
    for acceleration, colour, dash, who in (
        (curve.tcp_acceleration, BLUE, "--", "tool (TCP)"),
        (curve.pcp_acceleration, VERMILION, "-", "product (PCP)"),
    ):
        if np.any(np.isfinite(acceleration[:, 0])):
            draw_line(lower, curve.time_s, acceleration[:, 0], dash, color=colour, lw=1, label=who)
    if window is not None:
        for panel in (upper, middle, lower):
            panel.axvspan(window.start_s, window.end_s, color=GREEN, alpha=0.1, lw=0, label="free vibration")
    for event in events:
        for panel in (upper, middle, lower):
            panel.axvline(event.time_s.value, color=INK, ls="-.", lw=1.3, label=event.words)
    name_panel(upper, "Track", f"x ({name})", legend=True)
    name_panel(middle, None, f"z ({name})")
    name_panel(lower, None, f"x acceleration\n({drawn_acceleration(unit)})", x="time (s)")
    return figure


def plot_decay(curve: DecayCurve, *, unit: LengthUnit = "m", axes: Sequence[Axes] | None = None) -> Figure:
    """Draw the free decay with its fit, envelope and peaks, and the residual below.

    Parameters
    ----------
    curve : DecayCurve
        The sway about its rest position.
    unit : {"m", "px"}
        Its length unit; metres are drawn in mm.
    axes : sequence of two Axes, optional
        To draw into.

    Returns
    -------
    Figure
        That of the axes.
    """
    figure, (upper, lower) = make_panels(axes, (3, 1), height_inch=4.8)
    scale, name = drawn_length(unit)
    draw_line(upper, curve.time_s, scale * curve.sway, ".", color=GREY, ms=3, label="measured")
    draw_line(upper, curve.time_s, scale * curve.fit, "-", color=VERMILION, lw=1, label="fit")
    draw_line(upper, curve.time_s, scale * curve.envelope, "--", color=INK, lw=1, label="envelope")
    draw_line(upper, curve.time_s, -scale * curve.envelope, "--", color=INK, lw=1)
    draw_line(upper, curve.peak_time_s, scale * curve.peak_sway, "o", mfc="none", mec=BLUE, ms=4, mew=1, label="peaks")
    draw_line(lower, curve.time_s, scale * curve.residual, ".", color=INK, ms=2)
    lower.axhline(0, color=GREY, lw=0.8)
    frame_panel(upper, [scale * curve.fit, scale * curve.envelope, -scale * curve.envelope], [scale * curve.sway])
    frame_panel(lower, [], [scale * curve.residual])
    name_panel(upper, "Free decay", f"sway ({name})", legend=True)
    name_panel(lower, None, f"measured − fit\n({name})", x="time (s)")
    return figure


def plot_spectrum(
    curve: SpectrumCurve, *, natural_frequency_hz: Estimate | None = None, axes: Sequence[Axes] | None = None
) -> Figure:
    """Draw the spectrum of the decay, in dB below its largest line, with f_n and its 95 % interval.

    Parameters
    ----------
    curve : SpectrumCurve
        Amplitude over frequency.
    natural_frequency_hz : Estimate, optional
        Drawn as a line and a band; the axis then ends at six times it.
    axes : sequence of one Axes, optional
        To draw into.

    Returns
    -------
    Figure
        That of the axes.
    """
    figure, (panel,) = make_panels(axes, (1,), height_inch=3.4)
    draw_line(panel, curve.frequency_hz, to_decibel(curve.amplitude), "-", color=INK, lw=1, label="decay")
    panel.set_ylim(-80, 5)
    if natural_frequency_hz is not None:
        mark_frequency(panel, natural_frequency_hz, f"f$_n$ = {format_estimate(natural_frequency_hz, 'Hz')}")
        panel.set_xlim(0, 6 * natural_frequency_hz.value)
    name_panel(panel, "Spectrum of the decay", "amplitude (dB, 0 = largest)", x="frequency (Hz)", legend=True)
    return figure


def plot_pendulum(curve: PendulumCurve, *, unit: LengthUnit = "m", axes: Sequence[Axes] | None = None) -> Figure:
    """Draw the measured sway against the simulated one, both axes, and their difference.

    Parameters
    ----------
    curve : PendulumCurve
        PCP minus TCP, measured and simulated.
    unit : {"m", "px"}
        Its length unit; metres are drawn in mm.
    axes : sequence of three Axes, optional
        To draw into.

    Returns
    -------
    Figure
        That of the axes.
    """
    figure, panels = make_panels(axes, (3, 2, 2), height_inch=6.4)
    scale, name = drawn_length(unit)
    for axis, panel in enumerate(panels[:2]):
        draw_line(panel, curve.time_s, scale * curve.measured[:, axis], ".", color=GREY, ms=3, label="measured")
        draw_line(panel, curve.time_s, scale * curve.simulated[:, axis], "-", color=VERMILION, lw=1, label="simulated")
        frame_panel(panel, [scale * curve.simulated[:, axis]], [scale * curve.measured[:, axis]])
    difference = scale * (curve.measured - curve.simulated)
    draw_line(panels[2], curve.time_s, difference[:, 0], ".", color=BLUE, ms=2, label="x")
    draw_line(panels[2], curve.time_s, difference[:, 1], "x", color=INK, ms=2, mew=0.6, label="z")
    frame_panel(panels[2], [], [difference[:, 0], difference[:, 1]])
    name_panel(panels[0], "Pendulum: product relative to tool", f"x ({name})", legend=True)
    name_panel(panels[1], None, f"z ({name})")
    name_panel(panels[2], None, f"measured −\nsimulated ({name})", x="time (s)", legend=True)
    return figure


def plot_residual(
    curve: ResidualCurve,
    *,
    frequency_hz: Estimate | None = None,
    shaper: Shaper | None = None,
    axes: Sequence[Axes] | None = None,
) -> Figure:
    """Draw the swing that a shaper leaves, over the frequency that the payload turns out to have.

    Parameters
    ----------
    curve : ResidualCurve
        Residual vibration V.
    frequency_hz : Estimate, optional
        Of the payload at the operating amplitude; its 95 % interval is drawn as a band.
    shaper : Shaper, optional
        Whose V at the design frequency is marked.
    axes : sequence of one Axes, optional
        To draw into.

    Returns
    -------
    Figure
        That of the axes.
    """
    figure, (panel,) = make_panels(axes, (1,), height_inch=3.4)
    panel.plot(curve.frequency_hz, 100 * curve.residual, color=INK, lw=1.4, label="shaper")
    panel.axhline(5, color=GREY, ls=":", lw=1.2, label="5 %")
    if frequency_hz is not None:
        mark_frequency(panel, frequency_hz, f"payload: {format_estimate(frequency_hz, 'Hz')}")
    if shaper is not None and shaper.residual is not None:
        at_mode = [shaper.modes[0].frequency_hz] if shaper.modes else []
        panel.plot(
            at_mode,
            [100 * shaper.residual.at_mode] * len(at_mode),
            "o",
            color=VERMILION,
            ms=6,
            label="design",
            clip_on=False,
        )
    panel.set_ylim(bottom=0)
    title = "What the shaper leaves" if shaper is None else f"What the {shaper.type.upper()} shaper leaves"
    name_panel(panel, title, "residual vibration V\n(% of the swing)", x="frequency (Hz)", legend=True)
    return figure


def plot_trajectory(curve: TrajectoryCurve, *, axes: Sequence[Axes] | None = None) -> Figure:
    """Draw a move before and after shaping: position and acceleration over time, and the path.

    Parameters
    ----------
    curve : TrajectoryCurve
        The tool's move; the sideways axis drawn is the one of x and y with the longer way.
    axes : sequence of five Axes, optional
        To draw into: sideways, z, sideways acceleration, z acceleration, path.

    Returns
    -------
    Figure
        That of the axes.
    """
    figure, panels = make_panels(axes, (2, 2, 2, 2, 3), height_inch=9.0, alone=1)
    side, side_name = sideways_axis(curve)
    for data, acceleration, colour, dash, label in (
        (curve.unshaped_m, curve.unshaped_m_s2, BLUE, "--", "before shaping"),
        (curve.shaped_m, curve.shaped_m_s2, VERMILION, "-", "after shaping"),
    ):
        drawn: list[FloatArray] = [1e3 * data[:, side], 1e3 * data[:, 2], acceleration[:, side], acceleration[:, 2]]
        for panel, values in zip(panels, drawn, strict=False):
            panel.plot(curve.time_s, values, dash, color=colour, lw=1.3, label=label)
        panels[4].plot(drawn[0], drawn[1], dash, color=colour, lw=1.3)
    name_panel(panels[0], "Move", f"{side_name} (mm)", legend=True)
    name_panel(panels[1], None, "z (mm)")
    name_panel(panels[2], None, f"{side_name} acceleration\n(m/s²)")
    name_panel(panels[3], None, "z acceleration\n(m/s²)", x="time (s)")
    name_panel(panels[4], None, "z (mm)", x=f"{side_name} (mm)")
    return figure


def write_figures(result: Result, curves: Curves, folder: Path) -> tuple[Path, ...]:
    """Write a PNG for each curve that there is.

    Parameters
    ----------
    result : Result
        For what is marked in the figures.
    curves : Curves
        What is drawn.
    folder : Path
        Made where it is missing.

    Returns
    -------
    tuple of Path
        What was written. The same input gives the same bytes; each file is written whole or not at all.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, plot in _plots(result, curves).items():
        written.append(folder / f"{name}.png")
        save_figure(plot(), written[-1])
    return tuple(written)


def _plots(result: Result, curves: Curves) -> dict[str, Callable[[], Figure]]:
    unit = length_unit(result)
    decay, spectrum, pendulum = curves.decay, curves.spectrum, curves.pendulum
    ridge, residual, trajectory = curves.ridge, curves.residual, curves.trajectory
    modal, backbone, excitation = result.modal, curves.backbone, curves.excitation
    natural = None if modal is None else modal.natural_frequency_hz
    shaped, shaper = shaped_frequency(result), result.shaper
    plots: dict[str, Callable[[], Figure]] = {
        "track": lambda: plot_track(curves.track, unit=unit, window=result.window, events=result.events)
    }
    if decay is not None:
        plots["decay"] = lambda: plot_decay(decay, unit=unit)
    if spectrum is not None:
        plots["spectrum"] = lambda: plot_spectrum(spectrum, natural_frequency_hz=natural)
    if modal is not None and natural is not None:
        plots["estimators"] = lambda: plot_estimators(modal, details=result.estimator_details)
    if backbone is not None:
        plots["backbone"] = lambda: plot_backbone(backbone, modal=modal)
    if excitation is not None:
        plots["excitation"] = lambda: plot_excitation(
            excitation, unit=unit, frequency_hz=shaped, excitation=result.excitation
        )
    if pendulum is not None:
        plots["pendulum"] = lambda: plot_pendulum(pendulum, unit=unit)
    if ridge is not None:
        length = None if result.pendulum is None else result.pendulum.length_m
        plots["ridge"] = lambda: plot_ridge(ridge, length_m=length)
    if residual is not None:
        plots["residual"] = lambda: plot_residual(residual, frequency_hz=shaped, shaper=shaper)
    if trajectory is not None:
        plots["trajectory"] = lambda: plot_trajectory(trajectory)
    return plots


def save_figure(figure: Figure, target: Path | BinaryIO) -> None:
    """Write a figure as a PNG, a file whole or not at all; the same figure gives the same bytes."""
    if isinstance(target, Path):
        with whole_file(target) as part:
            _save(figure, part)
    else:
        _save(figure, target)


def _save(figure: Figure, target: Path | BinaryIO) -> None:
    # without the program's version in the metadata the same input gives the same bytes; packed twice as long, a tenth
    # would be saved
    figure.savefig(target, format="png", dpi=150, metadata={"Software": None}, pil_kwargs={"compress_level": 3})
