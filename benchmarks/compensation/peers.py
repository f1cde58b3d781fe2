"""Peers in compensation: input shaping and zero-phase-error tracking control.

Both are filters of the commanded position that know the physics model only. The third peer, a filtered-basis-function
compensator on the physics model, is ``SepCompensator`` with ``compensate = "physics"``.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter, ss2tf

from hybridsep.base.errors import ParameterError
from hybridsep.base.signals import Array, as_samples
from hybridsep.model.discrete import DiscreteModel
from hybridsep.model.physics import ModalModel

_RINGING = 0.999
"""Magnitude from which on a zero is not inverted: its inverse would ring for a thousand samples or diverge.

Modes in antiphase have zeros at 0.99 … 0.998 on the paper's stage; left in ``B⁻`` they would make ``B⁻(1)²`` nearly 0.
"""


def input_shaper(model: ModalModel, T_s: float, kind: str = "zv") -> Array:
    """Return the impulses of an input shaper for all modes of a model.

    Singer and Seering, *J. Dyn. Sys. Meas. Control* 112 (1990): two (ZV) or three (ZVD) impulses half a damped period
    apart; the shapers of several modes are convolved. An impulse between two samples is shared by both.

    Parameters
    ----------
    model : ModalModel
        Natural frequencies and damping ratios.
    T_s : float
        Sampling interval, s.
    kind : {"zv", "zvd"}
        Zero vibration, or zero vibration and derivative.

    Returns
    -------
    (m,) array
        Of sum 1.

    Raises
    ------
    ParameterError
        If the kind is another one or a mode does not oscillate.
    """
    if kind not in ("zv", "zvd"):
        raise ParameterError(f"kind must be zv or zvd, got {kind!r}")
    shaper: Array = np.ones(1)
    for mode in model.modes:
        if mode.zeta >= 1:
            raise ParameterError(f"a shaper needs modes that oscillate (zeta < 1), got zeta = {mode.zeta}")
        damped = mode.omega * math.sqrt(1 - mode.zeta**2)
        ratio = math.exp(-mode.zeta * math.pi / math.sqrt(1 - mode.zeta**2))
        weights = [1.0, ratio] if kind == "zv" else [1.0, 2 * ratio, ratio**2]
        impulses = np.zeros(math.ceil(2 * math.pi / damped / T_s) + 2)
        for i, weight in enumerate(weights):
            whole, part = divmod(i * math.pi / damped / T_s, 1.0)
            impulses[int(whole)] += weight * (1 - part)
            impulses[int(whole) + 1] += weight * part
        shaper = np.convolve(shaper, np.trim_zeros(impulses, "b") / sum(weights))
    return shaper


def shape(x_d: ArrayLike, shaper: Array, *, advance: bool = False) -> Array:
    """Return the shaped command.

    Parameters
    ----------
    x_d : (n,) array_like, m
        Commanded positions; at rest before and after.
    shaper : (m,) array
        From :func:`input_shaper`.
    advance : bool
        Give it early by the shaper's mean delay, which look-ahead makes possible.
    """
    command = as_samples(x_d, "x_d")
    delay = round(float(np.arange(len(shaper)) @ shaper)) if advance else 0
    ahead = np.concatenate((command[delay:], np.full(delay, command[-1]))) - command[0]
    # Before the first sample the advanced command has already begun.
    before = command[:delay] - command[0]
    shaped: Array = np.asarray(lfilter(shaper, [1.0], np.concatenate((before, ahead))))[delay:] + command[0]
    return shaped


def zero_phase_command(x_d: ArrayLike, discrete: DiscreteModel) -> Array:
    """Return the command of zero-phase-error tracking control (Tomizuka, *J. Dyn. Sys. Meas. Control* 109 (1987)).

    The poles and the zeros well inside the unit circle are cancelled; of the others ``B⁻`` only the phase is, by
    ``B⁻(z)/B⁻(1)²`` ahead of time.

    Parameters
    ----------
    x_d : (n,) array_like, m
        Commanded positions; at rest before and after.
    discrete : DiscreteModel
        The physics model, without dead time.

    Returns
    -------
    x_dm : (n,) array, m

    Raises
    ------
    ParameterError
        If the model has dead time.
    """
    if discrete.dead_time:
        raise ParameterError(f"the model must have no dead time, got {discrete.dead_time} samples")
    command = as_samples(x_d, "x_d")
    numerators, den = ss2tf(discrete.A, discrete.b[:, None], discrete.c[None, :], np.array([[discrete.d]]))
    num = numerators[0]
    first = int(np.argmax(np.abs(num) > 1e-9 * np.max(np.abs(num))))
    zeros = np.roots(num[first:])
    inverted = np.abs(zeros) < _RINGING
    plus = num[first] * np.atleast_1d(np.real(np.poly(zeros[inverted])))
    minus = np.atleast_1d(np.real(np.poly(zeros[~inverted])))
    ahead = first + len(minus) - 1
    # z^d B⁻(z)/B⁻(1)² needs samples ahead; before and after the trajectory the drive rests.
    rest = command - command[0]
    extended = np.concatenate((rest, np.full(ahead, rest[-1])))
    smoothed = np.asarray(lfilter(minus[::-1] / np.sum(minus) ** 2, [1.0], extended))
    x_dm: Array = np.asarray(lfilter(den, plus, smoothed))[ahead : ahead + len(command)] + command[0]
    return x_dm
