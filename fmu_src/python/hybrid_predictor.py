"""The hybrid predictor as a pythonfmu slave: values in, values out, the arithmetic is in the library."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hybridsep.fmi import slave
from hybridsep.fmi.clock import SampleClock
from hybridsep.fmi.variables import modes_from
from hybridsep.fmi.weights import WEIGHTS_FILE, restore_weights
from hybridsep.lookahead import LookAhead
from hybridsep.physics import ModalModel, Mode
from hybridsep.predictor import HybridPredictor


class HybridPredictorPy(slave.TableSlave):
    """Sits between the interpolator and the drive: delays the command by Np samples and predicts what follows."""

    def initialise(self) -> None:
        """Make the look-ahead from the parameters as they are now, with what the resources say was learned."""
        names = ("Np", "p", "q", "lambda", "T_s", "t_init", "input_hold")
        model = ModalModel([Mode(**mode) for mode in modes_from(self.values)], self.values["dead_time"])
        predictor = HybridPredictor.with_parameters(model, {name: self.values[name] for name in names})
        trained = Path(self.resources) / WEIGHTS_FILE
        if trained.exists():
            restore_weights(predictor, trained.read_bytes())
        self.look_ahead = LookAhead(predictor, self.values["x_d_ahead"])
        self.clock = SampleClock(self.start_time, predictor.Ts)

    def advance(self, t: float, h: float) -> None:
        """Read the inputs at the first sub-step of a sample, show the outputs after its last one."""
        parts = self.clock.check(t, h)
        if self.clock.done == 0:
            self.inputs = (self.values["x_d_ahead"], self.values["x_meas"])
            self.look_ahead.check(*self.inputs)
        if self.clock.done == parts - 1:
            self.look_ahead.sample(*self.inputs)
        self.clock.advance(parts)

    def initial_value(self, name: str) -> float | int | bool:
        """Return the value at ``t_0``: the drive rests at the start value of ``x_d_ahead``."""
        if name == "batch":
            return 0
        if name == "hybrid_active":
            return False
        if name in ("e_servo", "rms_pb", "rms_h"):
            return 0.0
        _, i = _window_index(name)
        return float(self.values["x_d_ahead"]) if i < self.values["Np"] else 0.0

    def current_value(self, name: str) -> float | int | bool:
        """Return an output, or one sample of the current window."""
        if not name.endswith("]"):
            value: float | int | bool = getattr(self.look_ahead, name)
            return value
        window, i = _window_index(name)
        samples = getattr(self.look_ahead, window)
        return float(samples[i]) if i < len(samples) else 0.0

    def core_state(self) -> tuple[dict[str, Any], bytes]:
        """Return the clock with the inputs of the sample in progress, and the look-ahead."""
        return {"clock": self.clock.state(), "inputs": getattr(self, "inputs", None)}, self.look_ahead.to_bytes()

    def restore_core(self, meta: Mapping[str, Any], blob: bytes) -> None:
        """Take over a clock and a look-ahead."""
        self.look_ahead = LookAhead.from_bytes(blob)
        self.clock = SampleClock(**meta["clock"])
        self.inputs = meta["inputs"]


def _window_index(name: str) -> tuple[str, int]:
    """Split ``x_d_window[3]`` into the window's name and the place 2; a plain name is at place 0."""
    window, _, place = name.partition("[")
    return window, int(place[:-1]) - 1 if place else 0
