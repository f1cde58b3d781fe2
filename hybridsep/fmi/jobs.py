"""FMUs to build: which, and what weights and samples are built into them, checked before any work."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..base.errors import ParameterError
from ..logs.log import check_reading
from ..machines.agree import check_interval
from ..machines.machine import Machine, load_machine, machine_names
from ..plants.trajectory import read_trajectory
from .archive import fmu_names
from .compiler import expanded
from .flavours import FMI_VERSIONS, versions_of
from .fmu import table_of
from .libraries import Library, check_available, default_targets
from .warm_start import load_trained

__all__ = ["Job", "extras_of", "jobs_of", "libraries_of", "without_files"]

Job = tuple[Machine, str, str, str]
"""An FMU to build: its machine, name and model, and the version of FMI."""


def jobs_of(
    fmus: Sequence[str], machines: Sequence[str], flavour: str, targets: Sequence[str], fmi: str = FMI_VERSIONS[0]
) -> list[Job]:
    """Return the FMUs to build, all of the machines' if none is named; ``fmi`` is one of ``FMI_CHOICES``."""
    versions = versions_of(fmi, flavour)
    jobs = [
        (axis, name, model, version)
        for axis in map(load_machine, machines or machine_names())
        for version in versions
        for name, model in fmu_names(axis, flavour, version).items()
    ]
    if unknown := sorted(set(fmus) - {name for _, name, _, _ in jobs}):
        without = dict.fromkeys(axis.name for axis, _, _, _ in jobs if axis.drive_limits is None)
        hint = ""
        if without and any(name.startswith("SepCompensator") for name in unknown):
            hint = f"; {', '.join(without)} has no [drive_limits], which a compensator needs"
        if fmi == FMI_VERSIONS[0] and any("Fmi3" in name for name in unknown):
            hint += "; FMUs of FMI 3.0 need --fmi 3"
        raise ParameterError(
            f"no FMU {', '.join(unknown)}; there are {', '.join(name for _, name, _, _ in jobs)}{hint}"
        )
    if targets and flavour != "native":
        raise ParameterError(f"--target is for native FMUs; with --flavour {flavour} leave it out")
    if flavour == "native":
        check_available(targets or ("host",))
    return [job for job in jobs if not fmus or job[1] in fmus]


def libraries_of(jobs: Sequence[Job], targets: Sequence[str]) -> list[Library]:
    """Return the libraries of native FMUs for some platforms, the default ones if none is named."""
    kinds = dict.fromkeys(table_of(axis, model, name).kind for axis, name, model, _ in jobs)
    return [(kind, target) for target in expanded(targets or default_targets()) for kind in kinds]


def extras_of(
    jobs: Sequence[Job],
    weights: Path | None,
    trajectory: Path | None,
    unit: str | None,
    T_s: float | None,
    *,
    windows: bool = True,
    embed_weights: bool = False,
) -> dict[str, dict[str, Any]]:
    """Return what is special about some of the FMUs: model → keywords of ``build_fmu``.

    Weights, which ``embed_weights`` compiles into the sources, and the samples of a trajectory are for one of them;
    ``windows=False`` for all that have windows.
    """
    extras: dict[str, dict[str, Any]] = {}
    check_reading(unit, T_s)
    if weights is not None:
        axis, model = _one_of(jobs, ("HybridPredictor", "SepCompensator"), "--weights")
        load_trained(weights, axis, model)
        extras[model] = {"weights": weights, **({"embed_weights": True} if embed_weights else {})}
    elif embed_weights:
        raise ParameterError("--embed-weights needs --weights, which are compiled into the sources")
    if trajectory is not None:
        axis, model = _one_of(jobs, ("ReferenceTrajectory",), "--trajectory")
        samples, found = read_trajectory(trajectory, unit=unit, T_s=T_s)
        check_interval(trajectory.name, found, axis)
        extras[model] = {"samples": samples}
    if not windows:
        if not any(model == "HybridPredictor" for _, _, model, _ in jobs):
            names = ", ".join(name for _, name, _, _ in jobs)
            raise ParameterError(f"--no-windows is for a HybridPredictor, this would build {names}; leave it out")
        extras["HybridPredictor"] = {**extras.get("HybridPredictor", {}), "windows": False}
    return extras


def without_files(jobs: Sequence[Job], option: str, *, named: bool) -> list[Job]:
    """Return the FMUs whose sources open no file; ReferenceTrajectory plays files.

    Raises
    ------
    ParameterError
        If there is none, or a ReferenceTrajectory was asked for by name.
    """
    kept = [job for job in jobs if job[2] != "ReferenceTrajectory"]
    if not kept or (named and len(kept) < len(jobs)):
        raise ParameterError(f"{option} is for FMUs that open no files; ReferenceTrajectory plays files, leave it out")
    return kept


def _one_of(jobs: Sequence[Job], models: Sequence[str], option: str) -> tuple[Machine, str]:
    """Return machine and model of the one FMU of these models to which an option applies."""
    found = [job for job in jobs if job[2] in models]
    if len({(axis.name, model) for axis, _, model, _ in found}) != 1:
        names = ", ".join(name for _, name, _, _ in found) or "none"
        raise ParameterError(
            f"{option} is for one {' or '.join(models)}, this would build {names}; name one, or its --machine"
        )
    return found[0][0], found[0][2]
