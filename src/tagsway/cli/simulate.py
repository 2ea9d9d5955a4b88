"""`identify simulate`: what the payload does under a move, and studies of many moves."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tagsway.cli.payloads import KnownPayload, PayloadWish, read_payload
from tagsway.cli.study_options import SCAN, Study, choose_study, read_limits, read_scan
from tagsway.errors import InputError
from tagsway.model import DesignMode, LimitRow, Mode, Move, Notice, Pair, Shaper, StudyRow

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tagsway.simulation import SimulatedMotion
    from tagsway.studies import Limit, Shaping

SIMULATION_SCHEMA = "tagsway/simulation/1"
LARGE_SWING_DEG = 75.0
"""Above it the pendulum's parameters are not known from any film."""

LITTLE_PERCENT = 0.5
"""An unshaped overshoot below it makes the ratio of two overshoots a matter of chance."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What a run found: rows, what follows from them, how to draw them, and further files by name."""

    rows: Sequence[StudyRow]
    title: str
    draw: "Callable[[], Figure]"
    limits: Sequence[LimitRow] = ()
    pairs: Sequence[Pair] | None = None
    notices: Sequence[Notice] = ()
    motions: Sequence[tuple[str, str]] = ()


def simulate(
    move: Annotated[Path, typer.Option(help="move.toml.")],
    origin: Annotated[
        Path | None, typer.Option("--from", help="result.json of a measurement, or measurements.csv of many.")
    ] = None,
    length: Annotated[float | None, typer.Option(help="Equivalent length l in mm.")] = None,
    frequency: Annotated[float | None, typer.Option(help="Undamped natural frequency in Hz, instead of l.")] = None,
    damping: Annotated[
        float | None, typer.Option("--damping", "--damping-ratio", help="Damping ratio, with one of these two.")
    ] = None,
    stiffness: Annotated[float | None, typer.Option(help="k/J in 1/s², with --length.", show_default="none")] = None,
    tag_radius: Annotated[
        float | None, typer.Option(help="From the pivot to the product's tag, in mm.", show_default="l")
    ] = None,
    second_mode: Annotated[
        str | None, typer.Option(help="A second body driven by the first: HZ:RATIO.", show_default="the result's")
    ] = None,
    second_gain: Annotated[
        float | None,
        typer.Option(help="Of the second body: 1 is a point on a string.", show_default="as the film tells, or 1"),
    ] = None,
    shaper: Annotated[str, typer.Option(help="shaper.json, a type such as zv, or none.")] = "zv",
    spread: Annotated[float | None, typer.Option(help="By how many percent f_n may be off, up and down.")] = None,
    samples: Annotated[
        int | None, typer.Option(help="Payloads over the spread, or within a result's errors.", show_default="21 or 1")
    ] = None,
    study: Annotated[Study | None, typer.Option(help="Vary f_n, the acceleration, or find the fastest move.")] = None,
    accelerations: Annotated[
        str | None, typer.Option(help="A:B:STEP in m/s², or A,B,C: for studies.", show_default=SCAN)
    ] = None,
    max_pcp_acceleration: Annotated[
        float | None, typer.Option(help="For limits: most |x''| of the product in m/s², above which it peels off.")
    ] = None,
    max_overshoot: Annotated[float | None, typer.Option(help="For limits: in percent of the reference.")] = None,
    box: Annotated[
        float | None, typer.Option(help="For limits: room in mm on either side, below a rim of 50 mm.")
    ] = None,
    reference: Annotated[
        float | None, typer.Option(help="What the percentages refer to, in mm.", show_default="the travel")
    ] = None,
    mass: Annotated[float | None, typer.Option(help="Of the product in g: adds the force at its tag.")] = None,
    seed: Annotated[int, typer.Option(help="Of samples within a result's errors.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder for JSON, CSV and figure.", show_default="nothing")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")] = False,
) -> None:
    """Simulate the payload under a move, shaped and unshaped, or study many moves."""
    from tagsway.files import check_writable
    from tagsway.store.documents import dump
    from tagsway.store.moves import read_move

    if out is not None:
        check_writable(out)
    for name, value in (("--reference", reference), ("--mass", mass)):
        if value is not None and not 0 < value < 1e6:
            raise InputError(f"{name} is {value:g}: expected more than 0")
    limits = read_limits(max_pcp_acceleration, max_overshoot, box)
    chosen = choose_study(study, accelerations, bool(limits))
    wanted = read_move(move)
    known = read_payload(
        PayloadWish(
            origin=origin,
            length_mm=length,
            frequency_hz=frequency,
            damping_ratio=damping,
            tag_radius_mm=tag_radius,
            stiffness=stiffness,
            second=_second(second_mode),
            gain=second_gain,
            spread_percent=spread,
            samples=samples,
            seed=seed,
        )
    )
    designed = _shaper(shaper, known.mode, wanted)
    reference_m = None if reference is None else reference / 1e3
    if chosen is None:
        found = _run_once(wanted, known, designed, reference_m, None if mass is None else mass / 1e3)
    else:
        scan = read_scan(accelerations if accelerations is not None else SCAN)
        found = _run_study(chosen, wanted, known, designed, scan, limits, reference_m)
    document = _document(known, wanted, designed, reference_m, found)
    if out is not None:
        _write(out, document, found)
    typer.echo(dump(document) if as_json else _words(known, designed, found, out), nl=False)


def _run_once(
    move: Move, known: KnownPayload, shaper: Shaper | None, reference_m: float | None, mass_kg: float | None
) -> Found:
    """Simulate the move as it is and as it is shaped."""
    import numpy as np

    from tagsway.simulation import simulate_moves
    from tagsway.studies import UNSHAPED, Shaping, worst_rows

    shapings = [UNSHAPED]
    if shaper is not None and move.shaped_axes:
        shapings.append(Shaping(name=",".join(move.shaped_axes), shaper=shaper, axes=move.shaped_axes))
    fastest = [move.max_acceleration_m_s2]
    motions = [simulate_moves(shaping.plan(move, fastest[0]), known.payload) for shaping in shapings]
    criteria = {s.name: m.judge(reference_m=reference_m) for s, m in zip(shapings, motions, strict=True)}
    rows = worst_rows(criteria, shapings, fastest, known.payload)
    swing = max(float(np.degrees(np.abs(motion.sway.angle_rad).max())) for motion in motions)
    notices = [*known.notices, *_notices(rows), *_swing_notices(swing)]
    tables = [
        (f"motion-{s.name.replace(',', '')}.csv", _motion_csv(motion, known.nominal, mass_kg))
        for s, motion in zip(shapings, motions, strict=True)
    ]
    title = f"at {move.max_acceleration_m_s2:g} m/s², worst of {len(known.payload)}"
    draw = partial(_draw_motions, shapings, motions, known.nominal)
    return Found(rows=rows, title=title, draw=draw, notices=notices, motions=tables)


def _draw_motions(shapings: "Sequence[Shaping]", motions: "Sequence[SimulatedMotion]", nominal: int) -> "Figure":
    from tagsway.report.studies import MotionCurve, plot_motions

    return plot_motions(
        [
            MotionCurve(
                name=shaping.name,
                time_s=motion.time_s[:, 0],
                tool_m=motion.pivot_m[:, :, 0, 0],
                product_m=motion.pcp_m[:, :, 0],
                product_m_s2=motion.pcp_acceleration_m_s2[:, :, 0],
                nominal=nominal,
            )
            for shaping, motion in zip(shapings, motions, strict=True)
        ]
    )


def _draw_study(rows: Sequence[StudyRow], limits: Sequence[LimitRow] = ()) -> "Figure":
    from tagsway.report.studies import plot_study

    return plot_study(rows, limits)


def _run_study(
    study: Study,
    move: Move,
    known: KnownPayload,
    shaper: Shaper | None,
    scan: list[float],
    limits: "list[Limit]",
    reference_m: float | None,
) -> Found:
    from tagsway.studies import find_pairs, shapings_of, study_accelerations, study_deviations, study_limits

    shapings: tuple[Shaping, ...] = shapings_of(shaper)
    payload = known.payload
    worst = f"worst of {len(payload)}" if len(payload) > 1 else "one payload"
    if study is Study.DEVIATIONS:
        if len(payload) < 2:
            raise InputError(
                "--study deviations needs payloads that differ: give --spread PERCENT, or measurements.csv"
            )
        rows = study_deviations(move, payload, shapings, nominal=known.nominal, reference_m=reference_m)
        title = f"at {move.max_acceleration_m_s2:g} m/s², over the frequency"
        return Found(rows=rows, title=title, draw=partial(_draw_study, rows), notices=known.notices)
    if study is Study.ACCELERATIONS:
        rows = study_accelerations(move, scan, payload, shapings, reference_m=reference_m)
        pairs = find_pairs(rows)
        notices = [*known.notices, *_notices(rows)]
        title = f"over the acceleration, {worst}"
        return Found(rows=rows, title=title, draw=partial(_draw_study, rows), pairs=pairs, notices=notices)
    if not limits:
        raise InputError("--study limits needs one: give --max-pcp-acceleration, --max-overshoot or --box")
    found, rows = study_limits(move, scan, payload, shapings, limits, reference_m=reference_m)
    return Found(
        rows=rows,
        title=f"scanned from {scan[0]:g} to {scan[-1]:g} m/s², {worst}",
        draw=partial(_draw_study, rows, found),
        limits=found,
        notices=known.notices,
    )


def _second(text: str | None) -> Mode | None:
    if text is None:
        return None
    try:
        hertz, ratio = (float(part) for part in text.split(":"))
    except ValueError:
        raise InputError(f"--second-mode is {text!r}: expected HZ:RATIO, such as 7.5:0.02") from None
    return Mode(natural_frequency_hz=hertz, damping_ratio=ratio)


def _shaper(text: str, mode: Mode, move: Move) -> Shaper | None:
    from tagsway.shapers import design_shaper
    from tagsway.store.documents import read_shaper
    from tagsway.trajectories import plan_move

    if text == "none":
        return None
    if text.endswith(".json"):
        return read_shaper(Path(text))
    target = DesignMode(frequency_hz=mode.natural_frequency_hz, damping_ratio=mode.damping_ratio)
    return design_shaper(text, target, move_duration_s=plan_move(move).duration_s)


def _notices(rows: Sequence[StudyRow]) -> list[Notice]:
    plain = [row for row in rows if row.shaping == "unshaped" and row.overshoot_percent < LITTLE_PERCENT]
    shaped = any(row.shaping != "unshaped" for row in rows)
    found = []
    if plain and shaped:
        found.append(
            Notice(
                code="ratio_ill_conditioned",
                message=f"the unshaped move at {plain[0].max_acceleration_m_s2:g} m/s² overshoots by only "
                f"{plain[0].overshoot_percent:.2g} %: the ratio to it says little, look at the overshoots",
            )
        )
    if any(row.motion_time_s is None for row in rows):
        found.append(Notice(code="never_settles", message="some moves do not settle within 2 s after their end"))
    return found


def _swing_notices(swing_deg: float) -> list[Notice]:
    if swing_deg <= LARGE_SWING_DEG:
        return []
    words = f"the payload swings by {swing_deg:.0f}°: farther than any film shows it, a spring need not hold there"
    return [Notice(code="large_swing", message=words)]


def _motion_csv(motion: "SimulatedMotion", nominal: int, mass_kg: float | None) -> str:
    """Return the nominal payload's motion; where the acceleration jumps a time stands twice."""
    import numpy as np

    names = ["time_s"] + [f"{what}_{axis}_{unit}" for what, unit in _QUANTITIES for axis in "xz"]
    columns = [motion.time_s[:, :1], 1e3 * motion.pivot_m[:, :, 0, 0], 1e3 * motion.pcp_m[:, :, 0, nominal]]
    columns += [motion.pcp_velocity_m_s[:, :, 0, nominal], motion.pcp_acceleration_m_s2[:, :, 0, nominal]]
    if mass_kg is not None:
        names += ["pcp_force_x_n", "pcp_force_z_n"]
        columns.append(motion.pcp_force_n(mass_kg)[:, :, 0, nominal])
    names.append("angle_rad")
    columns.append(motion.sway.angle_rad[:, 0, nominal, None])
    rows = np.concatenate(columns, axis=1)
    return "\n".join([",".join(names), *(",".join(f"{value:.9g}" for value in row) for row in rows)]) + "\n"


_QUANTITIES = (("tcp", "mm"), ("pcp", "mm"), ("pcp_velocity", "m_s"), ("pcp_acceleration", "m_s2"))


def _document(
    known: KnownPayload, move: Move, shaper: Shaper | None, reference_m: float | None, found: Found
) -> dict[str, Any]:
    from tagsway import __version__
    from tagsway.store.documents import shaper_document, to_document

    pendulums, nominal = known.payload.pendulums, known.nominal
    return {
        "schema": SIMULATION_SCHEMA,
        "created_by": {"name": "tagsway", "version": __version__},
        "payload": {
            "source": known.source,
            "samples": len(known.payload),
            "natural_frequency_hz": known.mode.natural_frequency_hz,
            "damping_ratio": known.mode.damping_ratio,
            "length_mm": 1e3 * float(pendulums.length_m[nominal]),
            "tag_radius_mm": 1e3 * float(known.payload.tag_radius_m[nominal]),
            "stiffness_over_inertia_rad2_s2": float(pendulums.stiffness_over_inertia_rad2_s2[nominal]),
            "damping_over_inertia_rad_s": float(pendulums.damping_over_inertia_rad_s[nominal]),
        },
        "max_acceleration_m_s2": move.max_acceleration_m_s2,
        "reference_mm": None if reference_m is None else 1e3 * reference_m,
        "shaper": None if shaper is None else shaper_document(shaper),
        "rows": to_document(list(found.rows)),
        "limits": to_document(list(found.limits)),
        "pairs": None if found.pairs is None else to_document(list(found.pairs)),
        "warnings": to_document(list(found.notices)),
    }


def _write(out: Path, document: dict[str, Any], found: Found) -> None:
    from tagsway.cli.study_tables import rows_csv
    from tagsway.files import write_text
    from tagsway.report.studies import write_study_figure
    from tagsway.store.documents import dump

    write_text(out / "simulation.json", dump(document))
    write_text(out / "rows.csv", rows_csv(found.rows))
    for name, text in found.motions:
        write_text(out / name, text)
    write_study_figure(found.draw(), out / "figures" / "simulation.png")


def _words(known: KnownPayload, shaper: Shaper | None, found: Found, out: Path | None) -> str:
    from tagsway.cli.study_tables import limits_table, pairs_words, rows_table

    mode = known.mode
    lines = [f"payload: {known.source}\n"]
    if shaper is not None:
        lines.append(f"shaper: {shaper.type}, {1e3 * shaper.duration_s:.1f} ms, the payload has ")
        lines.append(f"{mode.natural_frequency_hz:.4f} Hz and a damping ratio of {mode.damping_ratio:.3g}\n")
    if found.limits:
        lines.append(limits_table(found.limits, title=found.title))
    else:
        lines.append(rows_table(found.rows, title=found.title))
    if found.pairs is not None:
        lines.append(pairs_words(found.pairs))
    lines += [f"warning: {notice.message}\n" for notice in found.notices]
    if out is not None:
        lines.append(f"written to {out}\n")
    return "".join(lines)
