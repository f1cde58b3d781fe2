"""Records: frozen dataclasses of numbers, arrays, tuples and records, saved and restored as they are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np

from .saved import COUNT_MAX, Saved
from .signals import PREDICTION_MAX, Array

__all__ = ["FIXED", "Leaf", "arrays_of", "bounded", "leaves", "numbers_of", "restored", "unsound", "with_numbers"]

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

    Parameters
    ----------
    like : dataclass
        Record with the same shapes; what is fixed is taken from it.
    saved : Saved

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
        if value is None or (whole and 0 <= value <= COUNT_MAX):
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
