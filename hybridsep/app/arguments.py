"""Arguments common to several commands: checks, and names from those of files."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from ..base.errors import ParameterError
from ..machines.machine import NAME_PATTERN

__all__ = ["check_ending", "checked_name", "machine_name"]


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
