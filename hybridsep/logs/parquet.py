"""Parquet files, read by pyarrow."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib import import_module
from typing import Any

from .arrow_columns import ArrowColumnsSource

__all__ = ["ParquetSource"]


class ParquetSource(ArrowColumnsSource):
    """The columns of a Parquet file, streamed row group by row group."""

    format = "Parquet"
    endings = (".parquet", ".pq")
    article = "a Parquet file"

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it begins with Parquet's mark."""
        return head.startswith(b"PAR1")

    def _schema(self) -> Any:
        with self._file() as file:
            return file.schema_arrow

    def _batches(self, columns: Sequence[str], n: int) -> Iterator[Any]:
        with self._file() as file:
            yield from file.iter_batches(batch_size=n, columns=list(dict.fromkeys(columns)), use_threads=False)

    def _file(self) -> Any:
        # A column of a row group is then read in pieces, not at once
        return import_module("pyarrow.parquet").ParquetFile(self.path, buffer_size=1 << 20, pre_buffer=False)
