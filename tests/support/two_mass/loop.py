"""Closed loop of the native SepCompensator and a drive of two masses, with the FMU's timing."""

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from c_core import TABLES, CModel, RefusedError
from scipy.optimize import brentq

from hybridsep.base.metrics import largest, peak_derivatives
from hybridsep.base.settings import PARAMETERS, CompensatorSettings, Limits, PredictorSettings
from hybridsep.base.signals import Array
from two_mass.axis import Axis, LinearLoop
from two_mass.generator import Recipe
from two_mass.plant import TwoMassDrive

DURATION = 2.5  # longest run, s
KNOTS, SETTLING = 0.002, 0.15  # time between the knots of a plan, and time of a preview beyond the window, s
SPARE = (2.0, 3.0, 5.0)  # limits of velocity, acceleration and jerk relative to the trajectory's
Sensor = Callable[[int, float], float]  # called as ``sensor(k, x_meas)``; returns what is measured in its place


class Loop(NamedTuple):
    """A run: modified commands, true positions, ``(n,)``, m, and states; NaN from where it refused to go on."""

    x_dm: Array
    x: Array
    state: Array


def settings_of(recipe: Recipe) -> tuple[PredictorSettings, CompensatorSettings, Array]:
    """Return the settings of a drive's compensator, and its trajectory, ``(n,)``, m, of at most :data:`DURATION`.

    The drive's limits leave something to the trajectory's, and the change of the command may be twice the servo error.
    """
    T_s, Np = recipe.axis.T_s, recipe.settings.Np
    spacing = max(1, round(KNOTS / T_s))
    Np = spacing * max(1, round(Np / spacing))
    x_d = recipe.x_d[: round(DURATION / T_s)]
    error = x_d - TwoMassDrive(recipe.axis, float(x_d[0])).run(x_d)
    velocity, acceleration, jerk = (spare * peak for spare, peak in zip(SPARE, peak_derivatives(x_d, T_s), strict=True))
    return (
        replace(recipe.settings, Np=Np, p=min(50, Np)),
        CompensatorSettings(
            preview=Np + max(Np, 4 * spacing + 3, round(SETTLING / T_s)),
            spacing=spacing,
            limits=Limits(velocity=velocity, acceleration=acceleration, jerk=jerk),
            change_max=2 * largest(error),
        ),
        x_d,
    )


def closed_loop(
    recipe: Recipe,
    axis: Axis,
    compensate: str,
    sensor: Sensor = lambda _k, x: x,
    weights: bytes | None = None,
    **more: float,
) -> Loop:
    """Return a run of a drive behind its compensator.

    ``axis``: the drive, which may be another one than the recipe's; ``compensate``: {"off", "physics", "hybrid"};
    ``sensor``: called as ``sensor(k, x_meas)``; returns what is measured in its place; ``weights``: content of
    ``weights.bin``, with which it starts; ``**more``: parameters of the compensator's FMU besides.
    """
    predictor, compensator, x_d = settings_of(recipe)
    assert compensator.preview is not None
    modes, late, start = recipe.model.modes, compensator.preview, float(x_d[0])
    name = f"compensator of {len(modes)} modes"
    any_modes = TABLES["compensator"].modes * len(modes)
    TABLES.setdefault(name, replace(TABLES["compensator"], name=name, modes=any_modes))
    values = {f"mode[{i}].{key}": value for i, mode in enumerate(modes, 1) for key, value in asdict(mode).items()}
    values |= {**predictor.to_fmi(), **compensator.to_fmi(), "dead_time": recipe.model.dead_time}
    assert compensator.limits is not None
    values |= {**compensator.limits.to_fmi(), "compensate": PARAMETERS["compensate"].to_fmi(compensate), **more}
    core = CModel(name, {**values, "x_d_ahead": start, "x_meas": start}, weights=weights).initialise()
    drive = TwoMassDrive(replace(axis, change_at=axis.change_at + late), start)
    ahead, measured, modified, state = (core.place[key] for key in ("x_d_ahead", "x_meas", "x_dm", "sep_state"))
    n, T_s, noise, quantum = len(x_d), axis.T_s, recipe.noise.tolist(), recipe.encoder.quantum
    commands, out = [*x_d.tolist(), *[float(x_d[-1])] * late], np.full((3, n + late), np.nan)
    for k, command in enumerate(commands):
        x, x_dm = drive.x, float(core.values[modified])
        out[:, k] = x_dm, x, core.values[state]
        core.values[ahead] = command
        core.values[measured] = sensor(k - late, quantum * round((x + noise[k % n]) / quantum))
        drive.step(x_dm)
        try:
            core.step(k * T_s, T_s)
        except RefusedError:
            break
    return Loop(*out[:, late:])


SATURATED = 0.6  # motor force beyond friction, relative to that which the trajectory needs
RINGING = 0.015  # damping ratio of the mode that begins to ring
CHANGE = 0.4  # part of a run after which the plant changes or the measurement fails


@dataclass(frozen=True)
class Condition:
    """What is not as it should be."""

    # returns the drive under it, from the sound one and the trajectory, (n,), m
    axis: Callable[[Axis, Array], Axis] = lambda axis, _: axis
    # called as ``fault(k, first, end, x_meas, held)`` while the measurement fails; returns what is measured
    fault: Callable[[float], float] | None = None
    duration: float = 0.0  # s: of the fault

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
