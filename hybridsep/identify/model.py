"""Result of an identification: the physics model, how sure it is, and what else was tried."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..base.files import plain
from ..machines.machine import Machine, machine_from_table
from ..model.physics import ModalModel
from .uncertainty import Estimate


@dataclass(frozen=True)
class Alternative:
    """Structure that was tried."""

    name: str
    n_parameters: int
    rms_fitted: float  # error of the simulated position on the part that was fitted to, m
    rms_held_out: float  # and on the later one, m
    objection: str  # why it was not chosen whatever its error; empty if there is none


@dataclass(frozen=True)
class IdentifiedModel:
    """Identified physics model."""

    model: ModalModel  # ``G_pb`` of eq. (15) with its dead time
    input_hold: str  # "zoh" or "foh", hold of the command between samples
    T_s: float  # sampling interval, s
    unit: str  # "m" or "rad", of the positions, and of what is in metres below
    structure: str  # name of the chosen structure
    parameters: tuple[Estimate, ...]  # parameters with standard deviations
    offset: float  # measured minus modelled position, m, which no physics model holds
    rms: float  # error of the simulated position, m, of the fit to all samples
    rms_held_out: float  # and of the held-out part before
    n_samples: int  # samples that were used
    n_effective: float  # independent samples that would tell as much
    alternatives: tuple[Alternative, ...]  # all structures that were tried, the simplest first
    findings: tuple[str, ...]  # what a user should know, in words

    def machine(self, name: str, title: str, **entries: Any) -> Machine:
        """Return the machine with this model; ``entries`` are more of its file, such as ``predictor={"Np": 20}``.

        Raises
        ------
        ParameterError
            If an entry is invalid.
        """
        return machine_of(self.model, self.input_hold, self.T_s, name, title, unit=self.unit, **entries)

    def summary(self) -> dict[str, Any]:
        """Return plain values for JSON and tables."""
        own = ("parameters", "offset", "rms", "rms_held_out", "n_samples", "n_effective", "alternatives", "findings")
        model = {"dead_time": self.model.dead_time, "modes": plain(self.model.modes)}
        heads = {name: getattr(self, name) for name in ("structure", "T_s", "unit", "input_hold")}
        return {**heads, **model, **{name: plain(getattr(self, name)) for name in own}}


def machine_of(model: ModalModel, input_hold: str, T_s: float, name: str, title: str, **entries: Any) -> Machine:
    """Return the machine with an identified model; parameters as for :meth:`IdentifiedModel.machine`."""
    physics = {
        "mode": [vars(mode) for mode in model.modes],
        "dead_time": model.dead_time,
        "input_hold": input_hold,
    }
    return machine_from_table({"name": name, "title": title, "T_s": T_s, "physics": physics, **entries})
