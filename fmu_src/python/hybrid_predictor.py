"""pythonfmu slave of the hybrid predictor; the arithmetic is in the library."""

from __future__ import annotations

from hybridsep.fmi import look_ahead_slave
from hybridsep.predict.predictor import HybridPredictor


class HybridPredictorPy(look_ahead_slave.LookAheadSlave):
    """Look-ahead buffer between interpolator and drive: delays the command by Np samples and predicts the position."""

    model_type = HybridPredictor

    def new_model(self) -> HybridPredictor:
        """Create the predictor from the current parameters, warm-started from the resources if they hold weights."""
        return self.new_predictor(self.physics_model())

    def initial_value(self, name: str) -> float | int | bool:
        """Return the value at ``t_0``: the drive rests at the start value of ``x_d_ahead``."""
        if name in ("batch", "n_rejected"):
            return 0
        if name == "hybrid_active":
            return False
        if name in ("x_h_std", "e_servo", "rms_pb", "rms_h", "rms_hold"):
            return 0.0
        window, i = _window_index(name)
        if window == "x_h_std_window":
            return 0.0
        return float(self.values["x_d_ahead"]) if i < self.values["Np"] else 0.0

    def current_value(self, name: str) -> float | int | bool:
        """Return an output, or one sample of the current window."""
        if not name.endswith("]"):
            value: float | int | bool = getattr(self.look_ahead, name)
            return value
        window, i = _window_index(name)
        samples = getattr(self.look_ahead.window, window.removesuffix("_window"))
        return float(samples[i]) if i < len(samples) else 0.0


def _window_index(name: str) -> tuple[str, int]:
    """Split ``x_d_window[3]`` into name and zero-based index 2; a scalar has index 0."""
    window, _, place = name.partition("[")
    return window, int(place[:-1]) - 1 if place else 0
