"""FMUs built for a command's own use."""

from __future__ import annotations

from pathlib import Path

from ..machines.machine import Machine
from .archive import build_fmu, fmu_name
from .libraries import has_native, ready_targets

__all__ = ["build_here", "build_pair", "default_flavour"]


def default_flavour() -> str:
    """Return the flavour of the demo's FMUs: native where their libraries can be had, Python otherwise."""
    return "native" if has_native() else "python"


def build_here(machine: Machine, model: str, out: Path, flavour: str, *, weights: Path | None = None) -> Path:
    """Build one of a machine's FMUs, for all platforms whose libraries are there."""
    name = fmu_name(model, machine.name, flavour)
    return build_fmu(
        machine, name, out, flavour, targets=ready_targets() if flavour == "native" else None, weights=weights
    )


def build_pair(machine: Machine, out: Path, flavour: str) -> tuple[Path, Path]:
    """Build a machine's predictor and plant FMU."""
    return (
        build_here(machine, "HybridPredictor", out, flavour),
        build_here(machine, "FeedDrive", out, flavour),
    )
