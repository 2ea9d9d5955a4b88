"""From a measurement to the files of its folder."""

from pathlib import Path

from tagsway.errors import InputError
from tagsway.files import staging_folder, write_text
from tagsway.indicators import find_last_move
from tagsway.model import Progress, Window
from tagsway.pipeline.assembling import Measurement
from tagsway.report.page import render_page
from tagsway.report.style import FIGURES
from tagsway.store.documents import RESULT_SCHEMA, dump, read_json, write_result, write_shaper
from tagsway.store.packing import write_curves
from tagsway.store.tracks import write_track

RESULT = "result.json"
OVERLAY = "overlay.mp4"
OUTPUTS = (
    "track.csv",
    "curves.npz",
    "shaper.json",
    "trajectory.csv",
    "trajectory.json",
    "report.html",
    OVERLAY,
    *(f"figures/{name}.png" for name in FIGURES),
    RESULT,
)
"""Every file that a measurement may have, in the order in which they take their places; the result comes last."""


def write_measurement(
    measurement: Measurement, folder: Path, *, film: Path | None = None, progress: Progress | None = None
) -> None:
    """Write everything that a measurement has into a folder: all of it, or nothing.

    Parameters
    ----------
    measurement : Measurement
        Where it is not determined, only result.json and track.csv are written; the page, too, where something happened
        to the grip.
    folder : Path
        Made where it is missing. What an earlier measurement left there and this one does not have is removed, so that
        no file in it belongs to another result; what is not a measurement's is left alone.
    film : Path, optional
        The video that was measured: then what was seen is drawn into it, as overlay.mp4, determined or not.
        A table has none.
    progress : callable, optional
        Called with (frames done, frames in all) while that is drawn.
    """
    fresh = not folder.exists()
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with staging_folder(folder) as staging:
            _write_all(measurement, staging)
            if film is not None and measurement.sightings is not None:
                from tagsway.report.overlay import write_overlay  # matplotlib, which a set's workers need not load

                write_overlay(
                    staging / OVERLAY,
                    film,
                    result=measurement.result,
                    sightings=measurement.sightings,
                    track=measurement.track,
                    move=_find_move(measurement),
                    progress=progress,
                )
            _take_places(staging, folder)
    finally:
        if fresh and not any(folder.iterdir()):
            folder.rmdir()


def check_outputs(folder: Path, *inputs: Path | None) -> None:
    """Raise an InputError where a measurement would write over one of its inputs, or where a folder is in its way."""
    for name in OUTPUTS:
        target = folder / name
        if target.is_dir():
            raise InputError(f"--out {folder}: {target} is a folder, where a file is to be; give another folder")
        for file in inputs:
            if file is not None and target.exists() and file.exists() and target.samefile(file):
                raise InputError(f"--out {folder} would write over the input {file}; give another folder")


def _write_all(measurement: Measurement, folder: Path) -> None:
    result = measurement.result
    write_track(folder / "track.csv", measurement.track, measurement.clean)
    if measurement.not_determined is None:
        write_curves(folder / "curves.npz", measurement.curves)
        if result.shaper is not None:
            write_shaper(folder / "shaper.json", result.shaper)
        if measurement.planned is not None:
            text, description = measurement.planned.files()
            write_text(folder / "trajectory.csv", text)
            write_text(folder / "trajectory.json", dump(description))
    if measurement.has_page:
        from tagsway.report.figures import write_figures

        write_figures(result, measurement.curves, folder / "figures")
        write_text(folder / "report.html", render_page(result, measurement.curves, title=result.source.file))
    write_result(folder / RESULT, result)


def _take_places(staging: Path, folder: Path) -> None:
    """Move what was written to where it belongs; what only an earlier measurement had is removed."""
    earlier = _holds_a_measurement(folder)
    for name in OUTPUTS:
        if (staging / name).exists():
            (folder / name).parent.mkdir(exist_ok=True)
            (staging / name).replace(folder / name)
        elif earlier:
            (folder / name).unlink(missing_ok=True)


def _find_move(measurement: Measurement) -> Window | None:
    clean, window = measurement.clean, measurement.result.window
    if window is None or measurement.track.length_unit != "m":
        return None
    return find_last_move(clean, window)


def _holds_a_measurement(folder: Path) -> bool:
    try:
        read_json(folder / RESULT, RESULT_SCHEMA)
    except InputError:
        return False
    return True
