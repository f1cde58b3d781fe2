"""Random nonlinear feed drives with a physics model that is 20 % wrong: pure functions of a seed and an index."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.random_drives.commands import T_S, random_command
from benchmarks.random_drives.disturbances import Disturbances, random_disturbances
from benchmarks.random_drives.draws import Draws
from benchmarks.random_drives.drive import Drive
from benchmarks.random_drives.modes import ModalDrive, nominal_drive, random_modes
from benchmarks.random_drives.simulation import simulate
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel

__all__ = ["CHUNK", "SEED", "RandomDrive", "drives_at", "random_drive", "random_drives", "true_positions"]

SEED = 1
"""Seed of the 1 000 drives that figures are given for."""

CHUNK = 125
"""Drives simulated at once: their states stay in the processor's cache."""


@dataclass(frozen=True)
class RandomDrive(Drive):
    """A drive of modes.

    Attributes
    ----------
    true_model : ModalModel
        The drive's linear part; ``model`` is up to 20 % wrong.
    disturbances : Disturbances
    noise_std, quantum : float, m
        Of the encoder: white noise, and resolution (0: none).
    """

    true_model: ModalModel
    disturbances: Disturbances
    noise_std: float
    quantum: float


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
    def draw(cls, index: int, seed: int) -> Recipe:
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

    def drive(self, x: Array) -> RandomDrive:
        """Return the drive with its true positions, ``(n,)``, m."""
        x_meas = x + self.noise
        if self.quantum:
            x_meas = self.quantum * np.rint(x_meas / self.quantum)
        parts = (
            f"{self.kind} of {1e3 * np.ptp(self.x_d):.3g} mm in {len(self.x_d) * T_S:.1f} s",
            "modes " + " ".join(f"{m.f_n:.3g} Hz/{m.zeta:.2g}/{m.g:+.2g}" for m in self.true.modes),
            f"model {self.nominal.text}",
            self.disturbances.text,
            f"noise {1e6 * self.noise_std:.2g} µm" + (f", resolution {1e6 * self.quantum:.2g} µm" * bool(self.quantum)),
        )
        return RandomDrive(
            index=self.index,
            x_d=self.x_d,
            x=x,
            x_meas=x_meas,
            model=self.nominal.model,
            settings=PredictorSettings(),
            true_model=self.true.model,
            kind=self.kind,
            disturbances=self.disturbances,
            noise_std=self.noise_std,
            quantum=self.quantum,
            text="; ".join(parts),
        )


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
    """Return several drives, each as :func:`random_drive` returns it."""
    return drives_at(indices, true_positions(indices, seed), seed)


def random_drive(index: int, seed: int = SEED) -> RandomDrive:
    """Return the drive of an index, the same for ever for the same seed."""
    return random_drives([index], seed)[0]
