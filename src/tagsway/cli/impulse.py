"""`identify impulse FILE...`: the robot's own first frequency from hammer blows."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tagsway.errors import InputError

if TYPE_CHECKING:
    from tagsway.model import ImpulseResult, ImpulseSpectra, Shaper


def impulse(
    files: Annotated[list[Path], typer.Argument(help="CSV of joint accelerations after blows.", metavar="FILE...")],
    origin: Annotated[Path | None, typer.Option("--from", help="result.json of the payload.")] = None,
    frequency: Annotated[float | None, typer.Option(help="The payload's natural frequency in Hz.")] = None,
    lowest: Annotated[float | None, typer.Option(help="Look for the first peak from here, in Hz.")] = None,
    highest: Annotated[float | None, typer.Option(help="Look for the first peak up to here, in Hz.")] = None,
    out: Annotated[str | None, typer.Option(help="Folder for the results.", show_default="NAME-impulse")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print impulse.json instead of the summary.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Find the robot's first frequency from hammer blows, and whether it is far from the payload's."""
    from tagsway.files import check_writable
    from tagsway.pipeline.impulse import identify_impulses
    from tagsway.store.documents import dump
    from tagsway.store.impulses import impulse_document

    if origin is not None and frequency is not None:
        raise InputError("--from and --frequency contradict each other: give one or the other")
    if out is not None and not out.strip():
        raise InputError("--out is empty: expected a folder for the results")
    folder = Path(f"{files[0].stem}-impulse" if out is None else out)
    check_writable(folder)
    shaper: Shaper | None = None
    if origin is not None:
        frequency, shaper = _payload(origin)
    result, spectra = identify_impulses(
        files, payload_hz=frequency, shaper=shaper, lowest_hz=lowest, highest_hz=highest
    )
    _write(result, spectra, folder)
    if json:
        typer.echo(dump(impulse_document(result)), nl=False)
    elif not quiet:
        typer.echo("\n".join(summary_lines(result)))
        typer.echo(f"\nwritten to {folder}/ — open {folder / 'figures' / 'impulse.png'}")


def summary_lines(result: "ImpulseResult") -> list[str]:
    """Return what a hammer test told, a line each."""
    peaks, payload = result.peaks, result.payload
    deviation = "" if peaks.deviation_percent is None else f" ± {peaks.deviation_percent:.2f} %"
    scatter = "" if peaks.std is None else f", s = {peaks.std:.3g} Hz"
    lines = [
        f"first frequency of the robot: {result.first_frequency_hz.value:.2f} Hz{deviation}, mean of {peaks.n} answers "
        f"(median {peaks.median:.2f} Hz{scatter})",
        f"resolution: {result.resolution_hz:.2g} Hz, zero-padded to {result.bin_hz:.2g} Hz",
    ]
    if result.natural_frequency_hz is not None:
        modal = result.natural_frequency_hz
        ratio = "" if result.damping_ratio is None else f", damping ratio {result.damping_ratio.median:.2g}"
        lines.append(f"by least squares: {modal.median:.2f} Hz (median of {modal.n}){ratio}")
    if payload is not None:
        verdict = "far enough" if payload.far_enough else "NOT far enough"
        lines.append(
            f"payload: {payload.payload_frequency_hz:.4g} Hz, a factor of {payload.ratio:.3g} below: {verdict} (the "
            f"arm's spring changes a command at that frequency by {payload.amplification_percent:.2g} %; up "
            "to 5 % is rigid)"
        )
        if payload.shaper_leaves_percent is not None:
            lines.append(
                f"the payload's shaper leaves {payload.shaper_leaves_percent:.0f} % of a vibration of the robot itself"
            )
    return lines + [f"warning: {notice.message}" for notice in result.warnings]


def _payload(origin: Path) -> tuple[float, "Shaper | None"]:
    from tagsway.store.documents import read_result

    result = read_result(origin)
    modal = result.modal
    if modal is None or modal.natural_frequency_hz is None:
        raise InputError(f"{origin} holds no natural frequency: its status is {result.status}")
    return modal.natural_frequency_hz.value, result.shaper


def _write(result: "ImpulseResult", spectra: "ImpulseSpectra", folder: Path) -> None:
    from tagsway.files import whole_file, write_text
    from tagsway.report.impulse import plot_impulse
    from tagsway.store.documents import dump
    from tagsway.store.impulses import impulse_csv, impulse_document

    with whole_file(folder / "figures" / "impulse.png") as temporary:
        plot_impulse(result, spectra).savefig(temporary, dpi=150)
    write_text(folder / "impulse.csv", impulse_csv(result))
    write_text(folder / "impulse.json", dump(impulse_document(result)))
