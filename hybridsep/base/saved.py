"""Checked access to the fields of a saved state; a checksum can be forged, so every field is validated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from .errors import ParameterError, SignalError, StateError
from .signals import PREDICTION_MAX, Array

__all__ = ["COUNT_MAX", "Saved"]

Value = TypeVar("Value")

COUNT_MAX = 2**53
"""Largest whole number in a state: the last up to which doubles count exactly."""


@dataclass(frozen=True)
class Saved:
    """Content of a blob, from :func:`hybridsep.base.state.unpack`.

    Every method raises StateError if the field is missing, of another type or out of its range.

    Attributes
    ----------
    kind : str
        For messages.
    meta : mapping
        Scalars.
    arrays : mapping
    parts : mapping
        Nested blobs.
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

    def whole(self, name: str, most: int = COUNT_MAX) -> int:
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
        values = self.field(name)
        if type(values) is not list or len(values) != count:
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
