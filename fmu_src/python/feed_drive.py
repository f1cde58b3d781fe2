"""pythonfmu slave of the nonlinear drives: eq. (13), or the stage where the FMU has modes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hybridsep.base.clock import check_communication_point, check_step_size
from hybridsep.base.settings import PARAMETERS
from hybridsep.base.signals import check_position
from hybridsep.fmi import slave
from hybridsep.fmi.variables import modes_from
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.plants.feed_drive import FeedDrive
from hybridsep.plants.plant import Drive, Encoder
from hybridsep.plants.stage_drive import StageDrive

_TIME_TOLERANCE = 0.5  # of a step: rounding of the importer's times


class FeedDrivePy(slave.TableSlave):
    """Drive with the command held over a step, and an encoder sampled at each communication point."""

    command = "x_d"

    def initialise(self) -> None:
        """Create the plant, at rest at the start value of x_d, and its encoder."""
        check_position("the start value of x_d", self.values["x_d"], unit=self.unit)
        self.encoder = Encoder(self.values["noise_std"], self.values["seed"])
        self.plant = self._new_plant()
        self.plant.reset(self.values["x_d"])
        self.x_meas = self.encoder.measure(self.plant.x)
        self.end = self.start_time

    def advance(self, t: float, h: float) -> None:
        """Step the plant and measure it."""
        check_position("x_d", self.values["x_d"], f" at t = {t:g} s", self.unit)
        check_step_size(h)
        check_communication_point(t, self.end, _TIME_TOLERANCE * h)
        self.plant.step(self.values["x_d"], h)
        self.end = t + h
        self.x_meas = self.encoder.measure(self.plant.x)

    def initial_value(self, name: str) -> float:
        """Return the value at ``t_0``: at rest at the start value of x_d, measured once."""
        if name == "v":
            return 0.0
        x = float(self.values["x_d"])
        return Encoder(self.values["noise_std"], self.values["seed"]).measure(x) if name == "x_meas" else x

    def current_value(self, name: str) -> float:
        """Return the true position or velocity, or the measurement."""
        return {"x": self.plant.x, "v": self.plant.v, "x_meas": self.x_meas}[name]

    def core_state(self) -> tuple[dict[str, Any], bytes]:
        """Return the plant's state, the end of the last step and the number of noise samples drawn."""
        meta = {"plant": self.plant.state(), "end": self.end, "n_draws": self.encoder.n_draws, "x_meas": self.x_meas}
        return meta, b""

    def restore_core(self, meta: Mapping[str, Any], blob: bytes) -> None:
        """Restore the plant's state and the position in the noise sequence."""
        plant, encoder = self._new_plant(), Encoder(self.values["noise_std"], self.values["seed"])
        plant.restore(meta["plant"])
        encoder.n_draws = meta["n_draws"]
        self.plant, self.encoder, self.x_meas, self.end = plant, encoder, meta["x_meas"], meta["end"]

    def _new_plant(self) -> Drive:
        values = self.values
        modes = modes_from(values)
        if modes:
            chosen = {name: PARAMETERS[name].from_fmi(values[name]) for name in ("friction_on", "input_hold")}
            numbers = {name: values[name] for name in ("f", "kappa", "T_s", "v_friction")}
            return StageDrive(ModalModel([Mode(**mode) for mode in modes], values["dead_time"]), **numbers, **chosen)
        return FeedDrive(*(values[name] for name in ("m", "c", "k", "c_nl", "k_nl")))
