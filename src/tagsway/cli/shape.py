"""`identify shaper` and `identify trajectory`: from a mode to impulses, from a move to the controller's file."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tagsway.errors import InputError
from tagsway.model import DesignMode, Shaper, Spread

if TYPE_CHECKING:
    from tagsway.pipeline.shaping import PlannedMove


SLOWEST = 1e-3
"""Of the planned speed: a move of a second then takes a quarter of an hour."""


class ShaperFormat(StrEnum):
    """How a shaper is printed."""

    JSON = "json"
    CSV = "csv"


class TrajectoryFormat(StrEnum):
    """What the controller takes."""

    BECKHOFF = "beckhoff"
    BECKHOFF_PVA = "beckhoff-pva"
    CSV = "csv"


def shaper(
    result: Annotated[Path | None, typer.Option("--from", help="result.json of a measurement.")] = None,
    frequency: Annotated[float | None, typer.Option(help="Undamped natural frequency in Hz.")] = None,
    damping: Annotated[float | None, typer.Option(help="Damping ratio.")] = None,
    kind: Annotated[str, typer.Option("--type", help="Type of the shaper.")] = "zv",
    frequency_spread: Annotated[
        float | None, typer.Option(help="Standard deviation of f_n between repeats, in percent.")
    ] = None,
    form: Annotated[ShaperFormat, typer.Option("--format", help="How to print it.")] = ShaperFormat.JSON,
) -> None:
    """Design an input shaper for a measured or a stated mode, and print it."""
    from tagsway.shapers import design_shaper
    from tagsway.store.documents import dump, shaper_document

    mode, source = _stated_mode(frequency, damping) if result is None else _measured_mode(result, frequency, damping)
    if frequency_spread is not None and not frequency_spread > 0:
        raise InputError(f"--frequency-spread is {frequency_spread:g}: expected a standard deviation in percent, > 0")
    spread = None
    if frequency_spread is not None:
        spread = Spread(source="--frequency-spread", natural_frequency_std_percent=frequency_spread, n=None)
    designed = design_shaper(kind, mode, spread=spread, source=source)
    typer.echo(_impulse_table(designed) if form is ShaperFormat.CSV else dump(shaper_document(designed)), nl=False)


def trajectory(
    move: Annotated[Path, typer.Option(help="move.toml.")],
    shaper: Annotated[str, typer.Option(help="shaper.json, or none for the unshaped move.")],
    out: Annotated[Path, typer.Option(help="The controller's file; its description lies beside it.")] = Path(
        "trajectory.csv"
    ),
    form: Annotated[TrajectoryFormat, typer.Option("--format", help="What the controller takes.")] = (
        TrajectoryFormat.BECKHOFF
    ),
    speed: Annotated[float, typer.Option(help="Share of the speed, up to 1: a dry run of the same path.")] = 1.0,
) -> None:
    """Plan a move, shape it, check its limits, and write what the controller runs."""
    from tagsway.pipeline.shaping import plan_shaped_move
    from tagsway.store.atomic import check_writable, write_text
    from tagsway.store.documents import dump, read_shaper
    from tagsway.store.moves import read_move

    if not SLOWEST <= speed <= 1:
        raise InputError(f"--speed is {speed:g}: expected a share of the planned speed, from {SLOWEST:g} to 1")
    if out.suffix == ".json":
        raise InputError(f"--out {out}: its description takes that name; give a name that ends in .csv")
    check_writable(out.parent)
    for target in (out, out.with_suffix(".json")):
        for file in (move, Path(shaper)):
            if target.exists() and file.exists() and target.samefile(file):
                raise InputError(f"--out {out} would write over the input {file}; give another name")
        if target.is_dir():
            raise InputError(f"--out {out}: {target} is a folder; give another name")
    designed = None if shaper == "none" else read_shaper(Path(shaper))
    planned = plan_shaped_move(read_move(move), designed, speed=speed)
    text, description = planned.files(form=form.value)
    described = dump(description)
    write_text(out, text)
    write_text(out.with_suffix(".json"), described)
    typer.echo("\n".join(_lines(planned, out)))


def _stated_mode(frequency: float | None, damping: float | None) -> tuple[DesignMode, str]:
    if frequency is None or damping is None:
        raise InputError("a shaper needs a mode: give --from result.json, or both --frequency HZ and --damping RATIO")
    return DesignMode(frequency_hz=frequency, damping_ratio=damping), "given"


def _measured_mode(path: Path, frequency: float | None, damping: float | None) -> tuple[DesignMode, str]:
    from tagsway.store.documents import read_result

    if frequency is not None or damping is not None:
        raise InputError("--from and --frequency/--damping contradict each other: give one or the other")
    measured = read_result(path).shaper
    if measured is None:
        raise InputError(f"{path} holds no mode to design for: its status is not_determined")
    return measured.modes[0], measured.source


def _impulse_table(designed: Shaper) -> str:
    rows = [f"{impulse.time_s:.9f},{impulse.amplitude:.9f}" for impulse in designed.impulses]
    return "\n".join(["time_s,amplitude", *rows]) + "\n"


def _lines(planned: "PlannedMove", out: Path) -> list[str]:
    sampled, report = planned.sampled, planned.report
    rows = len(sampled.position_m)
    lines = [
        f"{out}: {rows} samples of {1e3 * sampled.sample_time_s:g} ms, at rest after {sampled.moving_s:.4f} s",
        f"largest acceleration {max(report.peak_acceleration_m_s2):.3g} m/s² on an axis, "
        f"largest velocity {max(report.peak_velocity_m_s):.3g} m/s",
    ]
    if planned.speed < 1:
        lines.append(f"a dry run at {100 * planned.speed:g} % of the speed")
    return [*lines, *(f"warning: {notice.message}" for notice in planned.notices)]
