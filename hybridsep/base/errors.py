"""Exception hierarchy of the library.

::

    HybridSepError
    ├── ParameterError   a parameter out of its range, or several that are inconsistent
    ├── SignalError      samples that cannot be used: NaN, wrong shape, wrong length
    ├── LogError         a recorded log that cannot be read: columns, time axis, format
    ├── MachineError     a machine file that cannot be read or is inconsistent
    ├── ModelError       a linear model that is unstable, improper or of an unsupported kind
    ├── IdentificationError  a recording or a frequency response that cannot teach a model
    ├── StateError       a saved state that is foreign, truncated or of another version
    └── FmuError         an FMU that cannot be built, or a call that FMI does not allow now

Each message names the thing, what was expected, what came and, where there is one, the way out.
"""

from __future__ import annotations

__all__ = [
    "FmuError",
    "HybridSepError",
    "IdentificationError",
    "LogError",
    "MachineError",
    "ModelError",
    "ParameterError",
    "SignalError",
    "StateError",
    "brief",
]


def brief(value: object) -> str:
    """Return ``repr(value)`` for a message, in at most 80 characters."""
    try:
        text = repr(float(value) if isinstance(value, float) else value)  # NumPy's floats name their type
    except (ValueError, RecursionError):  # an integer of more than 4300 digits; lists in lists in lists
        return f"a value of type {type(value).__name__} that is too long to show"
    return text if len(text) <= 80 else f"{text[:60]}… ({len(text)} characters)"


class HybridSepError(Exception):
    """Base class of the library's errors."""


class ParameterError(HybridSepError, ValueError):
    """A parameter is out of its range, or several are inconsistent."""


class SignalError(HybridSepError, ValueError):
    """Samples cannot be used: NaN or infinite values, a wrong shape or length."""


class LogError(HybridSepError, ValueError):
    """A recorded log cannot be read: a missing column, a bad time axis, an unknown format."""


class MachineError(HybridSepError, ValueError):
    """A machine file cannot be read or is inconsistent."""


class ModelError(HybridSepError, ValueError):
    """A linear model is unstable, improper or cannot be written as a sum of modes."""


class IdentificationError(HybridSepError, ValueError):
    """A recording or a frequency response cannot teach a model."""


class StateError(HybridSepError, ValueError):
    """A saved state is foreign, truncated or of another version."""


class FmuError(HybridSepError, RuntimeError):
    """An FMU cannot be built, or a call came that FMI does not allow at this point."""
