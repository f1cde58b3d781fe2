"""The staircase experiment of the paper, made independently of the library's own plant and trajectory.

Six 10 mm moves, three up, three down, on ``m ẍ + c ẋ + k x + c_nl ẋ|ẋ| + k_nl x|x| = c ẋ_d + k x_d``, held for 1 ms.
"""

from functools import lru_cache

import numpy as np
from ruckig import InputParameter, Ruckig, Trajectory

from hybridsep.base.signals import Array

M, C, K = 1.0, 15.7, 24674.0  # kg, N·s/m, N/m
C_NL, K_NL = 100.0, 1000.0  # N·s²/m², N/m²
TS = 1e-3  # s
N_SAMPLES = 6001
NOISE_STD = 5e-6  # m
_STEP = 0.01  # m
_SUBSTEPS = 10


@lru_cache(maxsize=1)
def commanded() -> Array:
    """Return the commanded positions, (6001,), m."""
    t = np.arange(N_SAMPLES) * TS
    x_d = np.zeros(N_SAMPLES)
    position = 0.0
    for second in range(6):
        target = position + (_STEP if second < 3 else -_STEP)
        move = InputParameter(1)
        move.current_position, move.target_position = [position], [target]
        move.current_velocity = move.current_acceleration = [0.0]
        move.max_velocity, move.max_acceleration, move.max_jerk = [0.08], [8.0], [1000.0]
        trajectory = Trajectory(1)
        Ruckig(1).calculate(move, trajectory)
        for k in range(second * 1000, N_SAMPLES):
            elapsed = t[k] - second
            x_d[k] = trajectory.at_time(elapsed)[0][0] if elapsed < trajectory.duration else target
        position = target
    return x_d


@lru_cache(maxsize=1)
def true_position() -> Array:
    """Return the drive's true positions, (6001,), m, by RK4 with ten substeps a millisecond."""

    def slope(x: float, y: float, x_d: float) -> tuple[float, float]:
        # y = m ẋ + c x − c x_d has no derivative of the command in its equation.
        v = (y - C * x + C * x_d) / M
        return v, K * x_d - K * x - C_NL * v * abs(v) - K_NL * x * abs(x)

    h = TS / _SUBSTEPS
    x, y = 0.0, 0.0
    positions = np.empty(N_SAMPLES)
    for k, x_d in enumerate(commanded().tolist()):
        positions[k] = x
        for _ in range(_SUBSTEPS):
            a1, b1 = slope(x, y, x_d)
            a2, b2 = slope(x + h / 2 * a1, y + h / 2 * b1, x_d)
            a3, b3 = slope(x + h / 2 * a2, y + h / 2 * b2, x_d)
            a4, b4 = slope(x + h * a3, y + h * b3, x_d)
            x += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
            y += h / 6 * (b1 + 2 * b2 + 2 * b3 + b4)
    return positions


def measured(seed: int) -> Array:
    """Return the measured positions, (6001,), m: the true ones with 5 µm of encoder noise."""
    noise: Array = np.random.default_rng(seed).normal(0.0, NOISE_STD, N_SAMPLES)
    return true_position() + noise
