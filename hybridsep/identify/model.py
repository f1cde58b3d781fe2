"""Result of an identification: the physics model, how sure it is, and what else was tried."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from ..logs.units import DisplayUnits
from ..machines.machine import Machine, machine_from_table
from ..model.physics import ModalModel
from .uncertainty import Estimate

__all__ = ["Alternative", "IdentifiedModel", "deviation_words", "machine_of", "shown_estimates"]


@dataclass(frozen=True)
class Alternative:
    """Structure that was tried.

    Attributes
    ----------
    name : str
    n_parameters : int
    model : ModalModel or None
        Fitted to the part before the held-out one; None where there is an objection.
    input_hold : {"zoh", "foh"}
    rms_fitted, rms_held_out : float
        Error of the simulated position on the part that was fitted to and on the later one, m.
    objection : str
        Why it was not chosen whatever its error; empty if there is none.
    """

    name: str
    n_parameters: int
    model: ModalModel | None
    input_hold: str
    rms_fitted: float
    rms_held_out: float
    objection: str


@dataclass(frozen=True)
class IdentifiedModel:
    """Identified physics model.

    Attributes
    ----------
    model : ModalModel
        ``G_pb`` of eq. (15) with its dead time.
    input_hold : {"zoh", "foh"}
        Hold of the command between samples.
    T_s : float
        Sampling interval, s.
    unit : {"m", "rad"}
        Unit of the positions, and of what is in metres below.
    structure : str
        Name of the chosen structure.
    parameters : tuple of Estimate
        Parameters with standard deviations.
    offset : float
        Measured minus modelled position, m, which no physics model holds.
    rms, rms_held_out : float
        Error of the simulated position: of the fit to all samples, and of the held-out part before, m.
    n_samples : int
        Samples that were used.
    n_effective : float
        Independent samples that would tell as much.
    alternatives : tuple of Alternative
        All structures that were tried, the simplest first.
    findings : tuple of str
        What a user should know, in words.
    """

    model: ModalModel
    input_hold: str
    T_s: float
    unit: str
    structure: str
    parameters: tuple[Estimate, ...]
    offset: float
    rms: float
    rms_held_out: float
    n_samples: int
    n_effective: float
    alternatives: tuple[Alternative, ...]
    findings: tuple[str, ...]

    def machine(self, name: str, title: str, **entries: Any) -> Machine:
        """Return the machine with this model.

        Parameters
        ----------
        name, title : str
            As in a machine file.
        **entries
            Further entries of the file, such as ``predictor={"Np": 20}`` or ``sources``.

        Raises
        ------
        ParameterError
            If an entry is invalid.
        """
        return machine_of(self.model, self.input_hold, self.T_s, name, title, unit=self.unit, **entries)

    def summary(self) -> Mapping[str, Any]:
        """Return plain values for JSON and tables."""
        return {
            "structure": self.structure,
            "T_s": self.T_s,
            "unit": self.unit,
            "input_hold": self.input_hold,
            "dead_time": self.model.dead_time,
            "modes": [vars(mode) for mode in self.model.modes],
            "parameters": [vars(estimate) for estimate in self.parameters],
            "offset": self.offset,
            "rms": self.rms,
            "rms_held_out": self.rms_held_out,
            "n_samples": self.n_samples,
            "n_effective": self.n_effective,
            "alternatives": [
                {
                    "name": other.name,
                    "n_parameters": other.n_parameters,
                    "rms_fitted": other.rms_fitted,
                    "rms_held_out": other.rms_held_out,
                    "objection": other.objection,
                }
                for other in self.alternatives
            ],
            "findings": list(self.findings),
        }


def machine_of(model: ModalModel, input_hold: str, T_s: float, name: str, title: str, **entries: Any) -> Machine:
    """Return the machine with an identified model; parameters as for :meth:`IdentifiedModel.machine`."""
    physics = {
        "mode": [vars(mode) for mode in model.modes],
        "dead_time": model.dead_time,
        "input_hold": input_hold,
    }
    return machine_from_table({"name": name, "title": title, "T_s": T_s, "physics": physics, **entries})


def deviation_words(std: float, sign: str = "") -> str:
    """Return a standard deviation as text; "fixed" for a parameter that was not estimated."""
    return f"{sign}{std:.2g}" if std > 0 else "fixed"


def shown_estimates(parameters: Iterable[Estimate], shown: DisplayUnits) -> Iterator[tuple[str, float, float, str]]:
    """Yield name, value, standard deviation and unit of parameters; positions in the units of their log."""
    for one in parameters:
        factor, unit = shown.error(abs(one.value)) if one.unit in ("m", "rad") else (1.0, one.unit)
        yield one.name, factor * one.value, factor * one.std, unit
