"""Subsets drawn as soon as they are measured, by this process while its workers go on with the others."""

from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager
from types import TracebackType
from typing import TYPE_CHECKING, Any

from tagsway.sets.jobs import Job
from tagsway.sets.ledger import Ledger
from tagsway.sets.manifest import Item

if TYPE_CHECKING:
    from tagsway.sets.drawing import DrawnSubset


class Ahead(AbstractContextManager["Ahead"]):
    """Draws each subset of which nothing is left to be measured, in a thread of its own.

    What comes later may still change it, as when it turns out to hold a copy: `take` gives what was drawn only for the
    key of what is to be drawn.

    Parameters
    ----------
    items : sequence of Item
        Of the set.
    jobs : iterable of Job
        What is to be measured.
    ledger : Ledger
        Where the results are.
    """

    def __init__(self, items: Sequence[Item], jobs: Iterable[Job], ledger: Ledger) -> None:
        self._items, self._ledger = items, ledger
        self._left = Counter(job.item.subset for job in jobs)
        self._drawing: dict[str, Future[Any]] = {}
        self._thread = ThreadPoolExecutor(1)
        self._thread.submit(_load)  # while the workers load what they need

    def over(self, item: Item) -> None:
        """Note that a file is done or has failed."""
        self._left[item.subset] -= 1
        if self._left[item.subset] == 0:
            self._drawing[item.subset] = self._thread.submit(self._draw, item.subset)

    def stop(self) -> None:
        """Begin no further subset."""
        for future in self._drawing.values():
            future.cancel()

    def has(self, subset: str) -> bool:
        """Tell whether a subset is drawn, or is being drawn."""
        return subset in self._drawing and not self._drawing[subset].cancelled()

    def take(self, subset: str, key: str) -> "DrawnSubset | None":
        """Return what was drawn of a subset, once it is; None where that was not begun, or of something else."""
        if not self.has(subset) or self._drawing[subset].exception() is not None:
            return None  # what is wrong comes up again where it is drawn now
        drawn = self._drawing[subset].result()
        return drawn[1] if drawn is not None and drawn[0] == key else None

    def __exit__(
        self, kind: type[BaseException] | None, fault: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._thread.shutdown(cancel_futures=True)

    def _draw(self, subset: str) -> "tuple[str, DrawnSubset] | None":
        from tagsway.sets.drawing import draw_subset
        from tagsway.sets.subsets import plan_subsets
        from tagsway.sets.tables import tabulate

        items = [item for item in self._items if item.subset == subset]
        plans = plan_subsets(tabulate(items, self._ledger), items, self._ledger)
        return next(((plan.key, draw_subset(plan.task(self._ledger))) for plan in plans), None)


def _load() -> None:
    import tagsway.sets.output  # noqa: F401
