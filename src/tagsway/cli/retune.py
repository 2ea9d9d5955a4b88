"""`identify retune`: a second video corrects the shaper that was used in it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tagsway.errors import InputError

if TYPE_CHECKING:
    from tagsway.design import Retuned

SEED = 0


def retune(
    result: Annotated[
        Path,
        typer.Argument(help="result.json of a video of the shaped move; track.csv lies beside it.", metavar="RESULT"),
    ],
    shaper: Annotated[Path, typer.Option(help="shaper.json that was used in it.")],
    move: Annotated[
        Path | None, typer.Option(help="move.toml that was run: the pivot's motion is then exact, not measured.")
    ] = None,
    length: Annotated[
        float | None, typer.Option(help="Equivalent length of the payload in mm.", show_default="measured, or g/ω²")
    ] = None,
    frequency_spread: Annotated[
        float | None, typer.Option(help="Standard deviation of f_n between repeats, in percent.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Where to write the corrected shaper.json.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON instead of words.")] = False,
) -> None:
    """Correct a shaper's frequency and damping by the residual that a second video shows."""
    from tagsway.files import check_writable
    from tagsway.pipeline.retuning import retune_from_files
    from tagsway.store.designs import retune_document
    from tagsway.store.documents import dump, write_shaper

    if length is not None and not length > 0:
        raise InputError(f"--length is {length:g}: expected the payload's equivalent length in mm, > 0")
    if out is not None:
        check_writable(out.parent)
    found = retune_from_files(
        result, shaper, move=move, length_m=None if length is None else length / 1e3, spread_percent=frequency_spread,
        seed=SEED,
    )  # fmt: skip
    if out is not None:
        write_shaper(out, found.shaper)
    typer.echo(dump(retune_document(found)) if json else _words(found, shaper), nl=not json)


def _words(found: "Retuned", shaper: Path) -> str:
    frequency, damping, gain = found.natural_frequency_hz, found.damping_ratio, found.gain
    mode, residual = found.shaper.modes[0], found.residual_m
    return "\n".join(
        [
            f"residual {1e3 * residual.value:.2f} ± {1e3 * residual.std:.2f} mm, phase {found.phase_rad.value:.2f} rad "
            "at the move's end",
            f"natural frequency {frequency.value:.4f} ± {frequency.std:.4f} Hz, "
            f"damping ratio {damping.value:.4f} ± {damping.std:.4f}",
            f"{shaper} anew: {found.shaper.type} for {mode.frequency_hz:.4f} Hz, {mode.damping_ratio:.4f}",
            f"expected residual {1e3 * found.expected_m.value:.2f} ± {1e3 * found.expected_m.std:.2f} mm: "
            f"{100 * gain.value:.0f} ± {100 * gain.std:.0f} % of it go, for the same payload",
            *(f"warning: {notice.message}" for notice in found.notices),
        ]
    )
