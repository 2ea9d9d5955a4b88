"""`identify batch SET`: many measurements."""

import errno
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tagsway.errors import InputError, TagswayError

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from tagsway.sets.batch import Batch
    from tagsway.sets.jobs import Outcome
    from tagsway.sets.workers import Crew

SOME_FAILED = 4
"""Exit code: the others were done."""

DISK_IS_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Errors that name no file: as many writes may fail."""

MOST_NAMED = 20
"""Failed files that are named on standard error; all of them are in measurements.csv."""

MOST_EFFECTS = 20
"""That are told on the terminal, the sure ones first; all of them are in effects.csv and on the page."""


def batch(
    path: Annotated[
        Path,
        typer.Argument(
            help="A folder of subsets, a set.toml, a table with a column 'file', or a clip with many picks.",
            metavar="SET",
        ),
    ],
    out: Annotated[str | None, typer.Option(help="Folder for the results.", show_default="NAME-identify")] = None,
    workers: Annotated[int | None, typer.Option(help="Processes, each on one core.", show_default="the cores")] = None,
    cluster: Annotated[
        str | None, typer.Option(help="A Dask scheduler instead, such as tcp://host:8786.", metavar="ADDRESS")
    ] = None,
    pages: Annotated[
        bool | None,
        typer.Option("--pages/--no-pages", help="A page for each measurement.", show_default="up to 2000 files"),
    ] = None,
    watch: Annotated[bool, typer.Option("--watch", help="Go on looking for new files, until Ctrl-C.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print nothing but errors.")] = False,
) -> None:
    """Measure a whole set: what is missing or changed, each file once."""
    from tagsway.files import check_writable
    from tagsway.sets.batch import hire, measure_set, write_batch
    from tagsway.sets.ledger import open_ledger
    from tagsway.sets.manifest import find_set
    from tagsway.sets.watching import watch_set

    if workers is not None and cluster is not None:
        raise InputError("--workers is of this machine and --cluster of others: give one of them")
    if workers is not None and not workers >= 1:
        raise InputError(f"--workers is {workers}: expected 1 or more")
    if out is not None and not out.strip():
        raise InputError("--out is empty: expected a folder for the results")
    folder = Path(f"{path.resolve().stem}-identify" if out is None else out)
    check_writable(folder)
    find_set(path, leave_out=folder, may_be_empty=watch)  # a set that cannot be used leaves no folder behind

    def hired() -> "AbstractContextManager[Crew]":
        return hire(workers or usable_cores(), cluster)

    with open_ledger(folder, remembers=watch) as ledger:
        try:
            with display_set(path.name, shown=not quiet) as (begin, report):
                if watch:
                    watch_set(path, ledger, hired, begin=begin, report=report, pages=pages)
                done = measure_set(path, ledger, hired, begin=begin, report=report, pages=pages)
        except KeyboardInterrupt:
            if not watch:
                typer.echo(f"what is done is kept in {folder}/: the same command goes on from there", err=True)
                raise
            done = write_batch(find_set(path, leave_out=folder, may_be_empty=True), ledger)
        except OSError as fault:
            if fault.errno not in DISK_IS_FULL:
                raise
            reason = os.strerror(fault.errno).lower()
            raise TagswayError(f"{folder}/: {reason}; what is done is kept: the same command goes on") from None
    _tell(done, folder, quiet=quiet)


def _tell(done: "Batch", folder: Path, *, quiet: bool) -> None:
    table = done.tables.measurements
    failed = table[table["status"].isin(["failed", "not_determined"])]
    if not quiet:
        typer.echo("\n".join(_summary_lines(done)))
        if done.effects:
            typer.echo("\n".join(["", *_effect_lines(done)]))
        typer.echo(f"\nwritten to {folder}/ — open {folder}/report.html")
        for notice in done.notices:
            typer.echo(f"note: {notice.message}", err=True)
    for file, reason in list(zip(failed["file"], failed["error"], strict=True))[:MOST_NAMED]:
        typer.echo(f"failed: {reason if file in reason else f'{file}: {reason}'}", err=True)
    if len(failed) > MOST_NAMED:
        typer.echo(f"failed: {len(failed) - MOST_NAMED} more, see {folder / 'measurements.csv'}", err=True)
    if len(failed):
        raise typer.Exit(SOME_FAILED)


def _summary_lines(done: "Batch") -> list[str]:
    """Return summary.csv as people read it: a line a subset."""
    from tagsway.sets.columns import WHOLE

    rows = done.tables.summary.to_dict("records")
    names = [f"{WHOLE} {row['set']}".rstrip() if row["subset"] == WHOLE else str(row["subset"]) for row in rows]
    width = max(len("subset"), *(len(name) for name in names))
    lines = [
        f"{'subset':<{width}}  {'n':>5} {'failed':>6} {'rejected':>8}   {'f_n (Hz)':>9} {'± %':>6} {'s':>8}   "
        f"{'ζ':>9} {'± %':>6}"
    ]
    for name, row in zip(names, rows, strict=True):
        frequency, damping = (
            [row[f"{quantity}_{what}"] for what in whats]
            for quantity, whats in (
                ("natural_frequency", ("median_hz", "deviation_percent", "s_hz")),
                ("damping_ratio", ("median", "deviation_percent")),
            )
        )
        lines.append(
            f"{name:<{width}}  {row['n']:>5} {row['failed']:>6} {row['rejected']:>8}   "
            f"{_number(frequency[0], '9.4f')} {_number(frequency[1], '6.2f')} {_number(frequency[2], '8.4f')}   "
            f"{_number(damping[0], '9.5f')} {_number(damping[1], '6.1f')}"
        )
    return lines


def _effect_lines(done: "Batch") -> list[str]:
    """Return what the factors do, as the page says it."""
    more = len(done.effects) - MOST_EFFECTS
    head = "what the factors do, the others alike (± one standard error):"
    return [head, *done.effects[:MOST_EFFECTS], *([f"{more} more effects: see effects.csv"] if more > 0 else [])]


def _number(value: float | None, form: str) -> str:
    missing = value is None or value != value
    return "-".rjust(int(form.split(".")[0])) if missing else format(value, form)


def usable_cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def display_set(name: str, *, shown: bool) -> Iterator[tuple[Callable[[int, int], None], Callable[["Outcome"], None]]]:
    """Give what shows a set's progress: files done, failed and left, frames per second, time left."""
    import sys

    if not shown or not sys.stderr.isatty():
        yield lambda total, kept: None, lambda outcome: None
        return
    from rich import progress as rich
    from rich.console import Console

    columns = (
        rich.TextColumn("{task.description}"),
        rich.BarColumn(),
        rich.TextColumn("{task.fields[done]} done, {task.fields[failed]} failed, {task.fields[left]} left"),
        rich.TextColumn("{task.fields[speed]} fps"),
        rich.TimeRemainingColumn(),
    )
    with rich.Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(name, total=None, done=0, failed=0, left="?", speed="-")
        frames = failed = 0

        def begin(total: int, kept: int) -> None:
            nonlocal frames, failed
            frames = failed = 0  # what was done before has no speed
            bar.reset(task, total=total, completed=kept, done=kept, failed=0, left=total - kept, speed="-")

        def report(outcome: "Outcome") -> None:
            nonlocal frames, failed
            frames, failed = frames + outcome.frames, failed + outcome.failed
            shown_task = bar.tasks[0]
            over = int(shown_task.completed) + 1
            left = max(int(shown_task.total or 0) - over, 0)
            speed = f"{frames / shown_task.elapsed:.0f}" if shown_task.elapsed else "-"
            bar.update(task, completed=over, done=over - failed, failed=failed, left=left, speed=speed)

        yield begin, report
