"""A set from its files to its tables, once or as it is being filled."""

import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tagsway.model import Notice
from tagsway.sets.jobs import Job, Outcome
from tagsway.sets.ledger import Ledger
from tagsway.sets.manifest import Item, MeasurementSet, find_set
from tagsway.sets.remote import stamp_of
from tagsway.sets.running import Runner
from tagsway.sets.workers import Crew, cluster_crew, local_crew

if TYPE_CHECKING:
    from tagsway.sets.tables import Tables

POLL_S = 2.0
"""Between two looks into a folder that is being filled: a file that did not change from one to the next is complete."""

MOST_PAGES = 2000
"""Files of a set whose measurements have pages of their own unless it is asked for: as many as its page lists."""

Begin = Callable[[int, int], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """What a batch came to.

    Parameters
    ----------
    tables : Tables
        Of the whole set.
    effects : tuple of str
        What the factors do, a sentence each.
    notices : tuple of Notice
        What to know about them.
    """

    tables: "Tables"
    effects: tuple[str, ...]
    notices: tuple[Notice, ...]


def hire(workers: int, cluster: str | None) -> AbstractContextManager[Crew]:
    """Return processes of this machine, or the workers of a Dask scheduler."""
    return local_crew(workers) if cluster is None else cluster_crew(cluster)


def measure_set(
    path: Path,
    ledger: Ledger,
    hired: Callable[[], AbstractContextManager[Crew]],
    *,
    begin: Begin,
    report: Callable[[Outcome], None],
    pages: bool | None = None,
) -> Batch:
    """Measure what is missing or changed in a set, and write its tables.

    Parameters
    ----------
    path : Path
        The set; see `find_set`.
    ledger : Ledger
        Of the folder with the results.
    hired : callable
        Gives a crew; called only where there is something to do.
    begin : callable
        Called with the files in the set and those that are done already.
    report : callable
        Called with each outcome.
    pages : bool, optional
        Each measurement has a page of its own; by default those of a set of up to `MOST_PAGES` files.

    Returns
    -------
    Batch
    """
    found = find_set(path, leave_out=ledger.out)
    jobs = missing_jobs(found.items, ledger, pages=pages)
    begin(len(found.items), len(found.items) - len(jobs))
    if jobs:
        with hired() as crew:
            import tagsway.sets.output  # noqa: F401, loaded while the workers load what they need

            Runner(crew, ledger, report).run(jobs)
            return write_batch(found, ledger, crew=crew)
    return write_batch(found, ledger)


def measure_items(
    items: Sequence[Item],
    ledger: Ledger,
    hired: Callable[[], AbstractContextManager[Crew]],
    *,
    begin: Begin,
    report: Callable[[Outcome], None],
) -> None:
    """Measure what is missing or changed among some files; see `measure_set`. None has a page of its own."""
    jobs = missing_jobs(items, ledger, pages=False)
    begin(len(items), len(items) - len(jobs))
    if jobs:
        with hired() as crew:
            Runner(crew, ledger, report).run(jobs)


def write_batch(found: MeasurementSet, ledger: Ledger, *, crew: Crew | None = None) -> Batch:
    """Write the tables of all that is known of a set, with the workers' help where there are any."""
    from tagsway.sets.output import write_set
    from tagsway.sets.tables import tabulate

    tables = tabulate(found.items, ledger)
    told = write_set(tables, found, ledger, crew=crew)
    return Batch(tables=tables, effects=told.effects, notices=told.notices)


def missing_jobs(items: Sequence[Item], ledger: Ledger, *, pages: bool | None = None) -> list[Job]:
    """Return a job for each file that has no result of its content and settings, may have changed, or lacks a page."""
    drawn = len(items) <= MOST_PAGES if pages is None else pages
    jobs = []
    for item in items:
        digest = ledger.settings_digest(item)
        key = ledger.find_key(item, digest)
        if key is None or (drawn and ledger.lacks_page(item, key)):
            jobs.append(Job(item=item, settings_digest=digest, out=str(ledger.out.resolve()), pages=drawn))
    return jobs


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
    again after each time.
    """
    before: dict[str, str | None] = {}
    tried: dict[str, str | None] = {}
    with hired() as crew:
        runner = Runner(crew, ledger, report)
        while go_on():
            found = find_set(path, leave_out=ledger.out, may_be_empty=True)
            stamps = {item.name: stamp_of(item.path) for item in found.items}
            jobs = missing_jobs(found.items, ledger, pages=pages)
            ready = [job for job in jobs if _is_complete(job.item, stamps, before, tried)]
            before = stamps
            if ready:
                begin(len(found.items), len(found.items) - len(jobs))
                runner.run(ready)
                tried |= {job.item.name: stamps[job.item.name] for job in ready}
                write_batch(found, ledger, crew=crew)
            time.sleep(poll_s)


def _is_complete(
    item: Item, stamps: dict[str, str | None], before: dict[str, str | None], tried: dict[str, str | None]
) -> bool:
    """Tell whether a file stands as it stood, and has not been tried as it is."""
    stamp = stamps[item.name]
    return item.name in before and before[item.name] == stamp and (item.name not in tried or tried[item.name] != stamp)
