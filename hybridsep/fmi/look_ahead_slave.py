"""Slave over a look-ahead: communication steps of any size, executed sample by sample."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from ..base.settings import PredictorSettings
from ..model.physics import ModalModel, Mode
from ..online.look_ahead import LookAhead, Planner
from ..online.look_ahead_inputs import LookAheadInputs
from ..predict.predictor import HybridPredictor
from .slave import TableSlave
from .variables import modes_from
from .weights import WEIGHTS_FILE, restore_weights


class LookAheadSlave(TableSlave):
    """A slave whose core is a look-ahead."""

    command = "x_d_ahead"
    model_type: ClassVar[type[HybridPredictor] | type[Planner]]  # type of the look-ahead's predictor or planner

    @abstractmethod
    def new_model(self) -> HybridPredictor | Planner:
        """Make the predictor or planner from the parameters as they are now, with what the resources have learned."""

    def retune(self) -> None:
        """Take over the tunable parameters, from the next window on."""

    def physics_model(self) -> ModalModel:
        """Return the physics model of the current parameters."""
        return ModalModel([Mode(**mode) for mode in modes_from(self.values)], self.values["dead_time"])

    def new_predictor(self, model: ModalModel) -> HybridPredictor:
        """Return a predictor of the current parameters, warm-started from the resources if they hold weights."""
        predictor = HybridPredictor(model, PredictorSettings.from_fmi(self.values))
        trained = Path(self.resources) / WEIGHTS_FILE
        if trained.exists():
            restore_weights(predictor, trained.read_bytes())
        return predictor

    def new_look_ahead(self) -> LookAhead:
        """Make the look-ahead from the parameters as they are now."""
        return LookAhead(self.new_model(), self.values["x_d_ahead"], unit=self.unit)

    def initialise(self) -> None:
        """Make the look-ahead and start the clock."""
        self.look_ahead = self.new_look_ahead()
        self.inputs = LookAheadInputs(self.start_time, self.values["T_s"], self.values["x_d_ahead"])

    def advance(self, t: float, h: float) -> None:
        """Execute the samples that the step reaches."""
        x_d_ahead, x_meas = self.values["x_d_ahead"], self.values["x_meas"]
        self.warn_once(self.inputs.advance(self.look_ahead, x_d_ahead, x_meas, t, h, begin=self.retune))

    def core_state(self) -> tuple[dict[str, Any], bytes]:
        """Return the clock with the inputs of the sample in progress, and the look-ahead."""
        *others, x_meas = self.inputs.state()
        missing = math.isnan(x_meas)
        return {"inputs": [*others, 0.0 if missing else x_meas], "missing": missing}, self.look_ahead.to_bytes()

    def restore_core(self, meta: Mapping[str, Any], blob: bytes) -> None:
        """Take over a clock and a look-ahead."""
        *others, x_meas = meta["inputs"]
        inputs = LookAheadInputs.from_state([*others, math.nan if meta["missing"] else x_meas])
        self.look_ahead, self.inputs = LookAhead.from_bytes(blob, self.model_type), inputs
