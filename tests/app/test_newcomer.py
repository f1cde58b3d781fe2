"""A newcomer's way: from the log of an axis to a compensated run of it, by the lines that ``fit`` prints."""

import json
import shlex
import zipfile
from pathlib import Path

import numpy as np
import pytest
from command_line import Run, write_rows

from hybridsep import Limits, ModalModel, Mode, load_machine, rest_to_rest, simulate
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
