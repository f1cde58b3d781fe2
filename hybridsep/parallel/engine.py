"""Engines that work on many tasks: Dask distributed, a cluster of this machine or a running one, else joblib.

Dask blames every task that is assigned to a worker as it dies. So no worker has more than one, and one that is blamed
is repeated alone before it is reported: if the process ends twice, the log itself is the cause, by its memory for
example.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import signal
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager
from typing import Any, NamedTuple, TypeVar

from ..base.errors import HybridSepError, ParameterError, first_line
from ..logs.extras import library

__all__ = ["Done", "Engine", "check_engine", "cluster", "joblib_engine"]

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

_ALONE = 2
"""Attempts alone of a task that is blamed: it may not even have run, as it waited behind another."""

_COUNTED = 1.0
"""Time for which a count of workers is kept before they are counted again, s."""

_REACHED = 10.0
"""Time within which a scheduler answers, s."""

_CLOSED = 30.0
"""Time within which a cluster closes, s: rarely, Dask has waited for a worker without end."""

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
    """Task that is over.

    Attributes
    ----------
    task : object
    result : object
        None where it failed.
    failure : str
        Why it failed; empty if it did not.
    """

    task: Any
    result: Any
    failure: str = ""


class Engine(ABC):
    """Engine.

    Attributes
    ----------
    words : str
        What works, for messages.
    """

    words: str

    @abstractmethod
    def run(self, work: Callable[[T], Any], tasks: Iterable[T]) -> Iterator[Done]:
        """Work on all tasks; yield each once, as it is over, in any order."""


class _Joblib(Engine):
    """Processes of this machine; one that ends takes the others with it, which are begun again."""

    def __init__(self, jobs: int) -> None:
        from joblib import cpu_count

        self._jobs = min(jobs, cpu_count()) if jobs else cpu_count()
        self.words = f"joblib, {self._jobs} process{'es' if self._jobs > 1 else ''}"

    def run(self, work: Callable[[T], Any], tasks: Iterable[T]) -> Iterator[Done]:
        """Work on all tasks; yield each once, as it is over, in any order."""
        left = dict(enumerate(tasks))
        if self._jobs == 1:
            for task in left.values():
                yield Done(task, *_tried(work, task))
            return
        for i, outcome in self._parallel(work, left):
            yield Done(left.pop(i), *outcome)
        for i, task in left.items():  # a process has ended: one by one, so that it is known on which
            attempts = (list(self._parallel(work, {i: task})) for _ in range(_ALONE))
            found = next((attempt for attempt in attempts if attempt), None)
            yield Done(task, *found[0][1]) if found else Done(task, None, _ENDED.format(limit=""))

    def _parallel(self, work: Callable[[T], Any], tasks: dict[int, T]) -> Iterator[tuple[int, tuple[Any, str]]]:
        from joblib import Parallel, delayed
        from joblib.externals.loky.process_executor import BrokenProcessPool, TerminatedWorkerError

        parallel = Parallel(n_jobs=self._jobs if len(tasks) > 1 else 2, return_as="generator_unordered")
        try:
            with _ignoring_ctrl_c():
                running = parallel(delayed(_numbered)(work, i, task) for i, task in list(tasks.items()))
            with closing(running):  # ends the processes where this one is interrupted
                yield from running
        except (BrokenProcessPool, TerminatedWorkerError):
            return


def _numbered(work: Callable[[T], Any], i: int, task: T) -> tuple[int, tuple[Any, str]]:
    return i, _tried(work, task)


def _tried(work: Callable[[T], Any], task: T) -> tuple[Any, str]:
    """Return the result of a task, and why there is none; one task must not end the run of thousands."""
    try:
        return work(task), ""
    except HybridSepError as error:
        return None, str(error)
    except MemoryError as error:
        return None, f"out of memory: {error}"
    except Exception as error:
        return None, first_line(f"unexpected {type(error).__name__}: {error}")


def joblib_engine(jobs: int = 0) -> Engine:
    """Return joblib's processes, as many as there are cores if ``jobs`` is 0."""
    return _Joblib(jobs)


class _Dask(Engine):
    """Workers of a Dask cluster."""

    def __init__(self, client: Any, distributed: Any, words: str, limit: str) -> None:
        self._client, self._distributed = client, distributed
        self.words, self._limit = words, limit
        self._n, self._counted = 0, -_COUNTED

    def run(self, work: Callable[[T], Any], tasks: Iterable[T]) -> Iterator[Done]:
        """Work on all tasks; yield each once, as it is over, in any order."""
        waiting = iter(tasks)
        blamed: deque[T] = deque()
        under_way: dict[Any, T] = {}
        over = self._distributed.as_completed(with_results=False)
        while True:
            while len(under_way) < self._workers() and (task := next(waiting, _NONE)) is not _NONE:
                future = self._client.submit(_tried, work, task, pure=False, retries=0)
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
        future = self._client.submit(_tried, work, task, pure=False, retries=0)
        self._distributed.wait([future])
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
        if error is None or isinstance(error, self._distributed.KilledWorker):
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

    Parameters
    ----------
    workers : int
        Processes of a cluster of this machine, each with its share of the memory.
    scheduler : str
        Address of a running one, such as ``tcp://127.0.0.1:8786``; ``tls://`` with Dask's own settings.

    Raises
    ------
    LogError
        If Dask is not installed.
    ParameterError
        If the scheduler cannot be reached.
    """
    dask = library(scheduler or "--workers", "dask", "fleet", "an engine")
    distributed = library(scheduler or "--workers", "distributed", "fleet", "an engine")
    with dask.config.set(_CONFIG):
        if scheduler:
            try:
                client = distributed.Client(scheduler, timeout=_REACHED)
            except (OSError, ValueError) as error:
                raise ParameterError(f"--scheduler {scheduler} cannot be reached: {first_line(error)}") from error
            with client:
                yield _Dask(client, distributed, f"Dask at {scheduler}", "")
            return
        with _ignoring_ctrl_c():
            started = distributed.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",  # of its own, so that several may run, and for this machine alone
                silence_logs=50,
            )
        with _ending(started), distributed.Client(started) as client:
            limit = min(one["memory_limit"] for one in client.scheduler_info(n_workers=-1)["workers"].values())
            words = f"Dask, {workers} worker{'s' if workers > 1 else ''} of {limit / 2**30:.1f} GB"
            yield _Dask(client, distributed, words, f"; its memory limit is {limit / 2**30:.1f} GB")


def check_engine(workers: int, scheduler: str) -> None:
    """Raise ParameterError if both a cluster to be started and a running one are named."""
    if workers and scheduler:
        raise ParameterError("--workers and --scheduler exclude each other")
