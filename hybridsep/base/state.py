"""Serialisation of states: plain data in a sized, versioned, checksummed blob.

Layout, little-endian: magic ``HSEP``, u32 format version, u32 header length, header (JSON: kind, meta, array names
and shapes), the arrays as float64, the parts, u32 CRC-32 of all before. The same state always gives the same
bytes. What the checksum, the kind, the version and the shapes let pass is taken for a state of this library's.
"""

import json
import math
import struct
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

import numpy as np

from .errors import SignalError, StateError, check_kind
from .signals import Array

_MAGIC = b"HSEP"
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
    blob = _PREFIX.pack(_MAGIC, VERSION, len(text)) + text + body
    return blob + _CRC.pack(zlib.crc32(blob))


def unpack(kind: str, blob: bytes | bytearray) -> tuple[dict[str, Any], dict[str, Array], dict[str, bytes]]:
    """Return ``(meta, arrays, parts)`` of a blob made by :func:`pack`.

    StateError if the blob is not one, is truncated or damaged, or is of another kind or version.
    """
    check_kind(bytes | bytearray, blob=blob)
    if len(blob) < _PREFIX.size + _CRC.size or blob[:4] != _MAGIC:
        raise StateError(f"a saved state of kind {kind!r} was expected, got {len(blob)} bytes of another format")
    _, version, length = _PREFIX.unpack_from(blob)
    if version != VERSION:
        raise StateError(f"the saved state has format version {version}, this library reads {VERSION}: train again")
    if zlib.crc32(blob[: -_CRC.size]) != _CRC.unpack(blob[-_CRC.size :])[0]:
        raise StateError(f"the saved state is truncated or damaged: its {len(blob)} bytes do not fit its checksum")
    header, offset = json.loads(blob[_PREFIX.size : _PREFIX.size + length]), _PREFIX.size + length
    if header["kind"] != kind:
        raise StateError(f"a saved state of kind {kind!r} was expected, got one of kind {header['kind']!r}")
    arrays: dict[str, Array] = {}
    parts: dict[str, bytes] = {}
    for name, shape in header["arrays"]:
        count = math.prod(shape)
        arrays[name] = np.frombuffer(blob, "<f8", count, offset).reshape(shape).astype(np.float64)
        offset += 8 * count
    for name, count in header["parts"]:
        parts[name] = bytes(blob[offset : offset + count])
        offset += count
    return header["meta"], arrays, parts


@contextmanager
def restoring(kind: str) -> Iterator[None]:
    """Convert what goes wrong with the content of a blob of a kind to StateError: another build has saved it."""
    try:
        yield
    except StateError:
        raise
    except (ArithmeticError, AttributeError, LookupError, SignalError, TypeError, ValueError) as error:
        raise StateError(f"the saved {kind} is of another build of the library, train again: {error}") from error


_Record = TypeVar("_Record")

FIXED: Mapping[str, Any] = {"fixed": True}  # metadata of a field that follows from parameters: it is not saved


def _leaves(record: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield path, ``outer.0.inner``, and value of a record's numbers and arrays in the order of its fields."""
    if is_dataclass(record):
        for one in fields(record):
            if "fixed" not in one.metadata:
                yield from _leaves(getattr(record, one.name), f"{path}{one.name}.")
    elif isinstance(record, tuple):
        for i, part in enumerate(record):
            yield from _leaves(part, f"{path}{i}.")
    else:
        yield path.removesuffix("."), record


def arrays_of(record: Any) -> dict[str, Array]:
    """Return the numbers and arrays by their paths; None is NaN."""
    return {path: np.asarray(value, dtype=np.float64) for path, value in _leaves(record)}


def numbers_of(record: Any) -> Array:
    """Return all numbers one after the other, ``(n,)``."""
    return np.concatenate([np.ravel(value) for _, value in _leaves(record)])


def with_numbers(like: _Record, numbers: Array) -> _Record:
    """Return a record of the same shapes with the ``numbers`` of :func:`numbers_of`, which are as many."""
    parts = [value for _, value in _leaves(like)]
    found = np.split(numbers, np.cumsum([np.size(part) for part in parts])[:-1])
    record: _Record = _rebuilt(like, (one.reshape(np.shape(part)) for one, part in zip(found, parts, strict=True)))
    return record


def restored(like: _Record, arrays: Mapping[str, Array]) -> _Record:
    """Return the record of :func:`arrays_of`.

    ``like`` has the same shapes; what is fixed is taken from it.

    LookupError, ValueError if an array is missing or has another shape.
    """
    for path, value in _leaves(like):
        if arrays[path].shape != np.shape(value):
            raise ValueError(f"{path} must have the shape {np.shape(value)}, got {arrays[path].shape}")
    record: _Record = _rebuilt(like, (arrays[path] for path, _ in _leaves(like)))
    return record


def _rebuilt(like: Any, values: Iterator[Array]) -> Any:
    """Return a record whose numbers and arrays are the next ones of ``values``, of the same kind."""
    if is_dataclass(like) and not isinstance(like, type):
        names = [one.name for one in fields(like) if "fixed" not in one.metadata]
        return replace(like, **{name: _rebuilt(getattr(like, name), values) for name in names})
    if isinstance(like, tuple):
        return tuple(_rebuilt(part, values) for part in like)
    found = next(values)
    if isinstance(like, np.ndarray):
        return found > 0.0 if like.dtype == np.bool_ else np.array(found, order="F" if like.flags.fnc else "C")
    return type(like)(found) if like is not None else None if np.isnan(found) else float(found)
