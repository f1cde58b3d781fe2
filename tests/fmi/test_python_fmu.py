"""The pythonfmu FMUs: interface, archive, and the modules that they share in one process."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from built_once import each_kind
from driving import steps
from fmpy.validation import validate_fmu
from fmu_stream import FmuStream

from hybridsep import FmuInstance, build_fmu, fmu_names, load_machine, machine_names

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


@pytest.mark.slow
@pytest.mark.parametrize("name", each_kind(NAMES))
def test_fmpy_finds_nothing_to_object_to(python_fmu: Fmu, name: str) -> None:
    assert validate_fmu(str(python_fmu(name))) == []


@pytest.mark.parametrize("name", ["HybridPredictorPy", "SepCompensatorPy", "FeedDrivePy_als25010_x"])
def test_same_machine_same_bytes(python_fmu: Fmu, name: str, tmp_path: Path) -> None:
    machine = load_machine("spring_mass_damper" if "als" not in name else "als25010_x")
    again = build_fmu(machine, name, tmp_path, "python")
    assert again.read_bytes() == python_fmu(name).read_bytes()


def test_other_parameters_other_guid(python_fmu: Fmu, tmp_path: Path) -> None:
    machine = load_machine("spring_mass_damper")
    other = machine.changed("predictor", {"p": 40})
    build_fmu(other, "HybridPredictorPy", tmp_path, "python")
    guids = []
    for path in (tmp_path / "HybridPredictorPy.fmu", python_fmu("HybridPredictorPy")):
        with FmuInstance(path) as instance:
            guids.append(instance.description.guid)
    assert guids[0] != guids[1]


@pytest.mark.slow
def test_different_fmus_and_instances_in_one_process(python_fmu: Fmu, tmp_path: Path) -> None:
    machine = load_machine("spring_mass_damper")
    smaller = machine.changed("predictor", {"Np": 60, "p": 20})
    build_fmu(smaller, "HybridPredictorPy", tmp_path, "python")
    paths = [
        python_fmu("HybridPredictorPy"),
        python_fmu("HybridPredictorPy_als25010_x"),
        tmp_path / "HybridPredictorPy.fmu",
    ]

    def initialised(path: Path) -> FmuStream:
        stream = FmuStream(path, "HybridPredictor")
        stream.initialise({})
        return stream

    def alone(path: Path) -> list[list[float]]:
        stream = initialised(path)
        outputs = steps(stream, 0, 800)
        stream.close()
        return outputs

    expected = [alone(path) for path in paths + paths[:1]]
    together = [initialised(path) for path in paths + paths[:1]]
    rows: list[list[list[float]]] = [[] for _ in together]
    for k in range(800):
        for stream, row in zip(together, rows, strict=True):
            row += steps(stream, k, k + 1)
    assert rows == expected
    for stream in together:
        stream.close()
    assert expected[0] != expected[1]


def test_the_library_travels_without_machine_data_or_other_needs(python_fmu: Fmu) -> None:
    with zipfile.ZipFile(python_fmu("HybridPredictorPy")) as archive:
        names = archive.namelist()
        sources = {name: archive.read(name).decode() for name in names if name.endswith(".py")}
        description = json.loads(archive.read("resources/machine.json"))
    assert description["modes"][0]["f_n"] == pytest.approx(25.0, rel=1e-4)
    mine = {name: text for name, text in sources.items() if "pythonfmu/" not in name}
    needed = ("ruckig", "fmpy", "matplotlib", "typer")
    assert len(mine) > 10
    for name, text in mine.items():
        assert not any(f"import {module}" in text or f"from {module}" in text for module in needed), name
