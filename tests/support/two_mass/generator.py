"""Random drives of two masses: pure functions of a seed and an index.

Their physics models are up to 40 % wrong, or a lag, or late by the wrong time.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from random_drives.drive import Draws, Drive

from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel, Mode
from two_mass.axis import Axis, Encoder, LinearLoop, random_axis, random_machine
from two_mass.commands import random_command
from two_mass.plant import TwoMassDrive

SEED = 2  # seed of the 250 drives that figures are given for
CHUNK = 25  # drives of one task: they take seconds each, and very different times
DURATION = (3.0, 5.0)  # length of a run, s
LOOK_AHEAD, NP_RANGE = (0.02, 0.1), (10, 400)  # look-ahead, s, and samples in a window
MODEL_ERROR = 0.4  # largest relative error of a parameter
CANCELLING = 3.0  # sum of the magnitudes of the modes' static gains from which on they cannot be wrong one by one


def nominal_model(draws: Draws, loop: LinearLoop, dead_time: int) -> ModalModel:
    """Return a physics model of a loop after a dead time, samples."""
    kind = draws.uniform(0.0, 1.0)
    true = loop.model
    if kind < 0.25:
        omega = loop.k_v * _off(draws)
        # 1/(τs + 1) = (ω² + ω s)/(s + ω)²
        modes = [Mode(omega / (2 * math.pi), 1.0, omega**2, omega)]
    elif kind < 0.6 and sum(abs(mode.alpha) / mode.omega**2 for mode in true.modes) < CANCELLING:
        modes = [_wrong(draws, mode) for mode in true.modes]
    else:
        names = ("stiffness", "damping", "viscous", "k_v", "k_p", "t_i", "load")
        wrong = replace(loop, **{name: getattr(loop, name) * _off(draws) for name in names})
        wrong = replace(wrong, load=min(wrong.load, 0.9))
        while wrong.least_damping < 0.01:  # a model must be stable
            wrong = replace(wrong, damping=1.5 * wrong.damping, k_p=0.9 * wrong.k_p, k_v=0.9 * wrong.k_v)
        modes = list(wrong.model.modes)
    known = draws.uniform(0.0, 1.0)
    gain = sum(mode.alpha / mode.omega**2 for mode in modes)
    asked = 1.0 if known < 0.6 else 1.0 + draws.uniform(-0.02, 0.02)
    if known > 0.8:
        asked = float(np.clip(gain, 1 - MODEL_ERROR, 1 + MODEL_ERROR))
    modes = [replace(mode, alpha=mode.alpha * asked / gain, beta=mode.beta * asked / gain) for mode in modes]
    late = dead_time
    if draws.chance(0.45):
        late = abs(dead_time + draws.choice((-3, -2, -1, 1, 2, 3)))
    return ModalModel(modes, late)


def _off(draws: Draws) -> float:
    return 1.0 + draws.uniform(-MODEL_ERROR, MODEL_ERROR)


def _wrong(draws: Draws, mode: Mode) -> Mode:
    """Return a mode with each parameter off: frequency, damping, and both parts of its gain."""
    frequency, gain = _off(draws), _off(draws)
    return Mode(
        mode.f_n * frequency,
        mode.zeta * _off(draws),
        mode.alpha * frequency**2 * gain,
        mode.beta * frequency * gain * _off(draws),
    )


@dataclass(frozen=True)
class Recipe:
    """Everything random about a drive."""

    index: int
    kind: str  # of the command
    # (n,), m: commanded positions, and the noise of the measured ones
    x_d: Array
    noise: Array
    axis: Axis
    encoder: Encoder
    model: ModalModel  # ``G_pb``
    settings: PredictorSettings

    @classmethod
    def draw(cls, index: int, seed: int) -> "Recipe":
        """Return the recipe of a drive."""
        draws = Draws(seed, index, 2)
        machine = random_machine(draws)
        kind, x_d = random_command(draws, machine.fastest, machine.T_s, draws.uniform(*DURATION))
        axis = random_axis(draws, machine, x_d)
        model = nominal_model(draws, axis.loop, axis.dead_time)
        Np = 2 * round(draws.log_uniform(*LOOK_AHEAD) / machine.T_s / 2)
        Np = min(max(Np, NP_RANGE[0]), NP_RANGE[1])
        settings = PredictorSettings(Np=Np, p=min(50, Np), T_s=machine.T_s)
        noise = machine.encoder.noise_std * draws.normal(len(x_d))
        return cls(index, kind, x_d, noise, axis, machine.encoder, model, settings)

    def drive(self, x: Array) -> Drive:
        """Return the drive with its true positions, ``(n,)``, m."""
        quantum = self.encoder.quantum
        x_meas = quantum * np.rint((x + self.noise) / quantum)
        return Drive(self.index, self.kind, self.x_d, x, x_meas, self.model, self.settings)


def true_positions(indices: Sequence[int], seed: int = SEED) -> list[Array]:
    """Return the true positions of drives, m."""
    recipes = [Recipe.draw(index, seed) for index in indices]
    return [TwoMassDrive(recipe.axis, float(recipe.x_d[0])).run(recipe.x_d) for recipe in recipes]


def drives_at(indices: Sequence[int], x: Sequence[Array], seed: int = SEED) -> list[Drive]:
    """Return drives whose :func:`true_positions` are known."""
    return [Recipe.draw(index, seed).drive(positions) for index, positions in zip(indices, x, strict=True)]


def random_drives(indices: Sequence[int], seed: int = SEED) -> list[Drive]:
    """Return several drives, each the same for ever for the same seed."""
    return drives_at(indices, true_positions(indices, seed), seed)
