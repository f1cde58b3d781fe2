"""Importers of other projects run the closed system of native FMUs, and another project's checker finds nothing."""

from __future__ import annotations

import logging
import os
import re
import subprocess
import sys
import zipfile
from importlib import import_module
from pathlib import Path

import importers_closed_system as closed_system
import numpy as np
import pytest
from importers_closed_system import N_STEPS, Array, exists_here

from hybridsep import build_fmu, cosimulate, load_machine, machine_names, staircase
from hybridsep.fmi.archive import fmu_names

NATIVE = {name: machine for machine in map(load_machine, machine_names()) for name in fmu_names(machine)}
TOLERANCE = 1e-12  # m; libcosim's step sizes are rounded differences of times
FIRST = 99  # row of t_100, where the first fill ends
FOREIGN = [
    pytest.param(
        name, marks=pytest.mark.skipif(not exists_here(name), reason=f"{name} has no library for this machine")
    )
    for name in closed_system.IMPORTERS
    if name != "fmpy"
]
SHIFT = 0.1  # m


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with all native FMUs of all machines, built for this machine."""
    folder = tmp_path_factory.mktemp("importers")
    for name, machine in NATIVE.items():
        build_fmu(machine, name, folder, targets=("host",))
    return folder


@pytest.fixture(scope="module")
def moved(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a closed system whose staircase starts at another place than the FMUs' start values."""
    folder, machine = tmp_path_factory.mktemp("moved"), load_machine("spring_mass_damper")
    for name in ("HybridPredictor", "FeedDrive"):
        (folder / f"{name}.fmu").write_bytes((fmus / f"{name}.fmu").read_bytes())
    build_fmu(machine, "ReferenceTrajectory", folder, targets=("host",), samples=staircase(machine.T_s) + SHIFT)
    return folder


@pytest.fixture(scope="module")
def expected(fmus: Path) -> Array:
    return closed_system.run("fmpy", fmus)


def run_apart(importer: str, folder: Path, out: Path) -> Array:
    """Return what :func:`closed_system.run` does in a process of its own."""
    program = Path(closed_system.__file__)
    for model in closed_system.COMPONENTS.values():
        (out / f"{model}.fmu").write_bytes((folder / f"{model}.fmu").read_bytes())
    python(out, str(program), importer, str(out), str(out / "rows.npy"))
    rows: Array = np.load(out / "rows.npy")
    return rows


def python(folder: Path, *arguments: str) -> str:
    """Return what Python prints with these arguments, run in a folder; the tests' modules can be imported."""
    tests = Path(closed_system.__file__).parent
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tests.parent), str(tests)])}
    command = [sys.executable, "-W", "error", *arguments]
    result = subprocess.run(
        command, capture_output=True, text=True, cwd=folder, env=environment, timeout=120, check=False
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


def figures(rows: Array) -> list[str]:
    """Return the FMU's own ``rms_pb`` and ``rms_h``, since ``t_init``, and both over all samples, µm, 4 digits."""
    x_pb, x_h, x_meas = rows[FIRST:, :3].T
    overall = [float(np.sqrt(np.mean((x_meas - x) ** 2))) for x in (x_pb, x_h)]
    return [f"{1e6 * figure:#.4g}" for figure in (*rows[-1, 3:], *overall)]


def test_the_loop_without_an_importer_is_cosimulate(fmus: Path, expected: Array) -> None:
    run = cosimulate(fmus / "HybridPredictor.fmu", fmus / "FeedDrive.fmu", staircase())
    assert len(run.t) == N_STEPS - FIRST
    for column, name in enumerate(("x_pb", "x_h", "x_meas")):
        np.testing.assert_array_equal(expected[FIRST:, column], getattr(run, name), err_msg=name)
    summary = run.summary()
    assert figures(expected)[2:] == [f"{summary[name]:#.4g}" for name in ("rms_pb_um", "rms_h_um")]
    assert summary["reduction_percent"] > 50


@pytest.mark.parametrize("importer", FOREIGN)
def test_importers_come_to_the_same_figures(fmus: Path, expected: Array, tmp_path: Path, importer: str) -> None:
    rows = run_apart(importer, fmus, tmp_path)
    print(importer, *figures(rows), "µm;", f"at most {abs(rows - expected).max():.1e} m apart from fmpy")
    assert figures(rows) == figures(expected)
    np.testing.assert_allclose(rows, expected, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("importer", [param for param in FOREIGN if param.values != ("fmpy SSP",)])
def test_the_start_goes_round_in_initialization_mode(
    moved: Path, expected: Array, tmp_path: Path, importer: str
) -> None:
    """``r`` is right before the first step and reaches the predictor and the drive; fmpy's SSP loop carries nothing."""
    rows = run_apart(importer, moved, tmp_path)
    assert figures(rows) == figures(expected)
    rows[:, :3] -= SHIFT
    np.testing.assert_allclose(rows, expected, rtol=0, atol=1e-11)


@pytest.mark.skipif(not exists_here("ecos"), reason="ecos has no library for this machine")
def test_the_script_of_the_guide(fmus: Path, expected: Array) -> None:
    (script,) = re.findall(r"^```python\n(.*?)^```$", closed_system.GUIDE.read_text("utf-8"), re.MULTILINE | re.DOTALL)
    folder = closed_system.system_structure(fmus).parent
    printed = python(folder, "-c", f"import importers_closed_system as c; c.load_tbb()\n{script}")
    assert [f"{1e6 * float(number):#.4g}" for number in printed.split()] == figures(expected)[:2]


@pytest.mark.skipif(not all(map(exists_here, closed_system.IMPORTERS)), reason="not all importers run here")
def test_the_figures_of_the_guide(expected: Array) -> None:
    row = " | ".join(figures(expected))
    assert closed_system.GUIDE.read_text("utf-8").count(f"| {row} |") == len(closed_system.IMPORTERS)


# The fmu-manipulation-toolbox's check ------------------------------------------------------------------------------


def findings(path: Path, caplog: pytest.LogCaptureFixture) -> list[str]:
    """Return what the toolbox's checkers complain about."""
    checkers = import_module("fmu_manipulation_toolbox.checker").get_checkers()
    assert {"OperationGenericCheck", "OperationSemanticCheck"} <= {checker.__name__ for checker in checkers}
    caplog.clear()
    with (
        caplog.at_level(logging.INFO, "fmu_manipulation_toolbox"),
        import_module("fmu_manipulation_toolbox.operations").FMU(str(path)) as fmu,
    ):
        for checker in checkers:
            fmu.apply_operation(checker())
    assert caplog.records
    return [record.getMessage() for record in caplog.records if record.levelno > logging.INFO]


@pytest.mark.parametrize("name", NATIVE)
def test_the_toolbox_has_no_finding(fmus: Path, caplog: pytest.LogCaptureFixture, name: str) -> None:
    assert findings(fmus / f"{name}.fmu", caplog) == []


def test_the_toolbox_would_find_something(fmus: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    broken = tmp_path / "broken.fmu"
    with zipfile.ZipFile(fmus / "FeedDrive.fmu") as archive, zipfile.ZipFile(broken, "w") as copy:
        description = archive.read("modelDescription.xml").decode()
        copy.writestr("modelDescription.xml", description.replace('name="v"', 'name="x"'))
    assert any("'x' is used by several variables" in finding for finding in findings(broken, caplog))
