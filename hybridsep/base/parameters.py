"""Declaration of a parameter: type, range, unit, default and description, and the check of a value."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .errors import ParameterError, brief


@dataclass(frozen=True)
class Parameter:
    """One scalar parameter."""

    kind: type  # ``int``, ``float``, ``bool``, or ``str`` for one of ``choices``
    default: Any  # value where none is given
    minimum: float  # closed bounds, maximum too, of the value in the FMU
    maximum: float
    unit: str  # SI unit in FMI's notation; ``"1"`` for a number
    description: str  # one line
    name: str = ""  # name in the FMU and in messages
    display_unit: str | None = None  # unit in which tools show it
    nonzero: float = 0.0  # smallest non-zero magnitude, where 0 turns a feature off; 0 if there is none
    automatic: float | None = None  # value out of the range that stands for an automatic choice
    choices: tuple[str, ...] = ()  # items in the order of their values in the FMU, where it is an Enumeration
    meanings: tuple[str, ...] = ()  # what each item means, in the same order
    # whether weights learned with one value are invalid for another: it shapes the features or the factor
    learned: bool = False
    tunable: bool = False  # whether it may change in a run

    @property
    def range_text(self) -> str:
        """Allowed range as text, for example ``"1 … 10000"``."""
        if self.choices:
            return " or ".join(self.choices)
        least = f"0 or {self.nonzero:g}" if self.nonzero else f"{self.minimum:g}"
        if self.automatic is not None:
            least = f"{self.automatic:g} (automatic) or {least}"
        return f"{least} … {self.maximum:.10g}"

    @property
    def help(self) -> str:
        """Description, unit and range on one line."""
        unit = "" if self.unit == "1" else f" [{self.unit}]"
        return f"{self.description}{unit}" + ("" if self.kind is bool else f", {self.range_text}")

    def checked(self, value: Any, label: str | None = None) -> Any:
        """Return a value, of a choice its name, in the parameter's type; ``label`` is its name in the message.

        ParameterError if the value is of another type, not finite, or out of range.
        """
        shown = label or self.name
        if self.kind is str:
            if not isinstance(value, str) or value not in self.choices:
                raise ParameterError(f"{shown} must be one of {', '.join(self.choices)}, got {brief(value)}")
            return value
        if self.kind is bool:
            if not isinstance(value, (bool, int, float)) or value not in (0, 1):
                raise ParameterError(f"{shown} must be true or false, got {brief(value)}")
            return bool(value)
        number = finite(value, shown)
        if self.kind is int and number != int(number):
            raise ParameterError(f"{shown} must be a whole number, got {brief(value)}")
        in_range = self.minimum <= number <= self.maximum and not 0 < abs(number) < self.nonzero
        if not in_range and number != self.automatic:
            unit = "" if self.unit == "1" else f" {self.unit}"
            raise ParameterError(f"{shown} must be {self.range_text}{unit}, got {brief(value)}")
        return self.kind(number)

    def to_fmi(self, value: Any) -> Any:
        """Return the value of its variable in an FMU."""
        return self.choices.index(value) if self.choices else value

    def from_fmi(self, value: Any) -> Any:
        """Return the parameter's value from an FMU variable's value; ParameterError if there is none."""
        if not self.choices:
            return value
        number = finite(value, self.name)
        if number not in range(len(self.choices)):
            raise ParameterError(f"{self.name} must be 0 … {len(self.choices) - 1}, got {brief(value)}")
        return self.choices[int(number)]


def finite(value: Any, shown: str, *, above: float = -math.inf, least: float = -math.inf) -> float:
    """Return a number, finite, ``> above`` and ``≥ least``; ParameterError, with the name ``shown``, if it is none."""
    try:
        if isinstance(value, (bool, str, bytes)):
            raise TypeError
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise ParameterError(f"{shown} must be a number, got {brief(value)}") from None
    if not math.isfinite(number):
        raise ParameterError(f"{shown} must be finite, got {brief(value)}")
    if not (number > above and number >= least):
        raise ParameterError(f"{shown} must be {f'≥ {least:g}' if number > above else f'> {above:g}'}, got {number:g}")
    return number


_ANGULAR = {"m": "rad", "m2": "rad2", "m/s": "rad/s", "m/s2": "rad/s2", "m/s3": "rad/s3", "1/m": "1/rad"}
_ANGULAR |= {"mm": "deg", "um": "urad", "mm/s": "deg/s"}
"""Unit of a linear axis, or unit in which it is shown → unit of a rotary axis."""


def angular_unit(unit: str | None) -> str | None:
    """Return the unit of a rotary axis for the unit of a linear one; the same if it has no length."""
    return _ANGULAR.get(unit, unit) if unit is not None else None


def whole(default: int | None, minimum: int, maximum: int, description: str, **more: Any) -> Any:
    """Declare a whole number as a field of settings; ``more`` are attributes of :class:`Parameter`."""
    return _declared(int, default, minimum, maximum, "1", description, **more)


def real(default: float | None, minimum: float, maximum: float, unit: str, description: str, **more: Any) -> Any:
    """Declare a real number as a field of settings."""
    return _declared(float, default, minimum, maximum, unit, description, **more)


def flag(default: bool, description: str, **more: Any) -> Any:
    """Declare a truth value as a field of settings."""
    return _declared(bool, default, 0, 1, "1", description, **more)


def choice(default: str, choices: Mapping[str, str], description: str, **more: Any) -> Any:
    """Declare one of several names as a field of settings; ``choices`` says what each means."""
    more |= {"choices": tuple(choices), "meanings": tuple(choices.values())}
    return _declared(str, default, 0, len(choices) - 1, "1", description, **more)


def _declared(kind: type, default: Any, *more: Any, unless_given: Any = ..., **named: Any) -> Any:
    """Return a dataclass field; ``unless_given`` is the library's default where it is not the FMU's."""
    parameter = Parameter(kind, default, *more, **named)
    return field(default=default if unless_given is ... else unless_given, metadata={"parameter": parameter})
