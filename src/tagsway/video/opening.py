"""What a film is read from: a video file, numbered images, or a Photron camera's raw file."""

import re
from pathlib import Path

from tagsway.errors import InputError
from tagsway.video.photron import SUFFIXES, PhotronSource, find_pair
from tagsway.video.sequence import SequenceSource, find_sequence
from tagsway.video.source import Source


def open_source(path: Path | str) -> Source:
    """Return the film behind a name.

    Parameters
    ----------
    path : Path or str
        A video file; a pattern of images such as ``frames/%06d.png``, or the folder that holds them; a Photron
        camera's ``.mraw``, ``.cihx`` or ``.cih``.

    Returns
    -------
    Source
        Nothing but its header was read.

    Raises
    ------
    InputError
        Where there is nothing of the kind.
    """
    file = Path(path)
    if file.is_dir() or is_pattern(file):
        return SequenceSource(find_sequence(file))
    if not file.exists():
        raise InputError(f"{file} does not exist: expected a video file")
    if file.suffix.lower() in SUFFIXES:
        return PhotronSource(file)
    from tagsway.video.container import ContainerSource  # PyAV, which those who ask for a film's files do not need

    return ContainerSource(file)


def list_files(path: Path) -> tuple[Path, ...]:
    """Return every file that a film is read from, in a fixed order: those a digest must cover."""

    if path.is_dir() or is_pattern(path):
        return find_sequence(path).files()
    return find_pair(path) if path.suffix.lower() in SUFFIXES else (path,)


def is_pattern(path: Path) -> bool:
    """Tell whether a name stands for numbered images, and is not a file's own."""
    return bool(re.search(r"%0?\d*d", path.name)) and not path.exists()


def name_film(path: Path) -> str:
    """Return what to call the film in a heading: the file's name, with its folder's where it is a pattern.

    Bytes in it that are no text stand as \\xff: documents and pages hold text.
    """
    whole = path.resolve()
    name = f"{whole.parent.name}/{path.name}" if is_pattern(path) else whole.name or "images"
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


def name_results(path: Path) -> str:
    """Return what to call a film's results: the file's stem, or the name of the folder with the images."""
    if is_pattern(path):
        return path.resolve().parent.name or "images"
    return name_film(path) if path.is_dir() else path.stem
