"""Ranges of a parameter's values, written as text."""

from __future__ import annotations

import math
from typing import Any

from .errors import ParameterError, brief
from .parameters import Parameter

__all__ = ["GRAMMAR", "parse_range"]

GRAMMAR = "5,10,50 or 5:100:5 (steps) or 1e-14:1e-6:x10 (factors)"
"""How ranges are written, by examples."""

_VALUES_MAX = 10_000
"""Values beyond which a range is a slip of the pen."""


def parse_range(text: str, parameter: Parameter) -> tuple[Any, ...]:
    """Return the values that a range written as in :data:`GRAMMAR` has, ascending.

    Raises
    ------
    ParameterError
        If it is not written so, or a value is out of the parameter's range; the message names the option.
    """
    option = f"--{parameter.name}"
    found: set[float] = set()
    for part in text.split(","):
        for value in _values(part.strip(), option, whole=parameter.kind is int):
            found.add(parameter.checked(int(value) if value.is_integer() else value, option))
    return tuple(sorted(found))


def _values(part: str, option: str, *, whole: bool) -> list[float]:
    """Return the values of a part between commas: one, or all of a range."""
    fields = part.split(":")
    if len(fields) == 1:
        return [_number(part, part, option)]
    if len(fields) == 2 and whole:
        fields.append("1")
    if len(fields) != 3:
        raise ParameterError(f"{option} must be a value or a range such as {GRAMMAR}, got {brief(part)}")
    begin, end = (_number(field, part, option) for field in fields[:2])
    geometric = fields[2].startswith("x")
    step = _number(fields[2].removeprefix("x"), part, option)
    if end < begin:
        raise ParameterError(f"{option} must have ranges that ascend, got {part}")
    if geometric and not (begin > 0.0 and step > 1.0):
        raise ParameterError(f"{option} must have factors above 1 and begin above 0, got {part}")
    if not geometric and step <= 0.0:
        raise ParameterError(f"{option} must have steps above 0, got {part}")
    steps = math.log(end / begin) / math.log(step) if geometric else (end - begin) / step
    if not steps < _VALUES_MAX:
        raise ParameterError(f"{option} must have at most {_VALUES_MAX} values, got {part}")
    n = math.floor(steps + 1e-9) + 1
    values = (begin * step**i if geometric else begin + i * step for i in range(n))
    return [float(f"{value:.12g}") for value in values]


def _number(text: str, part: str, option: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ParameterError(f"{option} must be a value or a range such as {GRAMMAR}, got {brief(part)}")
    return number
