"""Streaming reader of NumPy ``.npz`` files: each member's header, then its values block by block."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any

import numpy as np

from ..base.errors import LogError, brief, first_line
from ..base.signals import Array
from ..base.zip_files import ZIP_DAMAGE
from .npy_header import NpyHeader, read_npy_header
from .source import Block, Source, check_column, check_lengths, sample_number

__all__ = ["NpzSource"]


class NpzSource(Source):
    """The arrays of an ``.npz`` file, compressed or not."""

    format = "NumPy .npz"
    endings = (".npz",)

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with self._archive() as archive:
            members = archive.namelist()
        self.names = [member.removesuffix(".npy") for member in members if member.endswith(".npy")]

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it is a zip archive whose first member is an array, as far as that can be seen."""
        name = head[30 : 30 + int.from_bytes(head[26:28], "little")]
        return head.startswith(b"PK\x03\x04") and name.endswith(b".npy")

    def blocks(self, names: Sequence[str], n: int) -> Iterator[Block]:
        """Iterate over the columns ``names`` in blocks of at most ``n`` samples."""
        with ExitStack() as stack:
            archive = stack.enter_context(self._archive())
            streams, dtypes, lengths = [], [], {}
            for name in names:
                streams.append(stack.enter_context(self._open(archive, name)))
                shape, dtype = self._header(streams[-1], name)
                dtypes.append(dtype)
                lengths[name] = check_column(self.path, name, shape, dtype)
            check_lengths(self.path, lengths)
            total = lengths[names[0]]
            for i in range(0, total, n):
                m = min(n, total - i)
                columns = [self._read(*what, m) for what in zip(names, streams, dtypes, strict=True)]
                yield Block(columns, sample_number(i))

    def _archive(self) -> zipfile.ZipFile:
        try:
            return zipfile.ZipFile(self.path)
        except ZIP_DAMAGE as error:
            raise LogError(f"{self.path}: is truncated, damaged or not an .npz file: {first_line(error)}") from error

    def _open(self, archive: zipfile.ZipFile, name: str) -> IO[bytes]:
        """Open a member."""
        try:
            return archive.open(f"{name}.npy")
        except ZIP_DAMAGE as error:
            raise self._damaged(name, error) from error

    def _header(self, stream: IO[bytes], name: str) -> NpyHeader:
        """Read a member's header."""
        try:
            return read_npy_header(stream)
        except ZIP_DAMAGE as error:
            raise self._damaged(name, error) from error

    def _read(self, name: str, stream: IO[bytes], dtype: np.dtype[Any], m: int) -> Array:
        """Read the next ``m`` values of a member."""
        try:
            data = stream.read(m * dtype.itemsize)
        except ZIP_DAMAGE as error:
            raise self._damaged(name, error) from error
        if len(data) < m * dtype.itemsize:
            raise LogError(
                f"{self.path}: column {brief(name)} is truncated: {m * dtype.itemsize} more bytes were expected, "
                f"got {len(data)}"
            )
        return np.frombuffer(data, dtype).astype(np.float64)

    def _damaged(self, name: str, error: Exception) -> LogError:
        return LogError(f"{self.path}: column {brief(name)} is truncated or damaged: {first_line(error)}")
