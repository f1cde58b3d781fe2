"""Location of FMU sources and machine files: beside the package in a checkout, inside it in a wheel."""

from __future__ import annotations

from pathlib import Path

__all__ = ["COMMANDS", "DEFAULT_MACHINE", "data_folder"]

DEFAULT_MACHINE = "spring_mass_damper"
"""Machine file of the paper's staircase; its FMUs have no suffix."""

COMMANDS = "commands.csv"
"""File that ``hybridsep fit`` writes beside a machine file: commands of the log to try with."""

_PACKAGE = Path(__file__).resolve().parents[1]


def data_folder(name: str) -> Path:
    """Return the folder ``fmu_src/…`` or ``models`` of this installation."""
    installed = _PACKAGE / "_data" / name
    return installed if installed.is_dir() else _PACKAGE.parent / name
