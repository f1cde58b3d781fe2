"""Closed loop of the native SepCompensator and a drive of two masses, with the FMU's timing."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "support"))

from c_core import TABLES, CModel, RefusedError

from benchmarks.two_mass.axis import Axis
from benchmarks.two_mass.generator import Recipe
from benchmarks.two_mass.plant import TwoMassDrive
from hybridsep.base.metrics import largest, peak_derivatives
from hybridsep.base.settings import PARAMETERS, CompensatorSettings, Limits, PredictorSettings
from hybridsep.base.signals import Array

__all__ = ["Loop", "Sensor", "closed_loop", "settings_of"]

DURATION = 2.5
"""Longest run, s."""

KNOTS, SETTLING = 0.002, 0.15
"""Time between the knots of a plan, and time of a preview beyond the window, s."""

SPARE = (2.0, 3.0, 5.0)
"""Limits of velocity, acceleration and jerk relative to the trajectory's."""

Sensor = Callable[[int, float], float]
"""Called as ``sensor(k, x_meas)``; returns what is measured in its place."""


class Loop(NamedTuple):
    """A run: modified commands and true positions, ``(n,)``, m; NaN from where the compensator refused to go on."""

    x_dm: Array
    x: Array


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


def closed_loop(recipe: Recipe, axis: Axis, compensate: str, sensor: Sensor = lambda _k, x: x) -> Loop:
    """Return a cold run of a drive behind its compensator.

    Parameters
    ----------
    recipe : Recipe
    axis : Axis
        The drive, which may be another one than the recipe's.
    compensate : {"off", "physics", "hybrid"}
    sensor : callable, optional
        Called as ``sensor(k, x_meas)``; returns what is measured in its place.
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
    values |= {**compensator.limits.to_fmi(), "compensate": PARAMETERS["compensate"].to_fmi(compensate)}
    core = CModel(name, {**values, "x_d_ahead": start, "x_meas": start}).initialise()
    drive = TwoMassDrive(replace(axis, change_at=axis.change_at + late), start)
    ahead, measured, modified = (core.place[key] for key in ("x_d_ahead", "x_meas", "x_dm"))
    n, T_s, noise, quantum = len(x_d), axis.T_s, recipe.noise.tolist(), recipe.encoder.quantum
    commands, out = [*x_d.tolist(), *[float(x_d[-1])] * late], np.full((2, n + late), np.nan)
    for k, command in enumerate(commands):
        x, x_dm = drive.x, float(core.values[modified])
        out[:, k] = x_dm, x
        core.values[ahead] = command
        core.values[measured] = sensor(k - late, quantum * round((x + noise[k % n]) / quantum))
        drive.step(x_dm)
        try:
            core.step(k * T_s, T_s)
        except RefusedError:
            break
    return Loop(*out[:, late:])
