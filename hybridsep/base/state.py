"""Serialisation of states: plain data in a sized, versioned, checksummed blob.

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
_LENGTH_MAX = 2**31 - 1
"""Largest dimension of an array, so that the product with a zero dimension stays a valid shape."""


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
    """Return ``(meta, arrays, parts)`` of a blob made by :func:`pack`.

    Raises
    ------
    StateError
        If the blob is not one, is truncated or damaged, or is of another kind or version.
    """
    if len(blob) < _PREFIX.size + _CRC.size or blob[:4] != MAGIC:
        raise StateError(f"a saved state of kind {kind!r} was expected, got {len(blob)} bytes of another format")
    _, version, length = _PREFIX.unpack_from(blob)
    if version != VERSION:
        raise StateError(f"the saved state has format version {version}, this library reads version {VERSION}")
    if zlib.crc32(blob[: -_CRC.size]) != _CRC.unpack(blob[-_CRC.size :])[0]:
        raise StateError(f"the saved state is truncated or damaged: its {len(blob)} bytes do not fit its checksum")
    body = _PREFIX.size + length
    try:
        header = json.loads(blob[_PREFIX.size : body])
        found, meta = header["kind"], header["meta"]
        if type(meta) is not dict:
            raise TypeError("meta must be a table")
        arrays, parts = _cut(memoryview(blob)[body : -_CRC.size], header)
    except RecursionError:
        raise StateError("the saved state has a header that cannot be read: it is nested too deeply") from None
    except (KeyError, TypeError, ValueError) as error:
        raise StateError(f"the saved state has a header that cannot be read: {error}") from error
    if found != kind:
        raise StateError(f"a saved state of kind {kind!r} was expected, got one of kind {found!r:.40}")
    return meta, arrays, parts


def _cut(body: memoryview, header: Any) -> tuple[dict[str, Array], dict[str, bytes]]:
    """Split the body into arrays and parts, with no byte left over; TypeError or ValueError otherwise."""
    arrays, parts, offset = {}, {}, 0
    for name, shape in header["arrays"]:
        lengths = [_length(n, _LENGTH_MAX) for n in shape]
        count = _length(math.prod(lengths), (len(body) - offset) // 8)
        arrays[str(name)] = np.frombuffer(body, "<f8", count, offset).reshape(lengths).astype(np.float64)
        offset += 8 * count
    for name, count in header["parts"]:
        end = offset + _length(count, len(body) - offset)
        parts[str(name)], offset = bytes(body[offset:end]), end
    if offset != len(body):
        raise ValueError(f"{len(body) - offset} bytes are left over")
    return arrays, parts


def _length(n: Any, most: int) -> int:
    """Return a length from a header, validated."""
    if type(n) is not int or not 0 <= n <= most:
        raise ValueError(f"a length must be a whole number, 0 … {most}")
    return n
