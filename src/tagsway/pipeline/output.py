"""From a measurement to the files of its folder."""

from pathlib import Path

from tagsway.pipeline.measurement import Measurement
from tagsway.report.figures import write_figures
from tagsway.report.page import render_page
from tagsway.store.atomic import write_text
from tagsway.store.documents import dump, write_result, write_shaper
from tagsway.store.packing import write_curves
from tagsway.store.tracks import track_csv


def write_measurement(measurement: Measurement, folder: Path) -> None:
    """Write everything that a measurement has into a folder, each file whole or not at all.

    Parameters
    ----------
    measurement : Measurement
        Where it is not determined, only result.json and track.csv are written.
    folder : Path
        Made where it is missing. What an earlier run left and this one does not have is removed, so that no file in it
        belongs to another result.
    """
    result = measurement.result
    kept = set()
    write_text(folder / "track.csv", track_csv(measurement.track, measurement.clean))
    if measurement.not_determined is None:
        write_curves(folder / "curves.npz", measurement.curves)
        kept |= {"curves.npz", "report.html"}
        if result.shaper is not None:
            write_shaper(folder / "shaper.json", result.shaper)
            kept.add("shaper.json")
        if measurement.planned is not None:
            text, description = measurement.planned.files()
            write_text(folder / "trajectory.csv", text)
            write_text(folder / "trajectory.json", dump(description))
            kept |= {"trajectory.csv", "trajectory.json"}
        figures = write_figures(result, measurement.curves, folder / "figures")
        page = render_page(result, measurement.curves, title=result.source.file)
        write_text(folder / "report.html", page)
        kept |= {f"figures/{figure.name}" for figure in figures}
    _remove_stale(folder, kept)
    write_result(folder / "result.json", result)


def _remove_stale(folder: Path, kept: set[str]) -> None:
    ours = ["curves.npz", "shaper.json", "trajectory.csv", "trajectory.json", "report.html"]
    ours += [f"figures/{path.name}" for path in folder.glob("figures/*.png")]
    for name in set(ours) - kept:
        (folder / name).unlink(missing_ok=True)
