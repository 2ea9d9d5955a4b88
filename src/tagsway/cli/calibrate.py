"""`identify calibrate FRAMES_OR_VIDEO`: a lens from a board."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tagsway.cli.progress import progress_bar

if TYPE_CHECKING:
    from tagsway.camera.calibration import Calibration


def calibrate(
    files: Annotated[
        list[Path], typer.Argument(help="A video of the board, or images of it.", metavar="FRAMES_OR_VIDEO...")
    ],
    columns: Annotated[int, typer.Option(help="Squares in a row; of an AprilGrid, tags.")],
    rows: Annotated[int, typer.Option(help="Squares in a column; of an AprilGrid, tags.")],
    square: Annotated[float, typer.Option(help="Side of a square in mm; of an AprilGrid, from tag to tag.")],
    marker: Annotated[float | None, typer.Option(help="Side of a marker's black square in mm.")] = None,
    pattern: Annotated[str, typer.Option(help="chessboard, charuco or aprilgrid.")] = "chessboard",
    family: Annotated[str, typer.Option(help="Family of the markers.")] = "tag36h11",
    out: Annotated[Path, typer.Option(help="Where to write the camera.")] = Path("camera.json"),
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Calibrate a camera from a video or images of a board: writes camera.json."""
    from tagsway.camera.boards import Board
    from tagsway.files import check_writable
    from tagsway.pipeline.calibration import calibrate_camera
    from tagsway.store.cameras import write_camera

    check_writable(out.parent)
    board = Board(
        pattern=pattern,  # type: ignore[arg-type]  # checked when it is made
        columns=columns,
        rows=rows,
        square_m=square / 1000,
        marker_m=None if marker is None else marker / 1000,
        family=family,
    )
    with progress_bar(files[0].name, shown=not quiet) as progress:
        calibration = calibrate_camera(files, board, progress=progress)
    write_camera(out, calibration.camera)
    if not quiet:
        typer.echo("\n".join(_lines(calibration)))
        typer.echo(f"\nwritten to {out} — use it: identify VIDEO --camera {out}")


def _lines(calibration: "Calibration") -> list[str]:
    """Return what a person wants to know of a calibration."""
    unit = dict.fromkeys(("fx", "fy", "cx", "cy"), " px")
    lines = [
        f"{calibration.boards} views of the board, {100 * calibration.coverage:.0f} % of the image covered",
        f"rms {calibration.rms_px:.3f} px",
    ]
    for name, estimate in calibration.parameters.items():
        digits = 2 if name in unit else 5
        lines.append(f"  {name}  {estimate.value:.{digits}f} ± {estimate.std:.{digits}f}{unit.get(name, '')}")
    return lines + [f"note: {notice.message}" for notice in calibration.notices]
