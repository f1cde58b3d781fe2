"""Specification of an FMU before it is built: its machine, model and flavour, and what its files say of them."""

import hashlib
import json
import uuid
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

from numpy.typing import ArrayLike

from ..base.errors import FmuError, check_kind
from ..base.files import DEFAULT_MACHINE
from ..base.settings import PARAMETERS
from ..base.signals import Array, as_samples
from ..machines.machine import PAPER_SETTINGS, Machine
from ..machines.sections import FeedDriveSection, IdentifiedSection
from ..plants.trajectory import staircase
from .flavours import FLAVOURS, FMI_VERSIONS
from .variables import SAMPLES_TRAJECTORY, FmuTable

AUTHOR = "the hybridsep authors"
COPYRIGHT = f"Copyright (c) 2026, {AUTHOR}"  # the line of LICENSE

_TITLES = {
    "HybridPredictor": "linear hybrid model: predicts the drive's position one look-ahead window early",
    "SepCompensator": "servo error pre-compensation: modifies the command so that the drive follows it",
    "FeedDrive": "nonlinear feed drive with encoder noise",
    "ReferenceTrajectory": "Source of commands: plays the paper's staircase and spirals, or given samples",
}


@dataclass(frozen=True, eq=False)
class FmuSpec:
    """An FMU of a machine, to be built."""

    machine: Machine
    table: FmuTable  # model, model identifier, start values and variables
    flavour: str  # {"native", "python"}
    fmi: str  # {"2", "3"}: version of FMI
    samples: Array | None = None  # (n,), m: trajectory 3 of a ReferenceTrajectory
    weights: bytes | None = None  # weights file with which a HybridPredictor or SepCompensator starts warm

    @classmethod
    def of(
        cls,
        machine: Machine,
        model: str,
        *,
        flavour: str = FLAVOURS[0],
        fmi: str = FMI_VERSIONS[0],
        samples: ArrayLike | None = None,
        weights: bytes | None = None,
        windows: bool = True,
        rest: float = 0.0,
    ) -> "FmuSpec":
        """Return the FMU of a model; arguments as the attributes, and as :func:`table_of`.

        FmuError if the flavour is unknown, or has no FMUs of this version of FMI; SignalError if ``samples`` is not
        finite or empty.
        """
        played = None if samples is None else as_samples(samples, "samples", T_s=machine.T_s)
        name, built_in = fmu_name(model, machine.name, flavour, fmi), {"samples": played is not None}
        table = table_of(machine, model, name, **built_in, warm=weights is not None, windows=windows, rest=rest)
        return cls(machine, table, flavour, fmi, played, weights)

    @property
    def title(self) -> str:
        """Description, with a predictor's settings of the paper; ReferenceTrajectory's is every machine's."""
        machine, model = self.machine, self.table.model
        if model == "ReferenceTrajectory":
            return _TITLES[model]
        title = f"{machine.title}: {_TITLES[model]}"
        if model != "HybridPredictor" or machine.name not in PAPER_SETTINGS:
            return title
        settings = ", ".join(f"{name} = {json.dumps(value)}" for name, value in PAPER_SETTINGS[machine.name].items())
        return f"{title}; the paper's settings are {settings}"

    @cached_property
    def stop_time(self) -> float:
        """End of the default experiment, s: of the samples, or of the machine's trajectory, after the look-ahead.

        With ``[limits]`` the trajectory is the staircase within them; without it is 10 s.
        """
        machine = self.machine
        if self.samples is not None:
            n = len(self.samples)
        elif machine.limits is not None:
            n = len(staircase(machine.T_s, limits=machine.trajectory_limits()))
        else:
            return 10.0
        # A compensator delays by its preview, everything else runs beside a predictor.
        delay = int(self.table.parameters.get("preview", machine.predictor_settings.Np))
        return round((n - 1 + delay) * machine.T_s, 9)


def fmu_names(machine: Machine, flavour: str = FLAVOURS[0], fmi: str = FMI_VERSIONS[0]) -> dict[str, str]:
    """Return the FMUs a machine has: archive stem → model (``HybridPredictor``, ``FeedDrive``, …).

    A ``SepCompensator`` needs the machine's ``[drive_limits]``, a ``FeedDrive`` its ``[plant]``.
    ``ReferenceTrajectory`` plays the paper's trajectories for every machine; it comes with the default one. Of the
    Python flavour are predictors and drives.

    FmuError if the flavour is unknown, or has no FMUs of this version of FMI.
    """
    check_kind(Machine, machine=machine)
    models = ["HybridPredictor"]
    if machine.drive_limits is not None and flavour == "native":
        models.append("SepCompensator")
    if machine.plant is not None:
        models.append("FeedDrive")
    if machine.name == DEFAULT_MACHINE and flavour == "native":
        models.append("ReferenceTrajectory")
    return {fmu_name(model, machine.name, flavour, fmi): model for model in models}


def fmu_name(model: str, machine: str, flavour: str = FLAVOURS[0], fmi: str = FMI_VERSIONS[0]) -> str:
    """Return the archive stem of a model of the machine with a name; FmuError as :func:`fmu_names`."""
    if flavour not in FLAVOURS:
        raise FmuError(f"flavour must be one of {', '.join(FLAVOURS)}, got {flavour!r}")
    if fmi not in FMI_VERSIONS:
        raise FmuError(f"the version of FMI must be one of {', '.join(FMI_VERSIONS)}, got {fmi!r}")
    if flavour == "python" and fmi != "2":
        raise FmuError(f"FMUs of the Python flavour are of FMI 2 only, as pythonfmu's are, got FMI {fmi}")
    suffix = {("native", "2"): "", ("native", "3"): "Fmi3", ("python", "2"): "Py"}[flavour, fmi]
    return f"{model}{suffix}{'' if machine == DEFAULT_MACHINE else f'_{machine}'}"


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
    """Return the table of a machine's FMU, at rest at the position ``rest``, m.

    A ReferenceTrajectory may play ``samples`` of its own, a look-ahead start ``warm``, with trained weights and so
    without a warm-up, and a HybridPredictor show the samples of its window.
    """
    parameters, modes = _starts(machine, model)
    if samples:
        parameters["trajectory"] = SAMPLES_TRAJECTORY
    if warm:
        parameters["t_init"] = 0.0
    return FmuTable(model, name, parameters, modes, machine.unit, windows or model != "HybridPredictor", rest)


def _starts(machine: Machine, model: str) -> tuple[dict[str, Any], tuple[dict[str, float], ...]]:
    if model in ("HybridPredictor", "SepCompensator"):
        values = machine.fmi_parameters() if model == "HybridPredictor" else machine.fmi_compensator_parameters()
        return dict(values), tuple(map(asdict, machine.model.modes))
    if model == "ReferenceTrajectory":
        return {"trajectory": 0, "T_s": machine.T_s}, ()
    assert machine.plant is not None  # by fmu_names
    parameters: dict[str, object] = machine.plant.values("kind", "mode")
    if isinstance(machine.plant, FeedDriveSection):
        assert machine.physics.spring_mass_damper is not None  # by Machine
        return parameters | machine.physics.spring_mass_damper.values(), ()
    identified = isinstance(machine.plant, IdentifiedSection)
    chosen = {
        "friction_on": "command" if identified else parameters["friction_on"],
        "input_hold": machine.physics.input_hold if identified else "zoh",
    }
    parameters = {"v_friction": PARAMETERS["v_friction"].default, **parameters}
    parameters |= {key: PARAMETERS[key].to_fmi(value) for key, value in chosen.items()}
    parameters |= {"T_s": machine.T_s, "dead_time": machine.physics.dead_time}
    return parameters, tuple(map(asdict, machine.plant_model.modes))


def content_guid(files: Mapping[str, bytes], table: FmuTable) -> str:
    """Return a GUID that follows from table and files (archive name → content), and from nothing else.

    Binaries and reference results, which are made from them, are not among them.
    """
    digest = hashlib.sha256(json.dumps(table.as_json(), sort_keys=True).encode())
    for arcname in sorted(files):
        digest.update(arcname.encode() + hashlib.sha256(files[arcname]).digest())
    return f"{{{uuid.UUID(bytes=digest.digest()[:16])}}}"
