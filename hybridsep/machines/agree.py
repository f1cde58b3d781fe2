"""Checks of a machine: that a log or a trajectory is its, in sampling interval and unit; that it may be compensated."""

from __future__ import annotations

from ..base.errors import FmuError, ParameterError
from ..logs.log import Log
from .machine import Machine

__all__ = ["check_drive_limits", "check_interval", "check_unit"]


def check_drive_limits(axis: Machine, instead: str) -> None:
    """Raise FmuError if a machine has no limits of its drive, which a compensator needs; ``instead`` needs none."""
    if axis.drive_limits is None:
        raise FmuError(
            f"the compensator needs what the drive allows: [drive_limits] in the machine file of {axis.name}; {instead}"
        )


def check_interval(name: str, T_s: float, axis: Machine) -> None:
    """Raise ParameterError if a file's sampling interval is not the machine's."""
    if abs(T_s - axis.T_s) <= 0.01 * axis.T_s:
        return
    hint = "resample the file or correct T_s"
    for factor, unit in ((1e3, "ms"), (1e6, "µs")):
        if abs(T_s / axis.T_s / factor - 1) < 0.01:
            hint = f"is its time in {unit}? It must be in seconds"
    raise ParameterError(f"{name} is sampled every {T_s:g} s, but machine {axis.name} has T_s = {axis.T_s:g} s; {hint}")


def check_unit(name: str, log: Log, axis: Machine) -> None:
    """Raise ParameterError if a log states lengths for a rotary axis, or angles for a linear one."""
    if log.unit_stated and log.unit != axis.unit:
        raise ParameterError(
            f"{name} is in {log.unit}, but machine {axis.name} has unit = {axis.unit!r}; correct the machine file, or "
            "say the log's unit (--unit)"
        )
