"""Exceptions of Python's zipfile for damaged archives."""

from __future__ import annotations

import lzma
import struct
import zipfile
import zlib

__all__ = ["ZIP_DAMAGE"]

ZIP_DAMAGE = (
    *(zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error, EOFError, OSError),
    *(RuntimeError, ValueError, LookupError, OverflowError, MemoryError),
)
"""Exceptions of a damaged or encrypted archive, from opening it to the last byte of a member."""
