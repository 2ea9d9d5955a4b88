"""A progress bar on standard error: frames, frames per second, time left."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from tagsway.model import Progress


@contextmanager
def progress_bar(name: str, *, shown: bool) -> Iterator[Progress | None]:
    """Give a function that moves the bar; None where it is not wanted or standard error is no terminal."""
    if not shown or not sys.stderr.isatty():
        yield None
        return
    from rich import progress as rich
    from rich.console import Console

    columns = (
        rich.TextColumn("{task.description}"),
        rich.BarColumn(),
        rich.MofNCompleteColumn(),
        rich.TextColumn("{task.fields[speed]} fps"),
        rich.TimeRemainingColumn(),
    )
    with rich.Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(name, total=None, speed="-")

        def advance(done: int, total: int) -> None:
            speed = bar.tasks[0].speed
            bar.update(task, completed=done, total=total, speed="-" if speed is None else f"{speed:.0f}")

        yield advance
