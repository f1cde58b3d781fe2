"""FMUs built for a command's own use, for this platform alone."""

from __future__ import annotations

from pathlib import Path

from ..fmi.archive import build_fmu, fmu_name
from ..fmi.compiler import can_compile
from ..machines.machine import Machine

__all__ = ["build_for_host", "build_pair", "default_flavour"]


def default_flavour() -> str:
    """Return the flavour of the demo's FMUs: native where there is a C compiler, Python otherwise."""
    return "native" if can_compile() else "python"


def build_for_host(machine: Machine, model: str, out: Path, flavour: str, *, weights: Path | None = None) -> Path:
    """Build one of a machine's FMUs for this platform."""
    name = fmu_name(model, machine.name, flavour)
    return build_fmu(machine, name, out, flavour, targets=("host",), weights=weights)


def build_pair(machine: Machine, out: Path, flavour: str) -> tuple[Path, Path]:
    """Build a machine's predictor and plant FMU."""
    return (
        build_for_host(machine, "HybridPredictor", out, flavour),
        build_for_host(machine, "FeedDrive", out, flavour),
    )
