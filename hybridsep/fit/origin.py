"""What a fitted FMU says of its origin: logs with their hashes, settings, figures of the fit."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..base.version import __version__
from ..logs.log import Log
from ..machines.machine import Machine

__all__ = ["fit_origin", "sha256_of"]

_BLOCK = 1 << 20


def fit_origin(
    machine: Machine,
    logs: Sequence[Log],
    identification: Mapping[str, Any],
    judged: Mapping[str, Any],
    *,
    share: float,
    changes: Sequence[str] = (),
) -> dict[str, Any]:
    """Return plain values for :func:`hybridsep.fmi.resource_data.resource_data`.

    Parameters
    ----------
    machine : Machine
        With the settings that were chosen.
    logs : sequence of Log
    identification, judged : mapping
        As in ``fit.json``.
    share : float
        Share of each log's samples that were for training.
    changes : sequence of str
        What was done to the logs' positions before.
    """
    return {
        "tool": f"hybridsep {__version__}",
        "log": [
            {"file": log.path.name, "sha256": sha256_of(log.path), "samples": len(log.t), "T_s": log.T_s}
            for log in logs
        ],
        "change": list(changes),
        "machine": {"name": machine.name, "unit": machine.unit},
        "identification": {"structure": identification["structure"], "offset": identification["offset"]},
        "settings": machine.predictor_settings.to_fmi(),
        "trained": {"share": share},
        "judged": {name: "unknown" if value is None else value for name, value in judged.items()},
    }


def sha256_of(path: Path) -> str:
    """Return the hash of a log's file, ``"unknown"`` where it is none that can be read again, as a pipe."""
    found = hashlib.sha256()
    if not path.is_file():
        return "unknown"
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            found.update(block)
    return found.hexdigest()
