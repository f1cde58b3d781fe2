"""Log that is replayed as it was recorded, at true or scaled speed."""

from __future__ import annotations

import time
from collections.abc import Iterator

from ..base.errors import ParameterError
from ..logs.log import LogReader
from .sample import Sample
from .source import IDLE, LiveSource

__all__ = ["RecordedSource"]

_PAUSE = 1e-3
"""Time for which a replay sleeps at least, s; samples due meanwhile come together."""


class RecordedSource(LiveSource):
    """Samples of a log.

    Parameters
    ----------
    log : LogReader
    speed : float
        Times the recorded one; 0: as fast as they are taken.

    Raises
    ------
    ParameterError
        If ``speed`` is negative.
    """

    def __init__(self, log: LogReader, speed: float = 1.0) -> None:
        if not 0.0 <= speed <= 1e6:
            raise ParameterError(f"speed must be 0 … 1e6, 0 for as fast as possible, got {speed:g}")
        self.name, self.file_unit = str(log.path), log.file_unit
        self._log, self._speed = log, speed

    def samples(self) -> Iterator[Sample | None]:
        """Yield the samples, each at its time."""
        T_s, k = self._log.T_s, 0
        begun = time.perf_counter()
        for commands, measured in self._log.chunks():
            for x_d, x_meas in zip(commands.tolist(), measured.tolist(), strict=True):
                if self._speed:
                    due = begun + k * T_s / self._speed
                    while (wait := due - time.perf_counter()) > 0.0:
                        time.sleep(min(max(wait, _PAUSE), IDLE))
                        if wait > IDLE:
                            yield None
                yield Sample(x_d, x_meas, k, k * T_s)
                k += 1
