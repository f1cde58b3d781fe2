"""Plans with the trusted model: the physics model's plan, or one on the trusted model, which judges it to be better.

Where a plan runs away, the physics model plans the rest of the run.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from ..base.signals import Array
from ..predict.predictor import HybridPredictor
from ..predict.trust.state import TrustedModel
from ..predict.window import Prediction
from .linearised import PlanModel
from .plan import SepState
from .planning import ChosenPlan, Planning, Preview, PublishedPosition
from .trusted_plan import TOLERANCE, TrustedPlanner, is_better, runs_away

__all__ = ["TrustedPlanning"]

_PINNED = 24
"""Leading samples of a window in which every plan follows the last one, as it takes more work than one on the paper's
model."""


class TrustedPlanning(Planning):
    """Plans with the trusted model, which watches itself."""

    PINNED: ClassVar[int] = _PINNED
    ALWAYS: ClassVar[bool] = True

    def choose(self, predictor: HybridPredictor, preview: Preview, most: SepState) -> ChosenPlan:
        """Return the physics model's plan, or a better one by Newton steps on the trusted model."""
        assert predictor.start is not None
        path = preview.command - predictor.start
        model = self._model(predictor, path, preview)
        rest, scales = preview.rest, model.scales
        if most is SepState.OFF:
            return ChosenPlan(SepState.OFF, rest, scales)
        g, free = predictor.physics_operator(self.preview)
        follows = most is SepState.HYBRID and predictor.k >= predictor.n_init and model.has_learned
        physics = self.affine_plan(g, free, preview, self.limits(preview), TOLERANCE)
        if physics is None:
            return ChosenPlan(SepState.OFF, rest, scales)
        if not follows:
            return ChosenPlan(SepState.PHYSICS, physics, scales)
        with np.errstate(all="ignore"):
            planner = TrustedPlanner(self.basis, self.settings.jerk_weight, model, path, preview.delta_before)
            bounds = self.limits(preview, may_turn=True)
            hybrid, cost = planner.plan(rest, bounds, self.n_pinned, self.basis.filtered(g))
            better = is_better(cost, planner.cost(physics))
        if not better:
            return ChosenPlan(SepState.PHYSICS, physics, scales)
        if self._runs_away(hybrid, physics, cost):
            return ChosenPlan(SepState.PHYSICS, physics, scales, ends_hybrid=True)
        return ChosenPlan(SepState.HYBRID, hybrid, scales)

    def published(self, prediction: Prediction, state: SepState, most: SepState) -> PublishedPosition:
        """Return the model's position wherever it may plan.

        Its prediction needs no stability test, and which model planned the window is known only after its first samples
        have acted.
        """
        n_followed, Np = self.n_pinned * self.spacing, len(prediction.x_pb)
        if most is SepState.HYBRID:
            return PublishedPosition(prediction.x_h, prediction.x_h_std, prediction.n_warm_up, n_followed)
        return PublishedPosition(prediction.x_pb.copy(), np.zeros(Np), Np, n_followed)

    def _runs_away(self, hybrid: Array, physics: Array, cost: float) -> bool:
        change_max, values = self.settings.change_max, self.basis.values[: self.Np]
        if change_max is None:
            return False
        return runs_away(values @ hybrid, values @ physics, math.sqrt(cost / self.preview), change_max)

    def _model(self, predictor: HybridPredictor, path: Array, preview: Preview) -> PlanModel:
        """Return the trusted model over the preview, with the scales of the remainder of the last plan."""
        trusted = predictor.residual
        assert isinstance(trusted, TrustedModel)
        assert predictor.start is not None
        with np.errstate(all="ignore"):  # a prediction that is no candidate may overflow
            x_d = path + self.basis.values @ preview.rest
            return PlanModel(trusted, predictor.state.physics, predictor.state.late, predictor.start, x_d, path)
