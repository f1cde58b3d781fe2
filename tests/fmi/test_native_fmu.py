"""The native FMUs as an importer sees them: archives, co-simulation with every flavour, states, sources."""

from __future__ import annotations

import re
import shutil
import struct
import sys
import zipfile
from importlib import import_module
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from elf import symbols
from fmpy.build import build_platform_binary
from fmpy.model_description import read_build_description
from fmpy.validation import validate_fmu

from hybridsep.base.errors import FmuError, SignalError
from hybridsep.base.signals import Array
from hybridsep.cosim.compensator_run import cosimulate_sep
from hybridsep.cosim.importer import FmuInstance
from hybridsep.cosim.predictor_run import CoSimulation, cosimulate
from hybridsep.fmi.archive import BACKENDS, build_fmu, fmu_names
from hybridsep.fmi.compiler import ALL_TARGETS, TARGETS, compile_flags, host_target
from hybridsep.fmi.macho import universal
from hybridsep.fmi.variables import Variable, variables_of
from hybridsep.machine import Machine, load_machine, machine_names
from hybridsep.plants.plant import Encoder
from hybridsep.plants.trajectory import spiral, staircase
from hybridsep.predict.lookahead import LookAhead

etree: Any = import_module("lxml.etree")  # comes with fmpy, has no types

MODELS = ("HybridPredictor", "SepCompensator", "FeedDrive")
NATIVE = [*MODELS, "ReferenceTrajectory", *(f"{model}_als25010_{axis}" for axis in "xy" for model in MODELS)]
NATIVE += ["HybridPredictor_emps"]
PYTHON = [name.replace(model, f"{model}Py") for name in NATIVE for model in MODELS if name.startswith(model)]
TOLERANCE = 1e-11  # m

Fmus = dict[str, Path]


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Fmus:
    """All FMUs of all machines in both flavours, built for this machine."""
    out = tmp_path_factory.mktemp("fmus")
    return {
        name: build_fmu(machine, name, out, backend, targets=("host",))
        for machine in map(load_machine, machine_names())
        for backend in BACKENDS
        for name in fmu_names(machine, backend)
    }


def reference(machine: Machine, r: Array) -> dict[str, Array]:
    """Return what the library alone computes in the same wiring, without the first fill."""
    predictor, plant = machine.new_predictor(), machine.new_plant()
    assert machine.plant is not None
    look_ahead, encoder = LookAhead(predictor, float(r[0])), Encoder(machine.plant.noise_std, machine.plant.seed)
    plant.reset(float(r[0]))
    x_meas = encoder.measure(plant.x)
    rows = []
    for k in range(len(r) + predictor.Np):
        rows.append((look_ahead.x_d, look_ahead.x_pb, look_ahead.x_h, plant.x, x_meas))
        x_d = look_ahead.x_d
        look_ahead.sample(float(r[min(k, len(r) - 1)]), x_meas)
        plant.step(x_d, machine.T_s)
        x_meas = encoder.measure(plant.x)
    return dict(zip(("x_d", "x_pb", "x_h", "x", "x_meas"), np.array(rows)[predictor.Np :].T, strict=True))


def assert_equal(run: CoSimulation, expected: dict[str, Array]) -> None:
    for name, samples in expected.items():
        np.testing.assert_allclose(getattr(run, name), samples, rtol=0, atol=TOLERANCE, err_msg=name)


# Archives ----------------------------------------------------------------------------------------------------------


def test_native_is_the_default_and_names_follow_the_machine() -> None:
    assert BACKENDS[0] == "native"
    assert [
        name for machine in map(load_machine, ("spring_mass_damper", "als25010_x")) for name in fmu_names(machine)
    ] == [
        "HybridPredictor",
        "SepCompensator",
        "FeedDrive",
        "ReferenceTrajectory",
        "HybridPredictor_als25010_x",
        "SepCompensator_als25010_x",
        "FeedDrive_als25010_x",
    ]


@pytest.mark.parametrize("name", NATIVE)
def test_checkers_have_no_finding(fmus: Fmus, name: str) -> None:
    assert validate_fmu(str(fmus[name])) == []
    with zipfile.ZipFile(fmus[name]) as archive:
        assert archive.testzip() is None
        description = etree.parse(archive.open("modelDescription.xml"))
    folder = Path(fmpy.__file__).parent / "schema"
    etree.XMLSchema(file=str(folder / "fmi2" / "fmi2ModelDescription.xsd")).assertValid(description)
    simulation = description.getroot().find("CoSimulation")
    assert simulation.get("needsExecutionTool") == "false"
    assert [file.get("name") for file in simulation.find("SourceFiles")] == ["all.c"]
    (configuration,) = read_build_description(str(fmus[name]))
    assert configuration.modelIdentifier == name
    assert configuration.sourceFileSets[0].sourceFiles == ["all.c"]


@pytest.mark.parametrize("name", NATIVE)
def test_the_archive_is_complete(fmus: Fmus, name: str) -> None:
    with zipfile.ZipFile(fmus[name]) as archive:
        files = set(archive.namelist())
        page = archive.read("documentation/index.html").decode()
        picture = archive.read("model.png")
        licence = archive.read("documentation/licenses/license.txt").decode()
        notice = archive.read("documentation/licenses/fmi-headers.txt").decode()
    assert {f"binaries/linux64/{name}.so", "sources/all.c", "sources/hsep_fmu.h"} <= files
    assert not [file for file in files if Path(file).name.startswith("fmi2")]  # FMI 2.0, section 2.3
    assert picture.startswith(b"\x89PNG\r\n\x1a\n")
    assert "BSD 3-Clause" in licence
    assert "Modelica Association" in notice
    assert "Redistribution and use" in notice
    assert "Chou, M. Duan, C. E. Okwudire" in page
    assert "<svg" in page
    etree.fromstring(re.sub(r"<!DOCTYPE html>|<meta [^>]*>|&nbsp;", "", page))  # well-formed
    variables = fmpy.read_model_description(str(fmus[name])).modelVariables
    for variable in variables:
        assert re.sub(r"(_window)\[\d+\]", r"\1[i]", variable.name) in page


def test_only_fmi_functions_are_exported(fmus: Fmus, tmp_path: Path) -> None:
    with zipfile.ZipFile(fmus["HybridPredictor"]) as archive:
        library = archive.extract("binaries/linux64/HybridPredictor.so", tmp_path)
    exported = {symbol.name for symbol in symbols(Path(library), dynamic=True) if symbol.defined and symbol.exported}
    assert len(exported) == 34
    assert all(name.startswith("fmi2") for name in exported)


def test_an_overflow_on_the_stack_is_noticed(fmus: Fmus, tmp_path: Path) -> None:
    with zipfile.ZipFile(fmus["HybridPredictor"]) as archive:
        library = archive.extract("binaries/linux64/HybridPredictor.so", tmp_path)
    assert "__stack_chk_fail" in {symbol.name for symbol in symbols(Path(library), dynamic=True)}


def test_a_compiler_without_a_stack_protector_will_do() -> None:
    refusing = [sys.executable, "-c", "import sys; sys.exit('-fstack-protector-strong' in sys.argv)"]
    assert "-fstack-protector-strong" not in compile_flags(refusing)
    accepting = [sys.executable, "-c", ""]
    assert compile_flags(accepting) == [*compile_flags(refusing), "-fstack-protector-strong"]


@pytest.mark.parametrize("name", [*NATIVE, "HybridPredictorPy"])
def test_a_description_names_the_machine_where_the_fmu_depends_on_it(fmus: Fmus, name: str) -> None:
    description = fmpy.read_model_description(str(fmus[name])).description
    with zipfile.ZipFile(fmus[name]) as archive:
        page = archive.read("documentation/index.html").decode()
    for text in (description, page):
        named = any(machine in text for machine in ("Spring-mass-damper", "stage, X axis", "stage, Y axis", "EMPS"))
        assert named != name.startswith("ReferenceTrajectory")
    assert ("Universal C Runtime" in page) == (not name.endswith("Py"))


def test_the_header_says_what_the_model_description_says(fmus: Fmus) -> None:
    with zipfile.ZipFile(fmus["HybridPredictor"]) as archive:
        header = archive.read("sources/hsep_fmu.h").decode()
    description = fmpy.read_model_description(str(fmus["HybridPredictor"]))
    assert f'#define HSEP_GUID "{description.guid}"' in header
    rows = re.findall(r'^    \{"([^"]+)", "([^"]*)", HSEP_(\w+), HSEP_(\w+), \d, ([^,]+),', header, re.MULTILINE)
    assert len(rows) == len(description.modelVariables)
    for (name, unit, kind, causality, start), variable in zip(rows, description.modelVariables, strict=True):
        assert (name, unit, kind) == (variable.name, variable.unit or "", variable.type.upper())
        assert causality == variable.causality.upper()
        assert float(start) == float(variable.start or 0)
    references = dict(re.findall(r"^    HSEP_VR_(\w+) = (\d+)", header, re.MULTILINE))
    for name in ("x_h", "lambda", "x_h_window[1]", "mode[1].f_n"):
        place = next(v.valueReference for v in description.modelVariables if v.name == name)
        assert references[name.partition("[")[0]] == str(place)


def test_archives_are_reproducible_and_the_guid_does_not_depend_on_the_compiler(tmp_path: Path, fmus: Fmus) -> None:
    machine = load_machine("spring_mass_damper")
    again = build_fmu(machine, "FeedDrive", tmp_path, targets=("host",))
    assert again.read_bytes() == fmus["FeedDrive"].read_bytes()
    other = build_fmu(machine, "FeedDrive", tmp_path, targets=(host_target(),))
    assert fmpy.read_model_description(str(other)).guid == fmpy.read_model_description(str(again)).guid


def test_another_machine_has_another_guid(fmus: Fmus) -> None:
    guids = {fmpy.read_model_description(str(fmus[name])).guid for name in NATIVE}
    assert len(guids) == len(NATIVE)


def test_all_platforms(tmp_path: Path) -> None:
    machine = load_machine("spring_mass_damper")
    path = build_fmu(machine, "FeedDrive", tmp_path / "1", targets=ALL_TARGETS)
    assert path.read_bytes() == build_fmu(machine, "FeedDrive", tmp_path / "2", targets=ALL_TARGETS).read_bytes()
    with zipfile.ZipFile(path) as archive:
        binaries = {
            n.removeprefix("binaries/"): archive.read(n) for n in archive.namelist() if n.startswith("binaries/")
        }
    assert {name.partition("/")[0] for name in binaries} == {
        "darwin64",
        *(folder for target in TARGETS.values() for folder in target.folders),
    }
    elf = {name.partition("/")[0]: content for name, content in binaries.items() if name.endswith(".so")}
    assert {name: struct.unpack_from("<H", content, 18)[0] for name, content in elf.items()} == {
        "linux64": 62,
        "x86_64-linux": 62,
        "aarch64-linux": 183,
    }
    versions = {tuple(map(int, v.split(b"."))) for v in re.findall(rb"GLIBC_([\d.]+)", elf["linux64"])}
    assert max(versions) <= (2, 17)
    assert struct.unpack_from(">2I", binaries["darwin64/FeedDrive.dylib"]) == (0xCAFEBABE, 2)
    for name, content in binaries.items():  # Windows has it from the compiler, under no name
        assert b"__stack_chk_fail" in content or name.endswith(".dll"), name
    for name in ("win64", "win32"):
        assert binaries[f"{name}/FeedDrive.dll"].startswith(b"MZ")
    for content in binaries.values():
        assert b"/tmp/" not in content


def test_universal_files() -> None:
    intel, arm = (
        struct.pack("<3I", 0xFEEDFACF, cpu, 3) + bytes(size) for cpu, size in ((0x01000007, 50), (0x0100000C, 60_000))
    )
    joined = universal([intel, arm])
    count = struct.unpack_from(">I", joined, 4)[0]
    parts = [struct.unpack_from(">5I", joined, 8 + 20 * i) for i in range(count)]
    assert [joined[offset : offset + size] for _, _, offset, size, _ in parts] == [intel, arm]
    assert all(offset % (1 << power) == 0 for _, _, offset, _, power in parts)
    with pytest.raises(FmuError, match="one library for each processor"):
        universal([intel, intel])
    with pytest.raises(FmuError, match="64-bit Mach-O"):
        universal([b"MZ"])


def test_unknown_targets_and_refusing_compilers_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    machine = load_machine("spring_mass_damper")
    with pytest.raises(FmuError, match="no target sparc; there are host, x86_64-linux"):
        build_fmu(machine, "FeedDrive", tmp_path, targets=("sparc",))
    monkeypatch.setenv("CC", f"{sys.executable} -c raise(SystemExit('broken'))")
    with pytest.raises(FmuError, match=r"FeedDrive cannot be compiled for (.|\n)*broken"):
        build_fmu(machine, "FeedDrive", tmp_path, targets=("host",))


# Co-simulation -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("plant", BACKENDS)
@pytest.mark.parametrize("predictor", BACKENDS)
def test_every_pairing_agrees_with_the_library_on_the_staircase(fmus: Fmus, predictor: str, plant: str) -> None:
    machine = load_machine("spring_mass_damper")
    suffix = {"native": "", "python": "Py"}
    run = cosimulate(fmus[f"HybridPredictor{suffix[predictor]}"], fmus[f"FeedDrive{suffix[plant]}"], staircase())
    assert_equal(run, reference(machine, staircase()))
    assert run.summary()["reduction_percent"] > 50


@pytest.mark.parametrize("plant", BACKENDS)
@pytest.mark.parametrize("predictor", BACKENDS)
@pytest.mark.parametrize("axis", [0, 1])
def test_every_pairing_agrees_with_the_library_on_the_spiral(fmus: Fmus, predictor: str, plant: str, axis: int) -> None:
    machine = load_machine(f"als25010_{'xy'[axis]}")
    names = [
        next(n for n, m in fmu_names(machine, b).items() if m == model)
        for b, model in ((predictor, "HybridPredictor"), (plant, "FeedDrive"))
    ]
    command = spiral()[axis]
    assert_equal(cosimulate(fmus[names[0]], fmus[names[1]], command), reference(machine, command))


PAPER = {"Np": 100, "p": 50, "q": 3, "lambda": 1e-12, "t_init": 0.3}
TIGHT = {"v_max": 0.08, "a_max": 8.0, "j_max": 1000.0}
"""Limits of the trajectory itself: most plans are bounded by them."""


@pytest.mark.parametrize(
    ("machine", "values"),
    [("", {}), ("", PAPER), ("", TIGHT), ("_als25010_x", {}), ("_als25010_x", TIGHT), ("_als25010_y", {})],
    ids=["staircase", "staircase, paper", "staircase, tight", "spiral X", "spiral X, tight", "spiral Y"],
)
def test_both_flavours_of_the_compensator_command_the_same(fmus: Fmus, machine: str, values: dict[str, float]) -> None:
    command = {"": staircase(), "_als25010_x": spiral()[0], "_als25010_y": spiral()[1]}[machine][:4000]
    native, python = (
        cosimulate_sep(
            fmus[f"SepCompensator{suffix}{machine}"], fmus[f"FeedDrive{machine}"], command, compensator_values=values
        )
        for suffix in ("", "Py")
    )
    np.testing.assert_allclose(native.x_dm, python.x_dm, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(native.state, python.state)
    assert set(native.state) == {1, 2}
    assert np.max(np.abs(native.change)) > 1e-5


def test_another_start_and_start_time(fmus: Fmus) -> None:
    command = 0.1 + staircase()[:2001]
    run = cosimulate(fmus["HybridPredictor"], fmus["FeedDrive"], command, start_time=1234.5)
    assert_equal(run, reference(load_machine("spring_mass_damper"), command))
    assert run.t[0] == pytest.approx(1234.6)


def test_the_whole_system_without_a_script(fmus: Fmus) -> None:
    """ReferenceTrajectory → HybridPredictor → FeedDrive give what the same system gives with commands from outside."""
    expected = reference(load_machine("spring_mass_damper"), staircase())
    rows = []
    with (
        FmuInstance(fmus["ReferenceTrajectory"]) as source,
        FmuInstance(fmus["HybridPredictor"]) as predictor,
        FmuInstance(fmus["FeedDrive"]) as plant,
    ):
        for instance in (source, predictor, plant):
            instance.initialise()
        for k in range(2000):
            x_d, x_h, x_meas = predictor.get("x_d"), predictor.get("x_h"), plant.get("x_meas")
            rows.append((x_d, x_h, x_meas))
            predictor.set("x_d_ahead", source.get("r"))
            predictor.set("x_meas", x_meas)
            plant.set("x_d", x_d)
            for instance in (source, predictor, plant):
                instance.step(k * 1e-3, 1e-3)
    for samples, name in zip(np.array(rows)[100:].T, ("x_d", "x_h", "x_meas"), strict=True):
        np.testing.assert_allclose(samples, expected[name][:1900], rtol=0, atol=TOLERANCE, err_msg=name)


@pytest.mark.parametrize("n", [0, 1, 2])
def test_the_trajectories(fmus: Fmus, n: int) -> None:
    command = (staircase(), *spiral())[n]
    assert_played(fmus["ReferenceTrajectory"], n, command)


def test_given_samples_are_trajectory_3(tmp_path: Path) -> None:
    machine = load_machine("spring_mass_damper")
    samples = 0.2 + np.cumsum(np.random.default_rng(1).normal(0, 1e-4, 40))
    path = build_fmu(machine, "ReferenceTrajectory", tmp_path, targets=("host",), samples=samples)
    assert_played(path, 3, samples)
    with pytest.raises(SignalError, match="samples"):
        build_fmu(machine, "ReferenceTrajectory", tmp_path, targets=("host",), samples=[0.0, np.nan])


def assert_played(path: Path, n: int, command: Array) -> None:
    with FmuInstance(path) as source:
        source.initialise({"trajectory": n}, start_time=3.0)
        played = [source.get("r")]
        for k in range(len(command) + 5):
            source.step(3.0 + k * 1e-3, 1e-3)
            played.append(source.get("r"))
    np.testing.assert_array_equal(played[: len(command)], command)
    assert set(played[len(command) :]) == {command[-1]}


def test_a_trajectory_that_is_not_there_is_named(fmus: Fmus) -> None:
    with FmuInstance(fmus["ReferenceTrajectory"]) as source, pytest.raises(FmuError, match="trajectory"):
        source.initialise({"trajectory": 3})


@pytest.mark.parametrize("name", [*NATIVE, *PYTHON])
def test_a_run_with_the_importers_defaults_reaches_the_end(fmus: Fmus, name: str) -> None:
    stop = float(fmpy.read_model_description(str(fmus[name])).defaultExperiment.stopTime)
    end = {"emps": 10.0}.get(name.rpartition("_")[2], 6.0 + (0.2 if "Sep" in name else 0.1))
    assert stop == pytest.approx(end, abs=0.011)
    for interval in (None, stop / 500):
        result = fmpy.simulate_fmu(str(fmus[name]), output_interval=interval)
        assert result["time"][-1] == pytest.approx(stop, abs=1e-9)
        assert len(result) >= 500
        assert all(np.isfinite(result[column].astype(float)).all() for column in result.dtype.names)


# One predictor, sample by sample -----------------------------------------------------------------------------------


def drive(
    instance: FmuInstance, first: int, last: int, *, parts: int = 1, start: float = 0.0
) -> list[tuple[float, ...]]:
    """Step through samples of a made-up motion and return the outputs after each."""
    outputs = []
    for k in range(first, last):
        instance.set("x_d_ahead", 1e-3 * np.sin(0.02 * k))
        instance.set("x_meas", 1e-3 * np.sin(0.02 * (k - 105)) + 1e-5 * np.cos(0.3 * k))
        for part in range(parts):
            instance.step(start + (k + part / parts) * 1e-3, 1e-3 / parts)
            instance.set("x_d_ahead", 99.0)  # inputs count at the beginning of a sample only
        outputs.append(tuple(instance.get(name) for name in ("x_d", "x_pb", "x_h", "e_servo", "rms_pb", "rms_h")))
    return outputs


# Sources -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["HybridPredictor", "FeedDrive_als25010_x", "ReferenceTrajectory"])
def test_the_archive_without_binaries_can_be_compiled(
    fmus: Fmus, tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not shutil.which("make"):
        monkeypatch.setenv("CMAKE_GENERATOR", "Ninja")
    if not shutil.which("cc"):
        for variable, command in (("CC", "cc"), ("CXX", "c++")):
            monkeypatch.setenv(variable, f"{sys.executable} -m ziglang {command}")
    folder = tmp_path / "unpacked"
    with zipfile.ZipFile(fmus[name]) as archive:
        archive.extractall(folder)
    shutil.rmtree(folder / "binaries")
    (tmp_path / "build").mkdir()
    build_platform_binary(
        folder, tmp_path / "build", all_warnings=True, cmake_options={"CMAKE_C_FLAGS:STRING": "-Werror"}
    )
    rebuilt = tmp_path / fmus[name].name
    with zipfile.ZipFile(rebuilt, "w") as archive:
        for path in folder.rglob("*"):
            archive.write(path, path.relative_to(folder))
    traces = []
    for path in (fmus[name], rebuilt):
        with FmuInstance(path) as instance:
            instance.initialise()
            traces.append(
                drive(instance, 0, 300) if name == "HybridPredictor" else [plain(instance, k) for k in range(300)]
            )
    np.testing.assert_allclose(traces[0], traces[1], rtol=0, atol=1e-12)


def plain(instance: FmuInstance, k: int) -> float:
    """Step a plant or a source and return its output."""
    if "x_d" in instance.variables:
        instance.set("x_d", 1e-3 * np.sin(0.02 * k))
    instance.step(k * 1e-3, 1e-3)
    return float(instance.get("x_meas" if "x_meas" in instance.variables else "r"))


def test_the_tables_hold_together() -> None:
    parameters = {"trajectory": 0, "T_s": 1e-3}
    table = variables_of({"model": "ReferenceTrajectory", "parameters": parameters, "modes": []})
    assert [variable.name for variable in table] == ["r", "trajectory", "T_s"]
    assert all(isinstance(variable, Variable) and variable.description for variable in table)
    assert (table[2].minimum, table[2].maximum) == (1e-5, 1.0)
