"""Random drives of two masses with a physics model that is up to 40 % wrong: pure functions of a seed and an index."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from random_drives.drive import Draws, Drive

from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel
from two_mass.axis import Axis, Encoder, random_axis, random_machine
from two_mass.commands import random_command
from two_mass.nominal import nominal_model
from two_mass.plant import TwoMassDrive

SEED = 2  # seed of the 250 drives that figures are given for
CHUNK = 25  # drives of one task: they take seconds each, and very different times
DURATION = (3.0, 5.0)  # length of a run, s
LOOK_AHEAD, NP_RANGE = (0.02, 0.1), (10, 400)  # look-ahead, s, and samples in a window


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
