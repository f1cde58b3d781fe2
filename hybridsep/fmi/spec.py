"""An FMU before it is an archive: a machine on its way into one, with all that the files of the archive say of it."""

from __future__ import annotations

import hashlib
import json
import os
import uuid
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import datetime, timezone
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from ..base.errors import FmuError
from ..base.settings import PARAMETERS
from ..base.signals import as_samples
from ..base.version import VERSION_DATE
from ..machines.machine import Machine
from ..machines.paper import PAPER_SETTINGS
from ..machines.sections import FeedDriveSection, IdentifiedSection
from ..model.physics import ModalModel
from ..plants.trajectory import staircase
from .flavours import FMI_VERSIONS
from .variables import SAMPLES_TRAJECTORY, FmuTable

if TYPE_CHECKING:
    from ..predict.predictor import HybridPredictor

__all__ = [
    "Fmu",
    "author",
    "content_guid",
    "copyright_notice",
    "fmu_title",
    "generation_time",
    "paper_note",
    "stop_time",
    "table_of",
]


@dataclass(frozen=True, eq=False)
class Fmu:
    """What an FMU is made from.

    Attributes
    ----------
    machine : Machine
    table : FmuTable
    fmi : {"2", "3"}
        Version of FMI.
    samples : (n,) array_like, m, or None
        Trajectory 3 of a ReferenceTrajectory.
    trained : HybridPredictor or None
        With which a HybridPredictor or SepCompensator starts warm.
    origin : mapping or None
        What the FMU was made from, plain values.
    """

    machine: Machine
    table: FmuTable
    fmi: str = FMI_VERSIONS[0]
    samples: ArrayLike | None = None
    trained: HybridPredictor | None = None
    origin: Mapping[str, Any] | None = None

    @classmethod
    def of(
        cls,
        machine: Machine,
        model: str,
        name: str,
        *,
        fmi: str = FMI_VERSIONS[0],
        samples: ArrayLike | None = None,
        trained: HybridPredictor | None = None,
        origin: Mapping[str, Any] | None = None,
        windows: bool = True,
        rest: float = 0.0,
    ) -> Fmu:
        """Return an FMU of a machine; arguments as the attributes, and as :func:`table_of`."""
        built_in = {"samples": samples is not None, "warm": trained is not None}
        table = table_of(machine, model, name, **built_in, windows=windows, rest=rest)
        return cls(machine, table, fmi, samples, trained, origin)


def table_of(
    machine: Machine,
    model: str,
    name: str,
    *,
    samples: bool = False,
    warm: bool = False,
    windows: bool = True,
    rest: float = 0.0,
) -> FmuTable:
    """Return the table of a machine's FMU.

    Parameters
    ----------
    machine : Machine
    model : str
        ``HybridPredictor``, ``FeedDrive``, …
    name : str
        Model identifier.
    samples : bool
        Whether a ReferenceTrajectory plays samples of its own.
    warm : bool
        Whether a look-ahead starts with trained weights, and so without a warm-up.
    windows : bool
        Whether a HybridPredictor shows the samples of its window.
    rest : float, m
        Position where the axis is at rest.
    """
    parameters, modes = _starts(machine, model)
    if samples:
        parameters["trajectory"] = SAMPLES_TRAJECTORY
    if warm:
        parameters["t_init"] = 0.0
    return FmuTable(model, name, parameters, modes, machine.unit, windows or model != "HybridPredictor", rest)


def _starts(machine: Machine, model: str) -> tuple[dict[str, Any], tuple[dict[str, float], ...]]:
    """Return start values and modes."""
    if model in ("HybridPredictor", "SepCompensator"):
        values = machine.fmi_parameters() if model == "HybridPredictor" else machine.fmi_compensator_parameters()
        return dict(values), _modes(machine.model)
    if model == "ReferenceTrajectory":
        return {"trajectory": 0, "T_s": machine.T_s}, ()
    assert machine.plant is not None  # by fmu_names
    parameters: dict[str, object] = machine.plant.values("kind", "mode")
    if isinstance(machine.plant, FeedDriveSection):
        assert machine.physics.spring_mass_damper is not None  # by Machine
        return parameters | machine.physics.spring_mass_damper.values(), ()
    identified = isinstance(machine.plant, IdentifiedSection)
    chosen = {
        "friction_on": "command" if isinstance(machine.plant, IdentifiedSection) else machine.plant.friction_on,
        "input_hold": machine.physics.input_hold if identified else "zoh",
    }
    parameters = {"v_friction": PARAMETERS["v_friction"].default, **parameters}
    parameters |= {key: PARAMETERS[key].to_fmi(value) for key, value in chosen.items()}
    parameters |= {"T_s": machine.T_s, "dead_time": machine.physics.dead_time}
    return parameters, _modes(machine.plant_model)


def _modes(model: ModalModel) -> tuple[dict[str, float], ...]:
    return tuple(asdict(mode) for mode in model.modes)


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


_WITHOUT_TRAJECTORY = 10.0  # s


def stop_time(fmu: Fmu) -> float:
    """Return the end of the FMU's samples, or of the machine's trajectory, with the look-ahead's delay, s.

    With ``[limits]`` the trajectory is the staircase within them; without it is 10 s.
    """
    machine = fmu.machine
    if fmu.samples is not None:
        n = len(as_samples(fmu.samples, "samples"))
    elif machine.limits is not None:
        n = len(staircase(machine.T_s, limits=machine.trajectory_limits()))
    else:
        return _WITHOUT_TRAJECTORY
    # A compensator delays by its preview, everything else runs beside a predictor.
    delay = int(fmu.table.parameters.get("preview", machine.predictor_settings.Np))
    return round((n - 1 + delay) * machine.T_s, 9)
