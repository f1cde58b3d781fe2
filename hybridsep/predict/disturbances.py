"""Features without lags: the physics-based prediction, and disturbances filtered by the physics model.

What the physics model misses acts where the command does, so ``e_pb = G_pb d(x, v)``. A feature is ``G_pb`` applied to
a candidate disturbance ``d``: friction ``tanh(v/v_i)`` over a spread of velocities ``v_i``, stiffness ``x·|x|`` and
damping ``v·|v|``. First differences of the features take up errors of ``G_pb`` in phase. As nothing here depends on the
learned weights, no recursion can become unstable.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..base.signals import Array
from ..model.discrete import DiscreteModel

__all__ = ["LEAST_VELOCITY", "N_DISTURBANCES", "StaticFeatures", "StaticState"]

_FRICTION_SPREAD = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0)
"""Velocities ``v_i`` of the friction's change of sign, relative to the velocity scale."""

N_DISTURBANCES = len(_FRICTION_SPREAD) + 2

LEAST_VELOCITY = 1e-200
"""Velocity, m/s, below which a command is at rest: ratios of smaller ones may underflow."""

_DIFFERENCES = 3
"""Largest order of a difference of ``x_pb``: velocity, acceleration and jerk."""

_DIFFERENCE_SHARE = 0.03
"""Effect of a disturbance's first difference relative to its own: they only correct its timing."""


class StaticState(NamedTuple):
    """State of the features between two windows; positions relative to the start.

    Attributes
    ----------
    filters : (n_state, N_DISTURBANCES) array
        State of ``G_pb`` for each disturbance.
    filtered : (N_DISTURBANCES,) array
        Last filtered disturbances.
    x_d : float, m
        Last command.
    x_pb : (4,) array, m
        Last physics-based predictions, oldest first.
    """

    filters: Array
    filtered: Array
    x_d: float
    x_pb: Array


class DisturbanceSlopes(NamedTuple):
    """Slopes of the disturbances at given commands.

    Attributes
    ----------
    friction : (n, N_DISTURBANCES − 2) array, s/m
        Of each friction with the commanded velocity.
    stiffness, damping : (n,) array, m and m/s
        Of ``x·|x|`` with ``x`` and of ``v·|v|`` with ``v``.
    """

    friction: Array
    stiffness: Array
    damping: Array


class StaticFeatures:
    """Features without lags, over consecutive windows.

    Parameters
    ----------
    discrete : DiscreteModel
        ``G_pb``.
    q : int
        Largest lag of ``x_pb``, as that many differences, at most three.

    Attributes
    ----------
    n : int
        Number of features.
    shares : (n,) array
        Effect that a feature may have, relative to the largest.
    damping_of_motion : bool
        Whether the damping is that of the position's own velocity; else that of ``x_pb``. Behind a compensator ``x_pb``
        turns with every change of the command, and is far from the motion.
    """

    def __init__(self, discrete: DiscreteModel, q: int) -> None:
        self.discrete = discrete
        self.damping_of_motion = False
        self.n_differences = min(q, _DIFFERENCES)
        self.n = 2 + self.n_differences + 2 * N_DISTURBANCES
        self.shares = np.ones(self.n)
        self.shares[-N_DISTURBANCES:] = _DIFFERENCE_SHARE

    def rest(self) -> StaticState:
        """Return the state at rest."""
        return StaticState(
            self.discrete.rest(N_DISTURBANCES), np.zeros(N_DISTURBANCES), 0.0, np.zeros(_DIFFERENCES + 1)
        )

    def peak_velocity(self, state: StaticState, x_d: Array) -> float:
        """Return the largest magnitude of the commanded velocity over a window, m/s."""
        return float(np.abs(np.diff(x_d, prepend=state.x_d)).max()) / self.discrete.T_s

    def rows(
        self, state: StaticState, x_d: Array, x_pb: Array, x: Array, velocity_scale: float
    ) -> tuple[Array, StaticState]:
        """Return the features of a window, ``(n, self.n)``, and the state after it.

        Columns: 1; ``x_pb`` and its differences; the filtered disturbances; their first differences.

        Parameters
        ----------
        state : StaticState
            Not changed.
        x_d, x_pb, x : (n,) array, m
            Commands, physics-based prediction, and the position that the stiffness acts at, and the damping where it is
            that of the motion.
        velocity_scale : float
            Velocity, m/s, that the friction's change of sign is relative to; 0 before any motion.
        """
        T_s, m = self.discrete.T_s, self.n_differences
        v_d = np.diff(x_d, prepend=state.x_d) / T_s
        past = np.concatenate((state.x_pb, x_pb))
        v = self._damped_velocity(state, x_pb, x)
        disturbances = np.empty((len(x_d), N_DISTURBANCES))
        disturbances[:, :-2] = np.tanh(v_d[:, None] / _spread(velocity_scale))
        disturbances[:, -2] = x * np.abs(x)
        disturbances[:, -1] = v * np.abs(v)
        filtered, filters = self.discrete.forced_response(state.filters, disturbances)
        rows = np.empty((len(x_d), self.n))
        rows[:, 0] = 1.0
        for i in range(m + 1):
            rows[:, 1 + i] = np.diff(past, i)[_DIFFERENCES + 1 - i :]
        rows[:, 2 + m : 2 + m + N_DISTURBANCES] = filtered
        rows[:, 2 + m + N_DISTURBANCES :] = np.diff(filtered, axis=0, prepend=state.filtered[None])
        return rows, StaticState(filters, filtered[-1].copy(), float(x_d[-1]), past[-_DIFFERENCES - 1 :].copy())

    def slopes(
        self, state: StaticState, x_d: Array, x_pb: Array, x: Array, velocity_scale: float, reach: float
    ) -> DisturbanceSlopes:
        """Return the slopes of the disturbances of a window; other parameters as those of :meth:`rows`.

        Parameters
        ----------
        reach : float
            Half of the change of velocity that the friction's slope is taken over, relative to the velocity scale;
            0: the tangent.
        """
        v_d = np.diff(x_d, prepend=state.x_d) / self.discrete.T_s
        spread = _spread(velocity_scale)
        v, half = v_d[:, None], reach * velocity_scale
        if half > 0.0:
            friction = (np.tanh((v + half) / spread) - np.tanh((v - half) / spread)) / (2.0 * half)
        else:
            friction = (1.0 - np.tanh(v / spread) ** 2) / spread
        return DisturbanceSlopes(friction, 2.0 * np.abs(x), 2.0 * np.abs(self._damped_velocity(state, x_pb, x)))

    def _damped_velocity(self, state: StaticState, x_pb: Array, x: Array) -> Array:
        """Return the velocity of the damping over a window, ``(n,)``, m/s."""
        v = np.diff(x_pb, prepend=state.x_pb[-1])
        if self.damping_of_motion:
            e = x - x_pb
            v = v + np.diff(e, prepend=e[:1])
        return np.asarray(v / self.discrete.T_s)

    def split(self, weights: Array) -> tuple[Array, Array, Array]:
        """Return the weights of ``x_pb`` and its differences, of the disturbances, and of their first differences."""
        first = 2 + self.n_differences
        return weights[1:first], weights[first : first + N_DISTURBANCES], weights[first + N_DISTURBANCES :]


def _spread(velocity_scale: float) -> Array:
    """Return the velocities of the friction's change of sign, m/s."""
    return (velocity_scale or 1.0) * np.array(_FRICTION_SPREAD)
