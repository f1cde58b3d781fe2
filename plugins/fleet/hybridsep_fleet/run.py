"""Run of a fleet: what is new or changed is looked at, then fitted; rows are written as they come."""

import datetime
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .engine import Done, Engine
from .results import Results
from .settings import AxisTask, FleetSettings, Looked
from .sources import find_logs

_EVERY = 5.0  # time after which the rows that are there are written, s: as much work as is lost if the run is killed
_MOST = 500  # rows after which they are written

Progress = Callable[[str, float], object]


@dataclass(frozen=True)
class FleetRun:
    """Outcome of a run."""

    # number of logs, and of logs that were not read, as nothing has changed
    n_logs: int
    n_unchanged: int
    rows: list[dict[str, Any]]  # rows that are new

    @property
    def failed(self) -> list[dict[str, Any]]:
        """New rows without figures."""
        return [row for row in self.rows if row["status"] == "failed"]


def run_fleet(
    sources: Sequence[str],
    out: Path,
    settings: FleetSettings,
    engine: Callable[[], AbstractContextManager[Engine]],
    progress: Progress = lambda _message, _done: None,
) -> FleetRun:
    """Fit, or replay, what is new or changed.

    ``out``: folder of the results; ``engine``: starts the engine; called only where there is something to do;
    ``progress``: called with a message and the fraction done. LogError if there are no logs.
    """
    results, key = Results(out), settings.key()
    logs = find_logs(sources)
    todo = results.unfinished(logs, key)
    if not todo:
        return FleetRun(len(logs), len(logs), [])
    from .task import look, work  # imports all that a fit needs

    run = datetime.datetime.now(tz=datetime.timezone.utc).isoformat(timespec="milliseconds")
    before = {row["key"]: row for row in results.rows()}
    rows: list[dict[str, Any]] = []
    with engine() as working, _Written(results) as written:
        say = _Rate(progress, f"{{}} of {len(todo)} logs looked at, {working.words}", len(todo), 0.0, 0.1)
        tasks: list[AxisTask] = []
        for done in say.each(working.run(look, [(log, settings) for log in todo])):
            looked = done.result or Looked(done.task[0], "", ("",))
            made = [AxisTask(looked, axis, settings, key, str(out.absolute()), run) for axis in looked.axes]
            if done.failure:
                rows += written.add(made[0].failed(done.failure))
                continue
            known = [task for task in made if before.get(task.key, {}).get("status") == "done"]
            rows += [row for task in known for row in written.add({**before[task.key], **task.row()})]
            tasks += [task for task in made if task not in known]
        say = _Rate(progress, f"{{}} of {len(tasks)} axes", len(tasks), 0.1, 1.0)
        for done in say.each(working.run(work, tasks)):
            rows += written.add(done.task.failed(done.failure) if done.failure else done.result)
    return FleetRun(len(logs), len(logs) - len(todo), rows)


class _Written:
    """Rows that are written some at once."""

    def __init__(self, results: Results) -> None:
        self._results = results
        self._waiting: list[Mapping[str, Any]] = []
        self._last = time.monotonic()

    def add(self, row: dict[str, Any]) -> list[dict[str, Any]]:
        """Take a row; return it in a list."""
        self._waiting.append(row)
        if len(self._waiting) >= _MOST or time.monotonic() - self._last > _EVERY:
            self._write()
        return [row]

    def _write(self) -> None:
        self._results.add(self._waiting)
        self._waiting, self._last = [], time.monotonic()

    def __enter__(self) -> "_Written":
        return self

    def __exit__(self, *_: object) -> None:
        self._write()


class _Rate:
    """Progress with the rate and the time that is left."""

    def __init__(self, progress: Progress, words: str, n: int, begin: float, end: float) -> None:
        self._progress, self._words, self._n = progress, words, n
        self._from, self._to = begin, end
        self._begun = time.monotonic()

    def each(self, done: Iterator[Done]) -> Iterator[Done]:
        """Iterate over what is done."""
        self._progress(self._words.format(0), self._from)
        for i, one in enumerate(done, 1):
            yield one
            rate = i / max(time.monotonic() - self._begun, 1e-9)
            left = datetime.timedelta(seconds=round((self._n - i) / rate))
            share = self._from + (self._to - self._from) * i / self._n
            self._progress(f"{self._words.format(i)}, {rate:.3g} a second, {left} left", min(share, 0.999))
