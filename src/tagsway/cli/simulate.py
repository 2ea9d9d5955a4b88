"""`identify simulate`: what the payload does under a move, and studies of many moves."""

from pathlib import Path
from typing import Annotated, Any

import typer

from tagsway.cli.options import AsJson, Box, MaxPcpAcceleration, MoveFile, Origin
from tagsway.cli.payloads import KnownPayload, PayloadWish, read_payload
from tagsway.cli.study_options import SCAN, Study, choose_study, read_limits, read_scan
from tagsway.cli.study_runs import Found, run_once, run_study
from tagsway.errors import InputError
from tagsway.model import DesignMode, Mode, Move, Shaper

SIMULATION_SCHEMA = "tagsway/simulation/1"

Damping = Annotated[
    float | None, typer.Option("--damping", "--damping-ratio", help="Damping ratio, with one of these two.")
]
TagRadius = Annotated[float | None, typer.Option(help="From the pivot to the product's tag, in mm.", show_default="l")]
SecondMode = Annotated[
    str | None, typer.Option(help="A second body driven by the first: HZ:RATIO.", show_default="the result's")
]
SecondGain = Annotated[
    float | None,
    typer.Option(help="Of the second body: 1 is a point on a string.", show_default="as the film tells, or 1"),
]
Samples = Annotated[
    int | None, typer.Option(help="Payloads over the spread, or within a result's errors.", show_default="21 or 1")
]
Accelerations = Annotated[
    str | None, typer.Option(help="FROM:TO:STEP in m/s², or A,B,C: for studies.", show_default=SCAN)
]
MaxOvershoot = Annotated[float | None, typer.Option(help="For limits: in percent of the reference.")]
Reference = Annotated[
    float | None, typer.Option(help="What the percentages refer to, in mm.", show_default="the travel")
]


def simulate(
    move: MoveFile,
    origin: Origin = None,
    length: Annotated[float | None, typer.Option(help="Equivalent length l in mm.")] = None,
    frequency: Annotated[float | None, typer.Option(help="Undamped natural frequency in Hz, instead of l.")] = None,
    damping: Damping = None,
    stiffness: Annotated[float | None, typer.Option(help="k/J in 1/s², with --length.", show_default="none")] = None,
    tag_radius: TagRadius = None,
    second_mode: SecondMode = None,
    second_gain: SecondGain = None,
    shaper: Annotated[str, typer.Option(help="shaper.json, a type such as zv, or none.")] = "zv",
    spread: Annotated[float | None, typer.Option(help="By how many percent f_n may be off, up and down.")] = None,
    samples: Samples = None,
    study: Annotated[Study | None, typer.Option(help="Vary f_n, the acceleration, or find the fastest move.")] = None,
    accelerations: Accelerations = None,
    max_pcp_acceleration: MaxPcpAcceleration = None,
    max_overshoot: MaxOvershoot = None,
    box: Box = None,
    reference: Reference = None,
    mass: Annotated[float | None, typer.Option(help="Of the product in g: adds the force at its tag.")] = None,
    seed: Annotated[int, typer.Option(help="Of samples within a result's errors.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder for JSON, CSV and figure.", show_default="nothing")] = None,
    as_json: AsJson = False,
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
    if mass is not None and chosen is not None:
        raise InputError("--mass gives the force in the motion of one move, and a study writes none: leave it out")
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
    reference_m, mass_kg = (None if value is None else value / 1e3 for value in (reference, mass))
    if chosen is None:
        found = run_once(wanted, known, designed, reference_m, mass_kg)
    else:
        scan = read_scan(SCAN if accelerations is None else accelerations)
        found = run_study(chosen, wanted, known, designed, scan, limits, reference_m)
    document = _document(known, wanted, designed, reference_m, found)
    if out is not None:
        _write(out, document, found)
    typer.echo(dump(document) if as_json else _words(known, designed, found, out), nl=False)


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
    from tagsway.cli.study_tables import limits_csv, pairs_csv, rows_csv
    from tagsway.files import write_text
    from tagsway.report.studies import write_study_figure
    from tagsway.store.documents import dump

    write_text(out / "simulation.json", dump(document))
    tables = [("rows.csv", rows_csv(found.rows)), *found.motions]
    if found.limits:
        tables.append(("limits.csv", limits_csv(found.limits)))
    if found.pairs is not None:
        tables.append(("pairs.csv", pairs_csv(found.pairs)))
    for name, text in tables:
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
