"""``hybridsep identify``: what it writes, draws and prints for each kind of file, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import Run
from identification_cases import T_S, measured, moves
from scipy.signal import chirp

from hybridsep import ModalModel, Mode, load_machine

TRUTH = ModalModel([Mode(20.0, 0.3, (40 * np.pi) ** 2)])


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "log.csv"
    x_d = moves(1200)
    columns = (np.arange(len(x_d)) * T_S, 1e3 * x_d, 1e3 * measured(TRUTH, x_d, "foh", 1e-6))
    np.savetxt(path, np.column_stack(columns), delimiter=",", header="t,x_d [mm],x [mm]", comments="", fmt="%.12g")
    return path


@pytest.fixture
def response(tmp_path: Path) -> Path:
    path = tmp_path / "frf.csv"
    f = np.linspace(1, 60, 120)
    G = TRUTH.frequency_response(2 * np.pi * f)
    np.savetxt(path, np.column_stack((f, G.real, G.imag)), delimiter=",", header="f,re,im", comments="")
    return path


def is_png(path: Path) -> bool:
    return path.read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_a_log(hybridsep: Run, log: Path, tmp_path: Path) -> None:
    out, figure = tmp_path / "my_axis.toml", tmp_path / "log.png"
    status, printed, err = hybridsep("identify", log, "--out", out, "--figure", figure, "--name", "my_axis")
    assert (status, err) == (0, "")
    assert "second order, gain 1" in printed
    assert printed.splitlines()[-2:] == [f"wrote {out}", f"wrote {figure}"]
    assert "chosen" in printed
    machine = load_machine(out)
    assert (machine.name, machine.T_s, machine.physics.input_hold) == ("my_axis", T_S, "foh")
    assert machine.model.modes[0].f_n == pytest.approx(20.0, abs=0.1)
    assert "# mode[1].f_n = 20.0" in out.read_text(encoding="utf-8").replace("19.99", "20.0")
    assert is_png(figure)
    status, printed, _ = hybridsep("identify", log, "--json", "--free-gain")
    assert json.loads(printed)["structure"] == "second order, gain free"


def test_a_frequency_response(hybridsep: Run, response: Path, tmp_path: Path) -> None:
    out, figure = tmp_path / "axis.toml", tmp_path / "frf.png"
    status, printed, err = hybridsep("identify", response, "--out", out, "--figure", figure, "--T_s", "0.002")
    assert (status, err) == (0, "")
    assert "1 modes" in printed
    assert load_machine(out).T_s == 0.002
    assert load_machine(out).model.modes[0].zeta == pytest.approx(0.3, rel=1e-9)
    assert is_png(figure)
    status, printed, _ = hybridsep("identify", response, "--json", "--modes", "1", "--unit-gain")
    assert json.loads(printed)["n_lines"] == 120


def test_a_swept_sine(hybridsep: Run, tmp_path: Path) -> None:
    path = tmp_path / "sweep.csv"
    t = np.arange(8000) * T_S
    x_d = 1e-3 * chirp(t, 2, 8, 60) * np.minimum(1, np.minimum(t, 8 - t) / 0.5)
    columns = np.column_stack((t, x_d, measured(TRUTH, x_d, "zoh", 1e-6)))
    np.savetxt(path, columns, delimiter=",", header="t,x_d,x", comments="", fmt="%.12g")
    status, printed, _ = hybridsep("identify", path, "--kind", "sweep", "--modes", "1", "--json")
    assert status == 0
    assert json.loads(printed)["modes"][0]["f_n"] == pytest.approx(20.0, abs=0.05)


@pytest.mark.slow
def test_an_accelerometer_file(hybridsep: Run, tmp_path: Path) -> None:
    path = tmp_path / "raw_data_x.csv"
    t = np.arange(0, 32, 1 / 1000)
    command = 75 * (5 + 4 * t) * chirp(t, 5, 32, 133)
    a = measured(ModalModel([Mode(45.0, 0.08, (90 * np.pi) ** 2)]), command, "foh")
    header = "#time,accel_x,accel_y,accel_z"
    np.savetxt(path, np.column_stack((t, a, a, a)), delimiter=",", header=header, comments="", fmt="%.6f")
    status, printed, _ = hybridsep("identify", path, "--axis", "x", "--figure", tmp_path / "x.png")
    assert status == 0
    assert "phase and dead time are unknown" in printed
    status, _, err = hybridsep("identify", path)
    assert status == 2
    assert "--axis x, y or z" in err


def test_what_is_refused(hybridsep: Run, log: Path, tmp_path: Path) -> None:
    for arguments, message in (
        (("--kind", "guess"), "--kind must be one of auto, operation"),
        (("--out", tmp_path / "axis.txt"), "--out must end in .toml"),
        (("--out", log.with_suffix(".toml"), "--T_s", "5"), "T_s"),
        (("--figure", tmp_path / "f.jpg"), "--figure must end in .png"),
    ):
        status, _, err = hybridsep("identify", log, *arguments)
        assert status == 2
        assert message in " ".join(err.split())
    other = tmp_path / "notes.toml"
    other.write_text("a = 1\n")
    status, _, err = hybridsep("identify", log, "--out", other)
    assert status == 2
    assert "is no machine file" in " ".join(err.split())
    still = tmp_path / "still.csv"
    still.write_text("t,x_d,x\n" + "".join(f"{k * 1e-3:.3f},0.1,0.1\n" for k in range(200)))
    status, _, err = hybridsep("identify", still)
    assert status == 2
    assert "an axis at rest shows neither its model nor its errors; record it while it moves" in " ".join(err.split())


@pytest.mark.slow
def test_the_log_is_checked(hybridsep: Run, tmp_path: Path) -> None:
    """Swapped columns gave a model of 290 Hz without a word."""
    x_d = moves(1200)
    swapped = tmp_path / "swapped.csv"
    columns = (np.arange(len(x_d)) * T_S, measured(TRUTH, x_d, "zoh", 1e-6), x_d)
    np.savetxt(swapped, np.column_stack(columns), delimiter=",", header="t,x_d,x", comments="", fmt="%.12g")
    out = tmp_path / "my_axis.toml"
    status, _, err = hybridsep("identify", swapped, "--out", out)
    assert status == 2
    assert "columns swapped" in " ".join(err.split())
    assert "(--fix does it)" in " ".join(err.split())
    assert not out.exists()
    status, _, err = hybridsep("identify", swapped, "--out", out, "--fix")
    assert status == 0
    assert "columns swapped" in " ".join(err.split())
    machine = load_machine(out)
    assert machine.name == "my_axis"  # as the file
    assert machine.sources[0] == "identified from swapped.csv"
    assert machine.sources[1].startswith("swapped.csv: columns swapped: exchange ")
    assert machine.model.modes[0].f_n == pytest.approx(20.0, abs=0.1)


@pytest.mark.slow
def test_missing_measurements(hybridsep: Run, tmp_path: Path) -> None:
    x_d = moves(1200)
    x = measured(TRUTH, x_d, "zoh", 1e-6)
    x[np.random.default_rng(2).integers(0, len(x), 20)] = np.nan
    n = int(np.isnan(x).sum())
    rows = "\n".join(f"{k * T_S:.6f},{x_d[k]:.9f},{'' if np.isnan(x[k]) else f'{x[k]:.9f}'}" for k in range(len(x)))
    path = tmp_path / "log.csv"
    path.write_text(f"t,x_d,x\n{rows}\n")
    out = tmp_path / "axis.toml"
    for fix in ([], ["--fix"]):
        status, _, err = hybridsep("identify", path, "--out", out, "--figure", tmp_path / "log.png", *fix)
        assert status == 0
        assert f"{n} of {len(x)} measured positions are missing" in " ".join(err.split())
        assert load_machine(out).model.modes[0].f_n == pytest.approx(20.0, abs=0.1)
    status, _, err = hybridsep("identify", path, "--kind", "sweep")
    assert status == 2
    assert f"{n} measured positions are missing; record it again, or read it as a log" in " ".join(err.split())
    assert "--trust" not in err


@pytest.mark.slow
def test_a_changed_position_is_a_source_of_the_machine(hybridsep: Run, tmp_path: Path) -> None:
    x_d = moves(1200)
    log, out = tmp_path / "flipped.csv", tmp_path / "axis.toml"
    columns = (np.arange(len(x_d)) * T_S, x_d, -measured(TRUTH, x_d, "zoh", 1e-6))
    np.savetxt(log, np.column_stack(columns), delimiter=",", header="t,x_d,x", comments="", fmt="%.12g")
    status, _, err = hybridsep("identify", log, "--out", out, "--fix")
    assert status == 0
    assert "your controller must do the same" in " ".join(err.split())
    assert "sign; the controller must do the same" in load_machine(out).sources[1]


def test_only_a_log_is_put_right(hybridsep: Run, response: Path) -> None:
    status, _, err = hybridsep("identify", response, "--fix")
    assert status == 2
    assert "--fix is for a log of operation, frf.csv is read as --kind response" in " ".join(err.split())
