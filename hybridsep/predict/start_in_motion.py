"""State of the physics model at the beginning of a run that is in motion, estimated from its first window.

A run is taken to begin at rest. A log that is cut in mid-motion, or a predictor that is switched on while the axis
moves, does not: what the axis did before decays as a free response of ``G_pb``, and so does what unmodelled
disturbances did before. Its state follows from the first window by least squares.
"""

from __future__ import annotations

import numpy as np

from ..base.signals import Array
from ..model.discrete import DiscreteModel
from ..model.physics import ModalModel
from .regression import RidgeRegression

__all__ = ["initial_state"]

_MOVING = 0.05
"""Commanded velocity of the first sample relative to the largest of the window, from which on an axis may have been in
motion: from rest a jerk-limited command needs time."""

_SAMPLES = 4
"""Samples for each number of the state that are needed to estimate it."""

_DAMPING = 1e-3
"""Ridge penalty on the change of the state, relative to a response of unit gain: modes that decay at once are not
determined."""


def initial_state(model: ModalModel, discrete: DiscreteModel, x_d: Array, residuals: Array) -> Array | None:
    """Return the state of ``G_pb`` that a run began with, ``(n_state,)``; None if it is more likely to be rest.

    The residuals decide, between rest and a motion at the first commanded velocity; the state is then the one that they
    are explained by best, near that of this motion.

    Parameters
    ----------
    model, discrete : ModalModel, DiscreteModel
        ``G_pb``.
    x_d : (n,) array, m
        Commands of the first window.
    residuals : (m,) array, m
        Of its first ``m`` samples, relative to the prediction from rest; NaN where missing.
    """
    speed, known = np.abs(np.diff(x_d)), np.isfinite(residuals)
    n = discrete.n_state - discrete.dead_time
    if known.sum() < _SAMPLES * n or not speed[0] > _MOVING * speed.max():
        return None
    moving = _state_in_motion(model, discrete, x_d[1] - x_d[0])
    states = np.column_stack((moving, np.eye(discrete.n_state, n)))
    responses, _ = discrete.forced_response(states, np.zeros((len(residuals), 1 + n)))
    seen, left = residuals[known], (residuals - responses[:, 0])[known]
    if not left @ left < seen @ seen:
        return None
    regression = RidgeRegression(n, _DAMPING)
    regression.update(responses[known, 1:], left)
    return np.asarray(states @ np.concatenate(([1.0], regression.weights)))


def _state_in_motion(model: ModalModel, discrete: DiscreteModel, step: float) -> Array:
    """Return the state at command 0 of a motion that has lasted, ``step`` from sample to sample, m, ``(n_state,)``."""
    register = step * np.arange(-discrete.dead_time, 0)
    # z̈ + 2ζω ż + ω² z = v t has the solution ω² z = v t − 2ζ v/ω, in the state (ω² z, ω ż).
    late = -discrete.dead_time * step
    v = step / discrete.T_s
    states = [(late - 2.0 * mode.zeta * v / mode.omega, v / mode.omega) for mode in model.modes]
    return np.concatenate((np.ravel(states), register))
