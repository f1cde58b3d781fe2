"""Help of the commands, whose examples are run, and of plug-ins; a newcomer's way: log, machine file, lines."""

import ast
import json
import re
import shlex
import zipfile
from importlib.metadata import EntryPoint
from pathlib import Path

import example_log
import numpy as np
import pytest
from command_line import Run, write_rows
from places import ROOT
from staircase_data import commanded, measured

from hybridsep import Limits, ModalModel, Mode, load_machine, read_log, rest_to_rest, simulate
from hybridsep.app import cli
from hybridsep.app.cli import EXAMPLES
from hybridsep.logs.checks import check
from hybridsep.logs.formats import EXAMPLE
from hybridsep.machines.machine import machine_text
from hybridsep.plants.stage_drive import StageDrive


@pytest.fixture(scope="module")
def axis(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the examples name: a log, a program, machine files, a trained predictor."""
    folder = tmp_path_factory.mktemp("examples")
    part = np.r_[:400, 999:1399]  # a move in each half
    write_rows(folder / "my_axis.csv", commanded()[part], measured(0)[part])
    machine = load_machine("spring_mass_damper").changed("predictor", {"Np": 50, "p": 20, "q": 1})
    for name in ("my_axis", "x", "y"):
        (folder / name).mkdir()
        text = machine_text(machine.changed("", {"name": name}))
        (folder / name / "machine.toml").write_text(text, encoding="utf-8")
    predictor = machine.new_predictor()
    x_d, x = commanded()[:100], measured(0)[:100]
    for begin in (0, 50):
        predictor.predict(x_d[begin : begin + 50])
        predictor.update(x[begin : begin + 50])
    predictor.save(folder / "my_axis" / "trained.state")
    (folder / "part.ngc").write_text("F1200 G2 X0 Y0 I1\n", encoding="utf-8")
    return folder


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
@pytest.mark.parametrize(
    "name",
    [  # the demonstration takes half a minute, and test_demo runs it
        pytest.param(name, marks=pytest.mark.nightly if name == "demo" else ()) for name in sorted(EXAMPLES)
    ],
)
def test_each_command_has_two_examples_that_run(
    hybridsep: Run, axis: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 1)  # other processes would load all that this one has
    monkeypatch.setattr("hybridsep.plants.trajectory.staircase", lambda *_, **__: commanded()[:400])
    lines = EXAMPLES[name]
    assert len(set(lines)) == 2
    for i, line in enumerate(lines):
        words = shlex.split(line)
        assert words[:2] == ["hybridsep", name]
        folder = tmp_path / str(i)
        folder.mkdir()
        for path in axis.rglob("*"):
            if path.is_file() and path.name not in (words[-1] if name == "example-log" else ""):
                place = folder / path.relative_to(axis)
                place.parent.mkdir(exist_ok=True)
                place.write_bytes(path.read_bytes())
        if name == "fit":  # which makes it
            (folder / "my_axis" / "machine.toml").unlink()
            (folder / "my_axis" / "trained.state").unlink()
        monkeypatch.chdir(folder)
        hybridsep.done(*words[1:])


def test_help_has_examples(hybridsep: Run) -> None:
    assert "  hybridsep fit my_axis.csv --Np 100\n" in hybridsep.done("fit", "--help")


@pytest.mark.parametrize("name", cli.PLUG_INS)
def test_a_plug_in_that_is_not_installed_is_named(name: str, hybridsep: Run) -> None:
    err = hybridsep.refused(name, "--help")
    assert f"pip install ./plugins/{name} in a checkout (hybridsep-{name} once released)" in err
    assert (ROOT / "plugins" / name / "pyproject.toml").is_file()


def test_a_plug_in_that_is_installed_is_a_command(hybridsep: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    point = EntryPoint("modal", "json:dumps", "hybridsep.commands")
    monkeypatch.setattr(EntryPoint, "load", lambda _: _shown)
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: [point] * (group == point.group))
    assert hybridsep("modal", "3")[:2] == (0, "got 3\n")
    assert "Show a number." in hybridsep("--help")[1]


def _shown(number: int) -> None:
    """Show a number."""
    print(f"got {number}")


def test_nothing_of_the_core_imports_a_plug_in() -> None:
    for path in (ROOT / "hybridsep").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            named = [one.name for one in node.names] if isinstance(node, ast.Import) else []
            named += [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
            assert not any(one.startswith("hybridsep_") for one in named), path


# A newcomer's way ---------------------------------------------------------------------------------------------------


T_S = 1e-3


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_the_lines_that_fit_prints_end_in_a_compensated_run(
    hybridsep: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    targets = np.concatenate(([0.0], np.random.default_rng(0).uniform(-0.01, 0.01, 5)))
    x_d = rest_to_rest(targets, Limits(velocity=0.08, acceleration=8.0, jerk=1000.0), T_S, dwell=0.05)
    stage = StageDrive(ModalModel([Mode(35.0, 0.4, (70 * np.pi) ** 2)], dead_time=2), 8e-6, 0.05, T_S)
    x = simulate(stage, x_d, T_S) + 5e-7 * np.random.default_rng(1).standard_normal(len(x_d))
    write_rows(Path("axis.csv"), x_d, x)
    said = hybridsep.done("fit", "axis.csv", "--Np", 50)
    lines = [shlex.split(line) for line in said.splitlines() if line.startswith("  hybridsep ")]
    assert [line[1] for line in lines] == ["cosim", "cosim", "system", "fit", "build"]
    assert lines[3][2:5] == ["axis.csv", "--Np", "50"]
    assert {"--v_max", "--a_max", "--j_max"} <= set(lines[3])
    machine = load_machine("axis/machine.toml")
    assert machine.plant is not None
    assert machine.plant.kind == "identified"
    assert "A plant to try with, no measurement" in Path("axis/machine.toml").read_text(encoding="utf-8")

    def tracked(line: list[str], *more: str) -> float:
        return float(json.loads(hybridsep.done(*line[1:], *more, "--json"))["tracking_rms_um"])

    without, compensated = (tracked(line) for line in lines[:2])
    assert without > 100
    assert compensated < 0.02 * without
    hybridsep.done(*lines[2][1:], "--target", "host")
    assert "resources/FeedDrive_axis.fmu" in zipfile.ZipFile("axis.ssp").namelist()
    # A file that exists is overwritten with --force only.
    assert hybridsep(*lines[2][1:], "--target", "host")[0] == 2
    hybridsep.done(*lines[2][1:], "--target", "host", "--force")


def test_a_lag(hybridsep: Run, tmp_path: Path) -> None:
    path = tmp_path / "x_axis.toml"
    assert "written: a lag, tau = 0.006" in hybridsep.done("init", path)
    machine = load_machine(path)
    assert (machine.name, machine.T_s, machine.predictor_settings.Np) == ("x_axis", 1e-3, 100)
    omega = np.array([1.0, 100.0])
    np.testing.assert_allclose(machine.model.frequency_response(omega, 1e-3), 1 / (1 + 0.006j * omega), rtol=1e-12)
    text = path.read_text(encoding="utf-8")
    assert "# Hz, natural frequency of the mode" in text
    assert "# samples in a look-ahead window" in text


def test_what_is_commented_out_is_a_machine_file_too(hybridsep: Run, tmp_path: Path) -> None:
    path = tmp_path / "axis.toml"
    hybridsep.done("init", path)
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
    hybridsep.done("example-log", "--out", "logs/other.csv.gz")
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
