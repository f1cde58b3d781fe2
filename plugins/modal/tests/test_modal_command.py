"""``hybridsep modal``: what it writes, draws and prints for each kind of file, and what it refuses."""

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import Run, run_page
from identification_cases import T_S, measured
from places import ROOT
from scipy.signal import chirp

from hybridsep import ModalModel, Mode, load_machine

TRUTH = ModalModel([Mode(20.0, 0.3, (40 * np.pi) ** 2)])


@pytest.fixture
def response(tmp_path: Path) -> Path:
    path = tmp_path / "frf.csv"
    f = np.linspace(1, 60, 120)
    G = TRUTH.frequency_response(2 * np.pi * f)
    np.savetxt(path, np.column_stack((f, G.real, G.imag)), delimiter=",", header="f,re,im", comments="")
    return path


def test_a_frequency_response(hybridsep: Run, response: Path, tmp_path: Path) -> None:
    out, figure = tmp_path / "axis.toml", tmp_path / "frf.png"
    status, printed, err = hybridsep("modal", response, "--out", out, "--figure", figure, "--T_s", "0.002")
    assert (status, err) == (0, "")
    assert "1 modes" in printed
    assert load_machine(out).T_s == 0.002
    assert load_machine(out).model.modes[0].zeta == pytest.approx(0.3, rel=1e-9)
    assert figure.read_bytes().startswith(b"\x89PNG")
    status, printed, _ = hybridsep("modal", response, "--json", "--modes", "1", "--unit-gain")
    assert json.loads(printed)["n_lines"] == 120


def test_a_swept_sine(hybridsep: Run, tmp_path: Path) -> None:
    path = tmp_path / "sweep.csv"
    t = np.arange(8000) * T_S
    x_d = 1e-3 * chirp(t, 2, 8, 60) * np.minimum(1, np.minimum(t, 8 - t) / 0.5)
    columns = np.column_stack((t, x_d, measured(TRUTH, x_d, "zoh", 1e-6)))
    np.savetxt(path, columns, delimiter=",", header="t,x_d,x", comments="", fmt="%.12g")
    status, printed, _ = hybridsep("modal", path, "--modes", "1", "--json")
    assert status == 0
    assert json.loads(printed)["modes"][0]["f_n"] == pytest.approx(20.0, abs=0.05)


def test_an_accelerometer_file(hybridsep: Run, tmp_path: Path) -> None:
    path = tmp_path / "raw_data_x.csv"
    t = np.arange(0, 32, 1 / 1000)
    command = 75 * (5 + 4 * t) * chirp(t, 5, 32, 133)
    a = measured(ModalModel([Mode(45.0, 0.08, (90 * np.pi) ** 2)]), command, "foh")
    header = "#time,accel_x,accel_y,accel_z"
    np.savetxt(path, np.column_stack((t, a, a, a)), delimiter=",", header=header, comments="", fmt="%.6f")
    status, printed, _ = hybridsep("modal", path, "--axis", "x", "--figure", tmp_path / "x.png")
    assert status == 0
    assert "phase and dead time are unknown" in printed
    status, _, err = hybridsep("modal", path)
    assert status == 2
    assert "--axis x, y or z" in err


def test_a_file_is_overwritten_where_it_is_said(hybridsep: Run, response: Path, tmp_path: Path) -> None:
    out = tmp_path / "axis.toml"
    out.write_text("mine")
    status, _, err = hybridsep("modal", response, "--out", out)
    assert status == 2
    assert "axis.toml exists; --force overwrites it" in " ".join(err.split())
    assert out.read_text() == "mine"
    assert hybridsep("modal", response, "--out", out, "--force")[0] == 0


def test_the_lines_of_the_page_run(hybridsep: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    run_page(ROOT / "plugins" / "modal" / "README.md", hybridsep)
