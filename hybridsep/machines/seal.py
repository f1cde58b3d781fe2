"""Seal of a machine file: the command that wrote it and a checksum, by which an edited file is known."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

__all__ = ["edited_since", "is_as_written", "sealed"]

_SEAL = re.compile(r"# Written by (?P<command>hybridsep \w+); checksum (?P<checksum>[0-9a-f]{12})")
"""First line of a machine file that a command wrote."""


def sealed(text: str, command: str) -> str:
    """Return the text of a machine file under a line with the command that writes it and the text's checksum.

    Parameters
    ----------
    text : str
    command : str
        Name after ``hybridsep``.
    """
    return f"# Written by hybridsep {command}; checksum {_checksum(text)}\n{text}"


def _checksum(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _seal_of(path: Path) -> tuple[re.Match[str] | None, str]:
    """Return the seal of a machine file, if it has one, and the text below its first line."""
    first, _, rest = path.read_text(encoding="utf-8").partition("\n")
    return _SEAL.fullmatch(first), rest


def is_as_written(path: Path) -> bool:
    """Return whether a machine file is as a command wrote it."""
    seal, rest = _seal_of(path)
    return seal is not None and seal["checksum"] == _checksum(rest)


def edited_since(path: Path) -> str:
    """Return what has happened to a machine file that a command wrote, in words; empty if no command wrote it."""
    seal, _ = _seal_of(path)
    return f"has been edited since `{seal['command']}` wrote it" if seal else ""
