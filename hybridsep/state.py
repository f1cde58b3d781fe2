"""Saved states: plain data in a sized, versioned, checked blob.

Layout, little-endian: magic ``HSEP``, u32 format version, u32 header length, header (JSON: kind, meta, array names
and shapes), the arrays as float64, the parts, u32 CRC-32 of all before. The same state always gives the same
bytes.
"""

from __future__ import annotations

import json
import math
import struct
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from .errors import StateError
from .signals import Array

__all__ = ["VERSION", "pack", "unpack"]

MAGIC = b"HSEP"
VERSION = 1
_PREFIX = struct.Struct("<4sII")
_CRC = struct.Struct("<I")


def pack(
    kind: str, meta: Mapping[str, Any], arrays: Mapping[str, Array], parts: Mapping[str, bytes] | None = None
) -> bytes:
    """Return a blob of the given kind with scalars ``meta``, float64 ``arrays`` and the blobs of its ``parts``."""
    header = {
        "kind": kind,
        "meta": dict(meta),
        "arrays": [[name, list(a.shape)] for name, a in arrays.items()],
        "parts": [[name, len(part)] for name, part in (parts or {}).items()],
    }
    text = json.dumps(header, separators=(",", ":"), sort_keys=True).encode()
    body = b"".join(np.ascontiguousarray(array, dtype="<f8").tobytes() for array in arrays.values())
    body += b"".join((parts or {}).values())
    blob = _PREFIX.pack(MAGIC, VERSION, len(text)) + text + body
    return blob + _CRC.pack(zlib.crc32(blob))


def unpack(kind: str, blob: bytes) -> tuple[dict[str, Any], dict[str, Array], dict[str, bytes]]:
    """Return ``(meta, arrays, parts)`` of a blob that :func:`pack` made.

    Raises
    ------
    StateError
        If the blob is not one, is truncated or damaged, or is of another kind or version.
    """
    if len(blob) < _PREFIX.size + _CRC.size or blob[:4] != MAGIC:
        raise StateError(f"a saved state of kind {kind!r} was expected, got {len(blob)} bytes of something else")
    _, version, length = _PREFIX.unpack_from(blob)
    if version != VERSION:
        raise StateError(f"the saved state has format version {version}, this library reads version {VERSION}")
    if zlib.crc32(blob[: -_CRC.size]) != _CRC.unpack(blob[-_CRC.size :])[0]:
        raise StateError(f"the saved state is truncated or damaged: its {len(blob)} bytes do not fit its checksum")
    try:
        header = json.loads(blob[_PREFIX.size : _PREFIX.size + length])
        found, meta = header["kind"], header["meta"]
        arrays, parts, offset = {}, {}, _PREFIX.size + length
        for name, shape in header["arrays"]:
            count = math.prod(shape)
            arrays[name] = np.frombuffer(blob, "<f8", count, offset).reshape(shape).astype(np.float64)
            offset += 8 * count
        for name, count in header["parts"]:
            parts[name] = blob[offset : offset + count]
            offset += count
    except (KeyError, TypeError, ValueError) as error:
        raise StateError(f"the saved state has a header that cannot be read: {error}") from error
    if found != kind:
        raise StateError(f"a saved state of kind {kind!r} was expected, got one of kind {found!r}")
    return meta, arrays, parts
