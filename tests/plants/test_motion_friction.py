"""Friction on the stage's actual velocity: its equation, its integration, and both implementations."""

import math
from itertools import product

import c_core
import numpy as np
import pytest
from c_core import STAGE_DRIVE, CModel
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from hybridsep import ModalModel, Mode, simulate
from hybridsep.base.settings import PARAMETERS
from hybridsep.base.signals import Array
from hybridsep.plants.stage_drive import StageDrive, velocity_under_friction
from hybridsep.plants.trajectory import spiral, staircase

FRICTION_VELOCITY = PARAMETERS["v_friction"].default
TS = 1e-3


@pytest.mark.parametrize("gain", [-0.06, -2e-3, -1e-3, 0.0, 1e-3, 0.5, 1e9])
def test_the_velocity_solves_its_equation(gain: float) -> None:
    for w, last in product([-10.0, -0.05, -1e-3, -1e-9, 1e-12, 1e-3, 0.02, 0.07, 3.0], [-0.1, 0.0, 0.1]):
        v = velocity_under_friction(w, gain, FRICTION_VELOCITY, last)
        assert v + gain * math.tanh(v / FRICTION_VELOCITY) == pytest.approx(w, rel=1e-9, abs=1e-15 * abs(gain))
        assert v == -velocity_under_friction(-w, gain, FRICTION_VELOCITY, -last)
        # stable: more velocity would meet more resistance
        assert 1.0 + gain / FRICTION_VELOCITY * (1.0 - math.tanh(v / FRICTION_VELOCITY) ** 2) > -1e-3


def test_the_direction_is_kept_until_its_solution_ends() -> None:
    gain, v, found = -0.06, 0.1, []
    for w in np.linspace(0.1, -0.1, 2001):
        v = velocity_under_friction(w, gain, FRICTION_VELOCITY, v)
        found.append(v)
    turned = int(np.argmax(np.array(found) < 0.0))
    turn = FRICTION_VELOCITY * math.acosh(math.sqrt(-gain / FRICTION_VELOCITY))
    assert 0.1 - 1e-4 * turned == pytest.approx(turn + gain * math.tanh(turn / FRICTION_VELOCITY), abs=2e-4)


def test_the_motion_is_integrated_to_a_nanometre() -> None:
    modes = [Mode(25.0, 0.3, (2 * math.pi * 25.0) ** 2, 20.0)]
    f, beta = 1e-5, sum(mode.beta for mode in modes)
    x_d = staircase()[:250]

    def slope(t: float, z: Array, r: float) -> list[float]:
        mode = modes[0]
        free = r - 2 * mode.zeta * mode.omega * z[1] - mode.omega**2 * z[0]
        w, gain = mode.alpha * z[1] + beta * free, beta * f
        v = brentq(lambda v: v + gain * math.tanh(v / FRICTION_VELOCITY) - w, w - gain, w + gain, xtol=1e-18)
        return [z[1], free - f * math.tanh(v / FRICTION_VELOCITY)]

    z, truth = np.zeros(2), np.empty(len(x_d))
    for k, r in enumerate(x_d):
        truth[k] = modes[0].alpha * z[0] + beta * z[1]
        z = solve_ivp(slope, (0, TS), z, "DOP853", args=(r,), rtol=1e-12, atol=1e-18).y[:, -1]
    x = simulate(StageDrive(ModalModel(modes), f, T_s=TS, friction_on="motion"), x_d, TS)
    assert np.max(np.abs(x - simulate(StageDrive(ModalModel(modes), f, T_s=TS), x_d, TS))) > 1e-6
    assert np.max(np.abs(x - truth)) < 1e-9


@pytest.mark.slow
def test_both_implementations_move_the_same() -> None:
    values = {**STAGE_DRIVE, "friction_on": 1, "noise_std": 0.0}
    core = CModel("stage_drive", values)
    core.start_values()
    core.initialise(0.0)
    model = ModalModel([Mode(**mode) for mode in c_core.STAGE_MODES])
    drive = StageDrive(model, values["f"], values["kappa"], values["T_s"], "motion")
    for k, x_d in enumerate(spiral()[0][:90].tolist()):
        core["x_d"] = x_d
        core.step(k * TS, TS)
        drive.step(x_d, TS)
        assert core["x"] == pytest.approx(drive.x, abs=1e-12)
        assert core["v"] == pytest.approx(drive.v, abs=1e-9)
