"""pythonfmu slave of the nonlinear drives: eq. (13), or the stage where the FMU has modes."""

from __future__ import annotations

from fmu_src.python import slave
from hybridsep.base.settings import PARAMETERS
from hybridsep.base.signals import check_position
from hybridsep.base.state import pack, unpack
from hybridsep.fmi.variables import modes_from
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.plants.feed_drive import FeedDrive
from hybridsep.plants.plant import Encoder
from hybridsep.plants.stage_drive import StageDrive


class FeedDrivePy(slave.Slave):
    """Drive with the command held over a step, and an encoder sampled at each communication point."""

    def begin(self) -> None:
        """Make the plant, at rest at the start value of x_d, and its encoder."""
        check_position("the start value of x_d", self.values["x_d"], unit=self.unit)
        self.plant, self.encoder = self._new_plant(), Encoder(self.values["noise_std"], self.values["seed"])
        self.plant.reset(self.values["x_d"])
        self.x_meas = self.encoder.measure(self.plant.x)

    def advance(self, h: float) -> None:
        """Step the plant and measure it."""
        check_position("x_d", self.values["x_d"], unit=self.unit)
        self.plant.step(self.values["x_d"], h)
        self.x_meas = self.encoder.measure(self.plant.x)

    def output(self, name: str) -> float:
        """Return the true position or velocity, or the measurement."""
        return {"x": self.plant.x, "v": self.plant.v, "x_meas": self.x_meas}[name]

    def saved(self) -> bytes:
        """Return the plant's state, the last measurement and the number of noise samples drawn."""
        state = {"plant": self.plant.state(), "n_draws": self.encoder.n_draws, "x_meas": self.x_meas}
        return pack(self.modelName, state, {})

    def restore(self, blob: bytes) -> None:
        """Take over the plant's state and the position in the noise sequence."""
        meta, plant = unpack(self.modelName, blob)[0], self._new_plant()
        plant.restore(meta["plant"])
        self.plant, self.encoder = plant, Encoder(self.values["noise_std"], self.values["seed"])
        self.encoder.n_draws, self.x_meas = meta["n_draws"], meta["x_meas"]

    def _new_plant(self) -> FeedDrive | StageDrive:
        values = self.values
        modes = modes_from(values)
        if modes:
            chosen = {name: PARAMETERS[name].from_fmi(values[name]) for name in ("friction_on", "input_hold")}
            numbers = {name: values[name] for name in ("f", "kappa", "T_s", "v_friction")}
            return StageDrive(ModalModel([Mode(**mode) for mode in modes], values["dead_time"]), **numbers, **chosen)
        return FeedDrive(*(values[name] for name in ("m", "c", "k", "c_nl", "k_nl")))
