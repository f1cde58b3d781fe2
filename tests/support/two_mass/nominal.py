"""Physics models of a drive of two masses that are up to 40 % wrong, or a lag, or late by the wrong time."""

import math
from dataclasses import replace

import numpy as np
from random_drives.drive import Draws

from hybridsep.model.physics import ModalModel, Mode
from two_mass.axis import LinearLoop

MODEL_ERROR = 0.4  # largest relative error of a parameter
CANCELLING = 3.0  # sum of the magnitudes of the modes' static gains from which on they cannot be wrong one by one


def nominal_model(draws: Draws, loop: LinearLoop, dead_time: int) -> ModalModel:
    """Return a physics model of a loop behind a dead time, samples."""
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
