"""Run of the native core on a source: samples in order, rows to the sinks that show or send them."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from hybridsep.cosim.loop import FmuController

from .core import LiveCore, Row
from .first_seconds import FirstSeconds
from .order import Order
from .sample import Sample
from .sources import LiveSource

_PUBLISHED = 0.03  # time between two batches of rows, s: shorter than a frame of the page
_ROWS_MAX = 1000  # most rows of a batch


class Sink(Protocol):
    """What takes rows: a page, a sender."""

    def begin(self, T_s: float, delay: int) -> None:
        """Learn of the first sample: the interval, s, and by how many samples rows are late."""

    def take(self, rows: Sequence[Row], status: Mapping[str, Any]) -> None:
        """Take rows in, and how the run is."""

    def end(self, message: str) -> None:
        """Learn that the run is over, and why where it is an error."""


@dataclass(frozen=True)
class LiveRun:
    """Run that is over."""

    status: Mapping[str, Any]  # counts, RMS errors in m, quantiles of the step time in s, as the sinks got them last
    n_rows: int  # rows that went to the sinks
    interrupted: bool = False  # whether it was ended before its source was


def run_live(
    source: LiveSource,
    controller: FmuController,
    sinks: Sequence[Sink],
    *,
    watch: Callable[[float, int], FirstSeconds] | None = None,
) -> LiveRun:
    """Run an FMU on a source until it ends, or Ctrl-C does.

    ``controller``: of a predictor; it is opened and closed here; ``sinks``: they get every row, and are told of the
    end, by an error too; ``watch``: sampling interval, s, and samples in a window → what checks the first seconds.
    HybridSepError if a sample is refused, or commands are missing.
    """
    with controller:
        run, interrupted = _Run(source, sinks, watch), False
        try:
            for sample in source.samples():
                if sample is not None:
                    run.take(sample, controller)
                run.publish(idle=sample is None)
            run.finish()
        except KeyboardInterrupt:
            interrupted = True
        except BaseException as error:
            run.end(str(error) or type(error).__name__)
            raise
        run.end("")
        return LiveRun(run.status(), run.n_rows, interrupted)


class _Run:
    """State of a run."""

    def __init__(
        self, source: LiveSource, sinks: Sequence[Sink], watch: Callable[[float, int], FirstSeconds] | None
    ) -> None:
        self._source, self._sinks, self._watch = source, sinks, watch
        self._first: FirstSeconds | None = None
        self._core: LiveCore | None = None
        self._order: Order | None = None
        self._rows: list[Row] = []
        self._published = time.monotonic()
        self.n_rows = 0

    def take(self, sample: Sample, controller: FmuController) -> None:
        """Take in a sample."""
        if self._core is None or self._order is None:
            self._core = LiveCore(controller, sample)
            self._order = Order(self._core.T_s)
            self._first = self._watch(self._core.T_s, self._core.Np) if self._watch is not None else None
            for sink in self._sinks:
                sink.begin(self._core.T_s, self._core.delay)
        for ready in self._order.take(sample):
            if self._first is not None:
                self._first.take(ready)
            row = self._core.step(ready)
            if row is not None:
                self._rows.append(row)

    def publish(self, *, idle: bool = False) -> None:
        """Give the rows to the sinks, where it is time."""
        if self._order is not None and idle:
            self._order.check_waiting()
        now = time.monotonic()
        if now - self._published >= _PUBLISHED or len(self._rows) >= _ROWS_MAX:
            self._published = now
            self._send()

    def finish(self) -> None:
        """Take in what is held back at the end of the source."""
        if self._core is not None and self._order is not None:
            self._order.finish()
            self._rows += self._core.finish()

    def end(self, message: str) -> None:
        """Give the last rows to the sinks, and tell them the end."""
        if self._first is not None:
            self._first.finish()
        self._send()
        for sink in self._sinks:
            sink.end(message)

    def status(self) -> dict[str, Any]:
        """Return how the run is."""
        if self._core is None or self._order is None:
            return {}
        times = self._core.times
        return {
            **self._core.status(),
            "n_repeated": self._order.n_repeated,
            "n_late": self._order.n_late,
            "n_malformed": self._source.n_malformed,
            "step_p50": times.quantile(0.5),
            "step_p99": times.quantile(0.99),
            "step_max": times.longest,
        }

    def _send(self) -> None:
        if not self._rows:
            return
        rows, self._rows = self._rows, []
        self.n_rows += len(rows)
        status = self.status()
        for sink in self._sinks:
            sink.take(rows, status)
