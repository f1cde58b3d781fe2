"""A whole system as one file (SSP): trajectory, look-ahead and drive of a machine, wired, with their parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from numpy.typing import ArrayLike

from ..base.errors import FmuError
from ..base.output import written_whole
from ..base.signals import as_samples
from ..fmi import native_flavour
from ..machines.machine import Machine
from .archive import archived, fmu_name
from .flavours import FMI_VERSIONS
from .fmi3_variables import fmi3_variables
from .fmu import Fmu
from .system_structure import SSP_VERSIONS, Component, Connection, parameter_set, system_structure
from .variables import Variable
from .warm_start import load_trained

__all__ = ["build_system", "check_system"]


def check_system(machine: Machine, *, compensate: str | None, ssp: str = SSP_VERSIONS[0]) -> None:
    """Check the version of SSP, and that a machine has a plant and, to compensate, drive limits; FmuError if not."""
    if ssp not in SSP_VERSIONS:
        raise FmuError(f"the version of SSP must be one of {', '.join(SSP_VERSIONS)}, got {ssp!r}")
    if machine.plant is None:
        raise FmuError(f"machine {machine.name} has no [plant] section, which a system needs for its drive")
    if compensate is not None and machine.drive_limits is None:
        raise FmuError(f"machine {machine.name} has no [drive_limits], which a compensator must keep; add them")


def build_system(
    machine: Machine,
    path: str | Path,
    command: ArrayLike,
    *,
    compensate: str | None = None,
    targets: Sequence[str] | None = None,
    weights: str | Path | None = None,
    ssp: str = SSP_VERSIONS[0],
    progress: Callable[[str, float], object] = lambda _message, _fraction: None,
) -> Path:
    """Write a system of three native FMUs as an SSP archive.

    Parameters
    ----------
    machine : Machine
        With a plant.
    path : str or Path
        The archive.
    command : (n,) array_like, m
        Commanded positions at the machine's ``T_s``, which the system's ReferenceTrajectory plays; all FMUs start at
        the first of them.
    compensate : {"off", "physics", "hybrid"}, optional
        Best model with which a SepCompensator modifies the command; if left out a HybridPredictor only predicts.
    targets, weights
        As in :func:`hybridsep.fmi.archive.build_fmu`, for the look-ahead.
    ssp : {"1", "2"}
        Version of SSP: 1.0 with FMI 2.0 FMUs, 2.0 with FMI 3.0 FMUs.
    progress : callable
        Called with a message and the fraction done.

    Raises
    ------
    FmuError
        If the machine has no plant or no drive limits, a library cannot be had, or there is no such version of SSP.
    SignalError
        If ``command`` is not finite or empty.
    StateError
        If ``weights`` is no saved predictor, or one of another machine or other settings.
    """
    check_system(machine, compensate=compensate, ssp=ssp)
    fmi = FMI_VERSIONS[SSP_VERSIONS.index(ssp)]
    samples = as_samples(command, "command")
    as_samples(samples[:1], "command", 1)
    model, look_ahead, sent = (
        ("HybridPredictor", "predictor", "x_d") if compensate is None else ("SepCompensator", "compensator", "x_dm")
    )
    if compensate is not None:
        machine = machine.changed("compensator", {"compensate": compensate})
    parts = {"reference": "ReferenceTrajectory", look_ahead: model, "drive": "FeedDrive"}
    content: dict[str, bytes] = {}
    components, sets = [], {}
    for i, (part, kind) in enumerate(parts.items()):
        progress(kind, i / len(parts))
        name = fmu_name(kind, machine.name, "native", fmi)
        trained = load_trained(weights, machine, kind) if weights is not None and part == look_ahead else None
        played = samples if part == "reference" else None
        # windows are no connectors, and thousands of errors of one importer's
        rest = float(samples[0])
        fmu = Fmu.of(machine, kind, name, fmi=fmi, samples=played, trained=trained, windows=False, rest=rest)
        content[f"resources/{name}.fmu"] = archived(native_flavour.files(fmu, targets=targets))
        components.append(Component(part, f"{name}.fmu", _variables(fmu)))
        sets[part] = f"{machine.name}_{part}.ssv"
        content[f"resources/{sets[part]}"] = parameter_set(components[-1], ssp)
    connections: list[Connection] = [
        ("reference", "r", look_ahead, "x_d_ahead"),
        (look_ahead, sent, "drive", "x_d"),
        ("drive", "x_meas", look_ahead, "x_meas"),
    ]
    starts = {variable.name: variable.start for variable in components[1].variables}
    delay = int(starts["Np" if compensate is None else "preview"] or 0)
    stop_time = round((len(samples) - 1 + delay) * machine.T_s, 9)
    structure = system_structure(machine.name, components, connections, sets, machine.T_s, stop_time, ssp)
    with written_whole(path) as file:
        file.write(archived({"SystemStructure.ssd": structure, **content}))
    progress("done", 1.0)
    return Path(path)


def _variables(fmu: Fmu) -> tuple[Variable, ...]:
    """Return an FMU's variables, of FMI 3.0 the scalar ones."""
    if fmu.fmi == FMI_VERSIONS[0]:
        return fmu.table.shown
    return tuple(each.variable for each in fmi3_variables(fmu.table) if each.size is None)
