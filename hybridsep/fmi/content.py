"""Title, author, date and GUID of an FMU, for both flavours."""

from __future__ import annotations

import hashlib
import json
import os
import uuid
from collections.abc import Mapping
from datetime import datetime, timezone

from ..base.errors import FmuError
from ..base.version import VERSION_DATE
from ..machines.machine import Machine
from ..machines.paper import PAPER_SETTINGS
from .fmu_table import FmuTable

__all__ = ["author", "content_guid", "copyright_notice", "fmu_title", "generation_time", "paper_note"]

_AUTHOR = "the hybridsep authors"
_YEAR = "2026"

_TITLES = {
    "HybridPredictor": "linear hybrid model: predicts the drive's position one look-ahead window early",
    "SepCompensator": "servo error pre-compensation: modifies the command so that the drive follows it",
    "FeedDrive": "nonlinear feed drive with encoder noise",
    "ReferenceTrajectory": "Source of commands: plays the paper's staircase and spirals, or given samples",
}


def fmu_title(machine: Machine, model: str) -> str:
    """Return an FMU's title; ReferenceTrajectory's is the same for every machine."""
    return _TITLES[model] if model == "ReferenceTrajectory" else f"{machine.title}: {_TITLES[model]}"


def paper_note(machine: Machine, model: str) -> str:
    """Return which settings of a predictor are the paper's, of a machine that it has figures for; else nothing."""
    if model != "HybridPredictor" or machine.name not in PAPER_SETTINGS:
        return ""
    settings = ", ".join(f"{name} = {json.dumps(value)}" for name, value in PAPER_SETTINGS[machine.name].items())
    return f"; the paper's settings are {settings}"


def author() -> str:
    """Return the author of the FMUs, as LICENSE names him."""
    return _AUTHOR


def copyright_notice() -> str:
    """Return the line of LICENSE."""
    return f"Copyright (c) {_YEAR}, {_AUTHOR}"


def generation_time() -> str:
    """Return ``generationDateAndTime``: the day of this version, or ``$SOURCE_DATE_EPOCH``, never the clock's.

    Raises
    ------
    FmuError
        If the variable is no number of seconds.
    """
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    if not epoch:
        return f"{VERSION_DATE}T00:00:00Z"
    try:
        return datetime.fromtimestamp(int(epoch), timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
    except (ValueError, OverflowError, OSError):
        raise FmuError(f"SOURCE_DATE_EPOCH must be a number of seconds since 1970, got {epoch!r}; unset it") from None


def content_guid(files: Mapping[str, bytes], table: FmuTable) -> str:
    """Return a GUID that follows from files and table, and from nothing else.

    Parameters
    ----------
    files : mapping
        Archive name → content, without the binaries and reference results made from it.
    table : FmuTable
    """
    digest = hashlib.sha256(json.dumps(table.as_json(), sort_keys=True).encode())
    for arcname in sorted(files):
        digest.update(arcname.encode() + hashlib.sha256(files[arcname]).digest())
    return f"{{{uuid.UUID(bytes=digest.digest()[:16])}}}"
