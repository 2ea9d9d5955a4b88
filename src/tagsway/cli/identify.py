"""`identify VIDEO_OR_TRACK`: the main job."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tagsway.cli.progress import progress_bar
from tagsway.errors import InputError, NotIdentifiableError
from tagsway.model import Move, Settings, Window

if TYPE_CHECKING:
    from tagsway.pipeline import Measurement


def run(
    file: Annotated[
        Path,
        typer.Argument(help="A video, numbered images (frames/%06d.png), or a track as CSV.", metavar="VIDEO_OR_TRACK"),
    ],
    out: Annotated[str | None, typer.Option(help="Folder for the results.", show_default="NAME-identify")] = None,
    fps: Annotated[float | None, typer.Option(help="Capture rate in Hz, where the file's header is wrong.")] = None,
    family: Annotated[str, typer.Option(help="Family of the tags.")] = "tag36h11",
    tcp_id: Annotated[int, typer.Option(help="Tag on the tool.")] = 0,
    pcp_id: Annotated[int, typer.Option(help="Tag on the product.")] = 1,
    reference_id: Annotated[
        int | None, typer.Option(help="A tag fixed to the machine: takes off the camera's shake.")
    ] = None,
    tag_size: Annotated[float | None, typer.Option(help="Side of the black square in mm, both tags.")] = None,
    tcp_tag_size: Annotated[float | None, typer.Option(help="The same for the tool's tag alone.")] = None,
    pcp_tag_size: Annotated[float | None, typer.Option(help="The same for the product's tag alone.")] = None,
    camera: Annotated[Path | None, typer.Option(help="camera.json of a known lens.")] = None,
    up: Annotated[str, typer.Option(help="Where up is: image, reference, or degrees.")] = "image",
    mass: Annotated[float | None, typer.Option(help="The product's mass in g: gives k and b.")] = None,
    point_mass: Annotated[
        bool, typer.Option("--point-mass", help="State that the product is a point at its tag: a decay then tells k.")
    ] = False,
    length: Annotated[float | None, typer.Option(help="State the equivalent length in mm, measured by hand.")] = None,
    nonnegative_stiffness: Annotated[
        bool, typer.Option("--nonnegative-stiffness", help="State that k ≥ 0: the gripper pushes back, if at all.")
    ] = False,
    other: Annotated[
        Path | None, typer.Option("--with", help="result.json of another mass at the same arm.", metavar="RESULT")
    ] = None,
    sway_axis: Annotated[
        str | None, typer.Option(help="Axis of the sway: x, z, or degrees.", show_default="found")
    ] = None,
    window: Annotated[str | None, typer.Option(help="Free vibration in s, START:END.", show_default="found")] = None,
    frequency_spread: Annotated[
        float | None, typer.Option(help="Standard deviation of f_n between repeats, in percent.")
    ] = None,
    columns: Annotated[str | None, typer.Option(help="Columns of a track: T,X[,Z].")] = None,
    shaper: Annotated[str, typer.Option(help="Type of the input shaper.")] = "zv",
    move: Annotated[Path | None, typer.Option(help="move.toml: writes the shaped trajectory.")] = None,
    overlay: Annotated[
        bool, typer.Option("--overlay", help="Write overlay.mp4: the video with what was seen in it.")
    ] = False,
    log: Annotated[Path | None, typer.Option(help="The controller's log: its tool moves the pivot.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print result.json instead of the summary.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Identify a payload's sway, and design the shaper that leaves it at rest."""
    settings = Settings(
        fps_hz=fps,
        family=family,
        tcp_id=tcp_id,
        pcp_id=pcp_id,
        reference_id=reference_id,
        tcp_tag_size_m=_metres(tag_size if tcp_tag_size is None else tcp_tag_size),
        pcp_tag_size_m=_metres(tag_size if pcp_tag_size is None else pcp_tag_size),
        camera=None if camera is None else str(camera),
        up=up,
        mass_kg=_metres(mass),
        point_mass=point_mass,
        length_m=_metres(length),
        nonnegative_stiffness=nonnegative_stiffness,
        other=None if other is None else str(other),
        sway_axis=sway_axis,
        window=None if window is None else _window(window),
        frequency_spread_percent=frequency_spread,
        columns=None if columns is None else tuple(part.strip() for part in columns.split(",")),
        shaper=shaper,
        log=None if log is None else str(log),
    )
    if out is not None and not out.strip():
        raise InputError("--out is empty: expected a folder for the results")
    folder = _default_folder(file) if out is None else Path(out)
    measurement = _measure(file, settings, move, folder, overlay=overlay, show_progress=not quiet)
    _report(measurement, folder, move, as_json=json, quiet=quiet)


def _measure(
    file: Path, settings: Settings, move_file: Path | None, folder: Path, *, overlay: bool, show_progress: bool
) -> "Measurement":
    from tagsway.files import check_writable
    from tagsway.pipeline import TABLES, check_outputs, identify, write_measurement
    from tagsway.store.moves import read_move
    from tagsway.store.steps import StepStore

    if overlay and file.suffix.lower() in TABLES:
        raise InputError(f"--overlay draws into a video, and {file} is a table: leave it out, or give the video")
    check_writable(folder)
    check_outputs(folder, file, move_file, None if settings.camera is None else Path(settings.camera))
    move: Move | None = None if move_file is None else read_move(move_file)
    steps = StepStore(folder=folder / ".steps")
    with progress_bar(file.name, shown=show_progress) as progress:
        measurement = identify(file, settings, move=move, steps=steps, progress=progress)
    with progress_bar("overlay.mp4", shown=show_progress and overlay) as progress:
        write_measurement(measurement, folder, film=file if overlay else None, progress=progress)
    steps.keep()
    return measurement


def _report(measurement: "Measurement", folder: Path, move: Path | None, *, as_json: bool, quiet: bool) -> None:
    from tagsway.cli.shape import describe_samples
    from tagsway.report.words import summary_lines
    from tagsway.store.documents import dump, result_document

    if as_json:
        typer.echo(dump(result_document(measurement.result)), nl=False)
    elif not quiet:
        typer.echo("\n".join(summary_lines(measurement.result)))
        opened = "report.html" if measurement.has_page else "result.json"
        typer.echo(f"\nwritten to {folder}/ — open {folder / opened}")
        if measurement.planned is not None:
            typer.echo(describe_samples(measurement.planned, folder / "trajectory.csv"))
            shaper = folder / "shaper.json"
            typer.echo(
                f"what that leaves: identify simulate --from {folder / 'result.json'} --move {move} --shaper {shaper}"
            )
    if measurement.not_determined is not None:
        raise NotIdentifiableError(measurement.not_determined)


def _default_folder(file: Path) -> Path:
    from tagsway.video.opening import name_results

    return Path(f"{name_results(file)}-identify")


def _metres(millimetres: float | None) -> float | None:
    """Return a thousandth: mm in m, g in kg."""
    return None if millimetres is None else millimetres / 1000


def _window(text: str) -> Window:
    try:
        start, end = (float(part) for part in text.split(":"))
    except ValueError:
        raise InputError(f"--window is {text!r}: expected START:END in seconds, such as 1.3:4") from None
    return Window(start_s=start, end_s=end)
