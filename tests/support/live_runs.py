"""Sources and sinks of live runs in tests."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from hybridsep.live.core import Row
from hybridsep.live.sample import Sample
from hybridsep.live.source import LiveSource

__all__ = ["Kept", "Listed", "until"]


class Kept:
    """Sink that keeps all it gets."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.status: Mapping[str, Any] = {}
        self.begun: tuple[tuple[str, ...], float, int] | None = None
        self.ends: list[str] = []

    def begin(self, experts: tuple[str, ...], T_s: float, delay: int) -> None:
        self.begun = (experts, T_s, delay)

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


def until(true: Callable[[], object], most: float = 20.0) -> None:
    """Wait until something is true."""
    end = time.monotonic() + most
    while not true():
        assert time.monotonic() < end, "it took too long"
        time.sleep(0.005)
