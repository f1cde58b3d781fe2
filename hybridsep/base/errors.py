"""Exception hierarchy of the library: each class below :class:`HybridSepError` says what it is for.

Each message names the thing, what was expected, what came and, where there is one, the way out.
"""

from collections.abc import Callable, Collection
from itertools import islice
from typing import Any

_LINE_MAX = 200  # largest length of another library's message within one of ours, in characters
_LISTED_MAX = 12  # most names or problems that a message lists; more are counted
_IN_WORDS = {"Integral": "a whole number", "Mapping": "a table (dict)", "Callable": "a function", "NoneType": "None"}
_IN_WORDS |= {"Sequence": "a list", "Iterable": "a list", "str": "a text", "PathLike": "a path"}


def brief(value: object) -> str:
    """Return ``repr(value)`` for a message, in at most 80 characters."""
    try:
        text = repr(float(value) if isinstance(value, float) else value)  # NumPy's floats name their type
    except (ValueError, RecursionError):  # an integer of more than 4300 digits; lists in lists in lists
        return f"a value of type {type(value).__name__} that is too long to show"
    return text if len(text) <= 80 else f"{text[:60]}… ({len(text)} characters)"


def listed(values: Collection[object], show: Callable[[object], str] = brief, separator: str = ", ") -> str:
    """Return the first values, each as ``show`` gives it, and how many more there are; ``none`` if there are none."""
    shown = separator.join(map(show, islice(values, _LISTED_MAX))) or "none"
    return shown if len(values) <= _LISTED_MAX else f"{shown} … and {len(values) - _LISTED_MAX} more"


def first_line(error: Exception | str) -> str:
    """Return the first line of another library's message, cut; the error's type where it has none."""
    line = next((line for line in str(error).splitlines() if line.strip()), type(error).__name__)
    return line if len(line) <= _LINE_MAX else f"{line[:_LINE_MAX]}…"


class HybridSepError(Exception):
    """Base class of the library's errors."""


class ParameterError(HybridSepError, ValueError):
    """A parameter is out of its range, or several are inconsistent."""


def check_kind(kind: Any, **given: object) -> None:
    """Raise ParameterError if what is given is of none of the types; a text is no sequence, a truth value no number."""
    kinds = getattr(kind, "__args__", (kind,))
    for name, value in given.items():
        if not isinstance(value, kind) or (type(value) in {str, bytes, bool} - {*kinds}):
            wanted = " or ".join(_IN_WORDS.get(one.__name__, f"of type {one.__name__}") for one in kinds)
            raise ParameterError(f"{name} must be {wanted}, got {brief(value)}")


def check_has(what: str, value: object, *names: str) -> None:
    """Raise ParameterError if an object of the user's own lacks one of the attributes that are needed of it."""
    if lacking := [name for name in names if not hasattr(value, name)]:
        raise ParameterError(f"{what} must have {', '.join(names)}, got {brief(value)} without {', '.join(lacking)}")


class SignalError(HybridSepError, ValueError):
    """Samples cannot be used: NaN or infinite values, a wrong shape or length."""


class LogError(HybridSepError, ValueError):
    """A recorded log cannot be read: a missing column, a bad time axis, an unknown format.

    The command line prints itself with the ``options`` that would put it right, one of them, each with what it means.
    """

    def __init__(self, message: str, options: Collection[tuple[str, str]] = ()) -> None:
        super().__init__(message)
        self.options = tuple(options)


class MachineError(HybridSepError, ValueError):
    """A machine file cannot be read or is inconsistent."""


class ModelError(HybridSepError, ValueError):
    """A linear model is unstable, improper or cannot be written as a sum of modes."""


class IdentificationError(HybridSepError, ValueError):
    """A recording or a frequency response cannot determine a model."""


class StateError(HybridSepError, ValueError):
    """A saved state is foreign, truncated or of another version."""


class FmuError(HybridSepError, RuntimeError):
    """An FMU cannot be built, or a call came that FMI does not allow at this point."""
