"""``hybridsep identify``: what it writes, draws and prints, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import Run
from identification_cases import T_S, measured, moves

from hybridsep import ModalModel, Mode, load_machine

TRUTH = ModalModel([Mode(20.0, 0.3, (40 * np.pi) ** 2)])


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "log.csv"
    x_d = moves(1200)
    columns = (np.arange(len(x_d)) * T_S, 1e3 * x_d, 1e3 * measured(TRUTH, x_d, "foh", 1e-6))
    np.savetxt(path, np.column_stack(columns), delimiter=",", header="t,x_d [mm],x [mm]", comments="", fmt="%.12g")
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


def test_what_is_refused(hybridsep: Run, log: Path, tmp_path: Path) -> None:
    for arguments, message in (
        (("--out", tmp_path / "axis.txt"), "--out must end in .toml"),
        (("--out", log.with_suffix(".toml"), "--T_s", "5"), "T_s"),
        (("--figure", tmp_path / "f.jpg"), "--figure must end in .png"),
    ):
        status, _, err = hybridsep("identify", log, *arguments)
        assert status == 2
        assert message in " ".join(err.split())
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
    assert not out.exists()
    assert hybridsep("identify", swapped, "--out", out, "--x_d", "x", "--x", "x_d")[0] == 0
    machine = load_machine(out)
    assert machine.name == "my_axis"  # as the file
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
    status, _, err = hybridsep("identify", path, "--out", out, "--figure", tmp_path / "log.png")
    assert status == 0
    assert f"{n} of {len(x)} measured positions are missing" in " ".join(err.split())
    assert load_machine(out).model.modes[0].f_n == pytest.approx(20.0, abs=0.1)
