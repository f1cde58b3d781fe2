"""Closed system of native FMUs in other projects' importers; all but two of them run at night."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import importers_closed_system as closed_system
import numpy as np
import pytest
from built_once import BuiltFmus
from importers_closed_system import IMPORTERS, MOVED, SYSTEMS, UNCARRIED, Array, ClosedSystem, exists_here
from places import SUPPORT

from hybridsep import build_fmu, cosimulate, load_machine, staircase

TOLERANCE = 1e-12  # m; libcosim's step sizes are rounded differences of times
SHIFT = 0.1  # m
N_MOVED = 800  # samples of the shorter run at another place


@pytest.fixture(scope="module")
def folder(fmus: BuiltFmus, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the FMUs of the closed systems, of both versions of FMI."""
    folder = tmp_path_factory.mktemp("importers")
    for system in SYSTEMS.values():
        for suffix in ("", "Fmi3"):
            for name in system.components.values():
                shutil.copy(fmus(f"{name}{suffix}"), folder)
    return folder


@pytest.fixture(scope="module")
def expected(folder: Path) -> dict[str, Array]:
    """What is observed without an importer, by system."""
    return {key: closed_system.run("fmpy", system, folder) for key, system in SYSTEMS.items()}


def python(folder: Path, *arguments: object) -> str:
    """Return what Python prints with these arguments, run in a folder; the tests' modules can be imported."""
    command = [sys.executable, "-W", "error", *map(str, arguments)]
    environment = os.environ | {"PYTHONPATH": str(SUPPORT)}
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, env=environment, timeout=600)
    assert done.returncode == 0, done.stderr
    return done.stdout


def figures(system: ClosedSystem, rows: Array) -> list[str]:
    """Return the FMU's own figures, since ``t_init``, and RMS errors over the whole trajectory, µm, 4 digits."""
    of = system.columns(rows)
    reported = [float(of[name][-1]) for name in system.figures]
    overall = [float(np.sqrt(np.mean((of[a] - of[b]) ** 2))) for a, b in system.errors]
    return [f"{1e6 * figure:#.4g}" for figure in (*reported, *overall)]


@pytest.mark.slow
@pytest.mark.parametrize("key", SYSTEMS)
def test_the_loop_without_an_importer_is_cosimulate(folder: Path, expected: dict[str, Array], key: str) -> None:
    system = SYSTEMS[key]
    run = cosimulate(folder / f"{system.model}.fmu", folder / "FeedDrive.fmu", staircase())
    of = system.columns(expected[key])
    for name in (*system.positions, "x", "x_meas"):
        np.testing.assert_array_equal(of[name], getattr(run, name), err_msg=name)
    summary = run.summary()
    names = ("rms_pb_um", "rms_h_um") if key == "predictor" else ("tracking_rms_um",)
    assert figures(system, expected[key])[2:] == [f"{summary[name]:#.4g}" for name in names]


@pytest.mark.slow
@pytest.mark.parametrize(
    "importer",
    [
        pytest.param(name, marks=[] if name in ("fmpy SSP", "libcosim") else [pytest.mark.nightly])
        for name in IMPORTERS
        if name != "fmpy"
    ],
)
def test_importers_come_to_the_same_figures(
    folder: Path, expected: dict[str, Array], tmp_path: Path, importer: str
) -> None:
    """Of FMI 3.0 too, where they read it; and where a start goes round in Initialization Mode, anywhere on the axis."""
    if not exists_here(importer):
        pytest.skip(f"{importer} has no library for this machine")
    moved, machine = tmp_path / "moved", load_machine("spring_mass_damper")
    moved.mkdir()
    for name in ("HybridPredictor", "SepCompensator", "FeedDrive"):
        shutil.copy(folder / f"{name}.fmu", moved)
    command = staircase(machine.T_s)[:N_MOVED] + SHIFT
    np.save(moved / "command.npy", command)
    build_fmu(machine, "ReferenceTrajectory", moved, targets=("host",), samples=command)
    python(tmp_path, closed_system.__file__, importer, folder, moved, tmp_path)
    found = {path.stem: np.load(path) for path in tmp_path.glob("*.npy")}
    assert set(SYSTEMS) <= set(found)
    for name, rows in found.items():
        key = name.partition(" ")[0]
        system, known = SYSTEMS[key], expected[key]
        if name.endswith(MOVED):
            rows, known = rows[: N_MOVED - 2].copy(), known[: N_MOVED - 2]  # up to where one command ends
            rows[:, : system.n_positions] -= SHIFT
            assert np.ptp(rows[:, 0]) > 1e-3
            np.testing.assert_allclose(rows, known, rtol=0, atol=1e-11)
            continue
        # The first measurement, from which a compensator with averaging judges the sensor, is another.
        judged = importer in UNCARRIED and key == "compensator"
        print(importer, name, *figures(system, rows), f"µm; at most {abs(rows - known).max():.1e} m apart from fmpy")
        if not judged:  # else nanometres may change the last digit
            assert figures(system, rows) == figures(system, known)
        np.testing.assert_allclose(rows, known, rtol=0, atol=1e-7 if judged else TOLERANCE, err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize("key", ["predictor", pytest.param("compensator", marks=pytest.mark.nightly)])
@pytest.mark.skipif(not exists_here("ecos"), reason="ecos has no library for this machine")
def test_the_script_of_the_guide(folder: Path, expected: dict[str, Array], key: str) -> None:
    (script,) = closed_system.blocks("python")
    if key == "compensator":  # what the guide says to change
        for old, new in (("6100", "6200"), ("predictor", "compensator"), ("rms_pb", "rms_e")):
            assert old in script
            script = script.replace(old, new)
    place = closed_system.system_structure(SYSTEMS[key], folder).parent
    printed = python(place, "-c", f"import importers_closed_system as c; c.load_tbb()\n{script}")
    assert [f"{1e6 * float(number):#.4g}" for number in printed.split()] == figures(SYSTEMS[key], expected[key])[:2]


@pytest.mark.slow
@pytest.mark.parametrize("key", SYSTEMS)
def test_the_figures_of_the_guide(expected: dict[str, Array], key: str) -> None:
    guide, row = closed_system.GUIDE.read_text("utf-8"), " | ".join(figures(SYSTEMS[key], expected[key]))
    others = key == "compensator"  # simulate_ssp, by its last digit
    assert guide.count(f"| {row} |") >= len(IMPORTERS) - others
    if key == "predictor":  # its drive follows x_d itself
        of = SYSTEMS[key].columns(expected[key])
        assert f"(without compensation: {1e6 * np.sqrt(np.mean((of['x_d'] - of['x']) ** 2)):.1f})" in guide
