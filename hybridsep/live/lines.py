"""CSV lines on standard input, or on any descriptor."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator

from .sample import AS_NAMED, Reading, RowReader, Sample
from .source import LiveSource
from .waiting import Waiting

__all__ = ["LinesSource"]


class LinesSource(LiveSource):
    """CSV lines of a descriptor, the first of which are the names; it ends where the writer closes it.

    Parameters
    ----------
    descriptor : int
        It is read from directly: a thread that waits in a buffered reader could not be left at the end.
    reading : Reading
    """

    name: str = "standard input"

    def __init__(self, descriptor: int, reading: Reading = AS_NAMED) -> None:
        self._descriptor, self._rows, self._waiting = descriptor, RowReader(self.name, reading), Waiting()

    def samples(self) -> Iterator[Sample | None]:
        """Yield samples as they come."""
        threading.Thread(target=self._read, daemon=True).start()
        rest = b""
        for piece in self._waiting.pieces():
            if piece is None:
                yield None
                continue
            *lines, rest = (rest + piece).split(b"\n")
            for line in lines:
                yield from self._rows.samples(line)
        yield from self._rows.samples(rest)

    def _read(self) -> None:
        try:
            while piece := os.read(self._descriptor, 1 << 16):
                self._waiting.put(piece)
        except OSError as error:
            self._waiting.end(error)
        else:
            self._waiting.end()
