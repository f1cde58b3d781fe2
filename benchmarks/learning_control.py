"""Norm-optimal learning control with a Q filter: what repeating a motion can reach, beside the hybrid.

N. Amann, D. H. Owens, E. Rogers, IEE Proc. Control Theory Appl. 143 (1996), with the low-pass filter of D. A. Bristow,
M. Tharayil, A. G. Alleyne, IEEE Control Systems Magazine 26 (2006): ``u ← Q (u + (GᵀG + r)⁻¹Gᵀ (x_d − x_meas))``, ``G``
being the physics model. It knows no limits of the drive, and is nothing on another motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.signal import butter, fftconvolve, sosfiltfilt
from scipy.sparse.linalg import LinearOperator, lsqr

from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.model.physics import ModalModel
from hybridsep.plants.plant import Encoder, Plant, simulate


class Repeat(NamedTuple):
    """Repeat of a motion: the command that the drive got, and its true position, (n,), m."""

    u: Array
    x: Array


def learned_commands(
    model: ModalModel,
    settings: PredictorSettings,
    plant: Plant,
    x_d: Array,
    n: int,
    *,
    encoder: Encoder,
    sensor: Callable[[float], float] = lambda x: x,
    weight: float = 0.1,
    cut_off: float | None = 120.0,
    advised: bool = False,
) -> Iterator[Repeat]:
    """Yield ``n`` repeats of a motion ``x_d``, (n,), m, from rest.

    ``weight`` is ``r`` relative to the square of the model's gain at rest, ``cut_off``, Hz, the Q filter's, None for
    none; ``advised`` says whether the first command is the physics model's, else it is ``x_d``.
    """
    samples, start = len(x_d), float(x_d[0])
    wanted = x_d - start
    g = model.discretise(settings.T_s, settings.input_hold).impulse_response(samples)
    G = LinearOperator(
        (samples, samples), lambda u: fftconvolve(g, u)[:samples], lambda e: fftconvolve(g, e[::-1])[:samples][::-1]
    )
    root = float(np.sqrt(weight)) * abs(float(g.sum()))
    low_pass = None if cut_off is None else butter(2, 2.0 * cut_off * settings.T_s, output="sos")

    def improved(u: Array, error: Array) -> Array:
        u = u + lsqr(G, error, damp=root, atol=1e-9, btol=1e-9, iter_lim=3000)[0]
        return u if low_pass is None else wanted + sosfiltfilt(low_pass, u - wanted)

    u = improved(wanted, wanted - G @ wanted) if advised else wanted
    for _ in range(n):
        x = simulate(plant, start + u, settings.T_s)
        yield Repeat(start + u, x)
        measured = np.array([sensor(encoder.measure(one)) for one in x.tolist()])
        u = improved(u, wanted - (measured - start))
