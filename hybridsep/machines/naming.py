"""Names of machines: from a log's, and checked."""

from __future__ import annotations

import re
from pathlib import Path

from ..base.errors import ParameterError
from .machine import NAME_PATTERN

__all__ = ["checked_name", "machine_name"]


def machine_name(path: Path, axis: str | None = None) -> str:
    """Return a machine's name from the names of a log and of the axis that is read from it."""
    name = re.sub(r"[^A-Za-z0-9]+", "_", f"{path.name.partition('.')[0]} {axis or ''}").strip("_")
    return name if re.match(r"[A-Za-z]", name) else f"axis_{name}".rstrip("_")


def checked_name(name: str) -> str:
    """Return a machine's name; ParameterError if it cannot be one."""
    if re.fullmatch(NAME_PATTERN, name):
        return name
    raise ParameterError(f"--name must be a letter, then letters, digits and _, got {name!r}")
