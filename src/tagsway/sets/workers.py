"""Who does the work: processes of this machine, or a Dask cluster; both are a `concurrent.futures.Executor`."""

import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any, Protocol

from tagsway.errors import InputError, TagswayError

NATIVE_POOLS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)
"""What the libraries below read their number of threads from, as they start."""

LOADED = ("tagsway.sets.measuring",)
"""What workers need, and take seconds to load; what they need to draw, they load where they have to."""

FORKED = sys.platform == "linux"
"""Whether one process loads that and is copied for each worker. Elsewhere what it loads may not survive a copy."""

CONNECT_S = 10

DYING_S = 30
"""How long a process that was killed may take to be gone: until then it is there, and refuses."""

REFUSED = (ConnectionError, EOFError)
"""What a process is answered that asks a dying one for a copy."""


class Crew(Protocol):
    """Workers that take jobs."""

    @property
    def executor(self) -> Executor:
        """Takes jobs; another one after `renew`."""

    @property
    def slots(self) -> int:
        """How many jobs they do at a time."""

    def renew(self) -> None:
        """Have as many workers again, after some have died."""

    def died(self, fault: BaseException) -> bool:
        """Tell whether a job ended because its worker did."""

    def take_back(self, future: Future[Any]) -> bool:
        """Take a job back that no worker has begun; tell whether it is."""


class LocalCrew:
    """Processes of this machine, each held to one core.

    Parameters
    ----------
    workers : int
        How many.
    """

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._start()

    @property
    def executor(self) -> Executor:
        """The pool."""
        return self._pool

    @property
    def slots(self) -> int:
        """One job a process."""
        return self._workers

    def renew(self) -> None:
        """Start a new pool: one that has lost a process takes no more jobs."""
        self.stop()
        self._start()
        _await_copies()

    def died(self, fault: BaseException) -> bool:
        """Tell whether a job ended because its worker did."""
        return isinstance(fault, BrokenExecutor)

    def take_back(self, future: Future[Any]) -> bool:
        """Take a job back that no worker has begun; tell whether it is."""
        return future.cancel()

    def stop(self) -> None:
        """End the processes at once: what they have not handed over is lost."""
        self._lifeline.close()
        self._pool.shutdown(wait=True, cancel_futures=True)

    def _start(self) -> None:
        context = multiprocessing.get_context("forkserver" if FORKED else "spawn")
        end, self._lifeline = context.Pipe(duplex=False)
        counter = context.Value("i", 0)
        self._pool = _Pool(self._workers, mp_context=context, initializer=_begin, initargs=(end, counter))
        with _deaf_to_interrupts():  # a process that starts inherits it: Ctrl-C is the parent's to answer
            if FORKED:  # workers are copied as jobs come; until then there is time for something else
                from multiprocessing import forkserver

                context.set_forkserver_preload(list(LOADED))
                forkserver.ensure_running()
            else:
                for _ in range(self._workers):
                    self._pool.submit(os.getpid)


class _Pool(ProcessPoolExecutor):
    def submit(self, work: Callable[..., Any], /, *args: Any, **options: Any) -> Future[Any]:
        """Take a job; a pool whose processes cannot be copied any more is broken as one that has lost a process."""
        try:
            return super().submit(work, *args, **options)
        except REFUSED as fault:
            raise BrokenExecutor(f"the process that workers are copied from is gone ({fault})") from fault


class ClusterCrew:
    """Workers of a Dask scheduler.

    Parameters
    ----------
    client : distributed.Client
        Connected to it.
    """

    def __init__(self, client: Any) -> None:
        self._client = client
        self._executor: Executor = client.get_executor(pure=False)

    @property
    def executor(self) -> Executor:
        """Dask's own."""
        return self._executor

    @property
    def slots(self) -> int:
        """As many as are there now; one that is awaited where none is."""
        return max(1, len(self._client.nthreads()))

    def renew(self) -> None:
        """Do nothing: the scheduler goes on with the workers that are left."""

    def died(self, fault: BaseException) -> bool:
        """Tell whether the scheduler has given a job up because its workers died."""
        from distributed import KilledWorker

        return isinstance(fault, KilledWorker)

    def take_back(self, future: Future[Any]) -> bool:
        """Leave it where it is: the scheduler does not tell what has begun."""
        return False


@contextmanager
def local_crew(workers: int) -> Iterator[LocalCrew]:
    """Give a crew of processes, and end them."""
    before = {name: os.environ.get(name) for name in NATIVE_POOLS}
    os.environ.update(dict.fromkeys(NATIVE_POOLS, "1"))  # processes inherit it before they load anything
    crew = LocalCrew(workers)
    try:
        yield crew
    finally:
        crew.stop()
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextmanager
def cluster_crew(address: str) -> Iterator[ClusterCrew]:
    """Give the crew of a Dask scheduler, and let go of it.

    Raises
    ------
    InputError
        Where Dask is not installed, nothing answers at the address, or a worker has several threads: detector and
        decoder are one to a process.
    """
    try:
        from distributed import Client
    except ImportError:
        raise InputError(f"--cluster {address} needs Dask: pip install 'tagsway[cluster]'") from None
    try:
        connect: Any = Client  # it states no types
        client = connect(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as fault:
        raise InputError(
            f"--cluster is {address!r}: no Dask scheduler answers there ({fault}); start one with: dask scheduler"
        ) from None
    with client:
        threads = client.nthreads()
        if any(count > 1 for count in threads.values()):
            raise InputError(
                f"a worker at {address} has {max(threads.values())} threads: expected one, so that each holds one "
                "core; start them with: dask worker ADDRESS --nthreads 1"
            )
        crew = ClusterCrew(client)
        try:
            yield crew
        finally:
            crew.executor.shutdown(wait=False)


def _await_copies() -> None:
    """Wait until processes start again: the one they are copied from may have been killed, and be dying still.

    Raises
    ------
    TagswayError
        Where they do not for a long time.
    """
    end_s = time.monotonic() + DYING_S
    while FORKED:
        trial = multiprocessing.get_context("forkserver").Process(target=os.getpid)
        try:
            with _deaf_to_interrupts():
                trial.start()
        except REFUSED as fault:
            if time.monotonic() > end_s:
                raise TagswayError(f"no worker can be started ({fault}); the same command goes on later") from None
            time.sleep(0.05)
        else:
            trial.join()
            return


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Ignore Ctrl-C for a moment; only a main thread can."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def interrupted_later() -> Iterator[None]:
    """Answer Ctrl-C after the block, and not in it; only a main thread can."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    seen: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: seen.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if seen and callable(before):
            before(seen[0], None)


def _begin(lifeline: Connection, counter: Any) -> None:
    """Make a new process one that ends with its parent, leaves Ctrl-C to it, holds one core, and is ready."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(lifeline,), daemon=True).start()
    if hasattr(os, "sched_setaffinity"):
        cores = sorted(os.sched_getaffinity(0))
        with counter.get_lock():
            number = counter.value
            counter.value += 1
        os.sched_setaffinity(0, {cores[(os.getppid() + number) % len(cores)]})
    import tagsway.sets.measuring  # noqa: F401, before the first job is there


def _end_with(lifeline: Connection) -> None:
    """End this process when its parent lets go of it, or has died: nothing else would tell it then."""
    try:
        lifeline.recv_bytes()
    except (EOFError, OSError):
        os._exit(1)
