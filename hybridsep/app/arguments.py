"""Arguments common to several commands: checks, and names from those of files."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from ..base.errors import ParameterError
from ..logs.log import Log
from ..machines.machine import NAME_PATTERN, Machine

__all__ = ["check_ending", "check_interval", "check_unit", "checked_name", "machine_name"]


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


def check_ending(path: Path | None, option: str, endings: Sequence[str]) -> None:
    """Raise ParameterError if a path, where given, ends in none of the endings."""
    if path is not None and path.suffix.lower() not in endings:
        raise ParameterError(f"{option} must end in {' or '.join(endings)}, got {path.name!r}")


def machine_name(path: Path, axis: str | None = None) -> str:
    """Return a machine's name from that of a log, and of the axis that is read of it."""
    name = re.sub(r"[^A-Za-z0-9]+", "_", f"{path.name.partition('.')[0]} {axis or ''}").strip("_")
    return name if re.match(r"[A-Za-z]", name) else f"axis_{name}".rstrip("_")


def checked_name(name: str) -> str:
    """Return a machine's name; ParameterError if it cannot be one."""
    if re.fullmatch(NAME_PATTERN, name):
        return name
    raise ParameterError(f"--name must be a letter, then letters, digits and _, got {name!r}")
