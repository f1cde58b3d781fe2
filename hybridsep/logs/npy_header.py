"""Header of NumPy's ``.npy`` format, read by its own grammar.

NumPy evaluates the header as Python, which fails in any way that Python's parser does, where it is damaged.
"""

from __future__ import annotations

import re
from typing import IO, Any, NamedTuple

import numpy as np

__all__ = ["NpyHeader", "read_npy_header"]

_MAGIC = b"\x93NUMPY"
_LENGTH_BYTES = {1: 2, 2: 4, 3: 4}
"""Bytes of the header's length, by the format's major version."""

_LENGTH_MAX = 10_000
"""Largest length of a header, in bytes, as in NumPy."""

_ENTRY = re.compile(r"""\s*(['"])(\w+)\1\s*:\s*('[^']*'|"[^"]*"|True|False|\([\d\sL,]*\)|\[[^{}]*\])\s*(?:,|$)""")
_TYPE = re.compile(r"[<>|=]?[?biufcmMOSUVa](\d{0,9})(\[\w{1,20}\])?")
_DIGITS_MAX = 18
"""Most digits of a dimension: an array has fewer than 2⁶³ values."""


class NpyHeader(NamedTuple):
    """Shape and type of an array.

    Attributes
    ----------
    shape : tuple of int
    dtype : numpy.dtype
        ``V`` where it is structured.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[Any]


def read_npy_header(stream: IO[bytes]) -> NpyHeader:
    """Read an array's header, up to its values.

    Raises
    ------
    ValueError
        If it is damaged.
    """
    start = stream.read(len(_MAGIC) + 2)
    if start[:6] != _MAGIC or len(start) < 8 or start[6] not in _LENGTH_BYTES:
        raise ValueError("it does not begin as an .npy array of version 1 to 3")
    length = int.from_bytes(stream.read(_LENGTH_BYTES[start[6]]), "little")
    if length > _LENGTH_MAX:
        raise ValueError(f"its header must have at most {_LENGTH_MAX} bytes, got {length}")
    entries = _entries(stream.read(length).decode("latin-1").strip())
    if entries is None or sorted(entries) != ["descr", "fortran_order", "shape"]:
        raise ValueError("its header must hold descr, fortran_order and shape")
    return NpyHeader(_shape(entries["shape"]), _dtype(entries["descr"]))


def _entries(text: str) -> dict[str, str] | None:
    """Return the values of a header's entries as they are written; None if it is damaged."""
    if not (text.startswith("{") and text.endswith("}")):
        return None
    text, place, entries = text[1:-1].strip(), 0, {}
    while place < len(text):
        entry = _ENTRY.match(text, place)
        if entry is None:
            return None
        entries[entry[2]], place = entry[3], entry.end()
    return entries


def _shape(text: str) -> tuple[int, ...]:
    lengths = [length.strip().removesuffix("L") for length in text.strip("()").split(",") if length.strip()]
    if not text.startswith("(") or not all(length.isdigit() and len(length) <= _DIGITS_MAX for length in lengths):
        raise ValueError("its shape is damaged")
    return tuple(map(int, lengths))


def _dtype(text: str) -> np.dtype[Any]:
    if text.startswith("["):
        return np.dtype("V")
    try:
        if _TYPE.fullmatch(text[1:-1]):
            return np.dtype(text[1:-1])
    except (TypeError, ValueError):
        pass
    raise ValueError("its type is damaged")
