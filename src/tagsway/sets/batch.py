"""A set from its files to its tables."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tagsway.model import Notice
from tagsway.sets.ahead import Ahead
from tagsway.sets.jobs import Job, Outcome
from tagsway.sets.ledger import Ledger
from tagsway.sets.manifest import Item, MeasurementSet, find_set
from tagsway.sets.running import Runner
from tagsway.sets.workers import Crew, cluster_crew, local_crew

if TYPE_CHECKING:
    from tagsway.sets.tables import Tables

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
        with hired() as crew, Ahead(found.items, jobs, ledger) as ahead:
            Runner(crew, ledger, report, over=ahead.over).run(jobs)
            return write_batch(found, ledger, crew=crew, ahead=ahead)
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


def write_batch(
    found: MeasurementSet, ledger: Ledger, *, crew: Crew | None = None, ahead: Ahead | None = None
) -> Batch:
    """Write the tables of all that is known of a set, with the workers' help and what was drawn ahead, if any."""
    from tagsway.sets.output import write_set
    from tagsway.sets.tables import tabulate

    tables = tabulate(found.items, ledger)
    told = write_set(tables, found, ledger, crew=crew, ahead=ahead)
    return Batch(tables=tables, effects=told.effects, notices=told.notices)


def missing_jobs(items: Sequence[Item], ledger: Ledger, *, pages: bool | None = None) -> list[Job]:
    """Return a job for each file that has no result of its content and settings, may have changed, or lacks a page."""
    drawn = has_pages(len(items), pages)
    jobs = []
    for item in items:
        digest = ledger.settings_digest(item)
        key = ledger.find_key(item, digest)
        if key is None or (drawn and ledger.lacks_page(item, key)):
            jobs.append(Job(item=item, settings_digest=digest, out=str(ledger.out.resolve()), pages=drawn))
    return jobs


def has_pages(files: int, pages: bool | None) -> bool:
    """Tell whether the measurements of a set of so many files have pages of their own."""
    return files <= MOST_PAGES if pages is None else pages
