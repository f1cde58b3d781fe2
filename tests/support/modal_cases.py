"""Modes of every kind, and commands for them."""

import numpy as np
import oracle

from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel, Mode

TS = 1e-3


UNDER = Mode(25.0, 0.05, 24674.0, 15.7)


CRITICAL = Mode(20.0, 1.0, 15791.4, 30.0)


OVER = Mode(15.0, 3.0, 8882.6, -4.0)


LIGHT = Mode(80.0, 0.01, -900.0, 0.7)


CASES = {
    "under-damped": ModalModel([UNDER]),
    "critical": ModalModel([CRITICAL]),
    "over-damped": ModalModel([OVER]),
    "three modes": ModalModel([UNDER, OVER, LIGHT]),
}


HOLDS = ("zoh", "foh")


def command(n: int, seed: int = 0) -> Array:
    """Return a rough command that starts away from zero, (n,), m."""
    rng = np.random.default_rng(seed)
    return np.asarray(0.01 * np.cumsum(rng.normal(size=n)) / np.sqrt(n) + 0.003, dtype=np.float64)


def transfer_function(model: ModalModel) -> tuple[Array, Array]:
    return oracle.transfer_function([(mode.f_n, mode.zeta, mode.alpha, mode.beta) for mode in model.modes])
