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
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np

from .errors import ParameterError, SignalError, StateError
from .signals import PREDICTION_MAX, Array

__all__ = [
    "FIXED",
    "VERSION",
    "Leaf",
    "Saved",
    "arrays_of",
    "bounded",
    "leaves",
    "numbers_of",
    "pack",
    "restored",
    "unpack",
    "unsound",
    "with_numbers",
]

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
        raise StateError(
            f"the saved state has format version {version}, this library reads version {VERSION}: train again"
        )
    if zlib.crc32(blob[: -_CRC.size]) != _CRC.unpack(blob[-_CRC.size :])[0]:
        raise StateError(f"the saved state is truncated or damaged: its {len(blob)} bytes do not fit its checksum")
    body = memoryview(blob)[_PREFIX.size + length : -_CRC.size]
    arrays: dict[str, Array] = {}
    parts: dict[str, bytes] = {}
    offset = 0
    try:
        header = json.loads(blob[_PREFIX.size : _PREFIX.size + length])
        found, meta = header["kind"], header["meta"]
        if type(meta) is not dict or min((n for _, shape in header["arrays"] for n in shape), default=0) < 0:
            raise TypeError("meta must be a table, and no length below 0")
        for name, shape in header["arrays"]:
            count = math.prod(shape)
            arrays[str(name)] = np.frombuffer(body, "<f8", count, offset).reshape(shape).astype(np.float64)
            offset += 8 * count
        for name, count in header["parts"]:
            parts[str(name)] = bytes(body[offset : offset + count])
            offset += count
        if offset != len(body):
            raise ValueError(f"{len(body) - offset} bytes are left over")
    except (ArithmeticError, KeyError, RecursionError, TypeError, ValueError) as error:
        raise StateError(f"the saved state has a header that cannot be read: {error}") from error
    if found != kind:
        raise StateError(f"a saved state of kind {kind!r} was expected, got one of kind {found!r:.40}")
    return meta, arrays, parts


Value = TypeVar("Value")

_COUNT_MAX = 2**53
"""Largest whole number in a state: the last up to which doubles count exactly."""


@dataclass(frozen=True)
class Saved:
    """Content of a blob, from :func:`hybridsep.base.state.unpack`.

    Every method raises StateError if the field is missing, of another type or out of its range. ``kind`` is for
    messages, ``meta`` are scalars, ``parts`` nested blobs.
    """

    kind: str
    meta: Mapping[str, Any]
    arrays: Mapping[str, Array]
    parts: Mapping[str, bytes]

    @contextmanager
    def consistent(self) -> Iterator[None]:
        """Convert ParameterError and SignalError from constructors to StateError."""
        try:
            yield
        except (ParameterError, SignalError) as error:
            raise self.error(str(error)) from error

    def error(self, problem: str) -> StateError:
        """Return a StateError for an inconsistent field."""
        return StateError(f"the saved {self.kind} is inconsistent: {problem}")

    def field(self, name: str) -> Any:
        """Return a scalar of any type, which the caller checks."""
        return self._found(self.meta, name)

    def whole(self, name: str, most: int = _COUNT_MAX) -> int:
        """Return a whole number from 0 to ``most``."""
        value = self.field(name)
        if type(value) is not int or not 0 <= value <= most:
            raise self.error(f"{name} must be a whole number, 0 … {most}")
        return value

    def real(self, name: str) -> float:
        """Return a finite number."""
        value = self.field(name)
        if type(value) not in (int, float) or not abs(value) <= PREDICTION_MAX**2:  # NaN too
            raise self.error(f"{name} must be a finite number")
        return float(value)

    def flag(self, name: str) -> bool:
        """Return a truth value."""
        return self._typed(name, bool, "true or false")

    def text(self, name: str) -> str:
        """Return a text."""
        return self._typed(name, str, "a text")

    def table(self, name: str) -> dict[str, Any]:
        """Return a mapping of names to scalars."""
        return self._typed(name, dict, "a table")

    def array(self, name: str, *shape: int | None, finite: bool = True) -> Array:
        """Return an array of a shape; None stands for any length.

        Its entries are finite and their squares do not overflow, unless ``finite`` is False.
        """
        array = self._found(self.arrays, name)
        fits = array.ndim == len(shape) and all(
            there in (length, None) for there, length in zip(shape, array.shape, strict=True)
        )
        if not fits:
            wanted = " × ".join("any" if length is None else str(length) for length in shape)
            raise self.error(f"{name} must have {wanted} numbers, got {' × '.join(map(str, array.shape)) or 'one'}")
        if finite and array.size and not np.abs(array).max() <= PREDICTION_MAX:
            raise self.error(f"{name} must be finite")
        return array

    def numbers(self, name: str, count: int) -> list[float]:
        """Return a list of finite numbers."""
        values = self._typed(name, list, f"{count} numbers")
        if len(values) != count:
            raise self.error(f"{name} must be {count} numbers")
        return [Saved(self.kind, {name: value}, {}, {}).real(name) for value in values]

    def part(self, name: str) -> bytes:
        """Return a nested blob."""
        return self._found(self.parts, name)

    def number_or_none(self, name: str) -> float | None:
        """Return a finite number, or None."""
        return None if self.field(name) is None else self.real(name)

    def _found(self, fields: Mapping[str, Value], name: str) -> Value:
        if name not in fields:
            raise self.error(f"{name} is missing")
        return fields[name]

    def _typed(self, name: str, kind: type[Value], expected: str) -> Value:
        value = self.field(name)
        if type(value) is not kind:
            raise self.error(f"{name} must be {expected}")
        return value


Record = TypeVar("Record")


class Leaf(NamedTuple):
    """Number or array of a record: its path, ``outer.0.inner``; its value; least and largest entry."""

    path: str
    value: Any
    least: float | Array
    most: float | Array


FIXED: Mapping[str, Any] = {"fixed": True}
"""Metadata of a field that follows from parameters: it is no part of what is saved."""


def bounded(least: float | Array = 0.0, most: float | Array = PREDICTION_MAX) -> dict[str, Any]:
    """Return the metadata of a field whose numbers are in a range, its bounds included; all others are finite."""
    return {"range": (least, most)}


def leaves(record: Any, path: str = "", bounds: tuple[Any, Any] = (-PREDICTION_MAX, PREDICTION_MAX)) -> Iterator[Leaf]:
    """Yield the numbers and arrays of a record in the order of its fields."""
    if is_dataclass(record):
        for one in fields(record):
            if "fixed" not in one.metadata:
                yield from leaves(getattr(record, one.name), f"{path}{one.name}.", one.metadata.get("range", bounds))
    elif isinstance(record, tuple):
        for i, part in enumerate(record):
            yield from leaves(part, f"{path}{i}.", bounds)
    else:
        yield Leaf(path.removesuffix("."), record, *bounds)


def arrays_of(record: Any) -> dict[str, Array]:
    """Return the numbers and arrays by their paths; None is NaN."""
    return {leaf.path: np.asarray(leaf.value, dtype=np.float64) for leaf in leaves(record)}


def numbers_of(record: Any) -> Array:
    """Return all numbers one after the other, ``(n,)``."""
    return np.concatenate([np.ravel(leaf.value) for leaf in leaves(record)])


def with_numbers(like: Record, numbers: Array) -> Record:
    """Return a record of the same shapes with the ``numbers`` of :func:`numbers_of`, which are as many."""
    parts = [leaf.value for leaf in leaves(like)]
    found = np.split(numbers, np.cumsum([np.size(part) for part in parts])[:-1])
    entries = zip(found, parts, strict=True)
    record: Record = _rebuilt(like, (_of_kind(one.reshape(np.shape(part)), part) for one, part in entries))
    return record


def restored(like: Record, saved: Saved) -> Record:
    """Return the record of :func:`arrays_of`.

    ``like`` has the same shapes; what is fixed is taken from it.

    Raises
    ------
    StateError
        If a number is missing, out of its range, or not whole where ``like`` has a whole one.
    """
    found = (_of_kind(saved.array(leaf.path, *np.shape(leaf.value), finite=False), leaf.value) for leaf in leaves(like))
    record: Record = _rebuilt(like, found)
    if (problem := unsound(record)) is not None:
        raise saved.error(problem)
    return record


def unsound(record: Any) -> str | None:
    """Return what is wrong with the numbers of a record; None if all are in range."""
    for path, value, least, most in leaves(record):
        whole = type(value) is int
        if value is None or (whole and 0 <= value <= _COUNT_MAX):
            continue
        if whole or not (np.greater_equal(value, least) & np.less_equal(value, most)).all():  # NaN too
            return f"{path} must be {'a whole number' if whole else 'finite, and'} within its range"
    return None


def _of_kind(array: Array, like: Any) -> Any:
    """Return an array as a value of the same kind and layout in memory, or itself where it cannot be."""
    if isinstance(like, np.ndarray):
        return array > 0.0 if like.dtype == np.bool_ else np.array(array, order="F" if like.flags.fnc else "C")
    found = float(array)
    if like is None:
        return None if np.isnan(found) else found
    if isinstance(like, int):
        return int(found) if found.is_integer() else -1
    return found


def _rebuilt(like: Any, values: Iterator[Any]) -> Any:
    """Return a record whose numbers and arrays are the next ones of ``values``."""
    if is_dataclass(like) and not isinstance(like, type):
        names = [one.name for one in fields(like) if "fixed" not in one.metadata]
        return replace(like, **{name: _rebuilt(getattr(like, name), values) for name in names})
    if isinstance(like, tuple):
        return tuple(_rebuilt(part, values) for part in like)
    return next(values)
