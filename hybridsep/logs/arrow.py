"""Arrow's files and streams, Feather's version 2 among them, read by pyarrow."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from .arrow_columns import ArrowColumnsSource

__all__ = ["ArrowSource"]

_FILE, _STREAM = b"ARROW1", b"\xff\xff\xff\xff"
"""Beginnings of a file, and of a stream: the latter's is the mark of its first message."""


class ArrowSource(ArrowColumnsSource):
    """The columns of an Arrow IPC file or stream, batch by batch."""

    format = "Arrow"
    endings = (".arrow", ".feather", ".arrows", ".ipc")
    article = "an Arrow file"

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it begins as a file or as a stream."""
        return head.startswith((_FILE, _STREAM))

    def _schema(self) -> Any:
        with self._reader() as (reader, _):
            return reader.schema

    def _batches(self, columns: Sequence[str], n: int) -> Iterator[Any]:
        with self._reader() as (_, batches):
            yield from batches

    @contextmanager
    def _reader(self) -> Iterator[tuple[Any, Iterator[Any]]]:
        """Open the file; yield the reader and its batches."""
        ipc = import_module("pyarrow.ipc")
        with self.path.open("rb") as file:
            whole = file.read(len(_FILE)) == _FILE
        with self._arrow.OSFile(str(self.path)) as content:
            if whole:
                with ipc.open_file(content) as reader:
                    yield reader, (reader.get_batch(i) for i in range(reader.num_record_batches))
            else:
                with ipc.open_stream(content) as reader:
                    yield reader, iter(reader)
