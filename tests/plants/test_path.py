"""Planar paths of G-code programs and of columns."""

from pathlib import Path

import numpy as np
import pytest

from hybridsep.base.errors import LogError
from hybridsep.base.settings import Limits
from hybridsep.plants.path import PlanarPath, read_path

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
