"""State of the physics model at the beginning of a run that is in motion, estimated from its first window.

A run is taken to begin at rest. A log that is cut in mid-motion, or a predictor that is switched on while the axis
moves, does not: what the axis did before decays as a free response of ``G_pb``, and so does what unmodelled
disturbances did before. Its state follows from the first window by least squares.
"""

from typing import NamedTuple

import numpy as np

from ...base.signals import Array
from ...model.discrete import DiscreteModel
from ...model.physics import ModalModel
from ..regression import RidgeRegression

_MOVING = 0.05
"""Commanded velocity of the first sample relative to the largest of the window, from which on an axis may have been in
motion: from rest a jerk-limited command needs time."""

_SAMPLES = 2  # samples for each number of the state that are needed: with one, noise at rest may be explained as motion

_DAMPING = 1e-3
"""Ridge penalty on the change of the state, relative to a response of unit gain: fast modes are not determined."""


class MotionBefore(NamedTuple):
    """Motion before a run, relative to rest."""

    state: Array  # (n_state,), m: of ``G_pb`` at the beginning of the first window
    x_d: Array  # (n,), m: commands of the window: 0, except the late ones at its beginning, which came before the run
    x_pb: Array  # (n,), m: response to both


def motion_before(
    model: ModalModel, discrete: DiscreteModel, x_d: Array, residuals: Array, late: int
) -> MotionBefore | None:
    """Return the motion that a run began in; None if it is more likely to have begun at rest.

    The residuals decide, between rest and a motion at the first commanded velocity; the state is then the one that they
    are explained by best, near this motion's.

    ``model`` and ``discrete`` are ``G_pb``; ``x_d``, (n,), m: commands of the first window, ``late`` from
    before the run; ``residuals``, (m,), m: of its first ``m`` samples, relative to the prediction from rest; NaN
    where missing; ``late``: samples by which the measurement is late.
    """
    speed, known = np.abs(np.diff(x_d[late:])), np.isfinite(residuals)
    n = discrete.n_state - discrete.dead_time
    if known[late:].sum() < _SAMPLES * n or not speed[0] > _MOVING * speed.max():
        return None
    step = float(x_d[late + 1] - x_d[late])
    commands = np.zeros(len(x_d))
    commands[:late] = step * np.arange(-late, 0)
    # z̈ + 2ζω ż + ω² z = v t has the solution ω² z = v t − 2ζ v/ω, in the state (ω² z, ω ż).
    here, v = -(discrete.dead_time + late) * step, step / discrete.T_s
    states = [(here - 2.0 * mode.zeta * v / mode.omega, v / mode.omega) for mode in model.modes]
    moving = np.concatenate((np.ravel(states), step * np.arange(-discrete.dead_time - late, -late)))
    of_motion, _ = discrete.forced_response(moving, commands)
    modes = np.eye(discrete.n_state, n)
    of_modes, _ = discrete.forced_response(modes, np.zeros((len(x_d), n)))
    seen, left = residuals[known], (residuals - of_motion[: len(residuals)])[known]
    if not left @ left < seen @ seen:
        return None
    change = RidgeRegression.init(n, _DAMPING).update(of_modes[: len(residuals)][known], left).weights
    return MotionBefore(moving + modes @ change, commands, of_motion + of_modes @ change)
