"""Files that lie elsewhere, by URL."""

import hashlib
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tagsway.errors import InputError
from tagsway.video.opening import list_files

REMOTE = ("http", "https", "s3", "gs", "gcs", "abfs", "az", "sftp", "webdav")
"""What leads to another machine, and to no file of this one."""


STAMPS = ("ETag", "etag", "mtime", "LastModified", "Last-Modified", "updated")
"""What file systems call that by which a change is seen."""


def is_url(text: str) -> bool:
    """Tell whether a name is a URL."""
    return "://" in text


def refuse_url(path: Path) -> None:
    """Raise an InputError for a URL in the place of a set: what is missing for it, or else how a set names it."""
    kind, _, rest = path.as_posix().partition(":/")
    if kind in REMOTE and rest and not path.exists():
        url = f"{kind}://{rest}"  # a path has lost one of the slashes
        _open(url)
        raise InputError(f'{url} is a URL: name the files in a set.toml or set.csv, such as file = "{url}/*.mp4"')


def find_remote(url: str, *, origin: str, may_be_empty: bool = False) -> list[str]:
    """Return the URLs that a pattern stands for, sorted; `may_be_empty` for a folder that is being filled.

    Raises
    ------
    InputError
        Where fsspec is missing, the URL is of a kind that may lead to a file of this machine, or nothing matches.
    """
    if "::" in url or url.partition("://")[0] not in REMOTE:
        raise InputError(f"{origin}: file {url!r}: expected a URL of {', '.join(REMOTE)}, or a path in the set")
    fs, path = _open(url)
    if not any(sign in url for sign in "*["):
        return [url]
    fs.invalidate_cache()  # a folder that is watched is listed again and again
    try:
        found = sorted(fs.unstrip_protocol(name) for name in fs.glob(path))
    except Exception as fault:  # each kind of file system has its own
        raise InputError(f"{origin}: file {url!r} cannot be listed: {fault}") from None
    if not found and not may_be_empty:
        raise InputError(f"{origin}: file {url!r} matches nothing")
    return found


def stamp_of(path: str) -> str | None:
    """Return what changes when a file does, without reading it; None where nothing tells."""
    if not is_url(path):
        try:
            stats = [file.stat() for file in list_files(Path(path))]
        except (InputError, OSError):
            return None
        return _digest(f"{stat.st_size}-{stat.st_mtime_ns}" for stat in stats)
    fs, name = _open(path)
    try:
        info = fs.info(name)
    except Exception:  # each kind of file system has its own; what is wrong is told where the file is fetched
        return None
    told = [str(info[key]) for key in STAMPS if info.get(key)]
    return _digest([str(info.get("size")), *told]) if told else None


@contextmanager
def local_copy(path: str) -> Iterator[Path]:
    """Give a file of this machine that holds what a path or a URL does; a copy is removed in the end."""
    if not is_url(path):
        yield Path(path)
        return
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / (path.rstrip("/").rpartition("/")[2].partition("?")[0] or "file")
        fs, name = _open(path)
        try:
            fs.get(name, str(copy))
        except Exception as fault:  # each kind of file system has its own
            reason = "not found" if isinstance(fault, FileNotFoundError) else fault
            raise InputError(f"{path} cannot be fetched: {reason}") from None
        yield copy


def _open(url: str) -> tuple[Any, str]:
    try:
        import fsspec
    except ImportError:
        raise InputError(f"{url} is a URL, which needs fsspec: pip install 'tagsway[cluster]'") from None
    try:
        fs, path = fsspec.core.url_to_fs(url)
    except (ImportError, ValueError) as fault:
        raise InputError(f"{url}: {fault}") from None
    return fs, path


def _digest(parts: Iterable[str]) -> str:
    return hashlib.sha256("|".join(parts).encode()).hexdigest()[:16]
