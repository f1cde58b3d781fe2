"""Closed system of native FMUs in other projects' importers."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import importers_closed_system as closed_system
import numpy as np
import pytest
from built_once import BuiltFmus
from importers_closed_system import SYSTEMS, Array, ClosedSystem, exists_here
from places import SUPPORT

from hybridsep import Run, build_fmu, cosimulate, load_machine, staircase

TOLERANCE = 1e-12  # m; libcosim's step sizes are rounded differences of times
FOREIGN = [
    pytest.param(
        name, marks=pytest.mark.skipif(not exists_here(name), reason=f"{name} has no library for this machine")
    )
    for name in closed_system.IMPORTERS
    if name != "fmpy"
]
READ_FMI3 = ("ecos", "fmucontainer")
UNCARRIED = ("fmpy SSP", "fmucontainer -sequential")
"""Importers that carry nothing to the drive before the first step, and change the first measurement."""
SHIFT = 0.1  # m
MOVED = " moved"
N_MOVED = 800
"""Samples of the shorter run at another place."""


@pytest.fixture(scope="module")
def folder(fmus: BuiltFmus, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the FMUs of the closed systems, of both versions of FMI."""
    folder = tmp_path_factory.mktemp("importers")
    for system in (*SYSTEMS.values(), *closed_system.FMI3_SYSTEMS.values()):
        for name in system.components.values():
            shutil.copy(fmus(name), folder)
    return folder


@pytest.fixture(scope="module")
def moved(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with closed systems whose staircase starts at another place than the FMUs' start values."""
    moved, machine = tmp_path_factory.mktemp("moved"), load_machine("spring_mass_damper")
    for name in ("HybridPredictor", "SepCompensator", "FeedDrive"):
        shutil.copy(folder / f"{name}.fmu", moved)
    command = staircase(machine.T_s)[:N_MOVED] + SHIFT
    np.save(moved / "command.npy", command)
    build_fmu(machine, "ReferenceTrajectory", moved, targets=("host",), samples=command)
    return moved


@pytest.fixture(scope="module", params=SYSTEMS)
def system(request: pytest.FixtureRequest) -> ClosedSystem:
    return SYSTEMS[request.param]


@pytest.fixture(scope="module")
def expected(folder: Path, system: ClosedSystem) -> Array:
    return closed_system.run("fmpy", system, folder)


Apart = Callable[[str], dict[str, Array]]


@pytest.fixture(scope="module")
def apart(folder: Path, moved: Path, tmp_path_factory: pytest.TempPathFactory) -> Apart:
    """Return a function that gives what an importer does in a process of its own, by key of the system.

    Each runs all systems that it can once, one after the other, systems with a moved start (``MOVED``) too.
    """

    @cache
    def rows_of(importer: str) -> dict[str, Array]:
        systems = {key: (system, folder) for key, system in SYSTEMS.items()}
        if importer not in UNCARRIED:
            systems |= {f"{key}{MOVED}": (system, moved) for key, system in SYSTEMS.items()}
        if importer in READ_FMI3:
            system = closed_system.FMI3_SYSTEMS["predictor Fmi3"]
            systems[system.key] = (system, folder)
        out, arguments = tmp_path_factory.mktemp("importer"), []
        for key, (system, source) in systems.items():
            place = out / key.replace(" ", "_")
            place.mkdir()
            for file in (*(f"{model}.fmu" for model in system.components.values()), "command.npy"):
                if (source / file).exists():
                    shutil.copy(source / file, place)
            arguments += [system.key, str(place)]
        python(out, closed_system.__file__, importer, *arguments)
        return {key: np.load(Path(place) / "rows.npy") for key, place in zip(systems, arguments[1::2], strict=True)}

    return rows_of


def python(folder: Path, *arguments: str) -> str:
    """Return what Python prints with these arguments, run in a folder; the tests' modules can be imported."""
    environment = os.environ | {"PYTHONPATH": str(SUPPORT)}
    command = [sys.executable, "-W", "error", *arguments]
    result = subprocess.run(
        command, capture_output=True, text=True, cwd=folder, env=environment, timeout=600, check=False
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


def columns(system: ClosedSystem, rows: Array) -> dict[str, Array]:
    """Return the columns by the outputs' names, from the end of the first fill on, m."""
    return dict(zip((name for _, name in system.observed), rows[system.first :].T, strict=True))


def figures(system: ClosedSystem, rows: Array) -> list[str]:
    """Return the FMU's own figures, since ``t_init``, and RMS errors over the whole trajectory, µm, 4 digits."""
    of = columns(system, rows)
    reported = [float(of[name][-1]) for name in system.figures]
    overall = [float(np.sqrt(np.mean((of[a] - of[b]) ** 2))) for a, b in system.errors]
    return [f"{1e6 * figure:#.4g}" for figure in (*reported, *overall)]


@pytest.mark.slow
@pytest.mark.parametrize("system", ["predictor"], indirect=True)
def test_the_loop_without_an_importer_is_cosimulate(folder: Path, system: ClosedSystem, expected: Array) -> None:
    run = cosimulate(folder / "HybridPredictor.fmu", folder / "FeedDrive.fmu", staircase())
    assert_bit_for_bit(run, system, expected)
    summary = run.summary()
    assert figures(system, expected)[2:] == [f"{summary[name]:#.4g}" for name in ("rms_pb_um", "rms_h_um")]
    assert summary["reduction_percent"] > 50


@pytest.mark.slow
@pytest.mark.parametrize("system", ["compensator"], indirect=True)
def test_the_compensated_loop_without_an_importer_is_the_same(
    folder: Path, system: ClosedSystem, expected: Array
) -> None:
    run = cosimulate(folder / "SepCompensator.fmu", folder / "FeedDrive.fmu", staircase())
    assert_bit_for_bit(run, system, expected)
    summary = run.summary()
    assert figures(system, expected)[2:] == [f"{summary['tracking_rms_um']:#.4g}"]
    assert summary["tracking_rms_um"] < 5.5
    assert summary["share_hybrid"] > 0.9


def assert_bit_for_bit(run: Run, system: ClosedSystem, rows: Array) -> None:
    of = columns(system, rows)
    assert len(run.t) == len(staircase())
    for name in (*system.positions, "x", "x_meas"):
        np.testing.assert_array_equal(of[name], getattr(run, name), err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize("importer", FOREIGN)
def test_importers_come_to_the_same_figures(system: ClosedSystem, expected: Array, apart: Apart, importer: str) -> None:
    rows = apart(importer)[system.key]
    difference = f"at most {abs(rows - expected).max():.1e} m apart from fmpy"
    print(importer, system.look_ahead, *figures(system, rows), "µm;", difference)
    # The first measurement, from which a compensator with averaging judges the sensor, is another.
    judged = importer in UNCARRIED and system.look_ahead == "compensator"
    if not judged:  # else nanometres may change the last digit
        assert figures(system, rows) == figures(system, expected)
    np.testing.assert_allclose(rows, expected, rtol=0, atol=1e-8 if judged else TOLERANCE)


@pytest.mark.slow
@pytest.mark.parametrize("system", ["predictor"], indirect=True)
@pytest.mark.parametrize("importer", [param for param in FOREIGN if param.values[0] in READ_FMI3])
def test_fmi_3_fmus_come_to_the_same_figures(
    system: ClosedSystem, expected: Array, apart: Apart, importer: str
) -> None:
    """In the importers that read FMI 3.0; fmucontainer is an FMI 2.0 FMU around them."""
    rows = apart(importer)["predictor Fmi3"]
    assert figures(system, rows) == figures(system, expected)
    np.testing.assert_allclose(rows, expected, rtol=0, atol=TOLERANCE)


@pytest.mark.slow
@pytest.mark.parametrize("importer", [param for param in FOREIGN if param.values[0] not in UNCARRIED])
def test_the_start_goes_round_in_initialization_mode(
    system: ClosedSystem, expected: Array, apart: Apart, importer: str
) -> None:
    """``r`` is right before the first step and reaches look-ahead and drive."""
    rows = apart(importer)[f"{system.key}{MOVED}"][: N_MOVED - 2].copy()  # up to where one command ends
    rows[:, : system.n_positions] -= SHIFT
    assert np.ptp(rows[:, 0]) > 1e-3
    np.testing.assert_allclose(rows, expected[: N_MOVED - 2], rtol=0, atol=1e-11)


@pytest.mark.slow
@pytest.mark.skipif(not exists_here("ecos"), reason="ecos has no library for this machine")
def test_the_script_of_the_guide(folder: Path, system: ClosedSystem, expected: Array) -> None:
    (script,) = closed_system.blocks("python")
    if system.look_ahead == "compensator":  # what the guide says to change
        for old, new in (("6100", "6200"), ("predictor", "compensator"), ("rms_pb", "rms_e")):
            assert old in script
            script = script.replace(old, new)
    folder = closed_system.system_structure(system, folder).parent
    printed = python(folder, "-c", f"import importers_closed_system as c; c.load_tbb()\n{script}")
    assert [f"{1e6 * float(number):#.4g}" for number in printed.split()] == figures(system, expected)[:2]


@pytest.mark.slow
@pytest.mark.skipif(not all(map(exists_here, closed_system.IMPORTERS)), reason="not all importers run here")
def test_the_figures_of_the_guide(system: ClosedSystem, expected: Array) -> None:
    guide, row = closed_system.GUIDE.read_text("utf-8"), " | ".join(figures(system, expected))
    others = system.look_ahead == "compensator"  # simulate_ssp, by its last digit
    assert guide.count(f"| {row} |") >= len(closed_system.IMPORTERS) - others
    if system.look_ahead == "predictor":  # its drive follows x_d itself
        of = columns(system, expected)
        assert f"(without compensation: {1e6 * np.sqrt(np.mean((of['x_d'] - of['x']) ** 2)):.1f})" in guide
