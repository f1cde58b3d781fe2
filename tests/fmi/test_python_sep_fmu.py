"""The compensator as a pythonfmu FMU through fmpy: the numbers of the library's look-ahead, and what it refuses."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridsep.base.errors import FmuError, StateError
from hybridsep.base.settings import CompensatorSettings, PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.compensate.compensator import SepCompensator, SepState
from hybridsep.cosim.importer import FmuInstance
from hybridsep.cosim.loop import cosimulate
from hybridsep.fmi.archive import build_fmu
from hybridsep.fmi.c_header import c_header
from hybridsep.fmi.reference import reference_files
from hybridsep.fmi.weights import weights_file
from hybridsep.machine import load_machine
from hybridsep.plants.encoder import Encoder
from hybridsep.plants.trajectory import staircase
from hybridsep.predict.look_ahead import LookAhead
from hybridsep.predict.predictor import HybridPredictor

MACHINE = load_machine("spring_mass_damper")
TS = 1e-3
N = 1800
REALS = ("x_dm", "x_d", "x_pb", "x_h", "e_servo", "rms_e", "rms_pb", "rms_h")
OUTPUTS = ("x_dm", "x_d", "x_pb", "x_h", "e_servo", "sep_state", "rms_e", "rms_pb", "rms_h", "batch")

Fmu = Callable[[str], Path]


def closed_loop(look_ahead: LookAhead, n: int) -> tuple[Array, Array, Array]:
    """Return ``r(k)``, ``x_meas(k)`` and the outputs at ``t_k``, ``(n, 10)``, of the library and the plant alone."""
    plant, encoder = MACHINE.new_plant(), Encoder(5e-6, 0)
    plant.reset(0.0)
    r, measured, rows = staircase()[:n], [], []
    for k in range(n):
        rows.append([float(getattr(look_ahead, name)) for name in OUTPUTS])
        measured.append(encoder.measure(plant.x))
        plant.step(look_ahead.x_dm, TS)
        look_ahead.sample(float(r[k]), measured[k])
    return r, np.array(measured), np.array(rows)


@pytest.fixture(scope="module")
def run() -> tuple[Array, Array, Array]:
    return closed_loop(LookAhead(MACHINE.new_compensator(), 0.0), N)


@pytest.fixture
def compensator(python_fmu: Fmu) -> Iterator[FmuInstance]:
    with FmuInstance(python_fmu("SepCompensatorPy")) as instance:
        yield instance


def replay(instance: FmuInstance, r: Array, x: Array, first: int, last: int, start_time: float = 0.0) -> Array:
    """Step samples ``first … last − 1``; return the outputs at ``t_k`` before each, ``(n, 10)``."""
    write = instance.real_writer(["x_d_ahead", "x_meas"])
    rows = []
    for k in range(first, last):
        rows.append(outputs(instance))
        write([float(r[k]), float(x[k])])
        instance.step(start_time + k * TS, TS)
    return np.array(rows)


def outputs(instance: FmuInstance) -> list[float]:
    return [float(instance.get(name)) for name in OUTPUTS]


# Interface ---------------------------------------------------------------------------------------------------------


def test_the_interface_is_the_contract(compensator: FmuInstance) -> None:
    expected = [
        ("x_d_ahead", "input", "Real", "m", "0.0"),
        ("x_meas", "input", "Real", "m", "0.0"),
        *((name, "output", "Real", "m", None) for name in ("x_dm", "x_d", "x_pb", "x_h", "e_servo")),
        ("sep_state", "output", "Integer", None, None),
        *((name, "output", "Real", "m", None) for name in ("rms_e", "rms_pb", "rms_h")),
        ("batch", "output", "Integer", None, None),
        ("Np", "parameter", "Integer", None, "50"),
        ("p", "parameter", "Integer", None, "50"),
        ("q", "parameter", "Integer", None, "40"),
        ("lambda", "parameter", "Real", "m2", "1e-08"),
        ("T_s", "parameter", "Real", "s", "0.001"),
        ("t_init", "parameter", "Real", "s", "0.1"),
        ("input_hold", "parameter", "Integer", None, "0"),
        ("dead_time", "parameter", "Integer", None, "0"),
        ("preview", "parameter", "Integer", None, "200"),
        ("spacing", "parameter", "Integer", None, "2"),
        ("jerk_weight", "parameter", "Real", None, "1.0"),
        ("v_max", "parameter", "Real", "m/s", "0.1"),
        ("a_max", "parameter", "Real", "m/s2", "16.0"),
        ("j_max", "parameter", "Real", "m/s3", "5000.0"),
        ("change_max", "parameter", "Real", "m", "0.001"),
        ("v_friction", "parameter", "Real", "m/s", "0.002"),
        ("no_reversal", "parameter", "Integer", None, "1"),
        ("compensate", "parameter", "Integer", None, "2"),
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
    assert initial["sep_state"] == ["t_init", "compensate"]
    assert initial["x_dm"] == ["x_d_ahead"]
    assert initial["x_h"] == ["x_d_ahead", "t_init", "compensate"]
    assert initial["rms_e"] == initial["batch"] == []


def test_both_flavours_have_the_table_and_the_page_shows_the_wiring(python_fmu: Fmu) -> None:
    with zipfile.ZipFile(python_fmu("SepCompensatorPy")) as archive:
        description = json.loads(archive.read("resources/machine.json"))
        page = archive.read("documentation/index.html").decode()
    header = c_header(description, "{0}")
    for line in ("HSEP_MODEL_SEP_COMPENSATOR 1", "HSEP_VR_x_dm = 2,", "HSEP_VR_preview = 20,", "HSEP_VR_mode = 30"):
        assert line in header
    assert "SepCompensator</text>" in page
    assert "x_dm → x_d" in page
    assert "FeedDrive.x_d = SepCompensator.x_dm" in page
    assert "HybridPredictor.x_d" not in page


# The same numbers as the library -----------------------------------------------------------------------------------


def test_a_closed_loop_is_the_librarys_bit_for_bit(
    compensator: FmuInstance, python_fmu: Fmu, run: tuple[Array, Array, Array]
) -> None:
    r, x, expected = run
    compensator.initialise()
    with FmuInstance(python_fmu("FeedDrivePy")) as drive:
        drive.initialise()
        for k in range(N):
            assert outputs(compensator) == expected[k].tolist(), k
            x_meas = drive.get("x_meas")
            assert x_meas == x[k]
            drive.set("x_d", compensator.get("x_dm"))
            compensator.set("x_d_ahead", float(r[k]))
            compensator.set("x_meas", x_meas)
            drive.step(k * TS, TS)
            compensator.step(k * TS, TS)
    states = expected[:, OUTPUTS.index("sep_state")]
    assert (states[:300] == SepState.PHYSICS).all()
    assert (states[300:] == SepState.HYBRID).all()
    assert 2e-6 < expected[-1, OUTPUTS.index("rms_e")] < 12e-6


def test_another_axis_with_modes_and_other_parameters(python_fmu: Fmu) -> None:
    machine = load_machine("als25010_y")
    changes: dict[str, Any] = {"Np": 40, "p": 30, "q": 5, "preview": 190, "spacing": 4, "jerk_weight": 0.5}
    changes |= {"change_max": 3e-4, "no_reversal": 0}
    bounds = {"v_max": 0.0805, "a_max": 8.1, "j_max": 2000.0}
    values = {**machine.fmi_compensator_parameters(), **changes, **bounds, "compensate": 1}
    library = machine.new_compensator(
        CompensatorSettings.from_fmi(values), predictor=PredictorSettings.from_fmi(values)
    )
    look_ahead = LookAhead(library, 0.1)
    r = staircase()[:700] + 0.1
    x = np.concatenate((np.full(200, 0.1), r[:500])) + 1e-6 * np.sin(np.arange(700))
    with FmuInstance(python_fmu("SepCompensatorPy_als25010_y")) as instance:
        instance.initialise({**changes, **bounds, "compensate": 1, "x_d_ahead": 0.1}, start_time=12.5)
        found = replay(instance, r, x, 0, len(r), 12.5)
    for k in range(len(r)):
        assert found[k].tolist() == [float(getattr(look_ahead, name)) for name in OUTPUTS], k
        look_ahead.sample(float(r[k]), float(x[k]))
    assert set(found[:, OUTPUTS.index("sep_state")]) == {1.0}
    x_dm, x_d = found[:, 0], found[:, 1]
    for signal, limit in ((np.diff(x_dm) / TS, 0.0805), (np.diff(x_dm, 3) / TS**3, 2000.0), (x_dm - x_d, 3e-4)):
        assert 0.999 * limit < np.max(np.abs(signal)) <= limit * (1 + 1e-6)


def test_the_reference_result_is_what_the_fmu_gives(compensator: FmuInstance) -> None:
    with zipfile.ZipFile(compensator.path) as archive:
        description = json.loads(archive.read("resources/machine.json"))
    files = reference_files(MACHINE, description)

    def table(kind: str) -> tuple[list[str], Array]:
        head, *rows = files[f"documentation/reference/SepCompensatorPy_{kind}.csv"].decode().splitlines()
        return head.replace('"', "").split(","), np.array([row.split(",") for row in rows], dtype=float)

    (names, inputs), (results, expected) = table("in"), table("ref")
    assert names == ["time", "x_d_ahead", "x_meas"]
    assert results == ["time", *OUTPUTS]
    compensator.initialise()
    found = replay(compensator, inputs[:, 1], inputs[:, 2], 0, len(inputs))
    np.testing.assert_allclose(found, expected[:, 1:], rtol=0, atol=1e-13)
    assert set(expected[:, results.index("sep_state")]) == {1.0, 2.0}


@pytest.mark.parametrize(("compensate", "state"), [(0, 0), (1, 1), (2, 1)])
def test_outputs_at_the_start(compensator: FmuInstance, compensate: int, state: int) -> None:
    expected = [0.25, 0.25, 0.25, 0.25, 0.0, state, 0.0, 0.0, 0.0, 0]
    assert in_initialization(compensator, {"x_d_ahead": 0.25, "compensate": compensate}) == expected
    assert outputs(compensator) == expected


def in_initialization(instance: FmuInstance, values: Mapping[str, Any]) -> list[float]:
    """Initialise; return the outputs just before the initialization ends."""
    instance.slave.setupExperiment()
    instance.slave.enterInitializationMode()
    for name, value in values.items():
        instance.set(name, value)
    found = outputs(instance)
    instance.slave.exitInitializationMode()
    return found


def test_parameters_may_be_set_one_after_the_other(compensator: FmuInstance) -> None:
    compensator.slave.setupExperiment()
    compensator.slave.enterInitializationMode()
    compensator.set("x_d_ahead", 0.1)
    compensator.set("Np", 75)  # which spacing = 2 does not divide
    assert outputs(compensator) == [0.1, 0.1, 0.1, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    compensator.set("spacing", 3)
    assert outputs(compensator)[5] == SepState.PHYSICS
    compensator.slave.exitInitializationMode()
    compensator.step(0.0, TS)


# States and sub-steps ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cut", [57, 312, 1234])
def test_a_saved_state_goes_on_identically(
    compensator: FmuInstance, python_fmu: Fmu, run: tuple[Array, Array, Array], cut: int
) -> None:
    r, x, expected = run
    last = min(cut + 250, N)
    compensator.initialise()
    replay(compensator, r, x, 0, cut)
    blob = compensator.save()
    np.testing.assert_array_equal(replay(compensator, r, x, cut, last), expected[cut:last])
    compensator.restore(blob)
    assert compensator.save() == blob
    np.testing.assert_array_equal(replay(compensator, r, x, cut, last), expected[cut:last])
    with FmuInstance(python_fmu("SepCompensatorPy")) as other:
        other.restore(blob)  # not even initialised
        np.testing.assert_array_equal(replay(other, r, x, cut, last), expected[cut:last])


def test_a_state_of_another_axis_is_refused(compensator: FmuInstance, python_fmu: Fmu) -> None:
    compensator.initialise()
    with FmuInstance(python_fmu("SepCompensatorPy_als25010_x")) as other:
        other.initialise()
        before = other.save()
        with pytest.raises(FmuError, match="the state belongs to another FMU than SepCompensatorPy_als25010_x"):
            other.restore(compensator.save())
        assert other.save() == before


# What is refused ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"preview": 7}, "preview must be 8 … 2000, got 7"),
        ({"preview": 2001}, "preview must be 8 … 2000, got 2001"),
        ({"preview": 60}, "preview must be ≥ Np + 4·spacing + 3 = 61, got 60"),
        ({"spacing": 0}, "spacing must be 1 … 1000, got 0"),
        ({"spacing": 3}, "spacing must be ≥ 1 and divide Np = 50, got 3"),
        ({"jerk_weight": -1.0}, "jerk_weight must be 0 … 1e+12, got -1.0"),
        ({"jerk_weight": math.nan}, "jerk_weight must be finite, got nan"),
        ({"v_max": 0.0}, "v_max must be 1e-09 … 10000 m/s, got 0.0"),
        ({"a_max": -16.0}, "a_max must be 1e-06 … 1000000 m/s2, got -16.0"),
        ({"j_max": math.inf}, "j_max must be finite, got inf"),
        (
            {"change_max": 0.0, "j_max": 0.0},
            "j_max must be 1e-06 … 1e+12 m/s3, got 0.0; change_max must be 1e-12 … 10 m, got 0.0",
        ),
        ({"v_friction": -1e-3}, "v_friction must be 0 or 1e-09 … 10000 m/s, got -0.001"),
        ({"v_friction": math.nan}, "v_friction must be finite, got nan"),
        ({"no_reversal": 2}, "no_reversal must be 0 … 1, got 2"),
        ({"compensate": 3}, "compensate must be 0 … 2, got 3"),
        ({"compensate": -1}, "compensate must be 0 … 2, got -1"),
        ({"p": 60, "q": 50}, "p must be 1 … Np = 50, got 60; lower p or raise Np; q must be 0 … Np − 1 = 49, got 50"),
        ({"lambda": 0.0}, "lambda must be 1e-40 … 1e+12 m2, got 0.0"),
        ({"mode[1].zeta": 0.0}, "mode[1].zeta must be 1e-06 … 10000, got 0.0"),
        ({"x_d_ahead": math.inf}, "the start value of x_d_ahead must be finite, got inf"),
    ],
)
def test_bad_parameters_are_named(python_fmu: Fmu, values: dict[str, Any], message: str) -> None:
    with FmuInstance(python_fmu("SepCompensatorPy"), "good") as good:
        good.initialise()
        with FmuInstance(python_fmu("SepCompensatorPy"), "bad") as bad:
            for _ in range(2):
                with pytest.raises(FmuError) as error:
                    bad.initialise(values)
                assert message in str(error.value)
        good.step(0.0, TS)


def test_inputs_that_are_no_numbers_change_nothing(compensator: FmuInstance, run: tuple[Array, Array, Array]) -> None:
    r, x, expected = run
    compensator.initialise()
    replay(compensator, r, x, 0, 349)
    for name, value, message in (
        ("x_meas", math.nan, "x_meas must be finite, got nan at sample 349"),
        ("x_d_ahead", -math.inf, "x_d_ahead must be finite, got -inf at sample 349"),
        ("x_meas", 1e30, "x_meas must be within ±"),
    ):
        compensator.set("x_d_ahead", float(r[349]))
        compensator.set("x_meas", float(x[349]))
        compensator.set(name, value)
        with pytest.raises(FmuError, match=re.escape(message)):
            compensator.step(349 * TS, TS)
        assert outputs(compensator) == expected[349].tolist()
    np.testing.assert_array_equal(replay(compensator, r, x, 349, 480), expected[349:480])


def test_calls_that_are_not_allowed_now(compensator: FmuInstance) -> None:
    with pytest.raises(FmuError, match="doStep is not allowed before the initialization has ended"):
        compensator.step(0.0, TS)
    compensator.initialise()
    with pytest.raises(FmuError, match="preview is a fixed parameter and cannot be set after initialization"):
        compensator.set("preview", 300)
    with pytest.raises(FmuError, match="x_dm is an output variable and cannot be set"):
        compensator.set("x_dm", 0.0)


# Warm start --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The predictor of a compensator that has run over one staircase."""
    learned = MACHINE.new_compensator()
    cosimulate(learned, MACHINE.new_plant(), staircase()[:4000], encoder=Encoder(5e-6, 7))
    path = tmp_path_factory.mktemp("trained") / "closed_loop.state"
    learned.predictor.save(path)
    return path


def test_a_warm_run_is_the_librarys_second_run(trained: Path, tmp_path: Path) -> None:
    limits, change_max = MACHINE.command_limits()
    second = SepCompensator(HybridPredictor.load(trained), CompensatorSettings(limits=limits, change_max=change_max))
    r, x, expected = closed_loop(LookAhead(second, 0.0, t_init=0.0), 700)
    path = build_fmu(MACHINE, "SepCompensatorPy", tmp_path, "python", weights=trained)
    with zipfile.ZipFile(path) as archive:
        assert archive.read("resources/weights.bin") == weights_file(HybridPredictor.load(trained))
    with FmuInstance(path) as warm:
        assert warm.get("t_init") == 0.0
        assert in_initialization(warm, {}) == expected[0].tolist()
        np.testing.assert_array_equal(replay(warm, r, x, 0, 700), expected)
    assert (expected[:, OUTPUTS.index("sep_state")] == SepState.HYBRID).all()
    assert expected[0, OUTPUTS.index("x_h")] != 0.0
    for values, state in (({"t_init": 0.1}, SepState.PHYSICS), ({"compensate": 1}, SepState.PHYSICS)):
        with FmuInstance(path) as instance:
            assert in_initialization(instance, values)[5] == outputs(instance)[5] == state
    with (
        FmuInstance(path) as instance,
        pytest.raises(FmuError, match=r"q must be 40, with which weights.bin was learned, got 3"),
    ):
        instance.initialise({"q": 3})
    with (
        FmuInstance(path) as instance,
        pytest.raises(FmuError, match=r"v_friction must be 0.002, with which weights.bin was learned, got 0.0"),
    ):
        instance.initialise({"v_friction": 0.0})


def test_weights_of_other_settings_are_refused(trained: Path, tmp_path: Path) -> None:
    predictor = MACHINE.new_predictor()
    predictor.predict(np.linspace(0, 1e-3, 50))
    predictor.update(np.linspace(0, 1e-3, 50))
    predictor.save(tmp_path / "other.state")

    def refused(name: str, weights: Path) -> str:
        with pytest.raises((StateError, FmuError)) as caught:
            build_fmu(MACHINE, name, tmp_path, "python", weights=weights)
        return str(caught.value)

    differing = "Np = 100 instead of 50, q = 3 instead of 40, lambda = 1e-12 instead of 1e-08"
    differing += ", v_friction = 0.0 instead of 0.002"
    assert refused("SepCompensatorPy", tmp_path / "other.state").startswith(
        f"other.state was not trained for machine spring_mass_damper's compensator: it has {differing}; "
    )
    assert refused("HybridPredictorPy", trained).startswith(
        "closed_loop.state was not trained for machine spring_mass_damper: it has Np = 50 instead of 100, "
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


def test_each_fmu_carries_what_it_needs(python_fmu: Fmu, tmp_path: Path) -> None:
    mine = travelling(python_fmu("SepCompensatorPy"))
    assert {"compensate/compensator.py", "predict/look_ahead.py", "base/limits.py", "fmi/slave.py"} < set(mine)
    assert {"predict/reference_features.py", "compensate/interior.py", "compensate/__init__.py"} < set(mine)
    assert not {"machine.py", "plants/plant.py", "plants/trajectory.py", "fmi/archive.py"} & set(mine)
    for name in ("HybridPredictorPy", "FeedDrivePy"):
        theirs = travelling(python_fmu(name))
        assert not any(module.startswith("compensate/") for module in theirs)
        assert "predict/look_ahead.py" in theirs or name == "FeedDrivePy"
    for name in ("SepCompensatorPy", "HybridPredictorPy", "FeedDrivePy"):
        needs_nothing_else(python_fmu(name), tmp_path / name)


def needs_nothing_else(path: Path, folder: Path) -> None:
    """Import an FMU's slave where NumPy and SciPy are all there is of what the library needs."""
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    absent: Sequence[str] = ("hybridsep", "ruckig", "pydantic", "matplotlib", "fmpy", "control", "typer", "rich")
    script = f"""
import importlib, sys
sys.modules.update(dict.fromkeys({absent!r}))
sys.path.insert(0, ".")
slave = importlib.import_module(open("slavemodule.txt").read())
assert any(name.endswith("Py") for name in dir(slave))
"""
    subprocess.run([sys.executable, "-c", script], check=True, cwd=folder / "resources")
