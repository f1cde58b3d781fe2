"""A compensator of the default machine, its plant and its moves."""

from typing import Any

import numpy as np
from staircase_data import commanded

from hybridsep.base.settings import CompensatorSettings, Limits, PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.compensate.compensator import SepCompensator
from hybridsep.cosim.loop import cosimulate
from hybridsep.cosim.run import Run
from hybridsep.machines.machine import load_machine
from hybridsep.model.physics import ModalModel
from hybridsep.plants.plant import Encoder, Plant
from hybridsep.plants.trajectory import PAPER_LIMITS, rest_to_rest
from hybridsep.predict.predictor import HybridPredictor

MODEL = ModalModel.spring_mass_damper(1.0, 15.7, 24674.0)
RECOMMENDED = PredictorSettings(averaging=False, Np=50, p=50, q=40, lam=1e-8, t_init=0.1)  # of the paper's model
DRIVE_LIMITS = Limits(0.1, 16.0, 5000.0)
TS = 1e-3


def compensator(
    compensate: str = "hybrid", limits: Limits | None = DRIVE_LIMITS, *, no_reversal: bool = True, **changes: Any
) -> SepCompensator:
    predictor = HybridPredictor(MODEL, PredictorSettings(**{"averaging": False, **changes}))
    return SepCompensator(
        predictor, CompensatorSettings(preview=200, limits=limits, compensate=compensate, no_reversal=no_reversal)
    )


def plant() -> Plant:
    return load_machine("spring_mass_damper").new_plant()


def move(n: int = 200, end: float = 0.01) -> Array:
    """Return a move that begins at sample 20."""
    x_d = rest_to_rest([0.0, end], PAPER_LIMITS, TS, start_times=[0.02])
    return np.concatenate((x_d, np.full(max(n - len(x_d), 0), end)))[:n]


def beyond(x_dm: Array, limits: Limits) -> float:
    """Return the largest share of a limit that a command takes."""
    bounds = (limits.velocity, limits.acceleration, limits.jerk)
    return max(float(np.max(np.abs(np.diff(x_dm, i)))) / (b * TS**i) for i, b in enumerate(bounds, start=1))


def turned(x_dm: Array, x_d: Array) -> int:
    """Return in how many samples a command runs against one that moves; m."""
    return int(np.sum((np.diff(x_dm) * np.sign(np.diff(x_d)))[np.abs(np.diff(x_d)) > 1e-12] < -1e-12))


def closed(sep: SepCompensator, seed: int = 0, **more: Any) -> Run:
    return cosimulate(
        sep, plant(), commanded()[: more.pop("n", None)], encoder=Encoder(more.pop("noise", 5e-6), seed), **more
    )
