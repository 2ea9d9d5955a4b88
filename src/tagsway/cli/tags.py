"""`identify tags`: which tags a video shows, and sheets of tags to print."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tagsway.errors import InputError

if TYPE_CHECKING:
    from tagsway.pipeline.survey import ListedTag

STILL_SIDES = 0.2
"""A tag whose places differ by less, in sides of its square, is fixed to the machine; the tool's travels."""

MOST_TAGS = 1000


def tags(
    file: Annotated[
        Path | None, typer.Argument(help="A video whose tags are listed.", metavar="VIDEO", show_default=False)
    ] = None,
    sheet: Annotated[bool, typer.Option("--print", help="Write a sheet of tags to print, at their true size.")] = False,
    family: Annotated[str, typer.Option(help="For --print: the family.")] = "tag36h11",
    ids: Annotated[str, typer.Option(help="For --print: which tags, such as 0,1 or 0-5.")] = "0,1",
    size: Annotated[float, typer.Option(help="For --print: the side of the black square in mm.")] = 30.0,
    out: Annotated[Path, typer.Option(help="For --print: a .pdf, .svg or .png.")] = Path("tags.pdf"),
) -> None:
    """List the tags that a video shows, or print new ones."""
    if sheet == (file is not None):
        raise InputError("identify tags needs either a VIDEO, whose tags are listed, or --print, which makes new ones")
    if file is not None:
        _list(file)
        return
    from tagsway.files import check_writable
    from tagsway.report.sheet import write_tag_sheet

    wanted = _numbers(ids)
    check_writable(out.parent)
    if out.is_dir():
        raise InputError(f"--out {out} is a folder: expected a file that ends in .pdf, .svg or .png")
    pages = write_tag_sheet(out, family=family, tag_ids=wanted, size_m=size / 1000)
    many = "" if pages == 1 else f" on {pages} pages"
    typer.echo(f"{len(wanted)} tags of {size:g} mm written to {out}{many}: print at 100 %, then measure the ruler")


def _list(file: Path) -> None:
    from tagsway.pipeline.recording import check_file
    from tagsway.pipeline.survey import survey_tags

    check_file(file)
    seen = survey_tags(file)
    typer.echo(f"{'family':<17} {'id':>5}  {'seen in':>8}  {'side':>7}  place (x, y)")
    for tag in seen:
        place = f"{tag.centre_px[0]:.0f}, {tag.centre_px[1]:.0f} px"
        moves = f", moves over {tag.travel_px:.0f} px" if tag.travel_px > STILL_SIDES * tag.side_px else ", stands"
        line = f"{tag.family:<17} {tag.tag_id:>5}  {100 * tag.share:>6.0f} %  {tag.side_px:>4.0f} px  {place}{moves}"
        typer.echo(line)
    typer.echo(f"\n{_advise(file, seen)}")


def _advise(file: Path, seen: Sequence["ListedTag"]) -> str:
    """Return what to type next: of the family that is seen most, the upper one that moves is the tool's."""
    same = [tag for tag in seen if tag.family == seen[0].family]
    if len(same) < 2:
        return "one tag alone: a tool (TCP) and a product (PCP) tag of one family are needed, the tool at least at rest"
    moving = sorted(same, key=lambda tag: -tag.travel_px / tag.side_px)
    tool, product = sorted(moving[:2], key=lambda tag: tag.centre_px[1])
    others = [tag for tag in moving[2:] if tag.travel_px <= STILL_SIDES * tag.side_px]
    reference = f" --reference-id {others[-1].tag_id}" if others else ""
    return (
        f"next, if the upper one is the tool's: identify {file} --family {tool.family} --tcp-id {tool.tag_id} "
        f"--pcp-id {product.tag_id}{reference} --tag-size MM"
    )


def _numbers(text: str) -> list[int]:
    """Return the ids of a list such as 0,1 or 0-5."""
    numbers: list[int] = []
    try:
        for part in text.split(","):
            first, _, last = part.strip().partition("-")
            numbers.extend(range(int(first), min(int(last or first), int(first) + MOST_TAGS) + 1))
    except ValueError:
        numbers = []
    if not numbers or len(numbers) > MOST_TAGS:
        raise InputError(f"--ids is {text!r}: expected numbers such as 0,1 or 0-5, at most {MOST_TAGS}")
    return numbers
