"""Trusted model over a preview, and its linearisation in the commands.

Disturbances of the commands are no affine functions of them, so a plan follows their slope: at given commands the
prediction changes with them as an affine map does, friction by ``sech²(v/v_i)``, stiffness by ``2|x|``. Weights, their
blend and the shrinking by the variance are held.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from ..base.signals import Array
from .candidates import SolvedCandidate
from .trusted import TrustedModel

__all__ = ["PlanModel", "PlanPrediction"]


@dataclass(frozen=True)
class PlanPrediction:
    """Prediction over a preview under given commands.

    Attributes
    ----------
    x_d, x_pb, x_h : (n,) array, m
        Commands, and predicted positions by the physics model and by the blend, relative to the start.
    x : (n,) array, m
        Position that the stiffness acts at.
    shrink : tuple of (n,) arrays
        Weight of each learned candidate's recursion in ``x_h``; empty before anything is learned.
    """

    x_d: Array
    x_pb: Array
    x_h: Array
    x: Array
    shrink: tuple[Array, ...]


class PlanModel:
    """Trusted model with the weights of this instant, as a function of the commands of a preview.

    Parameters
    ----------
    model : TrustedModel
        At the beginning of the preview; not changed.
    state : (n_state,) array
        State of ``G_pb`` there.
    x_d, path : (n,) array, m
        Commands that the scales of the features follow from, and unmodified ones, relative to the start.
    """

    def __init__(self, model: TrustedModel, state: Array, x_d: Array, path: Array) -> None:
        self._model, self._discrete, self._state = model, model.static.discrete, state
        x_pb, _ = self._discrete.forced_response(state, x_d)
        self._velocity_scale, largest = model.scales(x_d, x_pb, path)
        self._solved: tuple[SolvedCandidate, ...] = ()
        if model.has_learned(self._velocity_scale):
            self._solved = tuple(model.solve(candidate, largest) for candidate in model.candidates)

    @property
    def has_learned(self) -> bool:
        """Whether it predicts something else than the physics model."""
        return bool(self._solved)

    def predict(self, x_d: Array) -> PlanPrediction:
        """Predict the preview under commands ``x_d``, ``(n,)``, m, relative to the start."""
        model = self._model
        x_pb, _ = self._discrete.forced_response(self._state, x_d)
        if not self._solved:
            return PlanPrediction(x_d, x_pb, x_pb, x_pb, ())
        rows, _ = model.static.rows(model.state, x_d, x_pb, x_pb, self._velocity_scale)
        x = x_pb + model.predict(self._solved[0], rows).e_h
        rows, _ = model.static.rows(model.state, x_d, x_pb, x, self._velocity_scale)
        found = [model.predict(solved, rows) for solved in self._solved]
        hold, *weights = model.blend.weights.tolist()
        x_h: Array = x_pb + hold * model.hold
        shrink: list[Array] = []
        for weight, prediction in zip(weights, found, strict=True):
            x_h = x_h + weight * prediction.e_h
            e = prediction.unshrunk
            shrink.append(weight * np.divide(prediction.e_h, e, out=np.zeros_like(e), where=e != 0.0))
        return PlanPrediction(x_d, x_pb, x_h, x, tuple(shrink))

    def slope(self, at: PlanPrediction, changes: Array, passed: Array, reach: float) -> Array:
        """Return the change of ``x_h`` with changes of the commands, ``(n, m)``.

        Parameters
        ----------
        at : PlanPrediction
            Where the model is linearised.
        changes : (n, m) array
            Changes of the commands, each a column.
        passed : (n, m) array
            The changes filtered by ``G_pb``.
        reach : float
            Of the friction's slope, as that of :meth:`StaticFeatures.slopes`.
        """
        static, discrete = self._model.static, self._discrete
        total: Array = passed.copy()
        if not self._solved:
            return total
        slopes = static.slopes(self._model.state, at.x_d, at.x_pb, at.x, self._velocity_scale, reach)
        velocity = np.diff(changes, axis=0, prepend=0.0) / discrete.T_s
        moved = np.diff(passed, axis=0, prepend=0.0) / discrete.T_s
        for solved, shrink in zip(self._solved, at.shrink, strict=True):
            linear, own, differences = static.split(solved.solution.weights[: solved.n_static])
            disturbance = np.zeros_like(changes)
            for weights, is_difference in ((own, False), (differences, True)):
                acts = (
                    (slopes.friction @ weights[: slopes.friction.shape[1]])[:, None] * velocity
                    + (weights[-2] * slopes.stiffness)[:, None] * passed
                    + (weights[-1] * slopes.damping)[:, None] * moved
                )
                disturbance += np.diff(acts, axis=0, prepend=0.0) if is_difference else acts
            drive, _ = discrete.forced_response(discrete.rest(changes.shape[1]), disturbance)
            difference = passed
            for weight in linear:
                drive = drive + weight * difference
                difference = np.diff(difference, axis=0, prepend=0.0)
            if len(solved.lag_weights):
                drive = np.asarray(lfilter([1.0], np.concatenate(([1.0], -solved.lag_weights)), drive, axis=0))
            total += shrink[:, None] * drive
        return total
