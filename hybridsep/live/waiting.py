"""Pieces that a thread of a source's own brings, and their end."""

from __future__ import annotations

import queue
from collections.abc import Iterator

from .source import IDLE

__all__ = ["Waiting"]

_MOST = 10_000
"""Most pieces that wait; their thread waits then, or what it serves does."""


class Waiting:
    """Queue of pieces of a stream."""

    def __init__(self) -> None:
        self._queue: queue.Queue[bytes | Exception | None] = queue.Queue(_MOST)

    def put(self, piece: bytes) -> None:
        """Add a piece."""
        self._queue.put(piece)

    def end(self, error: Exception | None = None) -> None:
        """Say that no more will come, or why."""
        self._queue.put(error)

    def pieces(self) -> Iterator[bytes | None]:
        """Yield pieces as they come, None where none has come for a while; raise the error that they end with."""
        while True:
            try:
                piece = self._queue.get(timeout=IDLE)
            except queue.Empty:
                yield None
                continue
            if piece is None:
                return
            if isinstance(piece, Exception):
                raise piece
            yield piece
