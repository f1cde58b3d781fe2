"""Result of an identification: the physics model, how sure it is, and what else was tried."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base.files import plain
from ..base.settings import Cascade
from ..base.signals import Array
from ..logs.units import DisplayUnits
from ..machines.machine import Machine, machine_from_table
from ..model.physics import ModalModel


@dataclass(frozen=True)
class Estimate:
    """Estimated parameter."""

    name: str
    value: float  # in ``unit``, as its deviation
    std: float  # standard deviation; 0 for a parameter that was not estimated
    unit: str


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

        ParameterError if an entry is invalid.
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
    physics = {"mode": [vars(mode) for mode in model.modes], "dead_time": model.dead_time, "input_hold": input_hold}
    return machine_from_table({"name": name, "title": title, "T_s": T_s, "physics": physics, **entries})


_DEAD_TIMES = 21  # dead times that are tried with given gains, samples


def of_cascade(
    gains: Cascade, training: Sequence[tuple[Array, Array]], identified: IdentifiedModel, shown: DisplayUnits
) -> IdentifiedModel:
    """Return the model of given gains with the hold and dead time that leave least of the training samples.

    Its finding compares what it leaves with the servo error and with what an ``identified`` model leaves.
    """
    T_s, kept = identified.T_s, [one for one in training if len(one[0])]
    errors = {}
    for input_hold in ("foh", "zoh"):
        discrete = ModalModel.cascade(gains).discretise(T_s, input_hold)
        x_pb = [one[0] + discrete.forced_response(discrete.rest(), one - one[0])[0] for one, _ in kept]
        for late in range(_DEAD_TIMES):
            errors[input_hold, late] = np.concatenate(
                [x[late:] - mine[: len(x) - late] for mine, (_, x) in zip(x_pb, kept, strict=True)]
            )
    (input_hold, late), residual = min(errors.items(), key=lambda one: float(np.nanstd(one[1])))
    left, servo_error = float(np.nanstd(residual)), float(np.nanstd(np.concatenate([x - x_d for x_d, x in kept])))
    says = (
        f"the given gains leave {shown.words(left)} of a servo error of {shown.words(servo_error)}, a model that is "
        f"identified {shown.words(identified.rms)}"
    )
    return replace(
        identified,
        model=ModalModel.cascade(gains, late),
        input_hold=input_hold,
        structure="cascade of given gains",
        parameters=tuple(Estimate(name, value, 0.0, "SI") for name, value in vars(gains).items()),
        offset=float(np.nanmean(residual)),
        rms=left,
        rms_held_out=left,
        alternatives=(),
        findings=(says + ("" if left < servo_error else ": the log contradicts them"),),
    )
