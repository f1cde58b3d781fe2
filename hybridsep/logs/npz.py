"""Streaming reader of NumPy ``.npz`` files: each member's header, then its values block by block."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy

from ..base.errors import LogError
from ..base.signals import Array
from .source import Block, Source, check_column, check_lengths, sample_number

__all__ = ["NpzSource"]

_DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, OSError, RuntimeError, ValueError, MemoryError)
"""Exceptions raised by damaged archives."""


class NpzSource(Source):
    """The arrays of an ``.npz`` file, compressed or not."""

    format = "NumPy .npz"
    endings = (".npz",)

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        try:
            with zipfile.ZipFile(path) as archive:
                members = archive.namelist()
        except _DAMAGE as error:
            raise LogError(f"{path}: is truncated, damaged or not an .npz file: {error}") from error
        self.names = [member.removesuffix(".npy") for member in members if member.endswith(".npy")]

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it is a zip archive whose first member is an array, as far as that can be seen."""
        name = head[30 : 30 + int.from_bytes(head[26:28], "little")]
        return head.startswith(b"PK\x03\x04") and name.endswith(b".npy")

    def blocks(self, names: Sequence[str], n: int) -> Iterator[Block]:
        """Iterate over the columns ``names`` in blocks of at most ``n`` samples."""
        with ExitStack() as stack:
            archive = stack.enter_context(zipfile.ZipFile(self.path))
            streams, dtypes, lengths = [], [], {}
            for name in names:
                stream, shape, dtype = self._open(archive, name)
                streams.append(stack.enter_context(stream))
                dtypes.append(dtype)
                lengths[name] = check_column(self.path, name, shape, dtype)
            check_lengths(self.path, lengths)
            total = lengths[names[0]]
            for i in range(0, total, n):
                m = min(n, total - i)
                columns = [self._read(*what, m) for what in zip(names, streams, dtypes, strict=True)]
                yield Block(columns, sample_number(i))

    def _open(self, archive: zipfile.ZipFile, name: str) -> tuple[IO[bytes], tuple[int, ...], np.dtype[Any]]:
        """Open a member and read its header."""
        try:
            stream = archive.open(f"{name}.npy")
            version = npy.read_magic(stream)
            read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
            shape, _, dtype = read_header(stream)
        except _DAMAGE as error:
            raise LogError(f"{self.path}: column {name!r} is truncated or damaged: {error}") from error
        return stream, shape, dtype

    def _read(self, name: str, stream: IO[bytes], dtype: np.dtype[Any], m: int) -> Array:
        """Read the next ``m`` values of a member."""
        try:
            data = stream.read(m * dtype.itemsize)
        except _DAMAGE as error:
            raise LogError(f"{self.path}: column {name!r} is truncated or damaged: {error}") from error
        if len(data) < m * dtype.itemsize:
            raise LogError(
                f"{self.path}: column {name!r} is truncated: {m * dtype.itemsize} more bytes were expected, "
                f"got {len(data)}"
            )
        return np.frombuffer(data, dtype).astype(np.float64)
