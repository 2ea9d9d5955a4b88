"""`identify compare`: conditions beside each other."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tagsway.cli.batch import display_set, usable_cores
from tagsway.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tagsway.model import Comparison
    from tagsway.sets.comparing import Gathered
    from tagsway.sets.comparison import Wish
    from tagsway.sets.conditions import Condition

MOST_NAMED = 20
"""Failed files that are named on standard error; all of them are in comparison.csv."""


Words = Annotated[
    list[str],
    typer.Argument(
        help="NAME=FILES for each condition, the reference first: videos, tracks, results, sets, or patterns of them. "
        "Or one set, with --by.",
        metavar="NAME=FILES...",
    ),
]
Within = Annotated[
    str | None, typer.Option(help="A factor whose levels are compared each for itself, as the acceleration.")
]
Reference = Annotated[
    str | None, typer.Option(help="The condition that the others are compared with.", show_default="the first")
]
Designs = Annotated[
    list[str] | None,
    typer.Option(
        help="What was promised: design.json or simulation.json, or its folder; CONDITION=PATH says of which.",
        metavar="PATH",
    ),
]
Up = Annotated[str | None, typer.Option(help="Where up is: image, reference, or degrees.", show_default="image")]
SwayAxis = Annotated[str | None, typer.Option(help="Axis of the sway: x, z, or degrees.", show_default="found")]

STATED = (
    *("fps", "family", "tcp_id", "pcp_id", "reference_id", "tag_size", "tcp_tag_size", "pcp_tag_size", "camera", "up"),
    *("sway_axis", "columns", "picks"),
)
"""Options of `identify`, for the files of which their set says nothing else."""


def compare(
    context: typer.Context,
    words: Words,
    by: Annotated[str | None, typer.Option(help="Of one set: the factor whose levels are compared.")] = None,
    within: Within = None,
    reference: Reference = None,
    design: Designs = None,
    other_time: Annotated[float, typer.Option(help="Of a pick beside this move, in s: for the picks a minute.")] = 0.0,
    out: Annotated[str | None, typer.Option(help="Folder for the results.", show_default="NAMES-compare")] = None,
    fps: Annotated[float | None, typer.Option(help="Capture rate in Hz, where the files' headers are wrong.")] = None,
    family: Annotated[str | None, typer.Option(help="Family of the tags.", show_default="tag36h11")] = None,
    tcp_id: Annotated[int | None, typer.Option(help="Tag on the tool.", show_default="0")] = None,
    pcp_id: Annotated[int | None, typer.Option(help="Tag on the product.", show_default="1")] = None,
    reference_id: Annotated[int | None, typer.Option(help="A tag fixed to the machine.")] = None,
    tag_size: Annotated[float | None, typer.Option(help="Side of the black square in mm, both tags.")] = None,
    tcp_tag_size: Annotated[float | None, typer.Option(help="The same for the tool's tag alone.")] = None,
    pcp_tag_size: Annotated[float | None, typer.Option(help="The same for the product's tag alone.")] = None,
    camera: Annotated[Path | None, typer.Option(help="camera.json of a known lens.")] = None,
    up: Up = None,
    sway_axis: SwayAxis = None,
    columns: Annotated[str | None, typer.Option(help="Columns of tracks: T,X[,Z].")] = None,
    picks: Annotated[bool, typer.Option("--picks", help="Each move in a file is a measurement.")] = False,
    workers: Annotated[int | None, typer.Option(help="Processes, each on one core.", show_default="the cores")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print comparison.json instead of the tables.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Compare conditions, as unshaped and shaped: indicators, their differences and how sure they are, picks gained."""
    from tagsway.sets.comparison import Wish
    from tagsway.sets.conditions import read_conditions

    if workers is not None and not workers >= 1:
        raise InputError(f"--workers is {workers}: expected 1 or more")
    if not 0 <= other_time < 3600:
        raise InputError(f"--other-time is {other_time:g}: expected seconds of a pick beside the move, 0 or more")
    conditions = read_conditions(words)
    wish = Wish(by=_factor(conditions, by), within=within, reference=reference, other_time_s=other_time)
    if reference is not None and wish.by is None and reference not in {each.name for each in conditions}:
        raise InputError(f"--reference is {reference!r}: expected one of {', '.join(str(c.name) for c in conditions)}")
    title, folder = _names(conditions, wish.by, out)
    crew = workers or usable_cores()
    found, comparison = _compare(
        conditions, wish, design or [], _stated(context.params), folder, title=title, workers=crew, shown=not quiet
    )
    _report(found, comparison, folder, as_json=json, quiet=quiet)


def _compare(
    conditions: "Sequence[Condition]",
    wish: "Wish",
    design: "Sequence[str]",
    stated: dict[str, Any],
    folder: Path,
    *,
    title: str,
    workers: int,
    shown: bool,
) -> "tuple[Gathered, Comparison]":
    """Measure what is missing, compare, and write the folder."""
    from dataclasses import replace

    from tagsway.files import check_writable
    from tagsway.sets.batch import hire
    from tagsway.sets.comparing import gather
    from tagsway.sets.comparison import compare as compare_rows
    from tagsway.sets.comparison import sort_rows
    from tagsway.sets.comparison_output import check_comparison_outputs, leaving_nothing, write_comparison
    from tagsway.sets.conditions import check_factor, find_sources
    from tagsway.sets.promises import judge_promises, read_promises

    promised = read_promises(design)
    check_writable(folder)
    sources = find_sources(conditions, stated, leave_out=folder)
    check_factor(sources, wish.by, option="--by", least=2)
    check_factor(sources, wish.within, option="--within")
    read = [*(Path(item.path) for _, item in sources.items), *(path for _, path in sources.results)]
    check_comparison_outputs(folder, read)
    with leaving_nothing(folder):
        with display_set(title, shown=shown) as (begin, report):
            kept = _kept_in(conditions, folder)
            found = gather(sources, kept, lambda: hire(workers, None), begin=begin, report=report)
        rows = sort_rows(found.table, wish, named=[condition.name or "" for condition in conditions])
        comparison = compare_rows(rows, wish)
        promises, unsure = judge_promises(promised, rows, within=wish.within)
        told = (*found.notices, *comparison.warnings, *unsure)
        comparison = replace(comparison, promises=promises, warnings=told)
        write_comparison(comparison, rows, found.moves, folder, title=title)
    return found, comparison


def _report(found: "Gathered", comparison: "Comparison", folder: Path, *, as_json: bool, quiet: bool) -> None:
    from tagsway.report.comparison_words import summary_lines
    from tagsway.store.comparisons import comparison_document
    from tagsway.store.documents import dump

    if as_json:
        typer.echo(dump(comparison_document(comparison)), nl=False)
    elif not quiet:
        typer.echo("\n".join(summary_lines(comparison)))
        typer.echo(f"\nwritten to {folder}/ — open {folder / 'report.html'}")
    if not quiet:
        for notice in comparison.warnings:
            typer.echo(f"note: {notice.message}", err=True)
    _name_failed(found, folder)


def _factor(conditions: "Sequence[Condition]", by: str | None) -> str | None:
    """Return the factor that makes the conditions; None where they are named."""
    if conditions[0].name is None:
        return by or "subset"
    if by is not None:
        raise InputError(f"--by {by} takes the conditions from one set, and they are named: leave one of both out")
    return None


def _names(conditions: "Sequence[Condition]", by: str | None, out: str | None) -> tuple[str, Path]:
    """Return the title and the folder of a comparison."""
    from tagsway.sets.manifest import as_text

    if out is not None and not out.strip():
        raise InputError("--out is empty: expected a folder for the results")
    names = [condition.name for condition in conditions if condition.name is not None]
    if names:
        title, stem = f"{', '.join(names[1:])} against {names[0]}", "-".join(names)
    else:
        stem = Path(conditions[0].paths[0]).resolve().stem.removesuffix("-identify")
        title = as_text(f"{stem} by {by}")
    plain = "".join(sign if sign.isalnum() or sign in "-_." else "-" for sign in stem)[:80].strip("-.") or "conditions"
    return title, Path(f"{plain}-compare") if out is None else Path(out)


def _kept_in(conditions: "Sequence[Condition]", folder: Path) -> Path:
    """Return where measurements are kept: where `identify batch` keeps those of the same set, else in our folder."""
    from tagsway.sets.conditions import is_measured_set

    if conditions[0].name is None:
        batch = Path(f"{Path(conditions[0].paths[0]).resolve().stem}-identify")
        if is_measured_set(batch):
            return batch
    return folder


def _stated(options: "Mapping[str, Any]") -> dict[str, Any]:
    """Return the options of `identify` that were given."""
    found = {name: options[name] for name in STATED if options[name] is not None and options[name] is not False}
    return {name: str(value.resolve()) if isinstance(value, Path) else value for name, value in found.items()}


def _name_failed(found: "Gathered", folder: Path) -> None:
    table = found.table
    failed = table[(table["error"] != "") & table["trajectory_time_s"].isna()]
    for file, reason in list(zip(failed["file"], failed["error"], strict=True))[:MOST_NAMED]:
        typer.echo(f"failed: {reason if str(file) in reason else f'{file}: {reason}'}", err=True)
    if len(failed) > MOST_NAMED:
        typer.echo(f"failed: {len(failed) - MOST_NAMED} more, see {folder / 'comparison.csv'}", err=True)
