"""An FMU before it is an archive: the machine it is for, its table, and what is built into it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from ..base.settings import PARAMETERS
from ..machines.machine import Machine
from ..machines.sections import FeedDriveSection, IdentifiedSection
from ..model.physics import ModalModel
from .flavours import FMI_VERSIONS
from .fmu_table import SAMPLES_TRAJECTORY, FmuTable

if TYPE_CHECKING:
    from ..predict.predictor import HybridPredictor

__all__ = ["Fmu", "table_of"]


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
