"""Table of one FMU: its model's variables with start values, modes, unit and windows of its own.

This module is packed into the FMUs: it needs nothing but the standard library.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from ..base.settings import PARAMETERS
from .angular_units import angular_unit
from .variables import MODELS, Value, Variable

__all__ = ["SAMPLES_TRAJECTORY", "FmuTable"]

SAMPLES_TRAJECTORY = len(PARAMETERS["trajectory"].choices) - 1
"""The number under which a ReferenceTrajectory plays the samples it was built with: the last one."""


@dataclass(frozen=True)
class FmuTable:
    """What tables, headers and documents of an FMU are made of.

    Attributes
    ----------
    model : str
        Of :data:`hybridsep.fmi.variables.MODELS`.
    name : str
        Model identifier.
    parameters : mapping
        Start values by name.
    modes : tuple of mappings
        ``f_n``, ``zeta``, ``alpha``, ``beta`` of each mode of eq. (15); empty where the model has none.
    unit : {"m", "rad"}
        Of positions.
    windows : bool
        Whether a HybridPredictor shows the samples of its window.
    rest : float, m
        Start value of the positions that enter: where the axis is at rest.
    """

    model: str
    name: str
    parameters: Mapping[str, Value]
    modes: tuple[Mapping[str, float], ...] = ()
    unit: str = "m"
    windows: bool = True
    rest: float = 0.0

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> FmuTable:
        """Return the table that :meth:`as_json` wrote."""
        more = {key: content[key] for key in ("unit", "windows", "rest") if key in content}
        return cls(content["model"], content["name"], content["parameters"], tuple(content["modes"]), **more)

    def as_json(self) -> dict[str, object]:
        """Return plain values; unit, windows and rest where they are not the usual ones."""
        content: dict[str, object] = {
            "model": self.model,
            "name": self.name,
            "parameters": dict(self.parameters),
            "modes": list(self.modes),
        }
        if not self.windows:
            content["windows"] = False
        if self.rest != 0.0:
            content["rest"] = self.rest
        return {**content, "unit": self.unit} if self.is_angular else content

    @property
    def kind(self) -> str:
        """Kind of FMU, all of which one library serves: the model, or ``StageDrive`` for a FeedDrive with modes."""
        return "StageDrive" if self.model == "FeedDrive" and self.modes else self.model

    @property
    def is_angular(self) -> bool:
        """Whether positions are angles."""
        return self.unit != "m"

    @cached_property
    def variables(self) -> tuple[Variable, ...]:
        """Variables; the place of each is its value reference."""
        table = MODELS[self.model](self.parameters, self.modes)
        if not self.windows:
            table = [variable for variable in table if variable.causality != "local"]
        table = [
            replace(variable, start=self.rest) if variable.causality == "input" else variable for variable in table
        ]
        return tuple(map(_angular, table) if self.is_angular else table)

    @cached_property
    def shown(self) -> tuple[Variable, ...]:
        """Variables with the ranges that hold in this FMU, where its kind has wider ones.

        A ReferenceTrajectory plays what lies in its archive: at the interval of its samples, and samples of the user's
        only where it was built with some, which it then starts with.
        """
        if self.model != "ReferenceTrajectory":
            return self.variables
        T_s = float(self.parameters["T_s"])
        played = SAMPLES_TRAJECTORY + (self.parameters["trajectory"] == SAMPLES_TRAJECTORY)
        own: dict[str, dict[str, float]] = {
            "T_s": {"minimum": T_s, "maximum": T_s},
            "trajectory": {"maximum": played - 1},
        }
        return tuple(
            replace(
                variable,
                items=variable.items[:played],
                item_meanings=variable.item_meanings[:played],
                **own.get(variable.name, {}),  # type: ignore[arg-type]
            )
            for variable in self.variables
        )

    def named(self, causality: str) -> dict[str, Variable]:
        """Return the variables of a causality by name, in their order."""
        return {variable.name: variable for variable in self.variables if variable.causality == causality}


def _angular(variable: Variable) -> Variable:
    """Return a linear axis' variable with the units of a rotary one."""
    unit, display = angular_unit(variable.unit), angular_unit(variable.display_unit)
    return replace(variable, unit=unit, display_unit=display)
