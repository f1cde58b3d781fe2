"""Contour error of two axes against closed forms."""

import numpy as np
import pytest

from hybridsep.cosim.contour import Contour
from hybridsep.plants.path import PlanarPath
from hybridsep.plants.trajectory import archimedean_spiral

T_S = 1e-3
LAG = 0.01  # time constant of both axes, s


def test_a_lag_makes_a_circle_smaller() -> None:
    """By R (1 − 1/√(1 + ω²τ²)), which is left of a counter-clockwise path."""
    radius, omega = 0.02, 5.0
    for sense in (1, -1):
        path = radius * np.exp(1j * sense * omega * T_S * np.arange(1000))
        error = Contour.of(PlanarPath.of(path), path / (1.0 + 1j * sense * omega * LAG), T_S).error[100:-100]
        assert error == pytest.approx(sense * radius * (1.0 - 1.0 / np.hypot(1.0, omega * LAG)), abs=2e-9)


def test_a_lag_cuts_a_corner() -> None:
    """Nearest to both sides of a right angle at t = τ, where it is v τ / e from each."""
    velocity, t = 0.05, T_S * np.arange(-500, 501)
    past, left = np.maximum(t, 0.0), np.exp(-np.maximum(t, 0.0) / LAG)
    path = velocity * np.minimum(t, 0.0) + 1j * velocity * past
    reached = velocity * (np.minimum(t, 0.0) - LAG * left + 1j * (past - LAG * (1.0 - left)))
    error = Contour.of(PlanarPath.of(path), reached, T_S).error
    assert error[50:-50].max() == pytest.approx(velocity * LAG / np.e, rel=0.01)


def test_the_error_is_the_distance_to_the_path() -> None:
    position, derivative, end = archimedean_spiral(0.03, 5.0)
    u = np.linspace(2.0, end, 3000)
    path, slope = (part[:, 0] + 1j * part[:, 1] for part in (position(u), derivative(u)))
    distance = 1e-4 * np.sin(7 * u)
    found = Contour.of(PlanarPath.of(path), path + distance * (1j / np.abs(slope) * slope), T_S)
    assert found.error[5:-5] == pytest.approx(distance[5:-5], abs=2e-9)


def test_rapid_moves_do_not_count() -> None:
    path = PlanarPath.of(np.linspace(0.0, 0.1, 101) + 0j)
    path.cutting[50:] = False
    reached = path.points + 1e-6j * np.where(path.cutting, 3.0, 500.0)
    figures = Contour.of(path, reached, T_S).figures()
    assert figures == pytest.approx({"contour_rms_um": 3.0, "contour_p999_um": 3.0, "contour_max_um": 3.0})
