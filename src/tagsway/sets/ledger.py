"""The folder of a set's results: what is done, what was tried, and who may write."""

import json
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tagsway.errors import InputError
from tagsway.files import try_lock, write_text
from tagsway.model import Settings
from tagsway.sets.jobs import (
    FILE,
    Outcome,
    has_result,
    named_files,
    page_ending,
    page_path,
    result_key,
    result_path,
    settings_digest,
)
from tagsway.sets.manifest import ATTEMPTS, Item
from tagsway.sets.remote import stamp_of
from tagsway.store.steps import file_sha256

SCHEMA = "tagsway/measured/1"
NO_NUMBER = frozenset({"failed", "not_determined"})
"""What the status of a measurement that has none may be."""

LOCK, DIGESTS = ".lock", "files.jsonl"


@dataclass(slots=True)
class Ledger:
    """What is known of a set's files; only one process at a time has it open.

    Parameters
    ----------
    out : Path
        The folder of the results.
    remembers : bool
        Each result is read once: for a folder that is being filled, whose tables are written again and again.
    """

    out: Path
    remembers: bool = False
    _digests: dict[str, tuple[str | None, str]] = field(default_factory=dict)
    _named: dict[str, str] = field(default_factory=dict)
    _settings: dict[tuple[Settings, bool], str] = field(default_factory=dict)
    _failures: dict[str, str] = field(default_factory=dict)
    _read: dict[str, list[tuple[Any, ...]]] = field(default_factory=dict)
    _columns: dict[tuple[str, ...], tuple[str, ...]] = field(default_factory=dict)

    def settings_digest(self, item: Item) -> str:
        """Return the digest of an item's settings; the files that they name are read once.

        Raises
        ------
        InputError
            Where such a file cannot be read.
        """
        for name in named_files(item.settings):
            if name not in self._named:
                try:
                    self._named[name] = file_sha256(Path(name))
                except OSError as fault:
                    raise InputError(
                        f"{item.name}: its settings name {name}: {(fault.strerror or '').lower()}"
                    ) from None
        alike = (item.settings, item.picks)
        if alike not in self._settings:
            self._settings[alike] = settings_digest(item, self._named)
        return self._settings[alike]

    def find_key(self, item: Item, digest: str) -> str | None:
        """Return the key of an item's result, where it is kept and the file has not changed since."""
        known = self._digests.get(item.name)
        if known is None or known[0] is None or known[0] != stamp_of(item.path):
            return None
        key = result_key(known[1], digest)
        return key if has_result(self.out, key) else None

    def lacks_page(self, item: Item, key: str) -> bool:
        """Tell whether one of an item's measurements could have a page of its own, and has none."""
        return any(
            row["status"] not in NO_NUMBER and not page_path(self.out, key, page_ending(row.get("pick"))).exists()
            for row in self.rows(item)
        )

    def result_of(self, item: Item) -> str | None:
        """Return the key of an item's last result, where it has one."""
        known = self._digests.get(item.name)
        if known is None or item.name in self._failures:
            return None
        return result_key(known[1], self.settings_digest(item))

    def content_of(self, item: Item) -> str | None:
        """Return the digest of an item's file as it was when it was last measured; None where it never was."""
        known = self._digests.get(item.name)
        return None if known is None else known[1]

    def rows(self, item: Item) -> list[dict[str, Any]]:
        """Return what is known of an item: a row for each of its measurements, or none where it was not tried yet."""
        if item.name in self._failures:
            return [{"status": "failed", "error": self._failures[item.name]}]
        key = self.result_of(item)
        if key is None:
            return []
        rows = self._rows_of(key)
        for row in rows:
            row["key"] = key
            if row.get("error"):
                row["error"] = row["error"].replace(FILE, item.name)
        return rows

    def _rows_of(self, key: str) -> list[dict[str, Any]]:
        """Return the rows of a result as they are kept; none where it is damaged."""
        if key in self._read:
            return [dict(zip(names, values, strict=True)) for names, *values in self._read[key]]
        head = _first_line(result_path(self.out, key))
        rows: list[dict[str, Any]] = [] if head is None else head["rows"]
        if self.remembers and rows:  # the names once for all rows: a folder may hold a hundred thousand
            self._read[key] = [(self._columns.setdefault(names := tuple(row), names), *row.values()) for row in rows]
        return rows

    def kept(self, item: Item) -> list[dict[str, Any]]:
        """Return what is kept of each of an item's measurements beside its row: `result`, `decay` and `move`."""
        key = self.result_of(item)
        return [] if key is None else read_kept(result_path(self.out, key))

    def enter(self, item: Item, outcome: Outcome, *, stamp: str | None) -> None:
        """Keep what became of an item: its page, its result whole, then the digest of its content.

        Parameters
        ----------
        item : Item
            Of the set.
        outcome : Outcome
            What its worker says.
        stamp : str or None
            Of the file before it was measured.
        """
        self._failures.pop(item.name, None)
        if outcome.key is None or outcome.sha256 is None:
            self._failures[item.name] = outcome.error or "not known"
            return
        for ending, html in outcome.pages:
            write_text(page_path(self.out, outcome.key, ending), html)
        self._read.pop(outcome.key, None)
        if outcome.lines and not has_result(self.out, outcome.key):
            head = {"schema": SCHEMA, **json.loads(outcome.lines[0])}
            text = json.dumps(head, ensure_ascii=False, separators=(",", ":"))
            write_text(result_path(self.out, outcome.key), "\n".join([text, *outcome.lines[1:]]) + "\n")
        self._digests[item.name] = (stamp, outcome.sha256)
        _append(self.out / DIGESTS, {"file": item.name, "stamp": stamp, "sha256": outcome.sha256})

    def note(self, item: Item, event: str, **details: Any) -> None:
        """Write into the log what was tried, and when."""
        now = datetime.now(UTC).isoformat(timespec="milliseconds")
        _append(self.out / ATTEMPTS, {"time": now, "event": event, "file": item.name, **details})

    def load(self) -> None:
        """Read what earlier runs knew, and take away what a killed one left behind."""
        for entry in _read_lines(self.out / DIGESTS):
            if {"file", "stamp", "sha256"} <= entry.keys():
                self._digests[entry["file"]] = (entry["stamp"], entry["sha256"])
        lines = [
            json.dumps({"file": name, "stamp": stamp, "sha256": sha256}, ensure_ascii=False)
            for name, (stamp, sha256) in self._digests.items()
        ]
        if (self.out / DIGESTS).exists():  # what is half written would spoil the entry that comes after it
            write_text(self.out / DIGESTS, "".join(f"{line}\n" for line in lines))
        results = self.out / "results"
        for stray in (*results.glob("*/.*.jsonl"), *(self.out / "pages").glob("*/.*.html")):
            stray.unlink(missing_ok=True)


@contextmanager
def open_ledger(out: Path, *, remembers: bool = False) -> Iterator[Ledger]:
    """Give the ledger of a folder, which nobody else has meanwhile; `remembers` as in `Ledger`.

    Raises
    ------
    InputError
        Where another batch writes into the folder.
    """
    out.mkdir(parents=True, exist_ok=True)
    with (out / LOCK).open("a+", encoding="utf-8") as lock:
        if not try_lock(lock):
            lock.seek(0)
            who = lock.read().strip() or "another process"
            raise InputError(
                f"{out} is in use by another batch ({who}): wait for it, or give another folder with --out"
            )
        lock.truncate(0)
        lock.write(f"process {os.getpid()} on {socket.gethostname()}")
        lock.flush()
        ledger = Ledger(out, remembers)
        ledger.load()
        try:
            yield ledger
        finally:
            lock.truncate(0)


def read_digests(out: Path) -> dict[str, str]:
    """Return the digest of each file of a measured set, by its name; empty where none is kept."""
    entries = [entry for entry in _read_lines(out / DIGESTS) if {"file", "sha256"} <= entry.keys()]
    return {entry["file"]: entry["sha256"] for entry in entries}


def read_kept(path: Path) -> list[dict[str, Any]]:
    """Return what a result's file holds of each measurement beside its row; nothing where it is damaged."""
    try:
        return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()[1:]]
    except (OSError, ValueError):
        return []


def _append(path: Path, entry: dict[str, Any]) -> None:
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(entry, ensure_ascii=False) + "\n")


def _read_lines(path: Path) -> Iterator[dict[str, Any]]:
    """Give the entries of a log; what a killed run left half written is none."""
    if not path.exists():
        return
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in file:
            try:
                entry = json.loads(line)
            except ValueError:
                continue
            if isinstance(entry, dict):
                yield entry


def _first_line(path: Path) -> dict[str, Any] | None:
    try:
        with path.open("rb") as file:
            head = json.loads(file.readline())
    except (OSError, ValueError):
        return None
    return head if isinstance(head, dict) and head.get("schema") == SCHEMA else None
