"""FMUs built for a command's own use."""

from __future__ import annotations

from pathlib import Path

from ..machines.machine import Machine
from .archive import build_fmu, fmu_name
from .flavours import FMI_VERSIONS, versions_of
from .libraries import has_native, ready_targets

__all__ = ["build_here", "build_pair", "default_flavour"]


def default_flavour() -> str:
    """Return the flavour of the demo's FMUs: native where their libraries can be had, Python otherwise."""
    return "native" if has_native() else "python"


def build_here(
    machine: Machine,
    model: str,
    out: Path,
    flavour: str,
    *,
    weights: Path | None = None,
    fmi: str = FMI_VERSIONS[0],
) -> Path:
    """Build one of a machine's FMUs, for all platforms whose libraries are there.

    Parameters
    ----------
    machine, out, flavour, weights
        As in :func:`~hybridsep.fmi.archive.build_fmu`.
    model : str
        ``HybridPredictor``, ``FeedDrive``, …
    fmi : str
        Of :data:`~hybridsep.fmi.flavours.FMI_CHOICES`; of both versions the first one's path is returned.
    """
    targets = ready_targets() if flavour == "native" else None
    paths = [
        build_fmu(
            *(machine, fmu_name(model, machine.name, flavour, version), out, flavour),
            targets=targets,
            weights=weights,
            fmi=version,
        )
        for version in versions_of(fmi, flavour)
    ]
    return paths[0]


def build_pair(machine: Machine, out: Path, flavour: str, fmi: str = FMI_VERSIONS[0]) -> tuple[Path, Path]:
    """Build a machine's predictor and plant FMU; arguments as of :func:`build_here`."""
    return (
        build_here(machine, "HybridPredictor", out, flavour, fmi=fmi),
        build_here(machine, "FeedDrive", out, flavour, fmi=fmi),
    )
