"""One file of a set, what becomes of it, and where that is kept. Light: the main process waits for nothing else."""

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from tagsway import __version__
from tagsway.model import Settings
from tagsway.sets.manifest import Item
from tagsway.store.documents import to_document

FILE = "{file}"
"""Stands for the file's name in a kept error: the same content may lie under another name."""


ROWS = 2
"""Counts what a row holds: one that holds less is measured again, from the kept steps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A file to be measured.

    Parameters
    ----------
    item : Item
        The file, and what is said of it.
    settings_digest : str
        Of everything but the file's content that its measurement depends on.
    out : str
        The folder of the results; used where it is seen from the worker.
    pages : bool
        Each of its measurements has a page of its own.
    """

    item: Item
    settings_digest: str
    out: str
    pages: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What became of a job.

    Parameters
    ----------
    key : str or None
        Of the file's content and its settings; None where the file could not be read.
    sha256 : str or None
        Of the file's content.
    lines : tuple of str
        The JSON documents to be kept under the key: the rows first. Empty where it was kept before, and where the
        content does not tell the outcome.
    pages : tuple of (str, str)
        Ending of the name, and the HTML of each measurement's own page.
    error : str or None
        Why there is nothing to keep.
    frames : int
        That were measured.
    failed : bool
        Whether some row has no number.
    version : str
        Of the program that measured.
    seconds, cpu_seconds : float
        That it took.
    worker : str
        Machine and process.
    trace : str
        Where an error came from that is no fault of the file's.
    """

    key: str | None = None
    sha256: str | None = None
    lines: tuple[str, ...] = ()
    pages: tuple[tuple[str, str], ...] = ()
    error: str | None = None
    frames: int = 0
    failed: bool = False
    version: str = __version__
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    worker: str = ""
    trace: str = ""


def measure(job: Job) -> Outcome:
    """Measure one file of a set, in the process that it is called in; see `measure_file`."""
    from tagsway.sets.measuring import measure_file  # takes seconds to load, in the workers alone

    return measure_file(job)


def settings_digest(item: Item, files: Mapping[str, str]) -> str:
    """Return a digest of an item's settings, with the content of the files that they name.

    Parameters
    ----------
    item : Item
        Of the set.
    files : mapping
        The SHA-256 of every file that settings name.
    """
    settings = to_document(item.settings)
    for name in named_files(item.settings):
        settings = {key: files[name] if value == name else value for key, value in settings.items()}
    text = json.dumps([__version__, ROWS, settings, item.picks], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def named_files(settings: Settings) -> tuple[str, ...]:
    """Return the files that settings name."""
    return tuple(name for name in (settings.camera, settings.other, settings.log) if name is not None)


def result_key(sha256: str, digest: str) -> str:
    """Return the key under which a result is kept: of the file's content and its settings."""
    return hashlib.sha256(f"{sha256} {digest}".encode()).hexdigest()[:40]


def result_path(out: Path, key: str) -> Path:
    """Return where a result is kept: spread over folders, as a set may be large."""
    return out / f"results/{key[:2]}/{key}.jsonl"


def has_result(out: Path, key: str) -> bool:
    """Tell whether a result is kept, and ends as it was written: a disk that lost its power may hold less."""
    try:
        with result_path(out, key).open("rb") as file:
            begins = file.read(1) == b"{"
            file.seek(-1, os.SEEK_END)
            return begins and file.read(1) == b"\n"
    except OSError:
        return False


def page_path(out: Path, key: str, ending: str) -> Path:
    """Return where the page of a measurement is kept: `ending` tells the picks of one file apart."""
    return out / "pages" / key[:2] / f"{key}{ending}.html"


def page_ending(pick: int | None) -> str:
    """Return what tells the page of a pick from those of the others."""
    return "" if pick is None else f"-{pick}"
