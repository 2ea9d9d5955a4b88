"""Results of single steps, kept under a key of what they depend on."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from tagsway import __version__
from tagsway.model import Track
from tagsway.store.packing import pack, read_packed, write_packed

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class StepStore:
    """A folder of finished steps.

    Parameters
    ----------
    folder : Path or None
        Where they are kept; None keeps nothing.

    Notes
    -----
    What was computed is written by `keep` alone, so that a run that ends with an error leaves nothing behind.
    """

    folder: Path | None = None
    _new: dict[Path, Any] = field(default_factory=dict)

    def get(self, name: str, kind: type[T], compute: Callable[[], T], *, depends_on: Any) -> T:
        """Return a step's result, computed only where it is not kept yet.

        Parameters
        ----------
        name : str
            Of the step.
        kind : type
            Of its result, a dataclass.
        compute : callable
            Makes the result.
        depends_on : Any
            Everything that the result depends on, as plain lists, dicts and numbers.

        Returns
        -------
        T
            The same value whether it was computed now or before.
        """
        if self.folder is None:
            return compute()
        text = json.dumps([__version__, name, depends_on], sort_keys=True)
        path = self.folder / f"{name}-{hashlib.sha256(text.encode()).hexdigest()[:16]}.npz"
        if path.exists():
            try:
                return read_packed(kind, path)
            except ValueError:
                pass  # damaged, or of an older layout: computed again, and written over
        self._new[path] = compute()
        value: T = self._new[path]
        return value

    def keep(self) -> None:
        """Write the steps that were computed; what they replace is removed."""
        for path, value in self._new.items():
            for stale in path.parent.glob(f"{path.stem.rpartition('-')[0]}-*.npz"):
                stale.unlink(missing_ok=True)
            write_packed(path, value)
        self._new.clear()


def track_digest(track: Track) -> str:
    """Return the SHA-256 of all that a track holds, in hexadecimal."""
    arrays, tree = pack(track)
    digest = hashlib.sha256(json.dumps(tree, sort_keys=True).encode())
    for name, array in sorted(arrays.items()):
        digest.update(name.encode() + np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def file_sha256(*paths: Path) -> str:
    """Return the SHA-256 of a file's content, in hexadecimal; of several files, that of their names and their own."""
    digests = []
    for path in paths:
        with path.open("rb") as file:
            digests.append(hashlib.file_digest(file, "sha256").hexdigest())
    if len(paths) == 1:
        return digests[0]
    lines = [f"{digest} {path.name}\n" for path, digest in zip(paths, digests, strict=True)]
    return hashlib.sha256("".join(lines).encode()).hexdigest()
