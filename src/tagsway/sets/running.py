"""Every file of a set measured once: by any crew, whatever dies."""

from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from dataclasses import dataclass, field

from tagsway import __version__
from tagsway.errors import InputError, TagswayError
from tagsway.sets.jobs import Job, Outcome, measure
from tagsway.sets.ledger import Ledger
from tagsway.sets.manifest import Item
from tagsway.sets.remote import stamp_of
from tagsway.sets.workers import Crew, interrupted_later

ATTEMPTS = 2
"""A file whose process dies while nothing else runs is tried once more."""

AHEAD = 1
"""Jobs that wait beside each one that runs, so that no worker waits for its next."""

WORKER_DIED = "the process that measured it died twice, alone: the file crashes its decoder, or needs too much memory"

Report = Callable[[Outcome], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Flying:
    job: Job
    stamp: str | None


@dataclass(slots=True)
class Runner:
    """Runs jobs and enters what becomes of each.

    Parameters
    ----------
    crew : Crew
        Who does them.
    ledger : Ledger
        Where their outcomes go.
    report : callable
        Called with each outcome.
    over : callable
        Called with each file whose outcome is entered.
    work : callable
        What a worker does with a job.
    """

    crew: Crew
    ledger: Ledger
    report: Report
    over: Callable[[Item], None] = lambda item: None
    work: Callable[[Job], Outcome] = measure
    _flying: dict["Future[Outcome]", _Flying] = field(default_factory=dict)
    _broken: bool = False

    def run(self, jobs: Iterable[Job]) -> None:
        """Do all jobs; when a worker dies, those in flight are run again one at a time.

        Raises
        ------
        TagswayError
            Where the cluster is gone, or measures with another version.
        """
        waiting, suspects = deque(jobs), deque[Job]()
        while waiting or self._flying or suspects:
            if suspects and not self._flying:
                self._run_alone(suspects.popleft())
            while waiting and not suspects and len(self._flying) < (1 + AHEAD) * self.crew.slots:
                job = waiting.popleft()
                if not self._submit(job):
                    suspects.append(job)
            suspects.extend(self._gather())

    def _run_alone(self, job: Job) -> None:
        """Do a job while nothing else runs: when its worker dies now, it is this job's doing."""
        for attempt in range(1, ATTEMPTS + 1):
            if self._submit(job, alone=attempt) and not self._gather():
                return
        outcome = Outcome(error=WORKER_DIED, failed=True)
        self._enter(job.item, outcome, None)

    def _submit(self, job: Job, *, alone: int = 0) -> bool:
        """Hand a job to the crew; False where the crew turns out to be broken."""
        if self._broken and not self._flying:
            self.crew.renew()
            self._broken = False
        stamp = stamp_of(job.item.path)
        try:
            with interrupted_later():  # a worker that is started half would tell of it in many lines
                future = self.crew.executor.submit(self.work, job)
        except Exception as fault:
            if not self.crew.died(fault):
                raise
            self._broken = True
            return False
        self.ledger.note(job.item, "started", **({"alone": alone} if alone else {}))
        self._flying[future] = _Flying(job=job, stamp=stamp)
        return True

    def _gather(self) -> list[Job]:
        """Wait for a job to end, enter those that did, and return those whose worker died."""
        lost = []
        done, _ = wait(self._flying, return_when=FIRST_COMPLETED)
        for future in done:
            flying = self._flying.pop(future)
            try:
                outcome = future.result()
            except CancelledError:
                raise TagswayError("the workers are gone: what is done is kept, the same command goes on") from None
            except Exception as fault:
                if not self.crew.died(fault):
                    raise
                self._broken = True
                lost.append(flying.job)
                self.ledger.note(flying.job.item, "lost")
                continue
            self._enter(flying.job.item, outcome, flying.stamp)
        return lost

    def _enter(self, item: Item, outcome: Outcome, stamp: str | None) -> None:
        if outcome.version != __version__:
            raise InputError(
                f"a worker runs tagsway {outcome.version}, this is {__version__}: install the same on both"
            )
        self.ledger.enter(item, outcome, stamp=stamp)
        event = "finished" if outcome.lines else "known" if outcome.key else "failed"
        details: dict[str, object] = {"error": outcome.error} if outcome.error else {"key": outcome.key}
        details |= {name: getattr(outcome, name) for name in ("frames", "worker", "trace") if getattr(outcome, name)}
        self.ledger.note(
            item, event, seconds=round(outcome.seconds, 3), cpu_seconds=round(outcome.cpu_seconds, 3), **details
        )
        self.over(item)
        self.report(outcome)
