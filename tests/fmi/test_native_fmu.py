"""Archives of the native FMUs: content, binaries, sources."""

from __future__ import annotations

import io
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
from built_once import NATIVE, BuiltFmus, each_kind
from elf import symbols
from fmpy.build import build_platform_binary
from fmpy.model_description import read_build_description
from fmpy.validation import validate_fmu

from hybridsep.base.errors import FmuError
from hybridsep.cosim.fmu import FmuInstance
from hybridsep.fmi.archive import archived, build_fmu
from hybridsep.fmi.compile import ALL_TARGETS, host_target, universal
from hybridsep.fmi.flavours import FLAVOURS
from hybridsep.fmi.spec import fmu_names
from hybridsep.fmi.variables import FmuTable, Variable
from hybridsep.machines.machine import load_machine

etree: Any = import_module("lxml.etree")  # comes with fmpy, has no types


def test_native_is_the_default_and_names_follow_the_machine() -> None:
    assert FLAVOURS[0] == "native"
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


@pytest.mark.slow
@pytest.mark.parametrize("name", each_kind(NATIVE))
def test_checkers_have_no_finding(fmus: BuiltFmus, name: str) -> None:
    assert validate_fmu(str(fmus(name))) == []
    with zipfile.ZipFile(fmus(name)) as archive:
        assert archive.testzip() is None
        description = etree.parse(archive.open("modelDescription.xml"))
    folder = Path(fmpy.__file__).parent / "schema"
    etree.XMLSchema(file=str(folder / "fmi2" / "fmi2ModelDescription.xsd")).assertValid(description)
    simulation = description.getroot().find("CoSimulation")
    assert simulation.get("needsExecutionTool") == "false"
    assert [file.get("name") for file in simulation.find("SourceFiles")] == ["all.c"]
    (configuration,) = read_build_description(str(fmus(name)))
    assert configuration.modelIdentifier == name
    assert configuration.sourceFileSets[0].sourceFiles == ["all.c"]


@pytest.mark.slow
@pytest.mark.parametrize("name", each_kind(NATIVE))
def test_the_archive_is_complete(fmus: BuiltFmus, name: str) -> None:
    with zipfile.ZipFile(fmus(name)) as archive:
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
    variables = fmpy.read_model_description(str(fmus(name))).modelVariables
    for variable in variables:
        assert re.sub(r"(_window)\[\d+\]", r"\1[i]", variable.name) in page


def test_archives_are_deflated_and_the_same_every_time(fmus: BuiltFmus) -> None:
    """At one level of zlib; the figures are for HybridPredictor on this machine: 1.2 MB stored, with a double."""
    path = fmus("HybridPredictor")
    with zipfile.ZipFile(path) as archive:
        entries = archive.infolist()
        files = {entry.filename: archive.read(entry) for entry in entries}
    assert {entry.compress_type for entry in entries} == {zipfile.ZIP_DEFLATED}
    assert archived(files) == path.read_bytes()
    assert len(path.read_bytes()) < 0.4 * sum(map(len, files.values()))
    assert len(set(files.values())) == len(files)  # nothing lies there twice
    with zipfile.ZipFile(io.BytesIO(archived({"a.fmu": path.read_bytes()}))) as system:
        assert system.infolist()[0].compress_type == zipfile.ZIP_STORED


def test_only_fmi_functions_are_exported(fmus: BuiltFmus, tmp_path: Path) -> None:
    with zipfile.ZipFile(fmus("HybridPredictor")) as archive:
        library = archive.extract("binaries/linux64/HybridPredictor.so", tmp_path)
    exported = {symbol.name for symbol in symbols(Path(library), dynamic=True) if symbol.defined and symbol.exported}
    assert {prefix: sum(name.startswith(prefix) for name in exported) for prefix in ("fmi2", "fmi3")} == {
        "fmi2": 34,
        "fmi3": 75,
    }
    assert len(exported) == 34 + 75


def test_an_overflow_on_the_stack_is_noticed(fmus: BuiltFmus, tmp_path: Path) -> None:
    with zipfile.ZipFile(fmus("HybridPredictor")) as archive:
        library = archive.extract("binaries/linux64/HybridPredictor.so", tmp_path)
    assert "__stack_chk_fail" in {symbol.name for symbol in symbols(Path(library), dynamic=True)}


@pytest.mark.slow
@pytest.mark.parametrize("name", each_kind([*NATIVE, "HybridPredictorPy"]))
def test_a_description_names_the_machine_where_the_fmu_depends_on_it(fmus: BuiltFmus, name: str) -> None:
    description = fmpy.read_model_description(str(fmus(name))).description
    with zipfile.ZipFile(fmus(name)) as archive:
        page = archive.read("documentation/index.html").decode()
    for text in (description, page):
        named = any(machine in text for machine in ("Spring-mass-damper", "stage, X axis", "stage, Y axis", "EMPS"))
        assert named != name.startswith("ReferenceTrajectory")
    assert ("Universal C Runtime" in page) == (not name.endswith("Py"))


def test_the_header_says_what_the_model_description_says(fmus: BuiltFmus) -> None:
    with zipfile.ZipFile(fmus("HybridPredictor")) as archive:
        header = archive.read("sources/hsep_fmu.h").decode()
    description = fmpy.read_model_description(str(fmus("HybridPredictor")))
    assert f'#define HSEP_GUID "{description.guid}"' in header
    variables = {variable.name: variable for variable in description.modelVariables}
    starts = re.findall(r"^    (\S+) /\* (\S+) \*/", header, re.MULTILINE)
    assert [name for _, name in starts] == [name for name in variables if "_window[" not in name]
    for start, name in starts:
        expected = variables[name].start or 0
        assert float(start) == (expected == "true" if variables[name].type == "Boolean" else float(expected))
    rows = re.findall(r'^    \{"([^"]+)", "([^"]*)", "[^"]*", HSEP_(\w+), HSEP_(\w+), \d,', header, re.MULTILINE)
    firsts = {name: f"mode[1].{name}" for name in ("f_n", "zeta", "alpha", "beta")}
    firsts |= {name: f"{name}[1]" for name, *_ in rows if name.endswith("_window")}
    assert len(rows) == len(starts) + len(firsts) - 4  # its one mode, and a row for each window
    for name, unit, kind, causality in rows:
        variable = variables[firsts.get(name, name)]
        expected = (variable.unit or "", variable.type.upper(), variable.causality.upper())
        assert (unit, kind, causality) == expected
    references = dict(re.findall(r"^    HSEP_VR_(\w+) = (\d+)", header, re.MULTILINE))
    for name in ("x_h", "lambda", "mode[1].f_n"):
        assert references[name.partition("[")[0]] == str(variables[name].valueReference)


@pytest.mark.slow
def test_archives_are_reproducible_and_the_guid_does_not_depend_on_the_compiler(
    tmp_path: Path, fmus: BuiltFmus
) -> None:
    machine = load_machine("spring_mass_damper")
    again = build_fmu(machine, "FeedDrive", tmp_path, targets=("host",))
    assert again.read_bytes() == fmus("FeedDrive").read_bytes()
    other = build_fmu(machine, "FeedDrive", tmp_path, targets=(host_target(),))
    assert fmpy.read_model_description(str(other)).guid == fmpy.read_model_description(str(again)).guid


@pytest.mark.slow
def test_another_machine_has_another_guid(fmus: BuiltFmus) -> None:
    guids = {fmpy.read_model_description(str(fmus(name))).guid for name in NATIVE}
    assert len(guids) == len(NATIVE)


@pytest.mark.release
def test_all_platforms(tmp_path: Path) -> None:
    machine = load_machine("spring_mass_damper")
    path = build_fmu(machine, "FeedDrive", tmp_path / "1", targets=ALL_TARGETS)
    assert path.read_bytes() == build_fmu(machine, "FeedDrive", tmp_path / "2", targets=ALL_TARGETS).read_bytes()
    with zipfile.ZipFile(path) as archive:
        binaries = {
            n.removeprefix("binaries/"): archive.read(n) for n in archive.namelist() if n.startswith("binaries/")
        }
    assert list(binaries) == [  # FMI 2.0's names, and FMI 3.0's of the one platform that has none; nothing twice
        *("aarch64-linux/FeedDrive.so", "darwin64/FeedDrive.dylib", "linux64/FeedDrive.so"),
        *("win32/FeedDrive.dll", "win64/FeedDrive.dll"),
    ]
    elf = {name.partition("/")[0]: content for name, content in binaries.items() if name.endswith(".so")}
    assert {name: struct.unpack_from("<H", content, 18)[0] for name, content in elf.items()} == {
        "linux64": 62,
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


def test_unknown_targets_are_named(tmp_path: Path) -> None:
    with pytest.raises(FmuError, match="no target sparc; there are host, all, x86_64-linux"):
        build_fmu(load_machine("spring_mass_damper"), "FeedDrive", tmp_path, targets=("sparc",))


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
        outputs.append(
            tuple(
                instance.get(name)
                for name in ("x_d", "x_pb", "x_h", "x_h_std", "e_servo", "rms_pb", "rms_h", "rms_hold")
            )
        )
    return outputs


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "HybridPredictor",
        "FeedDriveFmi3",
        *(pytest.param(name, marks=pytest.mark.nightly) for name in ("FeedDrive_als25010_x", "ReferenceTrajectory")),
    ],
)
def test_the_archive_without_binaries_can_be_compiled(
    fmus: BuiltFmus, tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not shutil.which("make"):
        monkeypatch.setenv("CMAKE_GENERATOR", "Ninja")
    if not shutil.which("cc"):
        for variable, command in (("CC", "cc"), ("CXX", "c++")):
            monkeypatch.setenv(variable, f"{sys.executable} -m ziglang {command}")
    folder = tmp_path / "unpacked"
    with zipfile.ZipFile(fmus(name)) as archive:
        archive.extractall(folder)
    shutil.rmtree(folder / "binaries")
    (tmp_path / "build").mkdir()
    build_platform_binary(
        folder,
        tmp_path / "build",
        all_warnings=True,
        cmake_options={"CMAKE_C_FLAGS:STRING": "-Werror -Wno-strict-prototypes"},
    )
    rebuilt = tmp_path / fmus(name).name
    with zipfile.ZipFile(rebuilt, "w") as archive:
        for path in folder.rglob("*"):
            archive.write(path, path.relative_to(folder))
    traces = []
    for path in (fmus(name), rebuilt):
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
    table = FmuTable("ReferenceTrajectory", "trajectory", parameters).variables
    assert [variable.name for variable in table] == ["r", "trajectory", "T_s"]
    assert all(isinstance(variable, Variable) and variable.description for variable in table)
    assert (table[2].minimum, table[2].maximum) == (1e-5, 1.0)


@pytest.mark.parametrize(("samples", "fmi", "played"), [(None, "2", 3), ([0.0, 1e-3], "2", 4), ([0.0, 1e-3], "3", 4)])
def test_a_trajectory_declares_what_it_plays(
    tmp_path: Path, samples: list[float] | None, fmi: str, played: int
) -> None:
    """At the interval of its samples alone, and samples of the user's where it was built with some."""
    machine, name = load_machine("spring_mass_damper"), "ReferenceTrajectory" + "Fmi3" * (fmi == "3")
    path = build_fmu(machine, name, tmp_path, targets=("host",), samples=samples, fmi=fmi)
    description = fmpy.read_model_description(str(path))
    variables = {variable.name: variable for variable in description.modelVariables}
    T_s, trajectory = variables["T_s"], variables["trajectory"]
    assert T_s.start == T_s.min == T_s.max == "0.001"
    assert [item.name for item in trajectory.declaredType.items] == ["staircase", "spiral_x", "spiral_y", "samples"][
        :played
    ]
    assert (trajectory.min, trajectory.max) == ("0", str(played - 1))
    with zipfile.ZipFile(path) as archive:
        page = archive.read("documentation/index.html").decode()
    assert f"<td>0 … {played - 1}</td>" in page
    assert ("samples with which" in page) == (samples is not None)
    for number in range(5):
        with FmuInstance(path) as instance:
            instance.set("trajectory", number)
            if number < played:
                instance.initialise()
            else:
                with pytest.raises(FmuError, match="trajectory"):
                    instance.initialise()
    with FmuInstance(path) as instance:
        instance.set("T_s", 0.002)
        with pytest.raises(FmuError, match=r"T_s must be 0\.001 s"):
            instance.initialise()
