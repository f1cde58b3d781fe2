"""Trusted model over a preview, and its linearisation in the commands.

Disturbances are not affine in the commands, so a plan uses their slope at given commands, which is ``sech²(v/v_i)`` for
friction and ``2|x|`` for stiffness. The weights of the experts and of the stack, and the shrinking by the variance, are
held constant:

``∂x_h = (1 − π_A) G_pb + π_L ∂f_L + π_S ∂f_S + π_A ∂x_A``

The expert of the command alone, A, is linear and time-invariant: its features are increments and lags of the command.
The expert D, which doubts earlier runs, counts as the expert whose counterpart it is.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from ..base.signals import Array
from ..predict.residual_window import ResidualWindow
from ..predict.trust.disturbances import DisturbanceSlopes
from ..predict.trust.expert import SolvedExpert
from ..predict.trust.forecast import TrustedForecast, forecast_by, scales_of, solved
from ..predict.trust.stack import STATIC
from ..predict.trust.state import OF_COMMAND, TrustedModel

__all__ = ["PlanModel"]


class PlanModel:
    """Trusted model with the weights of this instant, as a function of the commands of a preview.

    Parameters
    ----------
    model : TrustedModel
        Where the measurements end, which is the beginning of the preview unless they are late.
    state : (n_state,) array
        State of ``G_pb`` there.
    late : (measurement_delay,) array, m
        Commands between there and the preview, relative to the start.
    start : float, m
    x_d, path : (n,) array, m
        Commands from which the scales of the features and the variances of predictions follow; and unmodified commands.
        Both relative to the start.

    Attributes
    ----------
    scales : FeatureScales
    """

    def __init__(self, model: TrustedModel, state: Array, late: Array, start: float, x_d: Array, path: Array) -> None:
        self._model, self._static, self._discrete = model, model.fixed.static, model.fixed.static.discrete
        self._state, self._late, self._start = state, late, start
        window = self._window(x_d)
        self.scales = scales_of(model, window, path)
        self._solved = solved(model, self.scales)
        self._held = forecast_by(model, self._solved, window, self.scales).predictions

    def _window(self, x_d: Array) -> ResidualWindow:
        """Return the preview under commands ``x_d``, and what is late before it."""
        command = np.concatenate((self._late, x_d))
        x_pb, _ = self._discrete.forced_response(self._state, command)
        return ResidualWindow(command, x_pb, self._start)

    @property
    def has_learned(self) -> bool:
        """Whether it has learned how the drive's disturbances act."""
        return STATIC in self._solved

    def predict(self, x_d: Array) -> TrustedForecast:
        """Predict the preview, and what is late before it, under commands ``x_d``, ``(n,)``, m."""
        return forecast_by(self._model, self._solved, self._window(x_d), self.scales, self._held)

    def position(self, at: TrustedForecast) -> Array:
        """Return ``x_h`` of :meth:`predict` over the preview, ``(n,)``, m."""
        return (at.window.x_pb + at.e_h)[len(self._late) :]

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
            Reach of the friction's slope, as in :meth:`StaticFeatures.slopes`.
        """
        n_late, weights = len(self._late), self._model.learned.stack.weights.tolist()
        over_all = self._static.slopes(self._model.run.static, at.window, at.x, self.scales.velocity, reach)
        slopes = DisturbanceSlopes(*(part[n_late:] for part in over_all))
        total: Array = passed.copy()
        for expert, one in self._solved.items():
            if weights[expert] == 0.0:
                continue
            kept = weights[expert] * at.predictions[expert].shrink[n_late:, None]
            if self._model.kind_of(expert) == OF_COMMAND:
                acted = self._late_changes(changes)
                total += kept * self._of_command(one, acted) + weights[expert] * (acted - passed)
            else:
                total += kept * self._of_disturbances(one, slopes, changes, passed)
        return total

    def _late_changes(self, changes: Array) -> Array:
        """Return what changes of the commands are after the dead time, ``(n, m)``, m."""
        d = min(self._model.fixed.command.dead_time, len(changes))
        return np.concatenate((np.zeros_like(changes[:d]), changes[: len(changes) - d]))

    def _of_command(self, solved: SolvedExpert, acted: Array) -> Array:
        """Return the change of the command's residual with changes of the commands after the dead time, ``(n, m)``."""
        increments = np.diff(acted, axis=0, prepend=0.0)
        drive = lfilter(solved.solution.weights[1 : solved.n_static], [1.0], increments, axis=0)
        return _recur(solved, drive)

    def _of_disturbances(self, solved: SolvedExpert, slopes: DisturbanceSlopes, changes: Array, passed: Array) -> Array:
        """Return the change of the physics model's residual by an expert with static features, ``(n, m)``."""
        discrete = self._discrete
        velocity = np.diff(changes, axis=0, prepend=0.0) / discrete.T_s
        moved = np.diff(passed, axis=0, prepend=0.0) / discrete.T_s
        linear, own, differences = self._static.split(solved.solution.weights[: solved.n_static])
        disturbance = slopes.change(own, velocity, passed, moved)
        disturbance += np.diff(slopes.change(differences, velocity, passed, moved), axis=0, prepend=0.0)
        drive, _ = discrete.forced_response(discrete.rest(changes.shape[1]), disturbance)
        difference = passed
        for weight in linear:
            drive = drive + weight * difference
            difference = np.diff(difference, axis=0, prepend=0.0)
        return _recur(solved, drive)


def _recur(solved: SolvedExpert, drive: Array) -> Array:
    """Return the free run ``e(k) = drive(k) + Σ_i w_e,i e(k−i)`` from rest, ``(n, m)``."""
    if not len(solved.lag_weights):
        return drive
    return np.asarray(lfilter([1.0], np.concatenate(([1.0], -solved.lag_weights)), drive, axis=0))
