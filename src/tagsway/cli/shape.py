"""`identify shaper` and `identify trajectory`: from a mode to impulses, from a move to the controller's file."""

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tagsway.cli.candidates import candidate_csv, candidate_table
from tagsway.cli.designs import Wish, design, design_by_hand
from tagsway.cli.modes import NO_TARGET, Target, read_target
from tagsway.cli.options import Dampings, Frequencies, MoveFile, Origin
from tagsway.errors import InputError
from tagsway.model import Move, Notice, Shaper

if TYPE_CHECKING:
    from tagsway.pipeline.shaping import PlannedMove


SLOWEST = 1e-3
"""Of the planned speed: a move of a second then takes a quarter of an hour."""


class ShaperFormat(StrEnum):
    """How a shaper is printed."""

    JSON = "json"
    CSV = "csv"
    KLIPPER = "klipper"


class KlipperAxes(StrEnum):
    """Which axes of a printer the mode is of."""

    X = "x"
    Y = "y"
    BOTH = "xy"


class TrajectoryFormat(StrEnum):
    """What the controller takes."""

    BECKHOFF = "beckhoff"
    BECKHOFF_PVA = "beckhoff-pva"
    CSV = "csv"
    JOINTS = "joints"
    ROS = "ros"


def shaper(
    origin: Origin = None,
    frequency: Frequencies = None,
    damping: Dampings = None,
    kind: Annotated[
        str,
        typer.Option(
            "--type",
            help="zv, zvd, ei, fir-zv … (an unknown one lists them); zv-ei for two modes, or simultaneous; all: a "
            "table and a figure of every type; auto: the shortest that keeps the tolerance over the spread.",
        ),
    ] = "zv",
    frequency_spread: Annotated[
        float | None, typer.Option(help="Standard deviation of f_n between repeats, in percent.")
    ] = None,
    tolerance: Annotated[
        float, typer.Option(help="Allowed residual vibration, a share of the swing: for auto, si, ei and its kin.")
    ] = 0.05,
    band: Annotated[
        list[float] | None,
        typer.Option(
            help="By how many percent f_n may be off: for si, and for auto with several modes, once for each."
        ),
    ] = None,
    move_duration: Annotated[
        float | None, typer.Option(help="Of the unshaped move in s: for ztd-zvd, mztd-zvd.")
    ] = None,
    impulses: Annotated[
        str | None, typer.Option(help="A shaper by hand instead of --type: TIME:AMPLITUDE,TIME:AMPLITUDE … in s.")
    ] = None,
    sample_time: Annotated[
        float | None, typer.Option(help="In ms: puts the impulses on the controller's samples, exact at the mode.")
    ] = None,
    form: Annotated[
        ShaperFormat | None, typer.Option("--format", help="How to print it.", show_default="json, or a table for all")
    ] = None,
    axes: Annotated[KlipperAxes, typer.Option("--axis", help="For klipper: the axes that sway so.")] = KlipperAxes.X,
    out: Annotated[Path, typer.Option(help="For all: the figure, a PNG.")] = Path("shapers.png"),
) -> None:
    """Design an input shaper for a measured or a stated mode, or several, and print it."""
    from tagsway.shapers import grid_costs, place_on_grid

    modeless = impulses is not None and origin is None and not frequency and not damping
    target = NO_TARGET if modeless else read_target(origin, frequency or [], damping or [], frequency_spread)
    wish = Wish(tolerance=tolerance, bands=band or [], move_duration_s=move_duration)
    if kind == "all" and impulses is None:
        typer.echo(_compare(target, wish, form, out), nl=False)
        return
    designed = design(kind, target, wish) if impulses is None else design_by_hand(impulses, target)
    if sample_time is not None:
        if not sample_time > 0:
            raise InputError(f"--sample-time is {sample_time:g}: expected the controller's cycle in ms, > 0")
        costs = grid_costs(designed, sample_time / 1e3) if designed.modes else ()
        designed = place_on_grid(designed, sample_time / 1e3)
        for cost in costs:
            left = f"{100 * cost.residual_at_mode:.2g} % at the mode"
            typer.echo(f"on samples of {sample_time:g} ms, {cost.placement}: {left}", err=True)
    typer.echo(_print_shaper(designed, form or ShaperFormat.JSON, axes), nl=False)


def trajectory(
    move: MoveFile,
    shaper: Annotated[str, typer.Option(help="shaper.json, or none for the unshaped move.")],
    out: Annotated[
        Path | None,
        typer.Option(
            help="The controller's file; its description lies beside it.",
            show_default="trajectory.csv, or trajectory.yaml for ros",
        ),
    ] = None,
    form: Annotated[TrajectoryFormat, typer.Option("--format", help="What the controller takes.")] = (
        TrajectoryFormat.BECKHOFF
    ),
    speed: Annotated[float, typer.Option(help="Share of the speed, up to 1: a dry run of the same path.")] = 1.0,
    joint_rate: Annotated[
        float | None,
        typer.Option(
            help="For joints and ros: the rate in Hz to which the joints are interpolated, such as 8000.",
            show_default="the move's sample time",
        ),
    ] = None,
) -> None:
    """Plan a move, shape it, check its limits, and write what the controller runs."""
    from tagsway.files import check_writable, write_text
    from tagsway.pipeline.shaping import plan_shaped_move
    from tagsway.store.documents import dump, read_shaper
    from tagsway.store.moves import read_move

    if not SLOWEST <= speed <= 1:
        raise InputError(f"--speed is {speed:g}: expected a share of the planned speed, from {SLOWEST:g} to 1")
    in_joints = form in (TrajectoryFormat.JOINTS, TrajectoryFormat.ROS)
    if joint_rate is not None and not in_joints:
        raise InputError(
            f"--joint-rate is {joint_rate:g} Hz, but --format {form} holds no joints: expected joints or ros"
        )
    if out is None:
        out = Path("trajectory.yaml" if form is TrajectoryFormat.ROS else "trajectory.csv")
    if out.suffix == ".json":
        raise InputError(f"--out is {out}: its description would take its place; give another ending, such as .csv")
    check_writable(out.parent)
    for target in (out, out.with_suffix(".json")):
        for file in (move, Path(shaper)):
            if target.exists() and file.exists() and target.samefile(file):
                raise InputError(f"--out {out} would write over the input {file}; give another name")
        if target.is_dir():
            raise InputError(f"--out {out}: {target} is a folder; give another name")
    designed = None if shaper == "none" else read_shaper(Path(shaper))
    wanted = read_move(move)
    planned = plan_shaped_move(wanted, designed, speed=speed, joint_rate_hz=joint_rate)
    text, description = planned.files(form=form.value)
    described = dump(description)
    write_text(out, text)
    write_text(out.with_suffix(".json"), described)
    typer.echo("\n".join(_lines(planned, out, tell_unshaped(wanted, designed))))


def _compare(target: Target, wish: Wish, form: ShaperFormat | None, out: Path) -> str:
    """Write the figure of every candidate and return their table."""
    import numpy as np

    from tagsway.files import check_writable
    from tagsway.report.candidates import write_candidates
    from tagsway.shapers import compare_shapers, residual_curve
    from tagsway.store.documents import dump, shaper_document

    if form is ShaperFormat.KLIPPER:
        raise InputError("--format klipper prints one shaper, not all: give --type zv or another, or --format csv")
    if out.suffix.lower() != ".png":
        raise InputError(f"--out is {out}: the figure is a PNG, expected a name that ends in .png")
    check_writable(out.parent)
    mode = target.mode
    found = compare_shapers(
        mode,
        tolerance=wish.tolerance,
        spread=target.spread,
        move_duration_s=wish.move_duration_s,
        source=target.source,
    )
    shapers = [price.shaper for price in found.prices]
    frequency = mode.frequency_hz * np.linspace(0.4, 1.6, 481)
    write_candidates(shapers, [residual_curve(each, frequency, mode.damping_ratio) for each in shapers], out)
    for notice in found.missing:
        typer.echo(f"not for this mode: {notice.message}", err=True)
    typer.echo(f"figure written to {out}", err=True)
    if form is ShaperFormat.JSON:
        return dump([shaper_document(each) for each in shapers])
    return candidate_csv(found.prices) if form is ShaperFormat.CSV else candidate_table(found.prices)


def _print_shaper(designed: Shaper, form: ShaperFormat, axes: KlipperAxes) -> str:
    from tagsway.store.documents import dump, shaper_document
    from tagsway.store.klipper import klipper_section

    if form is ShaperFormat.KLIPPER:
        return klipper_section(designed, axes=axes.value)
    if form is ShaperFormat.JSON:
        return dump(shaper_document(designed))
    if designed.box_s is not None or designed.filter is not None:
        raise InputError(
            f"--format csv holds impulses alone, but {designed.type} has a prefilter too: use --format json"
        )
    rows = [f"{impulse.time_s:.9f},{impulse.amplitude:.9f}" for impulse in designed.impulses]
    return "\n".join(["time_s,amplitude", *rows]) + "\n"


def describe_samples(planned: "PlannedMove", out: Path) -> str:
    """Return how many samples a file holds, and when they are at rest."""
    sampled = planned.sampled
    rows, step_ms = len(sampled.position_m), 1e3 * sampled.sample_time_s
    return f"{out}: {rows} samples of {step_ms:g} ms, at rest after {sampled.moving_s:.4f} s"


def tell_unshaped(move: Move, shaper: Shaper | None) -> tuple[Notice, ...]:
    """Return a warning where a shaper is given and the move lets it shape nothing."""
    if shaper is None or move.shaped_axes:
        return ()
    words = (
        f"the move's shaped_axes is []: it goes unshaped, and the {shaper.type} shaper takes no part; "
        'write ["x"] or ["x", "z"] there, or state --shaper none'
    )
    return (Notice(code="nothing_shaped", message=words),)


def _lines(planned: "PlannedMove", out: Path, notices: Sequence[Notice]) -> list[str]:
    report = planned.report
    lines = [
        describe_samples(planned, out),
        f"largest acceleration {max(report.peak_acceleration_m_s2):.3g} m/s² on an axis, "
        f"largest velocity {max(report.peak_velocity_m_s):.3g} m/s",
    ]
    if planned.joints is not None and planned.joints.turn:
        lines.append(f"margin to the nearest singularity {planned.joints.singularity_margin:.2f} of 1")
    if planned.ratio is not None:
        wanted = "below 1, as it should be" if planned.ratio.ratio < 1 else "the full acceleration is never reached"
        lines.append(f"τ = shaper ÷ acceleration time: {planned.ratio.ratio:.2f} ({wanted})")
    if planned.speed < 1:
        lines.append(f"a dry run at {100 * planned.speed:g} % of the speed")
    return [*lines, *(f"warning: {notice.message}" for notice in (*notices, *planned.notices))]
