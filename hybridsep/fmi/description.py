"""Description of an FMU by which tables, headers and documents are made: model, name, start values, modes, unit."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from ..base.settings import PARAMETERS
from ..machines.machine import Machine
from ..machines.sections import FeedDriveSection, IdentifiedSection
from ..model.physics import ModalModel

__all__ = ["fmu_description"]


_SAMPLES_TRAJECTORY = 3
"""The number under which ReferenceTrajectory plays the samples it was built with."""


def fmu_description(
    machine: Machine, model: str, name: str, *, samples: bool = False, warm: bool = False, windows: bool = True
) -> dict[str, Any]:
    """Return the description from which an FMU is made: model, name, start values, modes, and unit unless it is m.

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
    """
    description = _description(machine, model, name)
    if samples:
        description["parameters"] = {**description["parameters"], "trajectory": _SAMPLES_TRAJECTORY}
    if warm:
        description["parameters"] = {**description["parameters"], "t_init": 0.0}
    if model == "HybridPredictor" and not windows:
        description["windows"] = False
    return description if machine.unit == "m" else {**description, "unit": machine.unit}


def _description(machine: Machine, model: str, name: str) -> dict[str, Any]:
    if model in ("HybridPredictor", "SepCompensator"):
        values = machine.fmi_parameters() if model == "HybridPredictor" else machine.fmi_compensator_parameters()
        return {"model": model, "name": name, "parameters": values, "modes": _modes(machine.model)}
    if model == "ReferenceTrajectory":
        return {"model": model, "name": name, "parameters": {"trajectory": 0, "T_s": machine.T_s}, "modes": []}
    assert machine.plant is not None  # by fmu_names
    parameters: dict[str, object] = machine.plant.model_dump(exclude={"kind", "mode"})
    if isinstance(machine.plant, FeedDriveSection):
        assert machine.physics.spring_mass_damper is not None  # by Machine
        parameters |= machine.physics.spring_mass_damper.model_dump()
        return {"model": model, "name": name, "parameters": parameters, "modes": []}
    identified = isinstance(machine.plant, IdentifiedSection)
    chosen = {
        "friction_on": "command" if isinstance(machine.plant, IdentifiedSection) else machine.plant.friction_on,
        "input_hold": machine.physics.input_hold if identified else "zoh",
    }
    parameters = {"v_friction": PARAMETERS["v_friction"].default, **parameters}
    parameters |= {key: PARAMETERS[key].to_fmi(value) for key, value in chosen.items()}
    parameters |= {"T_s": machine.T_s, "dead_time": machine.physics.dead_time}
    return {"model": model, "name": name, "parameters": parameters, "modes": _modes(machine.plant_model)}


def _modes(model: ModalModel) -> list[dict[str, float]]:
    return [asdict(mode) for mode in model.modes]
