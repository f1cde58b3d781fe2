"""The rival in compensation: what it leaves on a drive that it fits, and on what it cannot be fitted to."""

import numpy as np
import pytest

from hybridsep.base.metrics import rms
from hybridsep.base.signals import Array
from hybridsep.cosim.fir_inverse import FirInverse, PlayedCommand
from hybridsep.cosim.loop import cosimulate
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.plants.plant import simulate
from hybridsep.plants.stage_drive import StageDrive

T_S, NP = 1e-3, 50


def drive(f: float, T_s: float) -> StageDrive:
    return StageDrive(ModalModel([Mode(0.02 / T_s, 0.7, (0.04 * np.pi / T_s) ** 2)]), f, 0.0, T_s=T_s, v_friction=1e-4)


def moves(seed: int) -> Array:
    """Return moves between points at random, with rests, m."""
    rng, x, pieces = np.random.default_rng(seed), 0.0, [np.zeros(100)]
    for _ in range(8):
        goal = rng.uniform(-0.01, 0.01)
        u = np.linspace(0.0, 1.0, int(rng.integers(150, 400)))
        pieces += [x + (goal - x) * (10 * u**3 - 15 * u**4 + 6 * u**5), np.full(100, goal)]
        x = goal
    return np.concatenate(pieces)


@pytest.mark.parametrize(("f", "T_s", "Np"), [(0.0, T_S, NP), (2e-5, T_S, NP), (0.0, 0.1 * T_S, 20 * NP)])
def test_it_compensates_other_moves_of_a_drive_with_friction(f: float, T_s: float, Np: int) -> None:
    x_d, r = moves(0), moves(1)
    x = simulate(drive(f, T_s), x_d, T_s)
    x[200:260] = np.nan  # missing measurements are no rows
    rival = FirInverse.fitted([(x_d, x)], Np)
    assert rival is not None
    off, played = (cosimulate(PlayedCommand(u, T_s), drive(f, T_s), r) for u in (r, rival.command(r)))
    assert rms(r - played.x) < (0.02 if f == 0.0 else 0.05) * rms(r - off.x)


def test_nothing_is_fitted_to_rest_or_to_what_is_missing() -> None:
    assert FirInverse.fitted([(np.zeros(1000), np.zeros(1000))], NP) is None
    assert FirInverse.fitted([(moves(0), np.full(len(moves(0)), np.nan))], NP) is None
    assert FirInverse.fitted([], NP) is None
