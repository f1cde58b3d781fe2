"""Trusted model over a preview, and its linearisation in the commands.

Disturbances are not affine in the commands, so a plan uses their slope at given commands, which is ``sech²(v/v_i)`` for
friction and ``2|x|`` for stiffness. The weights of the experts and of the stack, and the shrinking by the variance, are
held constant:

``∂x_h = (1 − π_A) G_pb + π_L ∂f_L + π_S ∂f_S + π_A ∂x_A``

The expert of the command alone, A, is linear and time-invariant: its features are increments and lags of the command.
The expert D, which doubts earlier runs, counts as the expert whose counterpart it is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from ..base.signals import Array
from ..predict.residual_window import ResidualWindow
from ..predict.trust.disturbances import N_FRICTION, N_LASTING, StaticFeatures, StaticState
from ..predict.trust.expert import ExpertPrediction, SolvedExpert
from ..predict.trust.forecast import TrustedForecast, forecast_by, scales_of, solved
from ..predict.trust.stack import STATIC
from ..predict.trust.state import OF_COMMAND, TrustedModel

__all__ = ["PlanModel"]

_OWN_REACH = 1e-3
"""Change of velocity, relative to the velocity scale, that slopes of the user's own disturbances are taken over where
the friction's is the tangent."""


_APART = 4
"""Samples behind the window that share the variance of the first one's features."""


class DisturbanceSlopes(NamedTuple):
    """Slopes of the disturbances at given commands.

    Attributes
    ----------
    friction : (n, 6) array, s/m
        Of each friction with the commanded velocity.
    stiffness, damping : (n,) array, m and m/s
        Of ``x·|x|`` with ``x`` and of ``v·|v|`` with ``v``.
    of_position : (n, n_disturbances − 8) array, 1/m
        Of all others with ``x``.
    of_velocity : (n, n_own) array, s/m
        Of the user's own, the last ones, with the commanded velocity.
    """

    friction: Array
    stiffness: Array
    damping: Array
    of_position: Array
    of_velocity: Array

    def change(self, weights: Array, velocity: Array, moved: Array, moved_velocity: Array) -> Array:
        """Return what the disturbances change by, ``(n, m)``, with weights ``(n_disturbances,)``.

        Parameters
        ----------
        weights : (n_disturbances,) array
        velocity : (n, m) array, m/s
            Changes of the commanded velocity, each a column.
        moved, moved_velocity : (n, m) array, m and m/s
            Changes of the position, and of its velocity.
        """
        of_position = weights[N_FRICTION] * self.stiffness + self.of_position @ weights[N_LASTING:]
        of_velocity = self.friction @ weights[:N_FRICTION]
        if n_own := self.of_velocity.shape[1]:
            of_velocity = of_velocity + self.of_velocity @ weights[-n_own:]
        return np.asarray(
            of_velocity[:, None] * velocity
            + of_position[:, None] * moved
            + (weights[N_FRICTION + 1] * self.damping)[:, None] * moved_velocity
        )


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
        Commands from which the scales of the features and the variances of predictions follow, of the remainder of the
        last plan; and unmodified commands.
        Both relative to the start.

    Attributes
    ----------
    scales : FeatureScales
    of_rest : TrustedForecast
        Prediction under ``x_d``, whose variances all others have.
    """

    def __init__(self, model: TrustedModel, state: Array, late: Array, start: float, x_d: Array, path: Array) -> None:
        self._model, self._static, self._discrete = model, model.fixed.static, model.fixed.static.discrete
        self._state, self._late, self._start = state, late, start
        window = self._window(x_d)
        self.scales = scales_of(model, window, path)
        self._solved = solved(model, self.scales)
        counts = np.arange(len(late) + len(x_d))
        behind = counts[len(late) + model.fixed.settings.Np :]
        behind -= np.arange(len(behind)) % _APART
        self.of_rest = forecast_by(model, self._solved, window, self.scales, counts=counts)

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
        return forecast_by(self._model, self._solved, self._window(x_d), self.scales, self.of_rest.predictions)

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
            Half of the change of velocity that the friction's slope is taken over, relative to the velocity scale.
        """
        n_late, weights = len(self._late), self._model.learned.stack.weights.tolist()
        over_all = slopes_of(self._static, self._model.run.static, at.window, at.x, self.scales.velocity, reach)
        slopes = DisturbanceSlopes(*(part[n_late:] for part in over_all))
        total: Array = passed.copy()
        for expert, one in self._solved.items():
            if weights[expert] == 0.0:
                continue
            kept = weights[expert] * _left(at.predictions[expert])[n_late:, None]
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
        weights, first = solved.solution.weights[: solved.n_static], 2 + self._static.n_differences
        linear, own, differences = np.split(weights[1:], [first - 1, first - 1 + self._static.n_disturbances])
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


def slopes_of(
    static: StaticFeatures, state: StaticState, window: ResidualWindow, x: Array, velocity_scale: float, reach: float
) -> DisturbanceSlopes:
    """Return the slopes of the disturbances of a window; other parameters as those of :meth:`StaticFeatures.rows`.

    Parameters
    ----------
    reach : float
        Half of the change of velocity that the friction's slope is taken over, relative to the velocity scale;
        0: the tangent.
    """
    x_d, x_pb, start = window
    v_d, spread = static.velocity(state, x_d), static.spread(velocity_scale)
    v, half = v_d[:, None], reach * velocity_scale
    if half > 0.0:
        friction = (np.tanh((v + half) / spread) - np.tanh((v - half) / spread)) / (2.0 * half)
    else:
        friction = (1.0 - np.tanh(v / spread) ** 2) / spread
    of_position = []
    if static.period > 0.0:
        angle, turns = static.angle(start + x), 2.0 * np.pi / static.period
        of_position += [(turns * np.cos(angle))[:, None], (-turns * np.sin(angle))[:, None]]
    of_velocity = np.empty((len(x), 0))
    if static.own:
        step, half = velocity_scale * static.discrete.T_s, half or _OWN_REACH * velocity_scale
        of_position.append(
            (static.own_at(start + (x + step), v_d) - static.own_at(start + (x - step), v_d)) / (2.0 * step)
        )
        of_velocity = (static.own_at(start + x, v_d + half) - static.own_at(start + x, v_d - half)) / (2.0 * half)
    damping = 2.0 * np.abs(static.damped_velocity(state, x_pb, x))
    return DisturbanceSlopes(
        friction, 2.0 * np.abs(x), damping, np.hstack([np.empty((len(x), 0)), *of_position]), of_velocity
    )


def _left(prediction: ExpertPrediction) -> Array:
    """Return what shrinking and bounds leave of a prediction, ``(n,)``."""
    unshrunk = prediction.unshrunk
    return np.asarray(np.divide(prediction.e_h, unshrunk, out=prediction.kept.copy(), where=unshrunk != 0.0))
