"""Plan on the trusted model, by Newton steps that follow the slope of its disturbances.

``min ‖x_d − x_h(x_d + δ)‖² + jerk_weight·‖D³ δ‖²`` within the drive's limits, where ``x_h`` is not affine in ``δ``:
friction that follows the command changes its sign with the command's velocity. Each step solves the quadratic programme
of the linearised model (Gauss-Newton), and goes to its minimum, or less far if only that lowers the cost. The first
samples of a plan follow the last plan, and the plan is made while they act. Steps, their lengths and the steps of the
solver are limited, so that the work fits into these samples. Predictions are shrunk by their variance, so where the
model knows nothing the plan is the physics model's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.signals import Array
from ..predict.trust.forecast import TrustedForecast
from .constraints import Bounds, solve, solve_again
from .interior import Tolerance
from .linearised import PlanModel
from .splines import N_DECIDED, PlanCost, SplineBasis

__all__ = ["TOLERANCE", "TrustedPlanner", "is_better", "runs_away"]

_SOLVED = (5, 5, 3, 3)
"""Solver steps at most, of the physics model's plan and of the programme of each Newton step: from the second one on a
bounded one begins where the last one ended."""

TOLERANCE = Tolerance(1e-4, 1e-2, 1e-5, _SOLVED[0])
"""Of the solver: a plan is judged by the model itself, and taken if it is better than the others. With a margin as
small as rounding an end that exceeds a bound by a millionth would be no plan; with a larger one there may be none
within the bounds."""

_REACHES = (0.1, 0.01, 0.0)
"""Reach of friction's slope in each Newton step, relative to the model's velocity scale: a tangent is blind to a sign
that changes nearby."""

_LENGTHS = (1.0, 0.3)
"""Lengths of a step that are tried, relative to the way to the minimum."""

_GAIN, _LEAST_GAIN = 1e-3, 1e-9
"""Relative gain of a step below which it is the last one, and below which a plan is no better than another: costs that
rounding tells apart are equal."""


_AT_BOUND, _BOUND_SHARE, _LEFT = 0.97, 0.2, 0.3
"""A plan is at its bound where its change is this share of the largest change. It may be there longer than the physics
model's plan by this share of a window, and may leave this RMS error then, relative to the largest change."""


def runs_away(delta: Array, of_physics: Array, error: float, change_max: float) -> bool:
    """Return whether a plan asks for a larger change than compensation is made for: its model is wrong then.

    A motor at its limit does not follow, so that the next plan asks for more. A position loop that is driven so far may
    fall into a second state with an error many times larger, and stays in it when compensation ends.

    Parameters
    ----------
    delta, of_physics : (Np,) arrays, m
        Changes of the command by the plan, and by the physics model's.
    error : float, m
        RMS error that the plan leaves, by its own model.
    change_max : float, m
        Largest change of the command.
    """
    shares = [float(np.mean(np.abs(change) > _AT_BOUND * change_max)) for change in (delta, of_physics)]
    return error > _LEFT * change_max and shares[0] - shares[1] > _BOUND_SHARE


def is_better(cost: float, other: float) -> bool:
    """Return whether a plan costs less, m², than another; not if it is NaN."""
    return cost < (1.0 - _LEAST_GAIN) * other


@dataclass(frozen=True)
class _Point:
    """Coefficients ``(3 + n_free,)``; prediction, position and third differences, ``(preview,)``, and cost, m²."""

    coefficients: Array
    prediction: TrustedForecast
    x_h: Array
    third: Array
    cost: float


class TrustedPlanner:
    """Cost of the plans of one window on the trusted model.

    Parameters
    ----------
    basis : SplineBasis
    jerk_weight : float
    model : PlanModel
        Of the preview that the window begins.
    x_d : (preview,) array, m
        Commanded positions, relative to the start.
    delta_before : (3,) array, m
        Last three values of δ.
    """

    def __init__(
        self, basis: SplineBasis, jerk_weight: float, model: PlanModel, x_d: Array, delta_before: Array
    ) -> None:
        self._basis, self._jerk_weight, self._model, self._x_d = basis, jerk_weight, model, x_d
        self._third_before = np.diff(np.concatenate((delta_before, np.zeros(len(x_d)))), 3)

    def cost(self, coefficients: Array) -> float:
        """Return the cost of a plan, m²; not finite if its prediction overflows."""
        return self._at(coefficients).cost

    def plan(self, rest: Array, bounds: Bounds, n_pinned: int, passed: Array) -> tuple[Array, float]:
        """Return the coefficients of the best plan found from the remainder of the last plan, and its cost, m².

        Parameters
        ----------
        rest : (3 + n_free,) array, m
            Coefficients of the remainder of the last plan, the decided ones first; they are feasible.
        bounds : Bounds
        n_pinned : int
            Coefficients that the plan does not change.
        passed : (preview, n_free) array
            Free splines filtered by ``G_pb``.
        """
        splines, third = self._basis.values[:, N_DECIDED:], self._basis.third[:, N_DECIDED:]
        here, last = self._point(rest, self._model.of_rest), None
        for reach, steps in zip(_REACHES, _SOLVED[1:], strict=True):
            W = self._model.slope(here.prediction, splines, passed, reach)
            at = here.coefficients[N_DECIDED:]
            P = W.T @ W + self._jerk_weight * (third.T @ third)
            target = self._x_d - here.x_h + W @ at
            v = W.T @ target - self._jerk_weight * (third.T @ (here.third - third @ at))
            cost, tolerance = PlanCost.regular(P, v), TOLERANCE._replace(steps=steps)
            found = (
                solve(cost, bounds, rest[N_DECIDED:], n_pinned, always=True, tolerance=tolerance)
                if last is None
                else solve_again(cost, bounds, rest[N_DECIDED:], n_pinned, at, last, tolerance)
            )
            if found is None:
                break
            last = found.ending
            ends = (np.concatenate((rest[:N_DECIDED], at + length * (found.x - at))) for length in _LENGTHS)
            best = next((end for end in map(self._at, ends) if is_better(end.cost, here.cost)), None)
            if best is None:
                break
            gain, here = here.cost - best.cost, best
            if gain < _GAIN * (gain + here.cost):
                break
        return here.coefficients, here.cost

    def _at(self, coefficients: Array) -> _Point:
        return self._point(coefficients, self._model.predict(self._x_d + self._basis.values @ coefficients))

    def _point(self, coefficients: Array, prediction: TrustedForecast) -> _Point:
        third = self._basis.third @ coefficients + self._third_before
        x_h = self._model.position(prediction)
        error = self._x_d - x_h
        cost = float(error @ error) + self._jerk_weight * float(third @ third)
        return _Point(coefficients, prediction, x_h, third, cost)
