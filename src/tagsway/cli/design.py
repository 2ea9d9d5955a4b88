"""`identify design`: which shaper, how fast, and how sure."""

import sys
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tagsway.cli.designs import NORMAL_95
from tagsway.cli.modes import Target, read_target
from tagsway.cli.options import AsJson, Box, Dampings, Frequencies, MaxPcpAcceleration, MoveFile, Origin
from tagsway.cli.spreads import SpreadWish, read_spread
from tagsway.errors import InputError
from tagsway.model import DesignMode, Move

if TYPE_CHECKING:
    from tagsway.design import Advice, DesignLimits, DesignTask, PayloadSpread

SEED = 0
"""Of the payloads that are drawn: the same question has the same answer."""

SHOWN = 12


class SpreadShape(StrEnum):
    """How the natural frequency is distributed."""

    NORMAL = "normal"
    UNIFORM = "uniform"


FrequencySpreads = Annotated[
    list[float] | None,
    typer.Option(
        help="Of f_n between repeats in percent: a standard deviation, or half the width if uniform; again for "
        "each further mode.",
        show_default="measured; for further modes the first one's",
    ),
]
DampingSpread = Annotated[
    float | None, typer.Option(help="The same of ζ, as a ratio.", show_default="0.3 ζ, or as measured")
]
Length = Annotated[
    float | None, typer.Option(help="Equivalent length of the payload in mm.", show_default="measured, or g/ω²")
]
Gains = Annotated[
    list[float] | None,
    typer.Option(
        help="How far a further mode sways per acceleration of its support: 1 is a point on a string; for each.",
        show_default="as the filmed move tells, or 1",
    ),
]
PlacementWindow = Annotated[
    float | None,
    typer.Option(help="In mm: how far off the product may be once the tool stands.", show_default="2 % of the way"),
]
Places = Annotated[
    list[str] | None, typer.Option(help="A further place point X,Y,Z in m, as on a conveyor; again for each.")
]
Kinds = Annotated[list[str] | None, typer.Option("--type", help="A shaper to try; again for each.", show_default="all")]


def design(
    move: MoveFile,
    origin: Origin = None,
    frequency: Frequencies = None,
    damping: Dampings = None,
    frequency_spread: FrequencySpreads = None,
    damping_spread: DampingSpread = None,
    spread_shape: Annotated[SpreadShape, typer.Option(help="Of that spread.")] = SpreadShape.NORMAL,
    length: Length = None,
    gain: Gains = None,
    max_pcp_acceleration: MaxPcpAcceleration = None,
    placement_window: PlacementWindow = None,
    box: Box = None,
    place: Places = None,
    kind: Kinds = None,
    optimise: Annotated[bool, typer.Option(help="Look for a move made for the payload too.")] = True,
    figure: Annotated[bool, typer.Option(help="Draw design.png.")] = True,
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("design"),
    json: AsJson = False,
) -> None:
    """Choose shaper, axes and acceleration: the quickest move that keeps its limits for 95 % of the payloads."""
    import numpy as np

    from tagsway.design import design_move, read_limits
    from tagsway.files import check_writable
    from tagsway.pipeline.designing import write_advice
    from tagsway.store.designs import design_document
    from tagsway.store.documents import dump
    from tagsway.store.moves import read_move

    asked = read_move(move)
    spreads = frequency_spread or []
    target = read_target(origin, frequency or [], damping or [], spreads[0] if spreads else None)
    payload, notices = read_spread(
        SpreadWish(
            target=target,
            folder=None if origin is None else origin.parent,
            damping_spread=damping_spread,
            further_percent=spreads[1:],
            gains=gain or [],
            length_mm=length,
            shape=spread_shape.value,
            stated=bool(spreads),
        )
    )
    limits = read_limits(
        asked,
        pcp_acceleration_m_s2=max_pcp_acceleration,
        placement_window_m=None if placement_window is None else placement_window / 1e3,
        box_error_m=None if box is None else box / 1e3,
    )
    check_writable(out)
    _keep_inputs(out, (move, origin))
    task = _task(asked, place or [], target, payload, limits, kind)
    advice = design_move(task, rng=np.random.default_rng(SEED), optimise=optimise, progress=_show_progress)
    advice = replace(advice, notices=(*notices, *advice.notices))
    write_advice(advice, out, figure=figure)
    typer.echo(dump(design_document(advice)) if json else _words(advice, out, drawn=figure), nl=not json)


def _task(
    move: Move,
    places: list[str],
    target: Target,
    payload: "PayloadSpread",
    limits: "DesignLimits",
    kinds: list[str] | None,
) -> "DesignTask":
    from tagsway.design import DesignTask
    from tagsway.shapers import SHAPER_TYPES

    for kind in kinds or []:
        if kind not in SHAPER_TYPES:
            raise InputError(f"--type is {kind!r}: expected one of {', '.join(SHAPER_TYPES)}")
    # A result's shaper is for its first mode; the further ones sway little, and so at their own frequency.
    further = [
        DesignMode(frequency_hz=mode.natural_frequency_hz, damping_ratio=mode.damping_ratio)
        for mode in target.swings[1:]
    ]
    widening = 1 if payload.shape == "uniform" else NORMAL_95
    percents = (payload.frequency_percent, *(each.frequency_percent for each in payload.further))
    return DesignTask(
        moves=(move, *(replace(move, to_m=_point(text)) for text in places)),
        modes=(target.modes[0], *further),
        band_percent=tuple(widening * percent for percent in percents),
        payload=payload,
        limits=limits,
        kinds=tuple(kinds) if kinds else SHAPER_TYPES,
    )


def _keep_inputs(out: Path, inputs: tuple[Path | None, ...]) -> None:
    from tagsway.pipeline.designing import DESIGN_FILES

    for name in DESIGN_FILES:
        if (out / name).exists() and any(f is not None and (out / name).samefile(f) for f in inputs):
            raise InputError(f"--out {out} would write over the input {out / name}; give another folder")


def _show_progress(done: int, total: int) -> None:
    if sys.stderr.isatty():
        typer.echo(f"\rcandidate {done} of {total}", err=True, nl=done == total)


def _point(text: str) -> tuple[float, float, float]:
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--place is {text!r}: expected X,Y,Z in m, such as 0.35,0.05,-0.767") from None
    return x, y, z


def _words(advice: "Advice", out: Path, *, drawn: bool) -> str:
    from tagsway.design import describe

    limits, chosen = advice.task.limits, advice.chosen
    error = 100 * (chosen.verdict.share_kept * (1 - chosen.verdict.share_kept) / advice.task.checked) ** 0.5
    lines = [
        f"for {advice.task.payload.words}",
        f"{'candidate':<18}{'axes':<6}{'time s':>8}{'m/s²':>8}{'kept %':>8}  gives up",
    ]
    for c in advice.candidates[:SHOWN]:
        lost = "" if c is chosen else _gives_up(c.motion_time_s - chosen.motion_time_s, c.verdict.broken)
        lines.append(
            f"{c.name:<18}{'+'.join(c.axes):<6}{c.motion_time_s:>8.3f}{c.acceleration_m_s2:>8.2f}"
            f"{100 * c.verdict.share_kept:>8.1f}  {lost}"
        )
    if len(advice.candidates) > SHOWN:
        lines.append(f"… and {len(advice.candidates) - SHOWN} more in {out / 'candidates.csv'}")
    lines.append(
        f"chosen: {describe(chosen)}; keeps {1e3 * limits.placement_window_m:.3g} mm and the other limits for "
        f"{100 * chosen.verdict.share_kept:.1f} ± {error:.1f} % of the payloads"
    )
    if len(advice.task.moves) > 1:
        lines.append(f"worst of {len(advice.task.moves)} place points: {list(advice.worst_place_m)}")
    if advice.optimised is not None:
        found = advice.optimised
        lines.append(
            f"optimised: {found.move.motion_time_s:.3f} s, {found.move.motion_time_s / chosen.motion_time_s:.2f} of "
            f"it, kept for {100 * found.verdict.share_kept:.1f} %; found in {found.move.solve_s:.1f} s"
        )
    lines += _beyond(advice, drawn=drawn)
    lines += [f"warning: {notice.message}" for notice in advice.notices]
    return "\n".join([*lines, f"written to {out}"])


def _beyond(advice: "Advice", *, drawn: bool) -> list[str]:
    """Return what each motion leaves of a payload that is half as far again from the middle as the spread reaches."""
    import numpy as np

    beyond = advice.beyond
    off = min(1.5 * advice.task.payload.band_percent, float(beyond.deviation_percent[-1]))
    see = " (see design.png)" if drawn else ""
    lines = [f"if f_n is {off:.0f} % off, beyond the spread, the product is left, in mm{see}:"]
    for name, row in zip(beyond.names, beyond.placement_m, strict=True):
        slow, quick = 1e3 * np.interp([-off, off], beyond.deviation_percent, row)
        lines.append(f"  {slow:.1f} if slower, {quick:.1f} if quicker: {name}")
    return lines


def _gives_up(later_s: float, broken: str | None) -> str:
    return f"{1e3 * later_s:.0f} ms" if broken is None else f"breaks {broken}"
