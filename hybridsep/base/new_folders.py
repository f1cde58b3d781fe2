"""Folders that a command makes for its outputs; those that a refusal leaves empty are removed."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

__all__ = ["make_folder", "remove_empty_folders"]

_made: list[Path] = []
"""Folders that were made, inner ones first."""


def make_folder(folder: Path) -> None:
    """Make a folder and its parents, as far as they do not exist.

    Raises
    ------
    OSError
        If a file has the name of one, or it may not be made.
    """
    new = [one.absolute() for one in (folder, *folder.parents) if not one.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    _made[:0] = new


def remove_empty_folders() -> None:
    """Remove the folders that were made and are empty."""
    for folder in _made:
        with suppress(OSError):
            folder.rmdir()
    _made.clear()
