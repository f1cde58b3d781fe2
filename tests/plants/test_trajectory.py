"""Trajectories: exact samples, limits held, arc length; planar paths of G-code programs and of columns."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from properties import examples

from hybridsep.base.errors import LogError, ParameterError, SignalError
from hybridsep.base.settings import Limits
from hybridsep.plants.path import PlanarPath, read_path
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
    with pytest.raises(SignalError, match="start_times must have 1 samples, got 2"):
        rest_to_rest([0, 0.01], PAPER_LIMITS, start_times=[0.0, 1.0])
    with pytest.raises(SignalError, match="at least one target, got 1"):
        rest_to_rest([0.0], PAPER_LIMITS)
    with pytest.raises(SignalError, match="positions must be finite, got nan at sample 1"):
        rest_to_rest([0.0, float("nan")], PAPER_LIMITS)
    with pytest.raises(ParameterError, match=r"dwell must be ≥ 0, got -0.05"):
        rest_to_rest([0.0, 0.01, 0.02], PAPER_LIMITS, dwell=-0.05)
    with pytest.raises(ParameterError, match=r"a trajectory must have fewer than 2000000 samples, got 1e\+09 s at"):
        rest_to_rest([0.0, 0.01], PAPER_LIMITS, duration=1e9)
    with pytest.raises(ParameterError, match="turns must be > 0, got 0"):
        spiral(turns=0)
    with pytest.raises(ParameterError, match=r"T_s must be 1e-05 … 1 s, got 0"):
        rest_to_rest([0.0, 0.01], PAPER_LIMITS, 0.0)


# Planar paths -------------------------------------------------------------------------------------------------------


LIMITS = Limits(velocity=0.2, acceleration=2.0, jerk=100.0)
T_S = 1e-3


def program(tmp_path: Path, *lines: str) -> PlanarPath:
    """Return the path of a program, in mm."""
    file = tmp_path / "part.ngc"
    file.write_text("\n".join(lines), encoding="utf-8")
    return read_path(file, LIMITS, T_S)


@pytest.mark.parametrize(
    ("line", "centre", "turns"),
    [
        ("G3 X0 Y10 I-10", 0.0, 1),
        ("G03 X0. Y10. R10.", 0.0, 1),
        ("g2 x0 y10 r-10", 0.0, 3),
        ("G91 G2 X-10 Y10 J10", 10 + 10j, 1),
        ("G20 G2 X0 Y.393700787 R.393700787 (inches)", 10 + 10j, 1),
    ],
)
def test_arcs(tmp_path: Path, line: str, centre: complex, turns: int) -> None:
    begin = ("%", "N10 G17 G21 G90 F6000 S3000 M3 ; start", "G0 X10 Z5", "G1 Z-1")
    path = program(tmp_path, *begin, f"N30 {line}", "M30", "X99")
    arc = 1e3 * path.points[path.cutting]
    assert path.points[-1] == pytest.approx(0.01j, abs=1e-9)
    assert np.abs(arc - centre) == pytest.approx(10.0, abs=1e-6)
    assert np.sum(np.abs(np.diff(arc))) == pytest.approx(5.0 * np.pi * turns, rel=1e-3)


def test_the_motion_keeps_feed_and_limits_and_rests_at_corners(tmp_path: Path) -> None:
    path = program(tmp_path, "F3000", "G1 X20", "X40", "Y20", "F60000 G3 X40 Y20 I-20", "G4 P0.1")
    velocity, acceleration, jerk = (np.abs(np.diff(path.points, n)) / T_S**n for n in (1, 2, 3))
    corner = int(np.argmin(np.abs(path.points - 0.04)))
    assert velocity[:corner].max() == pytest.approx(0.05, rel=1e-6)
    assert np.abs(path.points[corner] - 0.04) < 1e-12
    assert velocity[corner] < 1e-3
    assert np.min(velocity[50 : corner - 100]) == pytest.approx(0.05, rel=1e-6)  # through X20 without a stop
    assert velocity.max() == pytest.approx((2.0 * 0.02 * 0.5**0.5) ** 0.5, rel=1e-3)
    assert acceleration.max() < 1.01 * LIMITS.acceleration
    assert jerk.max() < 1.6 * LIMITS.jerk
    assert np.max(np.abs(path.points[-101:] - path.points[-1])) < 1e-15
    assert np.nanmax(np.abs(path.centre - 0.02 - 0.02j)) < 1e-12


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("G1 X[1+2]", r"line 3: words are .*got 'X\[1\+2\]'; expressions"),
        ("#1 = 0", "line 3"),
        ("G18 G2 X5 K3", "line 3: G18 is not read"),
        ("G92 X0", "line 3: G92"),
        ("G1 X5 A90", "line 3: A is not read here"),
        ("M98 P100", "line 3: P, M98"),
        ("G2 X5 Y5 I7", "line 3: an arc's ends must be as far from its centre, got 7 and"),
        ("G2 X50 R10", "line 3: no arc of R10 mm leads over 50 mm"),
        ("F0 G1 X5", "line 3: G1 needs a feed"),
        ("G0 X5", "no move in X or Y at a feed"),
    ],
)
def test_what_would_change_the_path_is_refused(tmp_path: Path, line: str, said: str) -> None:
    with pytest.raises(LogError, match=said):
        program(tmp_path, "(begins)", "F600", line)


def test_columns_are_a_path(tmp_path: Path) -> None:
    points = np.exp(1j * np.linspace(0.0, 1.0, 100))
    rows = np.column_stack((T_S * np.arange(100), points.real, points.imag))
    file = tmp_path / "path.csv"
    np.savetxt(file, rows, delimiter=",", header="t,x [mm],y [mm]", comments="")
    assert read_path(file, LIMITS, T_S).points == pytest.approx(1e-3 * points)
    with pytest.raises(LogError, match=r"0\.004"):
        read_path(file, LIMITS, 0.004)
