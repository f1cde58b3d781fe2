"""Norm-optimal learning control with a Q filter: what repeating a motion can reach, beside the hybrid.

N. Amann, D. H. Owens, E. Rogers, IEE Proc. Control Theory Appl. 143 (1996), over frequencies, with the low-pass filter
of D. A. Bristow, M. Tharayil, A. G. Alleyne, IEEE Control Systems Magazine 26 (2006): the change of the command becomes
``δ ← Q (δ + G*/(|G|² + r) (x_d − x_meas))``, ``G`` being the physics model. It knows no limits of the drive, and is
nothing on another motion.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel
from hybridsep.plants.plant import Plant, simulate

_REST = 1000  # samples of rest that are taken before and after a motion, so that its ends do not meet


class Repeat(NamedTuple):
    """Repeat of a motion: the command that the drive got, and its true position, (n,), m."""

    u: Array
    x: Array


def learned_commands(
    model: ModalModel,
    T_s: float,
    input_hold: str,
    plant: Plant,
    x_d: Array,
    n: int,
    measured: Callable[[Array, int], Array],
    *,
    weight: float = 0.1,
    cut_off: float = np.inf,
    advised: bool = False,
) -> Iterator[Repeat]:
    """Yield ``n`` repeats of a motion ``x_d``, (n,), m, from rest; ``measured`` has positions and the repeat's number.

    ``weight`` is ``r`` relative to the square of the model's gain at rest, ``cut_off``, Hz, the Q filter's; ``advised``
    says whether the first command is the physics model's, else it is ``x_d``.
    """
    size = len(x_d) + 2 * _REST
    G = np.fft.rfft(model.discretise(T_s, input_hold).impulse_response(size), size)
    learning = G.conj() / (np.abs(G) ** 2 + weight * np.abs(G[0]) ** 2)
    low_pass = 1.0 / (1.0 + (np.fft.rfftfreq(size, T_s) / cut_off) ** 4)

    def improved(delta: Array, error: Array) -> Array:
        change, missed = (np.fft.rfft(np.pad(one, _REST, mode="edge")) for one in (delta, error))
        return np.asarray(np.fft.irfft(low_pass * (change + learning * missed), size)[_REST:-_REST])

    delta = np.zeros_like(x_d)
    if advised:
        discrete, wanted = model.discretise(T_s, input_hold), x_d - x_d[0]
        delta = improved(delta, wanted - discrete.forced_response(discrete.rest(), wanted)[0])
    for run in range(n):
        x = simulate(plant, x_d + delta, T_s, start=float(x_d[0]))
        yield Repeat(x_d + delta, x)
        delta = improved(delta, x_d - measured(x, run))
