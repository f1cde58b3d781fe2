"""Moves of a log: how long they take to settle, and which are worst."""

import math

import numpy as np
import pytest

from hybridsep.fitting.report import moves_of

T_S, TAU = 1e-3, 0.02


def test_settling_of_a_lag_is_by_its_time_constant() -> None:
    """A step of size A is within w after τ ln(A/w); the last move is cut before it settles."""
    sizes, at = (1e-3, 2e-3, 0.5e-3, 4e-3), (200, 700, 1200, 1700)
    x_d = np.zeros(1740)
    for size, first in zip(sizes, at, strict=True):
        x_d[first:] += size
    x, pole = np.zeros(len(x_d)), math.exp(-T_S / TAU)
    for k in range(1, len(x)):
        x[k] = pole * x[k - 1] + (1.0 - pole) * x_d[k]
    window = 10e-6
    moves = moves_of(x_d, x, T_S, window)
    assert [one.start for one in moves] == pytest.approx([T_S * (first - 1) for first in at])
    for one, size in zip(moves[:3], sizes, strict=False):
        assert one.settling == pytest.approx(TAU * math.log(size / window), abs=2.0 * T_S)
        assert one.largest == pytest.approx(size, rel=0.06)
    assert math.isinf(moves[3].settling)
    x[300] = np.nan  # what is missing is not outside
    assert moves_of(x_d, x, T_S, window)[0].settling < 0.1
    assert moves_of(np.zeros(50), np.zeros(50), T_S, window) == []
