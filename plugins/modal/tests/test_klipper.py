"""Klipper's accelerometer files: reading, and the resonance that they show."""

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import chirp

from hybridsep import ModalModel, Mode
from hybridsep.base.errors import IdentificationError, LogError
from hybridsep_modal.klipper import Acceleration, identify_resonance, is_klipper, read_klipper

T = 1 / 3200


def resonance_test(f_n: float, zeta: float, rise: float = 4.0) -> Acceleration:
    """Return the accelerations of a simulated test from 5 to 133 Hz, which rises by ``rise`` Hz/s."""
    t = np.arange(0, 128 / rise, T)
    command = 0.075 * (5 + rise * t) * chirp(t, 5, t[-1], 133)
    discrete = ModalModel([Mode(f_n, zeta, (2 * np.pi * f_n) ** 2)]).discretise(T)
    a = discrete.forced_response(discrete.rest(), command)[0]
    rng = np.random.default_rng(0)
    axes = {name: part * a + 0.05 * rng.standard_normal(len(t)) for name, part in (("x", 1.0), ("y", 0.1), ("z", 0.0))}
    axes["z"] = axes["z"] + 9.81
    return Acceleration(t, axes, T)


def test_the_resonance_is_found() -> None:
    found = identify_resonance(resonance_test(45.0, 0.08), "x")
    f_n, zeta = found.parameters
    assert abs(f_n.value - 45.0) < 0.7
    assert zeta.value == pytest.approx(0.08, rel=0.25)
    assert found.model.dc_gain == pytest.approx(1.0)
    assert "phase and dead time are unknown" in found.findings[0]


def test_an_axis_without_resonance_is_refused() -> None:
    recording = resonance_test(45.0, 0.08)
    rng = np.random.default_rng(0)
    recording.axes["z"][:] = rng.standard_normal(len(recording.t))
    with pytest.raises(IdentificationError, match="axis z has no resonance"):
        identify_resonance(recording, "z")
    with pytest.raises(IdentificationError, match="fewer than 8 lines"):
        identify_resonance(recording, "x", band=(5.0, 9.0))


def test_files_are_read(tmp_path: Path) -> None:
    path = tmp_path / "raw_data_x.csv"
    path.write_text("#time,accel_x,accel_y,accel_z\n10.0,1000,2000,9810\n10.001,1,2,3\n10.002,1,2,3\n")
    assert is_klipper(path)
    recording = read_klipper(path)
    assert recording.T_s == pytest.approx(1e-3)
    assert [recording.axes[name][0] for name in "xyz"] == [1.0, 2.0, 9.81]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t,x_d,x\n0,0,0\n", "begins with #time,accel_x"),
        ("#time,accel_x,accel_y,accel_z\n0,1,2\n", "line 2: four numbers"),
        ("#time,accel_x,accel_y,accel_z\n0,1,2,x\n", "line 2: four numbers"),
        ("#time,accel_x,accel_y,accel_z\n0,1,2,3\n", "at least 2 samples, got 1"),
        ("#time,accel_x,accel_y,accel_z\n0,1,2,3\n1,1,2,3\n1,1,2,3\n", "line 4: time must increase"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "file.csv"
    path.write_text(text)
    with pytest.raises(LogError, match=message):
        read_klipper(path)
    assert not is_klipper(tmp_path / "none.csv")
