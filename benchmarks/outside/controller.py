"""Compensator of the C library in a loop, as a controller runs it, on a plant of any kind."""

from dataclasses import asdict, replace

from c_library import Library

from hybridsep.fmi.weights import weights_file
from hybridsep.machines.machine import Machine
from hybridsep.predict.predictor import HybridPredictor


class Controller:
    """Compensator of a machine, warm by what a predictor has learned, or cold without; it fits into ``cosimulate``."""

    def __init__(self, machine: Machine, compensate: str = "hybrid", trained: HybridPredictor | None = None) -> None:
        settings, model = replace(machine.compensator_settings, compensate=compensate), machine.model
        assert settings.preview is not None
        assert settings.limits is not None
        values = {**machine.compensator_predictor.to_fmi(), **settings.to_fmi(), **settings.limits.to_fmi()}
        values["dead_time"] = model.dead_time
        self._library = Library("compensator", values, [asdict(mode) for mode in model.modes])
        self._weights = None if trained is None else weights_file(trained)
        self.T_s, self.delay = machine.T_s, settings.preview
        self.x_h: list[float] = []  # predictions of all samples after the first one, m

    def restart(self, start: float) -> None:
        """Begin a run at rest at ``start``, m."""
        if began := self._library.begin(start, self._weights):
            raise ValueError(f"the C library refused to begin: {began}, {self._library.refused()}")
        self.x_h = []

    def step(self, x_d_ahead: float, x_meas: float, x_load: float = 0.0) -> float:
        """Process a sample, m; return the command of the next one, m."""
        self._library.load(x_load)
        outputs = self._library.sample(x_d_ahead, x_meas)
        self.x_h.append(outputs.predicted.x_h)
        return float(outputs.x_dm)
