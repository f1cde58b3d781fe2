"""The compensator as a pythonfmu slave: values in, values out, the arithmetic is in the library."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hybridsep.base.errors import HybridSepError, ParameterError
from hybridsep.base.limits import Limits
from hybridsep.base.parameters import check
from hybridsep.compensate.compensator import SepCompensator, SepState
from hybridsep.fmi import look_ahead_slave
from hybridsep.fmi.variables import PLANNING, modes_from
from hybridsep.fmi.weights import WEIGHTS_FILE, restore_weights
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.predict.look_ahead import LookAhead
from hybridsep.predict.predictor import HybridPredictor


class SepCompensatorPy(look_ahead_slave.LookAheadSlave):
    """Sits between the interpolator and the drive: delays the command by the preview and modifies it."""

    model_type = SepCompensator

    def initial_value(self, name: str) -> float | int | bool:
        """Return the value at ``t_0``, when the first window has been planned already.

        While the parameters do not fit together yet, the drive rests at ``x_d_ahead`` and nothing compensates; what is
        wrong with them is said when the initialization ends.
        """
        try:
            return _output(self.new_look_ahead(), name)
        except HybridSepError:
            return float(self.values["x_d_ahead"]) if name in ("x_dm", "x_d", "x_pb", "x_h") else 0

    def current_value(self, name: str) -> float | int | bool:
        """Return an output now."""
        return _output(self.look_ahead, name)

    def new_model(self) -> SepCompensator:
        """Make the compensator from the parameters as they are now, with what the resources say was learned."""
        values = self.values
        names = ("Np", "p", "q", "lambda", "T_s", "t_init", "input_hold")
        model = ModalModel([Mode(**mode) for mode in modes_from(values)], values["dead_time"])
        planning = self._planning()
        predictor = HybridPredictor.with_parameters(model, {name: values[name] for name in names}, v_s=planning["v_s"])
        trained = Path(self.resources) / WEIGHTS_FILE
        if trained.exists():
            restore_weights(predictor, trained.read_bytes())
        return SepCompensator(
            predictor,
            preview=planning["preview"],
            spacing=planning["spacing"],
            jerk_weight=planning["jerk_weight"],
            limits=Limits(planning["v_max"], planning["a_max"], planning["j_max"]),
            change_max=planning["change_max"],
            keep_direction=bool(planning["keep_direction"]),
            best=SepState(planning["compensate"]),
        )

    def _planning(self) -> dict[str, Any]:
        """Return the compensator's own parameters, each within its range; name all that are not."""
        planning, problems = {}, []
        for name in PLANNING:
            try:
                planning[name] = check(name, self.values[name])
            except ParameterError as error:
                problems.append(str(error))
        if problems:
            raise ParameterError("; ".join(problems))
        return planning


def _output(look_ahead: LookAhead, name: str) -> float | int:
    value = getattr(look_ahead, name)
    return int(value) if name in ("sep_state", "batch") else float(value)
