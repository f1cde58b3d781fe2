"""Recordings of simulated linear axes, for the tests of identification."""

import numpy as np
from scipy.signal import lfilter

from hybridsep import PAPER_LIMITS, ModalModel, rest_to_rest
from hybridsep.base.signals import Array

T_S = 1e-3


def moves(n: int = 4000, seed: int = 0) -> Array:
    """Return jerk-limited moves of 1 to 5 mm every 0.25 s, (n,), m."""
    n_moves = n // 250 + 1
    targets = np.concatenate(([0.0], np.random.default_rng(seed).uniform(-2.5e-3, 2.5e-3, n_moves)))
    starts = [0.1 + 0.25 * i for i in range(n_moves)]
    return rest_to_rest(targets, PAPER_LIMITS, T_S, start_times=starts, duration=starts[-1] + 0.25)[:n]


def measured(model: ModalModel, x_d: Array, input_hold: str = "zoh", noise: float = 0.0, seed: int = 1) -> Array:
    """Return the measured position of an axis at rest at its first command, m."""
    discrete = model.discretise(T_S, input_hold)
    x = discrete.forced_response(discrete.rest(), x_d - x_d[0])[0] + x_d[0]
    return np.asarray(x + noise * np.random.default_rng(seed).standard_normal(len(x)))


def correlated(n: int, std: float, seed: int) -> Array:
    """Return noise with a correlation of some 50 samples, (n,), m."""
    white = np.random.default_rng(seed).standard_normal(n + 500)
    return np.asarray(std * np.sqrt(1 - 0.98**2) * lfilter([1.0], [1.0, -0.98], white)[500:])
