"""A newcomer's way: the example log, a machine file to edit, the lines that ``fit`` prints."""

import json
import re
import shlex
import zipfile
from pathlib import Path

import example_log
import numpy as np
import pytest
from command_line import Run, write_rows

from hybridsep import Limits, ModalModel, Mode, load_machine, read_log, rest_to_rest, simulate
from hybridsep.logs.checks import check
from hybridsep.logs.formats import EXAMPLE
from hybridsep.plants.stage_drive import StageDrive

T_S = 1e-3


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_the_lines_that_fit_prints_end_in_a_compensated_run(
    hybridsep: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    targets = np.concatenate(([0.0], np.random.default_rng(0).uniform(-0.01, 0.01, 8)))
    x_d = rest_to_rest(targets, Limits(velocity=0.08, acceleration=8.0, jerk=1000.0), T_S, dwell=0.05)
    stage = StageDrive(ModalModel([Mode(35.0, 0.4, (70 * np.pi) ** 2)], dead_time=2), 8e-6, 0.05, T_S)
    x = simulate(stage, x_d, T_S) + 5e-7 * np.random.default_rng(1).standard_normal(len(x_d))
    write_rows(Path("axis.csv"), x_d, x)
    status, said, err = hybridsep("fit", "axis.csv", "--Np", 50)
    assert status == 0, err
    lines = [shlex.split(line) for line in said.splitlines() if line.startswith("  hybridsep ")]
    assert [line[1] for line in lines] == ["cosim", "cosim", "system", "fit", "build"]
    assert lines[3][2:5] == ["axis.csv", "--Np", "50"]
    assert {"--v_max", "--a_max", "--j_max"} <= set(lines[3])
    machine = load_machine("axis/machine.toml")
    assert machine.plant is not None
    assert machine.plant.kind == "identified"
    assert "A plant to try with, no measurement" in Path("axis/machine.toml").read_text(encoding="utf-8")

    def tracked(line: list[str], *more: str) -> float:
        status, said, err = hybridsep(*line[1:], *more, "--json")
        assert status == 0, err
        return float(json.loads(said)["tracking_rms_um"])

    without, compensated = (tracked(line) for line in lines[:2])
    assert without > 100
    assert compensated < 0.02 * without
    status, _, err = hybridsep(*lines[2][1:], "--target", "host")
    assert status == 0, err
    assert "resources/FeedDrive_axis.fmu" in zipfile.ZipFile("axis.ssp").namelist()
    # A file that exists is overwritten with --force only.
    assert hybridsep(*lines[2][1:], "--target", "host")[0] == 2
    assert hybridsep(*lines[2][1:], "--target", "host", "--force")[0] == 0


def test_a_lag(hybridsep: Run, tmp_path: Path) -> None:
    path = tmp_path / "x_axis.toml"
    status, out, _ = hybridsep("init", path)
    assert status == 0
    assert "written: a lag, tau = 0.006" in out
    machine = load_machine(path)
    assert (machine.name, machine.T_s, machine.predictor_settings.Np) == ("x_axis", 1e-3, 100)
    omega = np.array([1.0, 100.0])
    np.testing.assert_allclose(machine.model.frequency_response(omega, 1e-3), 1 / (1 + 0.006j * omega), rtol=1e-12)
    text = path.read_text(encoding="utf-8")
    assert "# Hz, natural frequency of the mode" in text
    assert "# samples in a look-ahead window" in text


def test_what_is_commented_out_is_a_machine_file_too(hybridsep: Run, tmp_path: Path) -> None:
    path = tmp_path / "axis.toml"
    assert hybridsep("init", path)[0] == 0
    head, modes, rest = re.split(r"(?=\n\[\[physics\.mode\]\]|\n\[predictor\])", path.read_text(encoding="utf-8"))
    assert "f_n" in modes
    path.write_text(head + re.sub(r"^# (?=\[|\w+ = )", "", rest, flags=re.MULTILINE), encoding="utf-8")
    machine = load_machine(path)
    assert machine.new_compensator().settings.limits is not None
    assert machine.physics.spring_mass_damper is not None
    assert machine.log.columns == {"t": "time", "x_d": "command", "x": "position"}


def test_it_is_written_and_read(hybridsep: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert hybridsep("example-log") == (0, "example_axis.csv\n", "")
    assert hybridsep("example-log", "--out", "logs/other.csv.gz")[0] == 0
    log = read_log("example_axis.csv")
    assert (len(log.t), log.T_s, log.unit, log.unit_stated) == (20_000, 1e-3, "m", True)
    assert check(log) == ()
    np.testing.assert_array_equal(read_log("logs/other.csv.gz").x_meas, log.x_meas)
    assert EXAMPLE.stat().st_size < 300_000
    assert hybridsep("example-log")[0] == 2
    assert "--out must end in .csv or .gz, got 'log.mat'" in hybridsep("example-log", "--out", "log.mat")[2]


@pytest.mark.slow
def test_it_is_what_its_script_makes() -> None:
    log = read_log(EXAMPLE)
    t, x_d, x_meas = example_log.table().T
    np.testing.assert_allclose(log.t, t, atol=1e-12)
    np.testing.assert_allclose(1e3 * log.x_d, x_d, atol=1e-9)
    # A rounding to the encoder's resolution, 0.2 µm, may fall otherwise on another platform.
    np.testing.assert_allclose(1e3 * log.x_meas, x_meas, atol=2.1e-4)
