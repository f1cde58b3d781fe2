"""What both flavours say about an FMU: what its models are, and the GUID that follows from its content."""

from __future__ import annotations

import hashlib
import json
import uuid
from collections.abc import Mapping

from ..machine import Machine

__all__ = ["content_guid", "fmu_title"]

_TITLES = {
    "HybridPredictor": "linear hybrid model: predicts the drive's position one look-ahead window early",
    "SepCompensator": "servo error pre-compensation: modifies the command so that the drive follows it",
    "FeedDrive": "nonlinear feed drive with encoder noise",
    "ReferenceTrajectory": "Source of commands: plays the paper's staircase and spirals, or given samples",
}


def fmu_title(machine: Machine, model: str) -> str:
    """Return what an FMU is, in one phrase; ReferenceTrajectory is the same for every machine."""
    return _TITLES[model] if model == "ReferenceTrajectory" else f"{machine.title}: {_TITLES[model]}"


def content_guid(files: Mapping[str, bytes], description: Mapping[str, object]) -> str:
    """Return a GUID that follows from files and description, and from nothing else.

    Parameters
    ----------
    files : mapping
        Archive name → content; what is made from the others, binaries and reference results, stays out.
    description : mapping
        What the FMU is made from.
    """
    digest = hashlib.sha256(json.dumps(description, sort_keys=True).encode())
    for arcname in sorted(files):
        digest.update(arcname.encode() + hashlib.sha256(files[arcname]).digest())
    return f"{{{uuid.UUID(bytes=digest.digest()[:16])}}}"
