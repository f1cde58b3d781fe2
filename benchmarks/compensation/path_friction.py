"""Bound on the stage's compensation: the same drive with friction of the path instead of the modified command."""

from __future__ import annotations

import numpy as np

from hybridsep.base.signals import Array
from hybridsep.cosim.loop import cosimulate
from hybridsep.cosim.run import Run
from hybridsep.machines.machine import Machine
from hybridsep.machines.sections import StageSection
from hybridsep.plants.encoder import Encoder
from hybridsep.plants.plant import Plant
from hybridsep.plants.stage_drive import StageDrive

from .loops import noise_seed

__all__ = ["runs_with_path_friction"]


class PathFriction(StageDrive):
    """The stage with friction of the velocity ``path_velocity``, m/s, which is set from outside."""

    path_velocity = 0.0

    def step(self, x_d: float, h: float) -> None:
        """Step by ``T_s`` as :class:`StageDrive` does, with the last command where ``v_d`` is the path's velocity."""
        self._last_x_d = x_d - self._start - self.path_velocity * self.T_s
        super().step(x_d, h)


def runs_with_path_friction(machine: Machine, r: Array, seed: int) -> list[Run]:
    """Return the library's cold and warm run over ``r``, ``(n,)``, m, with the hybrid model."""
    assert isinstance(machine.plant, StageSection)
    compensator = machine.new_compensator()
    velocity = np.diff(r, prepend=r[0]) / machine.T_s

    def follow(k: int, plant: Plant) -> None:
        assert isinstance(plant, PathFriction)
        plant.path_velocity = float(velocity[k]) if 0 <= k < len(r) else 0.0

    return [
        cosimulate(
            compensator,
            PathFriction(machine.model, f=machine.plant.f, kappa=machine.plant.kappa, T_s=machine.T_s),
            r,
            encoder=Encoder(machine.plant.noise_std, noise_seed(seed, run)),
            t_init=None if run == 0 else 0.0,
            disturb=follow,
        )
        for run in range(2)
    ]
