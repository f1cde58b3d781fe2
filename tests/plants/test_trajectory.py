"""Trajectories: exact samples, limits held, arc length against its closed form."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import examples

from hybridsep.base.errors import LogError, ParameterError, SignalError
from hybridsep.base.settings import Limits
from hybridsep.plants.trajectory import (
    PAPER_LIMITS,
    along_path,
    archimedean_spiral,
    read_trajectory,
    rest_to_rest,
    spiral,
    staircase,
)


def test_staircase_is_the_papers() -> None:
    x_d = staircase()
    assert len(x_d) == 6001
    # d/v + v/a + a/j = 0.125 + 0.010 + 0.008 s: the move has ended at its 143rd sample, and not before
    for second, (before, after) in enumerate([(0, 10), (10, 20), (20, 30), (30, 20), (20, 10), (10, 0)]):
        k = 1000 * second
        assert x_d[k] == pytest.approx(before * 1e-3, abs=1e-15)
        assert x_d[k + 143] == pytest.approx(after * 1e-3, abs=1e-15)
        assert abs(x_d[k + 142] - after * 1e-3) > 1e-8
    assert np.all(x_d[5143:] == x_d[5143])


def test_a_move_starts_as_its_jerk_says() -> None:
    # s(t) = j t³ / 6 during the first jerk phase, 8 ms
    x_d = rest_to_rest([0.0, 0.01], PAPER_LIMITS, 1e-3)
    t = np.arange(9) * 1e-3
    np.testing.assert_allclose(x_d[:9], 1000.0 * t**3 / 6, atol=1e-15)
    late = rest_to_rest([0.0, 0.01], PAPER_LIMITS, 1e-3, start_times=[100.0], duration=100.2)
    np.testing.assert_allclose(late[-201:-57], x_d[:144], atol=1e-14)


@examples(40)
@given(
    positions=st.lists(st.floats(-0.5, 0.5), min_size=2, max_size=5),
    velocity=st.floats(0.01, 1.0),
    acceleration=st.floats(0.5, 20.0),
    jerk=st.floats(50.0, 5000.0),
)
def test_limits_hold_and_targets_are_reached(
    positions: list[float], velocity: float, acceleration: float, jerk: float
) -> None:
    T_s = 1e-3
    x_d = rest_to_rest(positions, Limits(velocity, acceleration, jerk), T_s, dwell=0.005)
    # Mean values over an interval cannot exceed the limit; rounding of positions is magnified by 1/T_s
    assert np.max(np.abs(np.diff(x_d)), initial=0.0) / T_s <= velocity * (1 + 1e-9) + 1e-12
    assert np.max(np.abs(np.diff(x_d, 2)), initial=0.0) / T_s**2 <= acceleration * (1 + 1e-6) + 1e-8
    assert np.max(np.abs(np.diff(x_d, 3)), initial=0.0) / T_s**3 <= jerk * (1 + 1e-3) + 1e-5
    assert x_d[0] == positions[0]
    assert x_d[-1] == pytest.approx(positions[-1], abs=1e-12)


def test_spiral_is_the_papers() -> None:
    x_d, y_d = spiral()
    assert (len(x_d) - 1) * 1e-3 == pytest.approx(5.94, abs=0.01)
    assert (x_d[0], y_d[0]) == (0.0, 0.0)
    assert x_d[-1] == pytest.approx(0.030, abs=1e-12)
    assert y_d[-1] == pytest.approx(0.0, abs=1e-12)
    speed = np.hypot(np.diff(x_d), np.diff(y_d)) / 1e-3
    assert speed.max() <= 0.08 * (1 + 1e-9)
    assert np.median(speed) == pytest.approx(0.08, rel=1e-5)


def test_arc_length_against_the_closed_form() -> None:
    # s(θ) = b/2 (θ √(1+θ²) + asinh θ) for r = b θ
    position, derivative, end = archimedean_spiral(0.030, 5.0)
    slow = Limits(0.08, 8.0, 1000.0)
    points = along_path(position, derivative, end, slow, 1e-3)
    b = 0.030 / end
    theta = np.hypot(points[:, 0], points[:, 1]) / b
    length = b / 2 * (theta * np.sqrt(1 + theta**2) + np.arcsinh(theta))
    total = b / 2 * (end * np.sqrt(1 + end**2) + np.arcsinh(end))
    s = rest_to_rest([0.0, total], slow, 1e-3)
    np.testing.assert_allclose(length, s, atol=1e-11)


def test_from_file(tmp_path: Path) -> None:
    path = tmp_path / "command.csv"
    path.write_text("t,x_d\n0,0\n0.002,1.5\n0.004,3\n")
    x_d, T_s = read_trajectory(path, unit="mm")
    np.testing.assert_allclose(x_d, [0, 1.5e-3, 3e-3])
    assert T_s == pytest.approx(0.002)
    with pytest.raises(LogError, match=r"column .speed. is missing, .*; call the commanded position so in the file$"):
        read_trajectory(path, column="speed")


def test_what_cannot_be_planned_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"velocity limit must be 1e-09 … 10000 m/s, got -1\.0; the jerk limit"):
        Limits(-1.0, 1.0, float("nan"))
    with pytest.raises(ParameterError, match=r"move 2 starts at 0.1 s, before the one before has ended at 0.143 s"):
        rest_to_rest([0, 0.01, 0.02], PAPER_LIMITS, start_times=[0.0, 0.1])
    with pytest.raises(ParameterError, match=r"duration is 0.1 s, but the moves need 0.143 s"):
        rest_to_rest([0, 0.01], PAPER_LIMITS, duration=0.1)
    with pytest.raises(ParameterError, match="one time for each of 1 moves, got 2"):
        rest_to_rest([0, 0.01], PAPER_LIMITS, start_times=[0.0, 1.0])
    with pytest.raises(SignalError, match="at least one target, got 1"):
        rest_to_rest([0.0], PAPER_LIMITS)
    with pytest.raises(SignalError, match="positions must be finite, got nan at sample 1"):
        rest_to_rest([0.0, float("nan")], PAPER_LIMITS)
    with pytest.raises(ParameterError, match=r"dwell must be finite and ≥ 0 s, got -0.05"):
        rest_to_rest([0.0, 0.01, 0.02], PAPER_LIMITS, dwell=-0.05)
    with pytest.raises(ParameterError, match="a trajectory must have fewer than 2000000 samples, got inf s at"):
        rest_to_rest([0.0, 0.01], PAPER_LIMITS, duration=float("inf"))
    with pytest.raises(ParameterError, match="turns must be finite and > 0, got 0"):
        spiral(turns=0)
    with pytest.raises(ParameterError, match=r"T_s must be 1e-05 … 1 s, got 0"):
        rest_to_rest([0.0, 0.01], PAPER_LIMITS, 0.0)
