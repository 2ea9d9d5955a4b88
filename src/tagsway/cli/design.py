"""`identify design`: which shaper, how fast, and how sure."""

import sys
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tagsway.cli.modes import Target, read_target
from tagsway.errors import InputError, NotIdentifiableError
from tagsway.model import GRAVITY_M_S2, Mode, Notice

if TYPE_CHECKING:
    from tagsway.design import Advice, PayloadSpread

SEED = 0
"""Of the payloads that are drawn: the same question has the same answer."""

ASSUMED_DAMPING = 0.3
"""Of ζ, one standard deviation, where its spread is not stated: an optimum for one damping alone is fragile."""

NORMAL_95 = 1.96
SHOWN = 12


class SpreadShape(StrEnum):
    """How the natural frequency is distributed."""

    NORMAL = "normal"
    UNIFORM = "uniform"


def design(
    move: Annotated[Path, typer.Option(help="move.toml: points, heights, [limits] and [robot].")],
    origin: Annotated[
        Path | None, typer.Option("--from", help="result.json of a measurement, or measurements.csv of many.")
    ] = None,
    frequency: Annotated[
        list[float] | None, typer.Option(help="Undamped natural frequency in Hz; again for each further mode.")
    ] = None,
    damping: Annotated[list[float] | None, typer.Option(help="Damping ratio; again for each further mode.")] = None,
    frequency_spread: Annotated[
        float | None,
        typer.Option(help="Of f_n between repeats in percent: a standard deviation, or half the width if uniform."),
    ] = None,
    damping_spread: Annotated[
        float | None, typer.Option(help="The same of ζ, as a ratio.", show_default="0.3 ζ, or as measured")
    ] = None,
    spread_shape: Annotated[SpreadShape, typer.Option(help="Of that spread.")] = SpreadShape.NORMAL,
    length: Annotated[
        float | None, typer.Option(help="Equivalent length of the payload in mm.", show_default="measured, or g/ω²")
    ] = None,
    max_pcp_acceleration: Annotated[
        float | None, typer.Option(help="Largest |x''| of the product in m/s²: more peels it off.")
    ] = None,
    placement_window: Annotated[
        float | None,
        typer.Option(help="In mm: how far off the product may be once the tool stands.", show_default="2 % of the way"),
    ] = None,
    place: Annotated[
        list[str] | None, typer.Option(help="A further place point X,Y,Z in m, as on a conveyor; again for each.")
    ] = None,
    kind: Annotated[
        list[str] | None, typer.Option("--type", help="A shaper to try; again for each.", show_default="all")
    ] = None,
    optimise: Annotated[bool, typer.Option(help="Look for a move made for the payload too.")] = True,
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("design"),
    json: Annotated[bool, typer.Option("--json", help="Print design.json instead of the table.")] = False,
) -> None:
    """Choose shaper, axes and acceleration: the quickest move that keeps its limits for 95 % of the payloads."""
    import numpy as np

    from tagsway.design import DesignTask, design_move, read_limits
    from tagsway.files import check_writable
    from tagsway.pipeline.designing import DESIGN_FILES, write_advice
    from tagsway.shapers import SHAPER_TYPES
    from tagsway.store.designs import design_document
    from tagsway.store.documents import dump
    from tagsway.store.moves import read_move

    asked = read_move(move)
    target = read_target(origin, frequency or [], damping or [], frequency_spread)
    payload, notices = read_payload(origin, target, damping_spread, length, spread_shape)
    limits = read_limits(
        asked,
        pcp_acceleration_m_s2=max_pcp_acceleration,
        placement_window_m=None if placement_window is None else placement_window / 1e3,
    )
    check_writable(out)
    for name in DESIGN_FILES:
        if (out / name).exists() and any(f is not None and (out / name).samefile(f) for f in (move, origin)):
            raise InputError(f"--out {out} would write over the input {out / name}; give another folder")
    half = payload.frequency_percent * (1 if payload.shape == "uniform" else NORMAL_95)
    task = DesignTask(
        moves=(asked, *(replace(asked, to_m=_point(text)) for text in place or [])),
        modes=target.modes,
        band_percent=(half,) * len(target.modes),
        payload=payload,
        limits=limits,
        kinds=tuple(kind) if kind else SHAPER_TYPES,
    )
    advice = design_move(task, rng=np.random.default_rng(SEED), optimise=optimise, progress=_show_progress)
    advice = replace(advice, notices=(*notices, *advice.notices))
    write_advice(advice, out)
    typer.echo(dump(design_document(advice)) if json else _words(advice, out), nl=not json)


def read_payload(
    origin: Path | None,
    target: Target,
    damping_spread: float | None,
    length_mm: float | None,
    shape: SpreadShape = SpreadShape.NORMAL,
) -> tuple["PayloadSpread", list[Notice]]:
    """Return the payloads that options and measurements speak of.

    Raises
    ------
    NotIdentifiableError
        Without a spread: one measurement does not know how the next will differ.
    """
    from tagsway.design import PayloadSpread

    if target.spread is None:
        raise NotIdentifiableError(
            f"{target.source} does not tell how the payload varies between repeats, and without that nothing can be "
            "said of 95 % of them: give --frequency-spread PERCENT, or --from measurements.csv of two or more",
            code="single_measurement",
        )
    mode, length, radius, damping_std, notices = _measured(origin, target)
    if damping_spread is not None:
        if not damping_spread >= 0:
            raise InputError(f"--damping-spread is {damping_spread:g}: expected a ratio of 0 or more, such as 0.01")
        damping_std = damping_spread
    elif damping_std is None:
        damping_std = ASSUMED_DAMPING * mode.damping_ratio
        words = f"the damping's spread is not known: ±{100 * ASSUMED_DAMPING:g} % of it are assumed; state it"
        notices.append(Notice(code="damping_spread_assumed", message=f"{words} with --damping-spread"))
    if length_mm is not None:
        length, radius = length_mm / 1e3, length_mm / 1e3 if radius is None else radius
    if length is None:
        length = GRAVITY_M_S2 / mode.angular_frequency_rad_s**2
        words = f"a pendulum without a spring is assumed, {1e3 * length:.1f} mm long: state --length if it is stiffer"
        notices.append(Notice(code="length_assumed", message=words))
    payload = PayloadSpread(
        mode=mode,
        frequency_percent=target.spread.natural_frequency_std_percent,
        damping_low=max(mode.damping_ratio - damping_std, 0.0),
        damping_high=min(mode.damping_ratio + damping_std, 0.95),
        length_m=length,
        tag_radius_m=length if radius is None else radius,
        shape=shape.value,
        n=target.spread.n if shape is SpreadShape.NORMAL else None,
        source=target.spread.source,
    )
    return payload, notices


def _measured(
    origin: Path | None, target: Target
) -> tuple[Mode, float | None, float | None, float | None, list[Notice]]:
    """Return the small-swing mode, length, radius and the damping's standard deviation, as far as they are known."""
    first = target.modes[0]
    mode = Mode(natural_frequency_hz=first.frequency_hz, damping_ratio=first.damping_ratio)
    if origin is None:
        return mode, None, None, None, []
    if origin.suffix.lower() == ".csv":
        import numpy as np

        from tagsway.store.measurements import read_measurements

        ratios = read_measurements(origin).damping_ratio
        return mode, None, None, float(np.std(ratios, ddof=1)) if len(ratios) > 1 else None, []
    from tagsway.store.documents import read_result

    result = read_result(origin)
    modal, pendulum = result.modal, result.pendulum
    if modal is not None and modal.natural_frequency_hz is not None and modal.damping_ratio is not None:
        mode = Mode(
            natural_frequency_hz=modal.natural_frequency_hz.value,
            damping_ratio=min(max(modal.damping_ratio.value, 0.0), 0.9),
        )
    radius = None if pendulum is None or pendulum.tag_radius_m is None else pendulum.tag_radius_m.value
    if pendulum is None or pendulum.length_m is None or not pendulum.determined:
        return mode, None, radius, None, []
    # A spring cannot be negative: where the fit's errors make it so, the free pendulum's length is the nearest.
    length = max(pendulum.length_m.value, GRAVITY_M_S2 / mode.angular_frequency_rad_s**2)
    return mode, length, radius, None, []


def _show_progress(done: int, total: int) -> None:
    if sys.stderr.isatty():
        typer.echo(f"\rcandidate {done} of {total}", err=True, nl=done == total)


def _point(text: str) -> tuple[float, float, float]:
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--place is {text!r}: expected X,Y,Z in m, such as 0.35,0.05,-0.767") from None
    return x, y, z


def _words(advice: "Advice", out: Path) -> str:
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
            f"it, kept for {100 * found.verdict.share_kept:.1f} %; beyond the spread it fails sooner: see design.png"
        )
    lines += [f"warning: {notice.message}" for notice in advice.notices]
    return "\n".join([*lines, f"written to {out}"])


def _gives_up(later_s: float, broken: str | None) -> str:
    return f"{1e3 * later_s:.0f} ms" if broken is None else f"breaks {broken}"
