"""Figures of merit against closed forms."""

import math
from typing import Any

import numpy as np
import pytest

from hybridsep.base.metrics import (
    batch_rms,
    coverage,
    hold,
    in_unit,
    largest,
    line_plot,
    peak_derivatives,
    reduction_percent,
    rms,
    rms_ratio,
)
from hybridsep.base.signals import Array


def test_rms_and_largest() -> None:
    sine = 3.0 * np.sin(2 * np.pi * np.arange(400) / 100)
    assert rms(sine) == pytest.approx(3.0 / math.sqrt(2))
    assert rms([[3.0, -4.0]]) == pytest.approx(math.sqrt(12.5))
    assert largest([1.0, -4.0, 2.0]) == 4.0
    assert largest([]) == 0.0


def test_reduction() -> None:
    assert reduction_percent(1.0, 4.0) == 75.0
    assert reduction_percent(5.0, 4.0) == -25.0
    assert reduction_percent(0.0, 0.0) == 0.0
    assert reduction_percent(1.0, 0.0) == -math.inf
    assert (rms_ratio(1.0, 4.0), rms_ratio(0.0, 0.0), rms_ratio(1.0, 0.0)) == (0.25, 1.0, math.inf)


def test_coverage() -> None:
    error, std = np.random.default_rng(0).normal(0.0, 3e-6, 100_000), np.full(100_000, 3e-6)
    for level in (0.5, 0.9, 0.95):
        assert coverage(error, std, level) == pytest.approx(level, abs=5e-3)
    assert coverage(np.array([0.0, np.nan, 3.0]), np.ones(3), 0.95) == 0.5


def test_hold_skips_what_is_missing_and_what_has_not_arrived() -> None:
    x_pb, x = np.arange(10.0), np.arange(10.0) + np.array([1.0, 2.0, 3.0, np.nan, 5.0, 6.0, np.nan, np.nan, 9.0, 10.0])
    active = np.ones(10, dtype=np.bool_)
    for late, held in ((0, [0.0, 2.0, 3.0, 6.0, 6.0]), (1, [0.0, 1.0, 3.0, 5.0, 6.0]), (5, [0.0, 0.0, 0.0, 1.0, 3.0])):
        np.testing.assert_array_equal(hold(x_pb, x, active, 2, late=late), x_pb + np.repeat(held, 2))
    np.testing.assert_array_equal(hold(x_pb, x, np.arange(10) > 5, 2)[:6], x_pb[:6])  # the warm-up
    np.testing.assert_array_equal(hold(x_pb, np.full(10, np.nan), active, 2), x_pb)


def test_batch_rms_with_a_short_last_batch() -> None:
    np.testing.assert_allclose(batch_rms(np.array([3.0, 4.0, 1.0, -1.0, 2.0]), 2), [math.sqrt(12.5), 1.0, 2.0])
    missing = np.array([3.0, np.nan, np.nan, np.nan, 2.0])
    np.testing.assert_allclose(batch_rms(missing, 2), [3.0, np.nan, 2.0])


def test_peak_derivatives_of_a_cubic() -> None:
    T_s, n = 1e-2, 101
    t: Array = T_s * np.arange(n, dtype=np.float64)
    velocity, acceleration, jerk = peak_derivatives(t**3, T_s)
    # Backward differences of t³ at the last sample
    assert velocity == pytest.approx(3 - 3 * T_s + T_s**2)
    assert acceleration == pytest.approx(6 - 6 * T_s)
    assert jerk == pytest.approx(6.0, rel=1e-6)
    assert peak_derivatives(t[:1], T_s) == (0.0, 0.0, 0.0)


def test_a_notebook_shows_a_figure_and_units_are_the_axis_own() -> None:
    figure = line_plot(np.arange(3.0), {"error": np.zeros(3)}, "t [s]", "error [µm]")
    shown: Any = figure
    assert shown._repr_png_().startswith(b"\x89PNG")  # what IPython asks a value for
    named = in_unit({"rms_h_um": 1.0, "peak_velocity_m_s": 2.0, "n": 3}, "rad")
    assert named == {"rms_h_urad": 1.0, "peak_velocity_rad_s": 2.0, "n": 3}
