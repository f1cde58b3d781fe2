"""Random drives in modal form, eq. (15), and physics models of them that are up to 20 % wrong."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from benchmarks.random_drives.draws import Draws
from hybridsep.model.physics import ModalModel, Mode

__all__ = ["ModalDrive", "nominal_drive", "random_modes"]

MODEL_ERROR = 0.2
"""Largest relative error of each parameter of the physics model."""


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
    """Linear part of a drive: modes, the first with most of the static gain.

    Attributes
    ----------
    modes : tuple of ModalMode
    text : str
        How the model errs, of a physics model.
    """

    modes: tuple[ModalMode, ...]
    text: str = ""

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

    def with_gain(self, gain: float) -> ModalDrive:
        """Return the same drive with another static gain, all modes scaled alike."""
        scale = gain / self.gain
        return replace(self, modes=tuple(replace(mode, g=mode.g * scale) for mode in self.modes))


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
    text = "20 % off"
    if len(modes) > 1 and draws.chance(0.2):
        modes.remove(min(modes[1:], key=lambda mode: abs(mode.g)))
        text += ", a mode missing"
    nominal, kind = ModalDrive(tuple(modes)), draws.uniform(0.0, 1.0)
    if kind < 0.6:
        nominal = nominal.with_gain(true.gain)
    elif kind < 0.8:
        nominal = nominal.with_gain(true.gain * (1 + draws.uniform(-0.02, 0.02)))
    else:
        error = nominal.gain / true.gain - 1  # of modes in antiphase it can be more
        nominal = nominal.with_gain(true.gain * (1 + min(max(error, -MODEL_ERROR), MODEL_ERROR)))
    return replace(nominal, text=f"{text}, static gain {100 * (nominal.gain / true.gain - 1):+.1f} %")
