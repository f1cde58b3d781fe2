"""The pythonfmu FMUs through fmpy: interface, timing, states."""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import oracle
import pytest
from fmpy.validation import validate_fmu
from fmu_driving import TS, delayed, drive
from places import SUPPORT
from staircase_data import C, K, M, commanded, measured

from hybridsep import FmuInstance, backtest, build_fmu, fmu_names, load_machine, machine_names

Fmu = Callable[[str], Path]

NAMES = [
    "HybridPredictorPy",
    "SepCompensatorPy",
    "FeedDrivePy",
    "HybridPredictorPy_als25010_x",
    "SepCompensatorPy_als25010_x",
    "FeedDrivePy_als25010_x",
    "HybridPredictorPy_als25010_y",
    "SepCompensatorPy_als25010_y",
    "FeedDrivePy_als25010_y",
    "HybridPredictorPy_emps",
]


@pytest.fixture
def predictor(python_fmu: Fmu) -> Iterator[FmuInstance]:
    with FmuInstance(python_fmu("HybridPredictorPy")) as instance:
        yield instance


def test_all_fmus_are_there() -> None:
    assert sorted(name for m in machine_names() for name in fmu_names(load_machine(m), "python")) == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_fmpy_finds_nothing_to_object_to(python_fmu: Fmu, name: str) -> None:
    assert validate_fmu(str(python_fmu(name))) == []


@pytest.mark.parametrize("name", ["HybridPredictorPy", "SepCompensatorPy", "FeedDrivePy_als25010_x"])
def test_same_machine_same_bytes(python_fmu: Fmu, name: str, tmp_path: Path) -> None:
    machine = load_machine("spring_mass_damper" if "als" not in name else "als25010_x")
    again = build_fmu(machine, name, tmp_path, "python")
    assert again.read_bytes() == python_fmu(name).read_bytes()


def test_other_parameters_other_guid(python_fmu: Fmu, tmp_path: Path) -> None:
    machine = load_machine("spring_mass_damper")
    other = machine.model_copy(update={"predictor": machine.predictor.model_copy(update={"p": 40})})
    build_fmu(other, "HybridPredictorPy", tmp_path, "python")
    guids = []
    for path in (tmp_path / "HybridPredictorPy.fmu", python_fmu("HybridPredictorPy")):
        with FmuInstance(path) as instance:
            guids.append(instance.description.guid)
    assert guids[0] != guids[1]


def test_interface_of_the_predictor(predictor: FmuInstance) -> None:
    variables = predictor.variables
    expected = {
        "x_d_ahead": ("input", "Real", "m"),
        "x_meas": ("input", "Real", "m"),
        "x_d": ("output", "Real", "m"),
        "x_pb": ("output", "Real", "m"),
        "x_h": ("output", "Real", "m"),
        "e_servo": ("output", "Real", "m"),
        "hybrid_active": ("output", "Boolean", None),
        "rms_pb": ("output", "Real", "m"),
        "rms_h": ("output", "Real", "m"),
        "batch": ("output", "Integer", None),
        "x_d_window[1]": ("local", "Real", "m"),
        "x_pb_window[100]": ("local", "Real", "m"),
        "x_h_window[100]": ("local", "Real", "m"),
        "Np": ("parameter", "Integer", None),
        "p": ("parameter", "Integer", None),
        "q": ("parameter", "Integer", None),
        "lambda": ("parameter", "Real", "m2"),
        "T_s": ("parameter", "Real", "s"),
        "t_init": ("parameter", "Real", "s"),
        "input_hold": ("parameter", "Enumeration", None),
        "dead_time": ("parameter", "Integer", None),
        "mode[1].f_n": ("parameter", "Real", "Hz"),
        "mode[1].zeta": ("parameter", "Real", None),
        "mode[1].alpha": ("parameter", "Real", "1/s2"),
        "mode[1].beta": ("parameter", "Real", "1/s"),
    }
    found = {name: (v.causality, v.type, v.unit) for name, v in variables.items()}
    assert {name: found[name] for name in expected} == expected
    assert len(found) == 22 + 300
    starts = {name: variables[name].start for name in ("Np", "p", "q", "lambda", "T_s", "t_init", "input_hold")}
    assert starts == {
        "Np": "100",
        "p": "50",
        "q": "3",
        "lambda": "1e-12",
        "T_s": "0.001",
        "t_init": "0.3",
        "input_hold": "0",
    }
    assert predictor.description.defaultExperiment.stepSize == "0.001"
    assert variables["x_h"].displayUnit is not None
    # No output depends on an input of the same instant: no algebraic loop.
    assert all(unknown.dependencies == [] for unknown in predictor.description.outputs)
    assert {unknown.variable.name for unknown in predictor.description.initialUnknowns} == {
        v.name for v in variables.values() if v.causality == "output"
    }


@pytest.mark.parametrize(("name", "parameters"), [
    ("FeedDrivePy", {"m", "c", "k", "c_nl", "k_nl", "noise_std", "seed"}),
    ("FeedDrivePy_als25010_y", {"f", "kappa", "T_s", "noise_std", "seed"}
     | {f"mode[{i}].{key}" for i in (1, 2, 3, 4) for key in ("f_n", "zeta", "alpha", "beta")}),
])  # fmt: skip
def test_interface_of_the_plants(python_fmu: Fmu, name: str, parameters: set[str]) -> None:
    with FmuInstance(python_fmu(name)) as instance:
        by_causality: dict[str, set[str]] = {}
        for variable in instance.variables.values():
            by_causality.setdefault(variable.causality, set()).add(variable.name)
        assert by_causality == {"input": {"x_d"}, "output": {"x", "v", "x_meas"}, "parameter": parameters}


@pytest.mark.parametrize("shift", [0.0, 0.1])
def test_staircase_equals_library_and_oracle(predictor: FmuInstance, shift: float) -> None:
    r, x = delayed(shift)
    predictor.initialise({"x_d_ahead": float(r[0]), "x_meas": float(x[0])})
    outputs = drive(predictor, r, x, 0, len(r))
    x_h = outputs[99:-1, 2]
    library = backtest(load_machine("spring_mass_damper").new_predictor(), commanded() + shift, measured(0) + shift)
    assert np.max(np.abs(x_h - library.x_h)) < 1e-12
    truth = oracle.run(
        np.array([C / M, K / M]),
        np.array([1.0, C / M, K / M]),
        commanded() + shift,
        measured(0) + shift,
        T_s=TS,
        Np=100,
        p=50,
        q=3,
        lam=1e-12,
        t_init=0.3,
    )
    assert np.max(np.abs(x_h - np.array(truth.x_h))) < 1e-12
    if shift:
        unshifted = backtest(load_machine("spring_mass_damper").new_predictor(), commanded(), measured(0))
        assert np.max(np.abs(x_h - shift - unshifted.x_h)) < 1e-10


def test_outputs_right_after_initialization(predictor: FmuInstance, python_fmu: Fmu) -> None:
    predictor.initialise({"x_d_ahead": 0.25})
    assert [predictor.get(name) for name in ("x_d", "x_pb", "x_h", "e_servo", "rms_pb", "rms_h")] == [0.25] * 3 + [
        0.0
    ] * 3
    assert (predictor.get("batch"), predictor.get("hybrid_active")) == (0, False)
    with FmuInstance(python_fmu("FeedDrivePy")) as plant:
        plant.initialise({"x_d": 0.25, "noise_std": 0.0})
        assert [plant.get(name) for name in ("x", "v", "x_meas")] == [0.25, 0.0, 0.25]


def test_windows_show_the_batch(predictor: FmuInstance) -> None:
    predictor.initialise({"Np": 40, "p": 10})
    r, x = delayed()
    drive(predictor, r, x, 0, 120)
    assert (predictor.get("batch"), predictor.get("Np")) == (3, 40)
    assert [predictor.get(f"x_d_window[{i}]") for i in (1, 40)] == [r[80], r[119]]
    assert predictor.get("x_h_window[1]") == predictor.get("x_h")
    # Entries past a smaller Np than built are 0.
    assert [predictor.get(f"x_d_window[{i}]") for i in (41, 100)] == [0.0, 0.0]


def test_a_larger_window_than_built_shows_its_beginning(predictor: FmuInstance) -> None:
    predictor.initialise({"Np": 150})
    r, x = delayed()
    drive(predictor, r, x, 0, 150)
    assert [predictor.get(f"x_d_window[{i}]") for i in (1, 100)] == [r[0], r[99]]
    assert "x_d_window[101]" not in predictor.variables


def test_start_time_other_than_zero(python_fmu: Fmu) -> None:
    r, x = delayed(n=700)
    runs = []
    for start_time in (0.0, 1234.5):
        with FmuInstance(python_fmu("HybridPredictorPy")) as instance:
            instance.initialise(start_time=start_time)
            runs.append(drive(instance, r, x, 0, len(r), start_time))
    np.testing.assert_array_equal(runs[0], runs[1])


@pytest.mark.parametrize("cut", [57, 1234, 1300])
def test_roll_back_in_mid_run(predictor: FmuInstance, python_fmu: Fmu, cut: int) -> None:
    r, x = delayed(n=1800)
    predictor.initialise()
    drive(predictor, r, x, 0, cut)
    blob = predictor.save()
    first = drive(predictor, r, x, cut, len(r))
    predictor.restore(blob)
    np.testing.assert_array_equal(drive(predictor, r, x, cut, len(r)), first)
    with FmuInstance(python_fmu("HybridPredictorPy")) as other:
        other.restore(blob)  # not even initialised
        np.testing.assert_array_equal(drive(other, r, x, cut, len(r)), first)


def test_state_goes_into_another_process(predictor: FmuInstance, python_fmu: Fmu, tmp_path: Path) -> None:
    r, x = delayed(n=900)
    predictor.initialise()
    drive(predictor, r, x, 0, 650)
    (tmp_path / "state").write_bytes(predictor.save())
    np.save(tmp_path / "signals.npy", np.array([r, x]))
    script = f"""
import sys; sys.path.insert(0, {str(SUPPORT)!r})
import numpy as np
from hybridsep import FmuInstance
from fmu_driving import drive
r, x = np.load({str(tmp_path / "signals.npy")!r})
with FmuInstance({str(python_fmu("HybridPredictorPy"))!r}) as instance:
    instance.restore(open({str(tmp_path / "state")!r}, "rb").read())
    np.save({str(tmp_path / "outputs.npy")!r}, drive(instance, r, x, 650, 900))
"""
    subprocess.run([sys.executable, "-c", script], check=True)
    np.testing.assert_array_equal(np.load(tmp_path / "outputs.npy"), drive(predictor, r, x, 650, 900))


@pytest.mark.parametrize("name", ["FeedDrivePy", "FeedDrivePy_als25010_x"])
def test_plants_roll_back_and_reset(python_fmu: Fmu, name: str) -> None:
    def step(first: int, last: int) -> list[list[float]]:
        rows = []
        for k in range(first, last):
            plant.set("x_d", float(commanded()[k]))
            plant.step(k * TS, TS)
            rows.append(read())
        return rows

    with FmuInstance(python_fmu(name)) as plant:
        read = plant.real_reader(["x", "v", "x_meas"])
        plant.initialise({"seed": 5})
        run = step(0, 200)
        blob = plant.save()
        tail = step(200, 300)
        plant.restore(blob)
        assert step(200, 300) == tail
        plant.reset()
        plant.initialise({"seed": 5})
        assert step(0, 200) == run
        assert len({row[2] - row[0] for row in run}) == 200  # a new draw each communication step


def test_reset_is_a_new_beginning(predictor: FmuInstance) -> None:
    r, x = delayed(n=700)
    runs = []
    for _ in range(3):
        predictor.initialise({"p": 20})
        runs.append(drive(predictor, r, x, 0, len(r)))
        predictor.reset()
        assert predictor.get("p") == 50
    np.testing.assert_array_equal(runs[0], runs[1])
    np.testing.assert_array_equal(runs[0], runs[2])


def test_different_fmus_and_instances_in_one_process(python_fmu: Fmu, tmp_path: Path) -> None:
    machine = load_machine("spring_mass_damper")
    smaller = machine.model_copy(update={"predictor": machine.predictor.model_copy(update={"Np": 60, "p": 20})})
    build_fmu(smaller, "HybridPredictorPy", tmp_path, "python")
    paths = [
        python_fmu("HybridPredictorPy"),
        python_fmu("HybridPredictorPy_als25010_x"),
        tmp_path / "HybridPredictorPy.fmu",
    ]
    r, x = delayed(n=800)

    def alone(path: Path) -> np.ndarray:
        with FmuInstance(path) as instance:
            instance.initialise()
            return drive(instance, r, x, 0, len(r))

    expected = [alone(path) for path in paths + paths[:1]]
    instances = [FmuInstance(path, f"number {i}") for i, path in enumerate(paths + paths[:1])]
    for instance in instances:
        instance.initialise()
    rows: list[list[np.ndarray]] = [[] for _ in instances]
    for k in range(len(r)):
        for instance, row in zip(instances, rows, strict=True):
            row.append(drive(instance, r, x, k, k + 1)[0])
    for instance, row, alone_rows in zip(instances, rows, expected, strict=True):
        np.testing.assert_array_equal(np.array(row), alone_rows)
        instance.close()
    assert not np.array_equal(expected[0], expected[1])


def test_the_library_travels_without_machine_data_or_other_needs(python_fmu: Fmu) -> None:
    with zipfile.ZipFile(python_fmu("HybridPredictorPy")) as archive:
        names = archive.namelist()
        sources = {name: archive.read(name).decode() for name in names if name.endswith(".py")}
        description = json.loads(archive.read("resources/machine.json"))
    assert description["modes"][0]["f_n"] == pytest.approx(25.0, rel=1e-4)
    mine = {name: text for name, text in sources.items() if "pythonfmu/" not in name}
    needed = ("pydantic", "ruckig", "fmpy", "matplotlib", "typer")
    assert len(mine) > 10
    for name, text in mine.items():
        assert not any(f"import {module}" in text or f"from {module}" in text for module in needed), name
