"""Units of a rotary axis's FMU: where a linear axis has metres it has radians, shown in degrees."""

from __future__ import annotations

__all__ = ["angular_unit"]

_ANGULAR = {
    "m": "rad",
    "m2": "rad2",
    "m/s": "rad/s",
    "m/s2": "rad/s2",
    "m/s3": "rad/s3",
    "1/m": "1/rad",
    "mm": "deg",
    "um": "urad",
    "mm/s": "deg/s",
}
"""Unit of a linear axis, or unit in which it is shown → unit of a rotary axis."""


def angular_unit(unit: str | None) -> str | None:
    """Return the unit of a rotary axis for the unit of a linear one; the same if it has no length."""
    return _ANGULAR.get(unit, unit) if unit is not None else None
