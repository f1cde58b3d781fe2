"""The compensator as a pythonfmu FMU: interface, reference result, weights of other settings, packed modules."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest
from library_models import trained_predictor

from hybridsep.compensate.compensator import SepState
from hybridsep.cosim.fmu import FmuInstance
from hybridsep.fmi.c_header import c_header
from hybridsep.fmi.variables import FmuTable
from hybridsep.machines.machine import load_machine

MACHINE = load_machine("spring_mass_damper")
TS = 1e-3
OUTPUTS = (
    *("x_dm", "x_d", "x_pb", "x_h", "x_h_std", "e_servo", "sep_state"),
    *("rms_e", "rms_pb", "rms_h", "rms_hold", "batch", "n_rejected", "no_measurement"),
)

Build = Callable[[str], Path]


@pytest.fixture
def compensator(python_fmu: Build) -> Iterator[FmuInstance]:
    with FmuInstance(python_fmu("SepCompensatorPy")) as instance:
        yield instance


def outputs(instance: FmuInstance) -> list[float]:
    return [float(instance.get(name)) for name in OUTPUTS]


# Interface ---------------------------------------------------------------------------------------------------------


def test_both_flavours_have_the_table_and_the_page_shows_the_wiring(python_fmu: Build) -> None:
    with zipfile.ZipFile(python_fmu("SepCompensatorPy")) as archive:
        description = json.loads(archive.read("resources/machine.json"))
        page = archive.read("documentation/index.html").decode()
    header = c_header(FmuTable.from_json(description), "{0}")
    for line in ("HSEP_MODEL_SEP_COMPENSATOR 1", "HSEP_VR_x_dm = 2,", "HSEP_VR_preview = 30,", "HSEP_VR_mode = 40"):
        assert line in header
    assert "SepCompensator</text>" in page
    assert "x_dm → x_d" in page
    assert "FeedDrive.x_d = SepCompensator.x_dm" in page
    assert "HybridPredictor.x_d" not in page


def test_parameters_may_be_set_one_after_the_other(compensator: FmuInstance) -> None:
    compensator.slave.setupExperiment()
    compensator.slave.enterInitializationMode()
    compensator.set("x_d_ahead", 0.1)
    compensator.set("Np", 75)  # which spacing = 2 does not divide
    assert outputs(compensator) == [0.1] * 4 + [0.0] * 10
    compensator.set("spacing", 3)
    assert outputs(compensator)[6] == SepState.PHYSICS
    compensator.slave.exitInitializationMode()
    compensator.step(0.0, TS)


# Warm start --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The predictor of a compensator that has run over one staircase."""
    path = tmp_path_factory.mktemp("trained") / "closed_loop.state"
    trained_predictor("SepCompensator").save(path)
    return path


# What travels ------------------------------------------------------------------------------------------------------


def travelling(path: Path) -> dict[str, str]:
    """Return the library's modules in an archive, by their names in the package."""
    with zipfile.ZipFile(path) as archive:
        found = [(name, re.match(r"resources/hybridsep_\w+/(.+)", name)) for name in archive.namelist()]
        return {match[1]: archive.read(name).decode() for name, match in found if match}


@pytest.mark.slow
def test_each_fmu_carries_what_it_needs(python_fmu: Build, tmp_path: Path) -> None:
    mine = travelling(python_fmu("SepCompensatorPy"))
    assert {"compensate/compensator.py", "online/look_ahead.py", "base/settings.py", "fmi/slave.py"} < set(mine)
    assert {"predict/predictor.py", "compensate/qp.py", "compensate/__init__.py"} < set(mine)
    assert not {"machines/machine.py", "plants/plant.py", "plants/trajectory.py", "fmi/archive.py"} & set(mine)
    for name in ("HybridPredictorPy", "FeedDrivePy"):
        theirs = travelling(python_fmu(name))
        assert not any(module.startswith("compensate/") for module in theirs)
        assert "online/look_ahead.py" in theirs or name == "FeedDrivePy"
    for name in ("SepCompensatorPy", "HybridPredictorPy", "FeedDrivePy"):
        needs_nothing_else(python_fmu(name), tmp_path / name)


def needs_nothing_else(path: Path, folder: Path) -> None:
    """Import an FMU's slave where NumPy and SciPy are all there is of what the library needs."""
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    absent: Sequence[str] = ("hybridsep", "ruckig", "matplotlib", "fmpy", "control", "typer", "rich")
    script = f"""
import importlib, sys
sys.modules.update(dict.fromkeys({absent!r}))
sys.path.insert(0, ".")
slave = importlib.import_module(open("slavemodule.txt").read())
assert any(name.endswith("Py") for name in dir(slave))
"""
    subprocess.run([sys.executable, "-c", script], check=True, cwd=folder / "resources")
