"""Plans on the paper's model where its recent errors allow, eq. (3), and on the physics model elsewhere."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ..base.signals import Array, as_published
from ..predict.predictor import HybridPredictor
from ..predict.window import Prediction
from .interior import EXACT, Tolerance
from .plan import PendingPlan, SepState
from .plan_monitor import has_stable_poles
from .planning import ChosenPlan, Planning, Preview, PublishedPosition

__all__ = ["PaperPlanning"]


class PaperPlanning(Planning):
    """Plans with the paper's model, which :class:`PlanMonitor` and :class:`SensorWatch` watch."""

    PINNED: ClassVar[int] = 8
    """Real-time solvers take 3 steps in each."""

    ALWAYS: ClassVar[bool] = False
    TOLERANCE: ClassVar[Tolerance] = EXACT

    def choose(self, predictor: HybridPredictor, preview: Preview, most: SepState) -> ChosenPlan:
        """Return the plan of the best model that has one, else the rest of the last plan."""
        candidates = self._candidates(predictor, most)
        if not candidates:
            return ChosenPlan(SepState.OFF, preview.rest, None)
        bounds = self.limits(preview)
        with np.errstate(all="ignore"):  # a hybrid model that is no candidate may be unstable
            operator = predictor.operator(self.preview, reference=preview.command)  # Eq. (3)
        for state in candidates:
            hybrid = state is SepState.HYBRID
            g, free = (operator.g_h, operator.free) if hybrid else (operator.g_pb, operator.free_pb)
            found = self.affine_plan(g, free, preview, bounds)
            if found is not None:
                return ChosenPlan(state, found, None)
        return ChosenPlan(SepState.OFF, preview.rest, None)

    def published(self, prediction: Prediction, state: SepState, most: SepState) -> PublishedPosition:
        """Return the model's position where it planned, else that of the physics model."""
        x_h, Np = prediction.x_pb.copy(), len(prediction.x_pb)
        if state is SepState.HYBRID:
            return PublishedPosition(as_published(x_h + prediction.e_h, "x_h"), prediction.x_h_std, 0, 0)
        return PublishedPosition(x_h, np.zeros(Np), Np, 0)

    def update(self, predictor: HybridPredictor, measured: Array, pending: PendingPlan, *, learn: bool) -> None:
        """Learn a completely measured window, and judge the model by it; replace the residuals of another one."""
        x_pb, e_h = pending.prediction.x_pb, pending.prediction.e_h
        missing = self.sensor.misses(measured, x_pb)
        if missing:
            own = x_pb + e_h if pending.state is SepState.HYBRID else x_pb
            predictor.update(own, learn=False)
        else:
            # After a gap, the lags of the first window are still predictions.
            learn = self.measured_before and learn
            # Predictions from few rows, before the warm-up is over, are not used: they are not judged.
            judge = learn and predictor.k >= predictor.n_init
            predictor.update(measured, learn=learn)
            if judge:
                regression = predictor.regression
                self.monitor.observe(measured - x_pb, e_h, regression.residual_sum / regression.n_samples)
        self.measured_before = not missing

    def _candidates(self, predictor: HybridPredictor, most: SepState) -> list[SepState]:
        """Return the candidate models, best first."""
        hybrid = (
            most is SepState.HYBRID
            and predictor.k >= predictor.n_init
            and predictor.regression.n_samples > 0
            and self.monitor.hybrid
            and has_stable_poles(predictor.residual_weights)
        )
        candidates = [SepState.HYBRID] if hybrid else []
        return candidates + ([SepState.PHYSICS] if most is not SepState.OFF else [])
