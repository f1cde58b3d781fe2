"""The compensator as a pythonfmu FMU: interface, reference result, weights of other settings, packed modules."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from library_models import trained_predictor
from reference_models import library_models

from hybridsep.base.errors import FmuError, StateError
from hybridsep.base.signals import Array
from hybridsep.compensate.compensator import SepState
from hybridsep.cosim.fmu import FmuInstance
from hybridsep.fmi.archive import build_fmu
from hybridsep.fmi.c_header import c_header
from hybridsep.fmi.extras import RELATED_FOLDER
from hybridsep.fmi.reference import reference_files
from hybridsep.fmi.spec import FmuSpec
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


def test_the_interface_is_the_contract(compensator: FmuInstance) -> None:
    expected = [
        ("x_d_ahead", "input", "Real", "m", "0.0"),
        ("x_meas", "input", "Real", "m", "0.0"),
        *((name, "output", "Real", "m", None) for name in ("x_dm", "x_d", "x_pb", "x_h", "x_h_std", "e_servo")),
        ("sep_state", "output", "Enumeration", None, None),
        *((name, "output", "Real", "m", None) for name in ("rms_e", "rms_pb", "rms_h", "rms_hold")),
        *((name, "output", "Integer", None, None) for name in ("batch", "n_rejected")),
        ("no_measurement", "output", "Boolean", None, None),
        ("Np", "parameter", "Integer", None, "50"),
        ("p", "parameter", "Integer", None, "50"),
        ("q", "parameter", "Integer", None, "3"),
        ("lambda", "parameter", "Real", "m2", "1e-12"),
        ("T_s", "parameter", "Real", "s", "0.001"),
        ("t_init", "parameter", "Real", "s", "-1.0"),
        ("input_hold", "parameter", "Enumeration", None, "0"),
        ("measurement_delay", "parameter", "Integer", None, "0"),
        ("dead_time", "parameter", "Integer", None, "0"),
        ("trust", "parameter", "Boolean", None, "true"),
        ("effect", "parameter", "Real", "m", "0.0"),
        ("noise_std", "parameter", "Real", "m", "0.0"),
        ("forgetting", "parameter", "Real", "s", "0.0"),
        ("period", "parameter", "Real", "m", "0.0"),
        ("preview", "parameter", "Integer", None, "200"),
        ("spacing", "parameter", "Integer", None, "2"),
        ("jerk_weight", "parameter", "Real", None, "1.0"),
        ("v_max", "parameter", "Real", "m/s", "0.1"),
        ("a_max", "parameter", "Real", "m/s2", "16.0"),
        ("j_max", "parameter", "Real", "m/s3", "5000.0"),
        ("change_max", "parameter", "Real", "m", "0.001"),
        ("no_reversal", "parameter", "Boolean", None, "true"),
        ("compensate", "parameter", "Enumeration", None, "2"),
        ("measurement_timeout", "parameter", "Real", "s", "1.0"),
    ]
    variables = list(compensator.variables.values())
    found = [(v.name, v.causality, v.type, v.unit, v.start) for v in variables]
    assert found[: len(expected)] == expected
    assert [row[0] for row in found[len(expected) :]] == [f"mode[1].{key}" for key in ("f_n", "zeta", "alpha", "beta")]
    units = {unit.name: unit.baseUnit for unit in compensator.description.unitDefinitions}
    assert (units["m/s2"].m, units["m/s2"].s, units["m/s3"].m, units["m/s3"].s) == (1, -2, 1, -3)
    assert [unknown.variable.name for unknown in compensator.description.outputs] == list(OUTPUTS)
    assert all(unknown.dependencies == [] for unknown in compensator.description.outputs)
    initial = {u.variable.name: [v.name for v in u.dependencies] for u in compensator.description.initialUnknowns}
    assert initial["sep_state"] == ["t_init", "compensate", "trust"]
    assert initial["x_dm"] == ["x_d_ahead"]
    assert initial["x_h"] == ["x_d_ahead", "t_init", "compensate", "trust"]
    assert initial["x_h_std"] == [*initial["x_h"], "lambda", "noise_std"]
    assert initial["rms_e"] == initial["batch"] == []


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


@pytest.mark.slow
def test_the_reference_result_is_what_the_fmu_gives(compensator: FmuInstance) -> None:
    spec = FmuSpec.of(MACHINE, "SepCompensator", flavour="python")
    files = reference_files(spec, *library_models(spec))

    def table(kind: str) -> tuple[list[str], Array]:
        head, *rows = files[f"{RELATED_FOLDER}/SepCompensatorPy_{kind}.csv"].decode().splitlines()
        return head.replace('"', "").split(","), np.array([row.split(",") for row in rows], dtype=float)

    (names, inputs), (results, expected) = table("in"), table("ref")
    assert names == ["time", "x_d_ahead", "x_meas"]
    assert results == ["time", *OUTPUTS]
    compensator.initialise()
    found = []
    for t, x_d_ahead, x_meas in inputs.tolist():
        found.append(outputs(compensator))
        compensator.set("x_d_ahead", x_d_ahead)
        compensator.set("x_meas", x_meas)
        compensator.step(t, TS)
    np.testing.assert_allclose(found, expected[:, 1:], rtol=0, atol=6e-12)  # 11 decimals are written
    assert set(expected[:, results.index("sep_state")]) == {1.0, 2.0}


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


@pytest.mark.slow
def test_weights_of_other_settings_are_refused(trained: Path, tmp_path: Path) -> None:
    predictor = MACHINE.new_predictor()
    predictor.predict(np.linspace(0, 1e-3, 50))
    predictor.update(np.linspace(0, 1e-3, 50))
    predictor.save(tmp_path / "other.state")

    def refused(name: str, weights: Path) -> str:
        with pytest.raises((StateError, FmuError)) as caught:
            build_fmu(MACHINE, name, tmp_path, "python", weights=weights)
        return str(caught.value)

    differing = "Np = 100 instead of 50"
    assert refused("SepCompensatorPy", tmp_path / "other.state").startswith(
        f"other.state was not trained for machine spring_mass_damper's compensator: it has {differing}; "
    )
    assert refused("HybridPredictorPy", trained).startswith(
        "closed_loop.state was not trained for machine spring_mass_damper: it has Np = 50 instead of 100; "
    )
    assert refused("FeedDrivePy", trained) == (
        "weights are for a HybridPredictor or a SepCompensator, FeedDrivePy is a FeedDrive"
    )
    MACHINE.new_compensator().predictor.save(tmp_path / "empty.state")
    assert refused("SepCompensatorPy", tmp_path / "empty.state").startswith("empty.state has learned no sample")


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
