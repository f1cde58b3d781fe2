"""Trusted model over a preview, and its linearisation in the commands.

Disturbances of the commands are no affine functions of them, so a plan follows their slope: at given commands the
prediction changes with them as an affine map does, friction by ``sech²(v/v_i)``, stiffness by ``2|x|``. Weights, their
blend and the shrinking by the variance are held.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from ..base.signals import Array
from ..predict.trust.disturbances import DisturbanceSlopes
from ..predict.trust.forecast import TrustedForecast
from ..predict.trust.model import TrustedModel

__all__ = ["PlanModel"]


class PlanModel:
    """Trusted model with the weights of this instant, as a function of the commands of a preview.

    Parameters
    ----------
    model : TrustedModel
        Where the measurements end, which is the beginning of the preview unless they are late; not changed.
    state : (n_state,) array
        State of ``G_pb`` there.
    late : (measurement_delay,) array, m
        Commands between there and the preview, relative to the start.
    x_d, path : (n,) array, m
        Commands that the scales of the features and the variances of predictions follow from, and unmodified ones,
        relative to the start.

    Attributes
    ----------
    scales : FeatureScales
    """

    def __init__(self, model: TrustedModel, state: Array, late: Array, x_d: Array, path: Array) -> None:
        self._model, self._discrete, self._state, self._late = model, model.static.discrete, state, late
        command = np.concatenate((late, x_d))
        x_pb, _ = self._discrete.forced_response(state, command)
        self.scales = model.scales(command, x_pb, path)
        self._solved = model.solved(self.scales)
        self._held = model.forecast_by(self._solved, command, x_pb, self.scales).predictions

    @property
    def has_learned(self) -> bool:
        """Whether it predicts something else than the physics model."""
        return bool(self._solved)

    def predict(self, x_d: Array) -> TrustedForecast:
        """Predict the preview, and what is late before it, under commands ``x_d``, ``(n,)``, m."""
        command = np.concatenate((self._late, x_d))
        x_pb, _ = self._discrete.forced_response(self._state, command)
        return self._model.forecast_by(self._solved, command, x_pb, self.scales, self._held)

    def position(self, at: TrustedForecast) -> Array:
        """Return ``x_h`` of :meth:`predict` over the preview, ``(n,)``, m."""
        return (at.x_pb + at.e_h)[len(self._late) :]

    def slope(self, at: TrustedForecast, changes: Array, passed: Array, reach: float) -> Array:
        """Return the change of ``x_h`` with changes of the commands, ``(n, m)``, once something is learned.

        Parameters
        ----------
        at : TrustedForecast
            Of :meth:`predict`, where the model is linearised.
        changes : (n, m) array
            Changes of the commands, each a column.
        passed : (n, m) array
            The changes filtered by ``G_pb``.
        reach : float
            Of the friction's slope, as that of :meth:`StaticFeatures.slopes`.
        """
        static, discrete, n_late = self._model.static, self._discrete, len(self._late)
        total: Array = passed.copy()
        parts = self._model.blend.weights[1:].tolist()
        over_all = static.slopes(self._model.state, at.x_d, at.x_pb, at.x, self.scales.velocity, reach)
        slopes = DisturbanceSlopes(*(part[n_late:] for part in over_all))
        velocity = np.diff(changes, axis=0, prepend=0.0) / discrete.T_s
        moved = np.diff(passed, axis=0, prepend=0.0) / discrete.T_s
        for solved, found, part in zip(self._solved, at.predictions, parts, strict=True):
            if part == 0.0:
                continue
            shrink = part * found.shrink[n_late:]
            linear, own, differences = static.split(solved.solution.weights[: solved.n_static])
            disturbance = np.zeros_like(changes)
            for weights, is_difference in ((own, False), (differences, True)):
                acts = slopes.change(weights, velocity, passed, moved)
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
