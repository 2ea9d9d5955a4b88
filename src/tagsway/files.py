"""Files: written whole or not at all; and TOML, which people write."""

import os
import re
import shutil
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import IO, Any

from tagsway.errors import InputError

UNFINISHED = ".tagsway-"
"""In the name of what is being written: what a killed run leaves is known by it, and taken away by the next."""

_LEFT = re.compile(rf"(\..+)?{re.escape(UNFINISHED)}[a-z0-9_]{{8}}(\..+)?")  # as tempfile makes them
_HELD = ".held"
_YOUNG_S = 60.0  # between its making and its being held


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a temporary name beside `path`; take its place when the block ends well, leave no trace when it does not.

    Parameters
    ----------
    path : Path
        The file to write; its folder is made where it is missing.

    Yields
    ------
    Path
        Where to write. Has the same suffix.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    _take_away_unfinished(path.parent)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}{UNFINISHED}", suffix=path.suffix)
    temporary = Path(name)
    with os.fdopen(handle, "r+") as held:
        if sys.platform == "win32":
            held.close()  # what is open cannot be replaced there, nor be taken away by others
        else:
            try_lock(held)
        try:
            yield temporary
            temporary.chmod(0o666 & ~_umask())  # mkstemp makes it private
            temporary.replace(path)
        except OSError as fault:
            if fault.errno is not None:
                fault.filename = fault.filename or str(path)  # a full disk does not say where
            raise
        finally:
            temporary.unlink(missing_ok=True)


@contextmanager
def staging_folder(folder: Path) -> Iterator[Path]:
    """Give a folder of its own within `folder`, for files that take their places together; it is gone afterwards.

    Parameters
    ----------
    folder : Path
        Where the files are to go; it exists.

    Yields
    ------
    Path
        Where to write what is then moved.
    """
    _take_away_unfinished(folder)
    staging = Path(tempfile.mkdtemp(dir=folder, prefix=UNFINISHED))
    try:
        with (staging / _HELD).open("a+") as held:
            try_lock(held)
            yield staging
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def try_lock(file: IO[str]) -> bool:
    """Lock a file as long as it is open: the system lets go of it however the process ends."""
    try:
        if sys.platform == "win32":
            import msvcrt

            file.seek(1 << 30)  # beyond the text, which others may read
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


@cache
def _take_away_unfinished(folder: Path) -> None:
    """Remove what killed runs left in a folder: what bears our name, is not of this minute, and nobody holds.

    Once for a folder and process: a set's folders hold thousands of files. Windows could not tell what is held.
    """
    if sys.platform == "win32":
        return
    left: list[Path] = []
    with suppress(OSError):  # a folder may be written and not listed
        left = [path for path in folder.iterdir() if _LEFT.fullmatch(path.name)]
    for path in left:
        is_folder = path.is_dir()
        with suppress(OSError):
            if time.time() - path.stat().st_mtime < _YOUNG_S:
                continue
            with (path / _HELD if is_folder else path).open("r+") as held:
                if not try_lock(held):
                    continue
            shutil.rmtree(path) if is_folder else path.unlink()


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all, in UTF-8 and with the line ends it has."""
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="")


def read_toml(path: Path, *, expected: str) -> dict[str, Any]:
    """Return what a TOML file says.

    Parameters
    ----------
    path : Path
        The file.
    expected : str
        What it should be, for the error.

    Raises
    ------
    InputError
        Where the file cannot be read, or is no TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as fault:
        raise InputError(f"{path}: {(fault.strerror or 'cannot be read').lower()}; give {expected}") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as fault:
        raise InputError(f"{path} is not TOML ({fault}); give {expected}") from None


def check_writable(folder: Path) -> None:
    """Raise an InputError where nothing could be written into `folder`, without making it."""
    existing = next(parent for parent in (folder, *folder.absolute().parents) if parent.exists())
    if not existing.is_dir():
        raise InputError(f"--out {folder}: {existing} is a file; give a folder that can be written")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise InputError(f"--out {folder}: {existing} cannot be written; give another folder")
    figures = folder / "figures"
    if figures.exists() and not figures.is_dir():
        raise InputError(
            f"--out {folder}: {figures} is a file, where a folder is to be; move it or give another folder"
        )


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
