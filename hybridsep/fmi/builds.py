"""FMUs built for a command's own use."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..machines.machine import Machine
from .archive import build_fmu, fmu_name
from .compiler import ALL_TARGETS, expanded
from .flavours import FMI_VERSIONS, versions_of
from .libraries import default_targets, has_native

__all__ = ["build_here", "build_pair", "default_flavour", "other_platforms"]


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
    origin: Mapping[str, Any] | None = None,
) -> Path:
    """Build one of a machine's FMUs, for this machine, or for all platforms where their libraries are there.

    Parameters
    ----------
    machine, out, flavour, weights, origin
        As in :func:`~hybridsep.fmi.archive.build_fmu`.
    model : str
        ``HybridPredictor``, ``FeedDrive``, …
    fmi : str
        Of :data:`~hybridsep.fmi.flavours.FMI_CHOICES`; of both versions the first one's path is returned.
    """
    paths = [
        build_fmu(
            *(machine, fmu_name(model, machine.name, flavour, version), out, flavour),
            weights=weights,
            fmi=version,
            origin=origin,
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


def other_platforms(fmu: Path, machine: Path, weights: Path | None = None, fmi: str = FMI_VERSIONS[0]) -> str:
    """Return which platforms a native FMU was built for here and the line that builds it for all; empty if it was.

    Parameters
    ----------
    fmu, machine, weights : Path
        The archive, its machine file, and what it has learned.
    fmi : str
        As in :func:`build_here`.
    """
    targets = expanded(default_targets())
    if set(targets) == set(ALL_TARGETS):
        return ""
    line: list[object] = ["hybridsep", "build", fmu.stem, "--target", "all", "-m", machine]
    line += [] if weights is None else ["--weights", weights]
    line += ["--fmi", fmi] if fmi in FMI_VERSIONS[1:] else []
    line += ["--out", fmu.parent]
    return f"native FMUs are for {', '.join(targets)}; for all platforms: {shlex.join(map(str, line))}"
