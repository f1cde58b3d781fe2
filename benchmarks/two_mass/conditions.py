"""Conditions of a closed loop: a weak motor, a mode that begins to ring, and measurements that fail for a while."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from benchmarks.two_mass.axis import Axis, LinearLoop
from benchmarks.two_mass.loop import Sensor
from hybridsep.base.signals import Array

__all__ = ["CONDITIONS", "SOUND", "Condition"]

SATURATED = 0.6
"""Motor force beyond friction, relative to that which the trajectory needs."""

RINGING = 0.015
"""Damping ratio of the mode that begins to ring."""

CHANGE = 0.4
"""Part of a run after which the plant changes or the measurement fails."""


@dataclass(frozen=True)
class Condition:
    """What is not as it should be.

    Attributes
    ----------
    axis : callable
        Returns the drive under it, from the sound one and the trajectory, (n,), m.
    fault : callable, optional
        Called as ``fault(k, first, end, x_meas, held)`` while the measurement fails; returns what is measured.
    duration : float, s
        Of the fault.
    """

    axis: Callable[[Axis, Array], Axis] = lambda axis, _: axis
    fault: Callable[[float], float] | None = None
    duration: float = 0.0

    def sensor(self, x_d: Array, T_s: float) -> Sensor:
        """Return the sensor of a run over a trajectory, (n,), m; it fails while the axis moves."""
        fault = self.fault
        if fault is None:
            return lambda _k, x: x
        n = round(self.duration / T_s)
        first = _in_motion(x_d, n)
        last = float(x_d[0])

        def sensed(k: int, x_meas: float) -> float:
            nonlocal last
            if first <= k < first + n:
                return fault(last)
            last = x_meas
            return x_meas

        return sensed


def _in_motion(x_d: Array, n: int) -> int:
    """Return the first sample after :data:`CHANGE` of a run from which the axis goes half as far as it ever does."""
    first = round(CHANGE * len(x_d))
    distance = np.abs(x_d[first + n :] - x_d[first : len(x_d) - n])
    return first + int(np.argmax(distance >= distance.max() / 2))


def _saturated(axis: Axis, x_d: Array) -> Axis:
    acceleration = float(np.abs(np.diff(x_d, 2)).max()) / axis.T_s**2
    heaviest = 1.0 + max(0.0, axis.changed.added)
    return replace(axis, force_max=SATURATED * acceleration * heaviest + axis.motor.coulomb + axis.bearing.coulomb)


def _ringing(axis: Axis, x_d: Array) -> Axis:
    return replace(axis, changed=_with_less_damping(axis.changed), change_at=round(CHANGE * len(x_d)))


def _with_less_damping(loop: LinearLoop) -> LinearLoop:
    """Return a loop with less damping of belt or screw, down to a tenth; where that does not ring, with what makes it.

    A higher velocity gain, which leaves the following error as it is, or else a longer lag of the motor's force.
    """

    def changed(name: str, log_factor: float) -> LinearLoop:
        start = loop if name == "damping" else replace(loop, damping=0.1 * loop.damping)
        return replace(start, **{name: math.exp(log_factor) * getattr(start, name)})

    for name, end in (("damping", math.log(0.1)), ("k_p", 4.0), ("tau", 10.0)):
        factors = np.linspace(0.0, end, 81).tolist()
        for low, high in pairwise(factors):
            if changed(name, high).least_damping <= RINGING:
                return changed(name, brentq(lambda x, name=name: changed(name, x).least_damping - RINGING, low, high))
    raise ValueError(f"nothing makes {loop} ring")


SOUND = "sound"

CONDITIONS: dict[str, Condition] = {
    SOUND: Condition(),
    "motor saturated at 0.6": Condition(axis=_saturated),
    "begins to ring": Condition(axis=_ringing),
    "encoder held 50 ms": Condition(fault=lambda held: held, duration=0.05),
    "encoder held 500 ms": Condition(fault=lambda held: held, duration=0.5),
    "encoder zero 50 ms": Condition(fault=lambda _: 0.0, duration=0.05),
    "missing 100 ms": Condition(fault=lambda _: math.nan, duration=0.1),
}
