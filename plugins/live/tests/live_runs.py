"""Sources and sinks of live runs in tests."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from hybridsep_live.core import Row
from hybridsep_live.sample import Sample
from hybridsep_live.sources import LiveSource


class Kept:
    """Sink that keeps all it gets."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.status: Mapping[str, Any] = {}
        self.begun: tuple[float, int] | None = None
        self.ends: list[str] = []

    def begin(self, T_s: float, delay: int) -> None:
        self.begun = (T_s, delay)

    def take(self, rows: Sequence[Row], status: Mapping[str, Any]) -> None:
        self.rows += rows
        self.status = status

    def end(self, message: str) -> None:
        self.ends.append(message)


class Listed(LiveSource):
    """Source of given samples."""

    name = "a list"

    def __init__(self, samples: Sequence[Sample | None]) -> None:
        self._samples = samples

    def samples(self) -> Iterator[Sample | None]:
        yield from self._samples
