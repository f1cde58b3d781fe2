"""pythonfmu slave of the compensator; the arithmetic is in the library."""

from __future__ import annotations

from hybridsep.base.errors import HybridSepError
from hybridsep.base.settings import CompensatorSettings
from hybridsep.compensate.compensator import SepCompensator
from hybridsep.fmi import look_ahead_slave
from hybridsep.online.look_ahead import LookAhead


class SepCompensatorPy(look_ahead_slave.LookAheadSlave):
    """Look-ahead buffer between interpolator and drive: delays the command by the preview and modifies it."""

    model_type = SepCompensator

    def initial_value(self, name: str) -> float | int | bool:
        """Return the value at ``t_0``, where the first window is already planned.

        While the parameters are inconsistent, the drive is at rest at ``x_d_ahead`` without compensation; the error is
        reported when the initialization ends.
        """
        try:
            return _output(self.new_look_ahead(), name)
        except HybridSepError:
            return float(self.values["x_d_ahead"]) if name in ("x_dm", "x_d", "x_pb", "x_h") else 0

    def current_value(self, name: str) -> float | int | bool:
        """Return an output now."""
        return _output(self.look_ahead, name)

    def new_model(self) -> SepCompensator:
        """Create the compensator from the current parameters, warm-started from the resources if they hold weights."""
        model, settings = self.physics_model(), CompensatorSettings.from_fmi(self.values)
        return SepCompensator(self.new_predictor(model), settings)

    def retune(self) -> None:
        """Take over the tunable parameters and the level of ``reset``."""
        compensator = self.look_ahead.planner
        assert isinstance(compensator, SepCompensator)
        compensator.retune(self.values)


def _output(look_ahead: LookAhead, name: str) -> float | int:
    value = getattr(look_ahead, name)
    return int(value) if name in ("sep_state", "batch", "n_rejected", "no_measurement", "alarm") else float(value)
