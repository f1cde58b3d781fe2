"""Random nonlinear feed drives with a physics model that is 20 % wrong: pure functions of a seed and an index."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel, Mode
from random_drives.commands import random_command
from random_drives.disturbances import Disturbances, random_disturbances
from random_drives.drive import Draws, Drive
from random_drives.simulation import simulate

MODEL_ERROR = 0.2  # largest relative error of each parameter of the physics model


@dataclass(frozen=True)
class ModalMode:
    """One mode by its share of the static gain: ``α = g ω²``, ``β = b g 2ζω``; ``b = 1`` is eq. (11)."""

    f_n: float
    zeta: float
    g: float
    b: float

    @property
    def mode(self) -> Mode:
        """The mode of eq. (15)."""
        omega = 2 * np.pi * self.f_n
        return Mode(self.f_n, self.zeta, self.g * omega**2, self.b * self.g * 2 * self.zeta * omega)


@dataclass(frozen=True)
class ModalDrive:
    """Linear part of a drive: modes, the first with most of the static gain."""

    modes: tuple[ModalMode, ...]

    @property
    def model(self) -> ModalModel:
        """``G_pb`` with these modes."""
        return ModalModel([mode.mode for mode in self.modes])

    @property
    def gain(self) -> float:
        """Static gain."""
        return sum(mode.g for mode in self.modes)

    @property
    def in_antiphase(self) -> bool:
        """Whether a mode has a negative gain."""
        return any(mode.g < 0 for mode in self.modes)

    def with_gain(self, gain: float) -> "ModalDrive":
        """Return the same drive with another static gain, all modes scaled alike."""
        return replace(self, modes=tuple(replace(mode, g=mode.g * (gain / self.gain)) for mode in self.modes))


def random_modes(draws: Draws) -> ModalDrive:
    """Return a drive of 1 to 4 modes with a static gain of about 1."""
    n = draws.whole(1, 4)
    antiphase = draws.chance(0.5)
    modes = []
    for i in range(n):
        g = 1.0 if i == 0 else draws.log_uniform(0.02, 0.5)
        if i and antiphase and draws.chance(0.6):
            g = -g
        b = draws.uniform(0.0, 1.0) if draws.chance(0.5) else 0.0
        modes.append(ModalMode(draws.log_uniform(5.0, 200.0), draws.log_uniform(0.02, 0.8), g, b))
    gain = 1.0 + (draws.uniform(-0.02, 0.02) if draws.chance(0.2) else 0.0)
    drive = ModalDrive(tuple(modes))
    # Modes in antiphase that nearly cancel the first one would be scaled up without bound.
    return drive.with_gain(gain) if drive.gain > 0.4 else random_modes(draws)


def nominal_drive(true: ModalDrive, draws: Draws) -> ModalDrive:
    """Return a physics model of a drive: every parameter up to 20 % off, sometimes with a mode missing.

    Machine tools hold their position by integral action: in 60 % of models the static gain is right, in 20 % up to 2 %
    off, in 20 % as wrong as the other parameters make it.
    """

    def off(value: float) -> float:
        return value * (1 + draws.uniform(-MODEL_ERROR, MODEL_ERROR))

    modes = [ModalMode(off(mode.f_n), off(mode.zeta), off(mode.g), off(mode.b)) for mode in true.modes]
    if len(modes) > 1 and draws.chance(0.2):
        modes.remove(min(modes[1:], key=lambda mode: abs(mode.g)))
    nominal, kind = ModalDrive(tuple(modes)), draws.uniform(0.0, 1.0)
    if kind < 0.6:
        nominal = nominal.with_gain(true.gain)
    elif kind < 0.8:
        nominal = nominal.with_gain(true.gain * (1 + draws.uniform(-0.02, 0.02)))
    else:
        error = nominal.gain / true.gain - 1  # of modes in antiphase it can be more
        nominal = nominal.with_gain(true.gain * (1 + min(max(error, -MODEL_ERROR), MODEL_ERROR)))
    return nominal


SEED = 1  # seed of the 1 000 drives that figures are given for
CHUNK = 125  # drives simulated at once: their states stay in the processor's cache


@dataclass(frozen=True)
class Recipe:
    """Everything random about a drive."""

    index: int
    kind: str
    x_d: Array
    true: ModalDrive
    nominal: ModalDrive
    disturbances: Disturbances
    noise_std: float
    quantum: float
    noise: Array

    @classmethod
    def draw(cls, index: int, seed: int) -> "Recipe":
        """Return the recipe of a drive."""
        draws = Draws(seed, index)
        kind, x_d = random_command(draws)
        true = random_modes(draws)
        nominal = nominal_drive(true, draws)
        disturbances = random_disturbances(draws, float(np.ptp(x_d)), true.in_antiphase)
        noise_std = draws.log_uniform(1e-7, 2e-5)
        quantum = draws.log_uniform(1e-7, 1e-5) if draws.chance(0.3) else 0.0
        noise = noise_std * draws.normal(len(x_d))
        return cls(index, kind, x_d, true, nominal, disturbances, noise_std, quantum, noise)

    def drive(self, x: Array) -> "RandomDrive":
        """Return the drive with its true positions, ``(n,)``, m."""
        x_meas = x + self.noise
        if self.quantum:
            x_meas = self.quantum * np.rint(x_meas / self.quantum)
        return RandomDrive(self.index, self.kind, self.x_d, x, x_meas, self.nominal.model, PredictorSettings(), self)


@dataclass(frozen=True)
class RandomDrive(Drive):
    """A drive of modes, whose ``model`` is up to 20 % wrong."""

    recipe: Recipe


def true_positions(indices: Sequence[int], seed: int = SEED) -> list[Array]:
    """Return the true positions of drives, m."""
    positions: list[Array] = []
    for i in range(0, len(indices), CHUNK):
        recipes = [Recipe.draw(index, seed) for index in indices[i : i + CHUNK]]
        positions += simulate(
            [recipe.true.model for recipe in recipes],
            [recipe.disturbances for recipe in recipes],
            [recipe.x_d for recipe in recipes],
        )
    return positions


def drives_at(indices: Sequence[int], x: Sequence[Array], seed: int = SEED) -> list[RandomDrive]:
    """Return drives whose :func:`true_positions` are known."""
    return [Recipe.draw(index, seed).drive(positions) for index, positions in zip(indices, x, strict=True)]


def random_drives(indices: Sequence[int], seed: int = SEED) -> list[RandomDrive]:
    """Return several drives, each the same for ever for the same seed."""
    return drives_at(indices, true_positions(indices, seed), seed)
