"""pythonfmu slave of the hybrid predictor."""

from __future__ import annotations

from pathlib import Path

from fmu_src.python import slave
from hybridsep.base.errors import FmuError
from hybridsep.base.settings import PredictorSettings
from hybridsep.fmi.variables import modes_from
from hybridsep.fmi.weights import WEIGHTS_FILE, restore_weights
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.online.look_ahead import LookAhead
from hybridsep.predict.predictor import HybridPredictor

_TOLERANCE = 0.05  # of a sample: the importer's steps may be whole nanoseconds or in single precision


class HybridPredictorPy(slave.Slave):
    """Look-ahead buffer between interpolator and drive: delays the command by Np samples and predicts the position."""

    def begin(self) -> None:
        """Make the look-ahead, warm-started from the resources if they hold weights."""
        model = ModalModel([Mode(**mode) for mode in modes_from(self.values)], self.values["dead_time"])
        predictor = HybridPredictor(model, PredictorSettings.from_fmi(self.values))
        trained = Path(self.resources, WEIGHTS_FILE)
        if trained.exists():
            restore_weights(predictor, trained.read_bytes())
        self.look_ahead = LookAhead(predictor, self.values["x_d_ahead"], unit=self.unit)

    def advance(self, h: float) -> None:
        """Execute the samples of the step, whose inputs they share."""
        T_s, inputs = self.values["T_s"], (self.values["x_d_ahead"], self.values["x_meas"])
        n = round(h / T_s)
        if n < 1 or abs(h - n * T_s) > _TOLERANCE * T_s:
            raise FmuError(f"a step must be whole samples of T_s = {T_s:g} s, got {h!r} s; the native FMU takes any")
        self.look_ahead.check(*inputs)
        for _ in range(n):
            self.look_ahead.sample(*inputs)

    def output(self, name: str) -> float | int | bool:
        """Return an output, or one sample of the current window, such as ``x_d_window[3]``."""
        window, _, place = name.partition("[")
        if place:
            samples, i = getattr(self.look_ahead.window, window.removesuffix("_window")), int(place[:-1]) - 1
            return float(samples[i]) if i < len(samples) else 0.0
        value: float | int | bool = getattr(self.look_ahead, name)
        return value if isinstance(value, (bool, int)) else float(value)

    def saved(self) -> bytes:
        """Return the look-ahead's state."""
        return self.look_ahead.to_bytes()

    def restore(self, blob: bytes) -> None:
        """Take over a look-ahead."""
        self.look_ahead = LookAhead.from_bytes(blob, HybridPredictor)
