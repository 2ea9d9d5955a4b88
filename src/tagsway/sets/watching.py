"""A folder that is being filled: each file measured once it is complete."""

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path

from tagsway.sets.batch import Begin, has_pages, missing_jobs, write_batch
from tagsway.sets.jobs import Job, Outcome
from tagsway.sets.ledger import Ledger
from tagsway.sets.manifest import Item, MeasurementSet, find_set
from tagsway.sets.remote import stamp_of
from tagsway.sets.running import Runner
from tagsway.sets.workers import Crew

POLL_S = 2.0
"""Between two looks into a folder that is being filled: a file that did not change from one to the next is complete."""


def watch_set(
    path: Path,
    ledger: Ledger,
    hired: Callable[[], AbstractContextManager[Crew]],
    *,
    begin: Begin,
    report: Callable[[Outcome], None],
    pages: bool | None = None,
    go_on: Callable[[], bool] = lambda: True,
    poll_s: float = POLL_S,
) -> None:
    """Measure each file of a folder that is being filled, once it is complete.

    Parameters
    ----------
    path, ledger, hired, begin, report, pages
        As in `measure_set`; `begin` is called each time something was found.
    go_on : callable
        Asked before each look.
    poll_s : float
        Between two looks.

    Notes
    -----
    A file is complete when neither its size nor its time of change differ between two looks. The tables are written
    again after each time. Of a file that is done a look takes its size and its time alone, and where the ledger
    remembers, its result is read once.
    """
    looks = _Looks(ledger, pages)
    with hired() as crew:
        runner = Runner(crew, ledger, report)
        while go_on():
            found = find_set(path, leave_out=ledger.out, may_be_empty=True)
            missing, ready = looks.compare(found)
            if ready:
                begin(len(found.items), len(found.items) - missing)
                runner.run(ready)
                write_batch(found, ledger, crew=crew)
            time.sleep(poll_s)


@dataclass(slots=True)
class _Looks:
    """What earlier looks into a folder told, by the files' names: as they stood, as they were tried, as they are done.

    Parameters
    ----------
    ledger : Ledger
        Of the folder with the results.
    pages : bool or None
        As in `measure_set`.
    """

    ledger: Ledger
    pages: bool | None
    _before: dict[str, str | None] = field(default_factory=dict)
    _tried: dict[str, str | None] = field(default_factory=dict)
    _done: dict[str, tuple[str | None, str, bool]] = field(default_factory=dict)

    def compare(self, found: MeasurementSet) -> tuple[int, list[Job]]:
        """Return how many files are not done yet, and the jobs of those that are complete and were not tried."""
        drawn = has_pages(len(found.items), self.pages)
        stamps = {item.name: stamp_of(item.path) for item in found.items}
        standing = {item.name: (stamps[item.name], self.ledger.settings_digest(item), drawn) for item in found.items}
        left = [item for item in found.items if self._done.get(item.name) != standing[item.name]]
        jobs = missing_jobs(left, self.ledger, pages=drawn)
        missing = {job.item.name for job in jobs}
        self._done |= {item.name: standing[item.name] for item in left if item.name not in missing}
        ready = [job for job in jobs if self._is_complete(job.item, stamps[job.item.name])]
        self._before = stamps
        self._tried |= {job.item.name: stamps[job.item.name] for job in ready}
        return len(missing), ready

    def _is_complete(self, item: Item, stamp: str | None) -> bool:
        """Tell whether a file stands as it stood, and has not been tried as it is."""
        name = item.name
        return name in self._before and self._before[name] == stamp and self._tried.get(name, ...) != stamp
