"""Engine that works on many tasks: Dask distributed, a cluster of this machine or a running one.

Dask blames every task that is assigned to a worker as it dies. So no worker has more than one, and one that is blamed
is repeated by itself before it is reported: if the process ends twice, the log itself is the cause, by its memory for
example.
"""

import asyncio
import multiprocessing
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple, Protocol, TypeVar

import dask
from dask.system import CPU_COUNT
from distributed import Client, KilledWorker, LocalCluster, Security, as_completed, wait

from hybridsep.base.errors import HybridSepError, ParameterError, first_line

T = TypeVar("T")

_CONFIG: dict[str, Any] = {
    "distributed.scheduler.allowed-failures": 0,  # a task that is blamed is repeated by its own rule
    # What is kept of tasks that are over: messages and transitions, some megabytes
    "distributed.admin.log-length": 0,
    "distributed.admin.low-level-log-length": 0,
    # What watches a worker takes a hundred wake-ups a second, from the thread that works
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "500ms",
    "distributed.admin.tick.limit": "60s",
    "distributed.admin.system-monitor.interval": "5s",
}
"""Settings of a cluster that is started here."""

_ALONE = 2  # lone attempts of a task that is blamed: it may not even have run, as it waited behind another
_COUNTED = 1.0  # time for which a count of workers is kept before they are counted again, s
_REACHED = 10.0  # time within which a scheduler answers, s
_CLOSED = 30.0  # time within which a cluster closes, s: rarely, Dask has waited for a worker without end

_ENDED = "the process that worked on it ended, twice: out of memory, or a fault of a library{limit}"


@contextmanager
def _ignoring_ctrl_c() -> Iterator[None]:
    """Let processes that are started ignore a terminal's Ctrl-C: it ends this process, which ends them.

    Meanwhile it is ignored here, too. Does nothing outside the main thread.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # inherited, also by a new program
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


class Done(NamedTuple):
    """Task that is over."""

    task: Any
    result: Any  # None where it failed
    failure: str = ""  # why it failed; empty if it did not


class Engine(Protocol):
    """What works on tasks."""

    words: str  # what it is, for messages

    def run(self, work: Callable[[T], Any], tasks: Iterable[T]) -> Iterator[Done]:
        """Work on all tasks; yield each once, as it is over, in any order."""


def attempt(work: Callable[[T], Any], task: T) -> tuple[Any, str]:
    """Return the result of a task, and why there is none; one task must not end the run of thousands."""
    try:
        return work(task), ""
    except HybridSepError as error:
        return None, str(error)
    except MemoryError as error:
        return None, f"out of memory: {error}"
    except Exception as error:
        return None, first_line(f"unexpected {type(error).__name__}: {error}")


class _Dask:
    """Workers of a Dask cluster."""

    def __init__(self, client: Client, words: str, limit: str) -> None:
        self._client = client
        self.words, self._limit = words, limit
        self._n, self._counted = 0, -_COUNTED

    def run(self, work: Callable[[T], Any], tasks: Iterable[T]) -> Iterator[Done]:
        """Work on all tasks; yield each once, as it is over, in any order."""
        waiting = iter(tasks)
        blamed: deque[T] = deque()
        under_way: dict[Any, T] = {}
        over = as_completed(with_results=False)
        while True:
            while len(under_way) < self._workers() and (task := next(waiting, _NONE)) is not _NONE:
                future = self._client.submit(attempt, work, task, pure=False, retries=0)
                under_way[future] = task
                over.add(future)
            if not under_way:
                break
            future = next(over)
            task = under_way.pop(future)
            done = self._done(future, task)
            if done is None:
                blamed.append(task)
            else:
                yield done
            del future
        for task in blamed:
            attempts = (self._alone(work, task) for _ in range(_ALONE))
            found = next((attempt for attempt in attempts if attempt), None)
            yield found or Done(task, None, _ENDED.format(limit=self._limit))

    def _alone(self, work: Callable[[T], Any], task: T) -> Done | None:
        """Return what came of a task that nothing else runs beside; None if its worker ended."""
        future = self._client.submit(attempt, work, task, pure=False, retries=0)
        wait([future])
        return self._done(future, task)

    def _workers(self) -> int:
        """Return the workers there are now; one, which may come, if there are none."""
        if time.monotonic() - self._counted > _COUNTED:
            self._n, self._counted = len(self._client.scheduler_info(n_workers=-1)["workers"]), time.monotonic()
        return max(1, self._n)

    def _done(self, future: Any, task: T) -> Done | None:
        """Return what came of a task; None if its worker ended."""
        if future.status == "finished":
            return Done(task, *future.result())
        error = future.exception() if future.status == "error" else None
        if error is None or isinstance(error, KilledWorker):
            return None
        return Done(task, None, first_line(f"{type(error).__name__}: {error}"))


_NONE: Any = object()


@contextmanager
def _ending(started: Any) -> Iterator[None]:
    """Close a cluster of this machine at the end; kill its workers if it does not close in time."""
    try:
        yield
    finally:
        own = {nanny.pid for nanny in started.workers.values()}
        try:
            started.close(timeout=_CLOSED)
        except asyncio.TimeoutError:  # in Python 3.10 not the built-in one
            for child in multiprocessing.active_children():
                if child.pid in own:
                    child.kill()


@contextmanager
def cluster(workers: int = 0, scheduler: str = "") -> Iterator[Engine]:
    """Start a cluster of this machine, or use a running one, and end what was started.

    Who connects to a cluster that is started here needs a certificate that is made for it and stays in its processes:
    a scheduler runs what it is sent, as its own user.

    ``workers``: processes of a cluster of this machine, each with its share of the memory; as many as cores if 0;
    ``scheduler``: address of a running one, such as ``tls://10.0.0.5:8786``, with Dask's own settings of TLS.
    ParameterError if the scheduler cannot be reached, or both are given.
    """
    if workers and scheduler:
        raise ParameterError("--workers and --scheduler exclude each other")
    with dask.config.set(_CONFIG):
        if scheduler:
            try:
                client = Client(scheduler, timeout=_REACHED)
            except (OSError, ValueError) as error:
                raise ParameterError(f"--scheduler {scheduler} cannot be reached: {first_line(error)}") from error
            with client:
                yield _Dask(client, f"Dask at {scheduler}", "")
            return
        with _ignoring_ctrl_c():
            started = LocalCluster(
                n_workers=workers or CPU_COUNT,
                threads_per_worker=1,
                host="127.0.0.1",
                security=Security.temporary(),
                dashboard_address="127.0.0.1:0",  # of its own, so that several may run, and for this machine only
                silence_logs=50,
            )
        with _ending(started), Client(started) as client:
            there = client.scheduler_info(n_workers=-1)["workers"].values()
            limit = min(one["memory_limit"] for one in there) / 2**30
            words = f"Dask, {len(there)} worker{'s' if len(there) > 1 else ''} of {limit:.1f} GB"
            yield _Dask(client, words, f"; its memory limit is {limit:.1f} GB")
