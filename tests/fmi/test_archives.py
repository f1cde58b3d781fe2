"""Archives of the FMUs: what checkers of others say of them, what they hold, that they are the same every time."""

import io
import logging
import re
import shlex
import shutil
import struct
import subprocess
import sys
import zipfile
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from built_once import FMI3, NATIVE, PYTHON, BuiltFmus, content, each_kind
from c_compiler import FMI_HEADERS, compiler
from elf import symbols
from fmpy.build import build_platform_binary
from fmpy.model_description import read_build_description
from fmpy.validation import validate_fmu

from hybridsep.base.files import data_folder
from hybridsep.base.version import VERSION_DATE
from hybridsep.fmi.archive import archived, build_fmu
from hybridsep.fmi.compile import ALL_TARGETS, TARGETS, host_target, placed, universal
from hybridsep.fmi.description import ICON_FILE, TERMINALS_FILE
from hybridsep.fmi.spec import fmu_names
from hybridsep.machines.machine import load_machine

etree: Any = import_module("lxml.etree")  # comes with fmpy, has no types

MACHINE = load_machine("spring_mass_damper")
ALL = [*NATIVE, *FMI3, *PYTHON]
MORE_MODES_ALONE = tuple(f"{kind}_als25010_x" for kind in ("HybridPredictor", "HybridPredictorPy", "SepCompensator"))
"""The default machine's variables and more modes, as other FMUs have: fmpy takes seconds for that many variables."""

FILES = {
    "2": {"binaries/linux64/{}.so", "model.png", "sources/all.c", "documentation/licenses/fmi-headers.txt"},
    "3": {"binaries/x86_64-linux/{}.so", ICON_FILE, "sources/all.c", "documentation/licenses/fmi-headers.txt"},
    "Py": {"binaries/linux64/{}.so", "model.png", "resources/machine.json", "documentation/licenses/pythonfmu.txt"},
}
LICENCES = {
    "license": b"BSD 3-Clause",
    "fmi-headers": b"Redistribution and use",
    "pythonfmu": b"MIT License",
    "compiler-runtime": b"Zig",
}


def kind_of(name: str) -> str:
    return "Py" if name in PYTHON else "3" if name in FMI3 else "2"


def findings_of_the_toolbox(path: Path, caplog: pytest.LogCaptureFixture) -> list[str]:
    """Return what the fmu-manipulation-toolbox's checkers complain about."""
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


@pytest.mark.slow
@pytest.mark.parametrize("name", each_kind([name for name in ALL if name not in MORE_MODES_ALONE]))
def test_checkers_have_no_finding(fmus: BuiltFmus, caplog: pytest.LogCaptureFixture, name: str) -> None:
    """fmpy's, with the standard's schemas, and the toolbox's."""
    path = fmus(name)
    assert validate_fmu(str(path)) == []
    if name in PYTHON:
        return
    (configuration,) = read_build_description(str(path))  # by its schema
    assert (configuration.modelIdentifier, configuration.sourceFileSets[0].sourceFiles) == (name, ["all.c"])
    if name in FMI3:
        schema = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"
        etree.XMLSchema(file=str(schema)).assertValid(etree.fromstring(content(path)[TERMINALS_FILE]))
    assert findings_of_the_toolbox(path, caplog) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", each_kind(ALL))
def test_the_archive_is_complete(fmus: BuiltFmus, name: str) -> None:
    files, kind = content(fmus(name)), kind_of(name)
    assert {file.format(name) for file in FILES[kind]} <= set(files)
    assert not [file for file in files if "sources/fmi" in file]  # FMI 2.0, section 2.3
    for file, said in LICENCES.items():
        assert said in files.get(f"documentation/licenses/{file}.txt", said)
    assert files["model.png" if kind != "3" else ICON_FILE].startswith(b"\x89PNG\r\n\x1a\n")
    needed = ("Python", "NumPy", "SciPy", "LD_PRELOAD") if kind == "Py" else ("glibc", "Universal C Runtime")
    assert all(word in files["documentation/externalDependencies.txt"].decode() for word in needed)
    root = etree.fromstring(files["modelDescription.xml"])
    assert root.get("copyright") in files["documentation/licenses/license.txt"].decode().splitlines()
    assert (root.get("license"), root.get("author")) == ("BSD-3-Clause", "the hybridsep authors")
    page = files["documentation/index.html"].decode()
    etree.fromstring(re.sub(r"<!DOCTYPE html>|<meta [^>]*>|&nbsp;", "", page))  # well-formed
    for text in ("Chou, M. Duan, C. E. Okwudire", "<svg", 'href="externalDependencies.txt"', "width=device-width"):
        assert text in page
    for variable in fmpy.read_model_description(str(fmus(name))).modelVariables:
        size = "[Np]" if variable.shape else ""
        shown = re.sub(r"(_window)\[\d+\]", r"\1[i]", variable.name)
        assert f"<td>{shown}</td><td>{variable.type}{size}" in page
    for text in (root.get("description"), page):
        named = any(machine in text for machine in ("Spring-mass-damper", "stage, X axis", "stage, Y axis", "EMPS"))
        assert named != name.startswith("ReferenceTrajectory")


def test_names_follow_the_machine() -> None:
    assert list(fmu_names(MACHINE)) == ["HybridPredictor", "SepCompensator", "FeedDrive", "ReferenceTrajectory"]
    stage = load_machine("als25010_x")
    assert next(iter(fmu_names(stage, "python"))) == "HybridPredictorPy_als25010_x"
    assert list(fmu_names(stage, fmi="3"))[-1] == "FeedDriveFmi3_als25010_x"


def test_every_fmu_has_a_guid_of_its_own(fmus: BuiltFmus, tmp_path: Path) -> None:
    other = MACHINE.changed("predictor", {"p": 40})
    paths = [fmus(name) for name in ALL if "als25010_y" not in name and "emps" not in name]
    paths += [build_fmu(other, name, tmp_path, flavour) for name, flavour in OF_BOTH_FLAVOURS]
    assert len({fmpy.read_model_description(str(path)).guid for path in paths}) == len(paths)


OF_BOTH_FLAVOURS = (("HybridPredictor", "native"), ("HybridPredictorPy", "python"))


def test_archives_are_deflated_and_the_same_every_time(fmus: BuiltFmus, tmp_path: Path) -> None:
    """At one level of zlib; the size is a HybridPredictor's on this machine: 1.2 MB stored, with a double."""
    for name, flavour in OF_BOTH_FLAVOURS:
        assert build_fmu(MACHINE, name, tmp_path, flavour).read_bytes() == fmus(name).read_bytes()
    path = fmus("HybridPredictor")
    with zipfile.ZipFile(path) as archive:
        assert {entry.compress_type for entry in archive.infolist()} == {zipfile.ZIP_DEFLATED}
    files = content(path)
    assert archived(files) == path.read_bytes()
    assert len(path.read_bytes()) < 0.4 * sum(map(len, files.values()))
    assert len(set(files.values())) == len(files)  # nothing lies there twice
    with zipfile.ZipFile(io.BytesIO(archived({"a.fmu": path.read_bytes()}))) as system:
        assert system.infolist()[0].compress_type == zipfile.ZIP_STORED
    other = build_fmu(MACHINE, "HybridPredictor", tmp_path, targets=(host_target(),))
    assert content(other)["modelDescription.xml"] == files["modelDescription.xml"]
    assert f'generationDateAndTime="{VERSION_DATE}T00:00:00Z"'.encode() in files["modelDescription.xml"]  # no clock's


def test_the_notices_are_those_of_the_compiler() -> None:
    found = find_spec("ziglang")
    assert found is not None
    zig, own = Path(str(found.origin)).parent, data_folder("fmu_src") / "c" / "licenses"
    for one, other in (("zig.txt", "LICENSE"), ("mingw-w64.txt", "lib/libc/mingw/COPYING")):
        assert (own / one).read_text(encoding="utf-8").split() == (zig / other).read_text(encoding="utf-8").split()


# Libraries and sources ---------------------------------------------------------------------------------------------


def test_a_library_shows_the_fmi_functions_alone_and_notices_overflows(fmus: BuiltFmus, tmp_path: Path) -> None:
    with zipfile.ZipFile(fmus("HybridPredictor")) as archive:
        found = symbols(Path(archive.extract("binaries/linux64/HybridPredictor.so", tmp_path)), dynamic=True)
    shown = sorted(symbol.name[:4] for symbol in found if symbol.defined and symbol.exported)
    assert shown == ["fmi2"] * 34 + ["fmi3"] * 75
    assert "__stack_chk_fail" in {symbol.name for symbol in found}


@pytest.mark.release
def test_all_platforms(tmp_path: Path) -> None:
    path = build_fmu(MACHINE, "FeedDrive", tmp_path / "1", targets=ALL_TARGETS)
    assert path.read_bytes() == build_fmu(MACHINE, "FeedDrive", tmp_path / "2", targets=ALL_TARGETS).read_bytes()
    binaries = {n.removeprefix("binaries/"): c for n, c in content(path).items() if n.startswith("binaries/")}
    assert list(binaries) == [  # FMI 2.0's names, and FMI 3.0's of the one platform that has none; nothing twice
        *("aarch64-linux/FeedDrive.so", "darwin64/FeedDrive.dylib", "linux64/FeedDrive.so"),
        *("win32/FeedDrive.dll", "win64/FeedDrive.dll"),
    ]
    for name, processor in (("linux64", 62), ("aarch64-linux", 183)):
        assert struct.unpack_from("<H", binaries[f"{name}/FeedDrive.so"], 18)[0] == processor
    versions = re.findall(rb"GLIBC_([\d.]+)", binaries["linux64/FeedDrive.so"])
    assert max(tuple(map(int, version.split(b"."))) for version in versions) <= (2, 17)
    assert struct.unpack_from(">2I", binaries["darwin64/FeedDrive.dylib"]) == (0xCAFEBABE, 2)
    for name, library in binaries.items():
        assert library.startswith(b"MZ") == name.endswith(".dll")
        assert b"__stack_chk_fail" in library or name.endswith(".dll")  # Windows has it under no name
        assert b"/tmp/" not in library


def test_binaries_lie_where_fmi_3_has_them() -> None:
    found = placed(dict.fromkeys(ALL_TARGETS, b""), "Axis", "3")
    assert sorted(found) == sorted(f"{key}/Axis{TARGETS[key].suffix}" for key in ALL_TARGETS)


def test_universal_files() -> None:
    intel, arm = (
        struct.pack("<3I", 0xFEEDFACF, cpu, 3) + bytes(size) for cpu, size in ((0x01000007, 50), (0x0100000C, 60_000))
    )
    joined = universal([intel, arm])
    count = struct.unpack_from(">I", joined, 4)[0]
    parts = [struct.unpack_from(">5I", joined, 8 + 20 * i) for i in range(count)]
    assert [joined[offset : offset + size] for _, _, offset, size, _ in parts] == [intel, arm]
    assert all(offset % (1 << power) == 0 for _, _, offset, _, power in parts)


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param("FeedDrive", marks=pytest.mark.nightly), "FeedDriveFmi3"])
def test_the_archive_without_binaries_can_be_compiled(
    fmus: BuiltFmus, tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By fmpy, and what it compiles computes the same; then by the command on the page."""
    if not shutil.which("make"):
        monkeypatch.setenv("CMAKE_GENERATOR", "Ninja")
    if not shutil.which("cc"):
        for variable, command in (("CC", "cc"), ("CXX", "c++")):
            monkeypatch.setenv(variable, f"{sys.executable} -m ziglang {command}")
    folder = tmp_path / "unpacked"
    fmpy.extract(str(fmus(name)), unzipdir=str(folder))
    shutil.rmtree(folder / "binaries")
    (tmp_path / "build").mkdir()
    strict = {"CMAKE_C_FLAGS:STRING": "-Werror -Wno-strict-prototypes"}
    build_platform_binary(folder, tmp_path / "build", all_warnings=True, cmake_options=strict)
    given = np.zeros(300, [("time", float), ("x_d", float)])
    given["time"] = 1e-3 * np.arange(300)
    given["x_d"] = 1e-3 * np.sin(20.0 * given["time"])
    how: dict[str, Any] = {"stop_time": 0.3, "output_interval": 1e-3, "input": given}
    found, expected = (fmpy.simulate_fmu(str(path), **how) for path in (folder, fmus(name)))
    for column in found.dtype.names:
        np.testing.assert_allclose(found[column], expected[column], rtol=0, atol=1e-12, err_msg=column)
    (folder / "headers").symlink_to(FMI_HEADERS)
    page = (folder / "documentation" / "index.html").read_text(encoding="utf-8")
    (command,) = re.findall(r"<pre>cc (.*?)</pre>", page, re.DOTALL)
    subprocess.run([*compiler(), *shlex.split(command.replace("\\\n", " "))], cwd=folder, check=True)
    assert (folder / f"{name}.so").is_file()
