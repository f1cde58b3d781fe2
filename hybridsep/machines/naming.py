"""Names of machines: from a log's, and checked."""

from __future__ import annotations

import re
from pathlib import Path

from ..base.errors import ParameterError, brief
from .sections import NAME_PATTERN

__all__ = ["checked_name", "machine_name"]


_COMPRESSED = (".gz", ".bz2", ".xz", ".zip")
"""Endings behind that of the format."""


def machine_name(path: Path, axis: str | None = None) -> str:
    """Return a machine's name from the names of a log and of the axis that is read from it."""
    stem = path.with_suffix("") if path.suffix.lower() in _COMPRESSED else path
    name = re.sub(r"[^A-Za-z0-9]+", "_", f"{stem.stem} {axis or ''}").strip("_")
    name = name if re.match(r"[A-Za-z]", name) else f"axis_{name}".rstrip("_")
    if not re.fullmatch(NAME_PATTERN, name):
        raise ParameterError(
            f"an axis's name must have at most 100 letters, the log's gives {brief(name)}; give a --name"
        )
    return name


def checked_name(name: str) -> str:
    """Return a machine's name; ParameterError if it cannot be one."""
    if re.fullmatch(NAME_PATTERN, name):
        return name
    raise ParameterError(f"--name must be a letter, then at most 99 letters, digits and _, got {name!r}")
