"""MATLAB ``.mat`` files up to version 7, read by SciPy."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

from .arrays import ArraysSource

__all__ = ["MatSource"]

_TYPE_MAX = 4052
"""Largest type of a matrix in a version 4 file, ``1000·machine + 10·precision + kind``."""


class MatSource(ArraysSource):
    """The vectors of a ``.mat`` file of version 4, 5, 6 or 7; in structs they are called ``struct.field``."""

    format = "MATLAB"
    endings = (".mat",)
    library = "SciPy"

    @staticmethod
    def items(file: str) -> Iterator[tuple[str, Any]]:
        """Yield variables, the fields of structs and the parts of complex arrays."""
        from scipy import io

        for name, value in io.loadmat(file).items():
            if not name.startswith("__"):
                yield from _fields(name, value)

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it has the text of version 5, or the five small integers that begin one of version 4."""
        if head.startswith(b"MATLAB 5.0 MAT-file"):
            return True
        for order in "<>" if len(head) >= 20 else "":
            kind, rows, columns, imaginary, length = struct.unpack(f"{order}5I", head[:20])
            plausible = kind <= _TYPE_MAX and rows and columns and imaginary in (0, 1) and 1 < length <= 64
            if plausible and head[19 + length : 20 + length] == b"\0":
                return True
        return False


def _fields(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield a variable, or what is in it if it is a scalar struct."""
    names = getattr(getattr(value, "dtype", None), "names", None)
    if names and value.size == 1:
        for field in names:
            yield from _fields(f"{name}.{field}", value[field].reshape(-1)[0])
    else:
        yield name, value
        if getattr(getattr(value, "dtype", None), "kind", "") == "c":
            yield f"{name}.real", value.real
            yield f"{name}.imag", value.imag
