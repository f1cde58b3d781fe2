"""Bill of materials of an FMU: valid, what is in it, and the same every time."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from built_once import FMI3, NATIVE, PYTHON, BuiltFmus
from cyclonedx.schema import SchemaVersion

from hybridsep.base.data_files import data_folder
from hybridsep.base.errors import FmuError
from hybridsep.fmi.bill_of_materials import BILL_FILE, bill_of_materials, native_parts, python_parts
from hybridsep.fmi.compiler import ALL_TARGETS, ZIG
from hybridsep.fmi.pythonfmu_limits import pythonfmu_license

LICENSES = data_folder("fmu_src") / "c" / "licenses"
GUID = "{12345678-1234-1234-1234-123456789abc}"


def valid(bill: str) -> object:
    """Return what the schema of CycloneDX 1.6 has against a bill; its library takes seconds to load."""
    from cyclonedx.validation.json import JsonStrictValidator

    return JsonStrictValidator(SchemaVersion.V1_6).validate_str(bill)


def bill_in(path: Path) -> dict[str, Any]:
    with zipfile.ZipFile(path) as archive:
        assert "extra/org.cyclonedx/bom.json" in archive.namelist()
        text = archive.read(BILL_FILE).decode()
    assert valid(text) is None
    return dict(json.loads(text))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["HybridPredictor", "HybridPredictorFmi3"])
def test_the_bill_of_a_native_fmu(fmus: BuiltFmus, name: str) -> None:
    assert name in NATIVE + FMI3
    bill = bill_in(fmus(name))
    assert bill["metadata"]["component"]["name"] == name
    parts = {part["name"]: part for part in bill["components"]}
    assert set(parts) >= {"hybridsep C sources", "FMI 2.0 headers", "FMI 3.0 headers"}
    assert parts["hybridsep C sources"]["licenses"] == [{"license": {"id": "BSD-3-Clause"}}]
    with zipfile.ZipFile(fmus(name)) as archive:
        notices = archive.read("documentation/licenses/compiler-runtime.txt").decode()
    assert "Copyright (c) Zig contributors" in notices
    assert "by the mingw-w64 project" in notices
    compiler = parts["ziglang"]
    assert (f"ziglang {compiler['version']}", compiler["type"]) == (ZIG, "application")


def test_the_bill_of_a_python_fmu(python_fmu: Callable[[str], Path]) -> None:
    bill = bill_in(python_fmu(PYTHON[0]))
    with zipfile.ZipFile(python_fmu(PYTHON[0])) as archive:
        assert b"BSD 3-Clause" in archive.read("documentation/licenses/license.txt")
        assert b"MIT License" in archive.read("documentation/licenses/pythonfmu.txt")
        tool = archive.read("modelDescription.xml").decode().partition('generationTool="')[2].partition('"')[0]
    version = {part["name"]: part["version"] for part in bill["components"]}
    assert tool == f"hybridsep {version['hybridsep']} with pythonfmu {version['pythonfmu']}"


def test_the_same_fmu_has_the_same_bill_and_another_another() -> None:
    parts = native_parts([ZIG], ALL_TARGETS)
    bills = [
        bill_of_materials("Axis", guid, made_of)
        for guid, made_of in ((GUID, parts), (GUID, parts[::-1]), (GUID, parts[:-1]), (GUID.replace("1", "2"), parts))
    ]
    assert bills[0] == bill_of_materials("Axis", GUID, native_parts([ZIG], ALL_TARGETS))
    assert bills[0] == bills[1]
    assert len({json.loads(bill)["serialNumber"] for bill in bills}) == 3
    assert all(valid(bill.decode()) is None and b"timestamp" not in bill for bill in bills)


def test_parts_follow_platforms_and_compilers() -> None:
    def names(compilers: list[str], targets: list[str]) -> list[str]:
        return [part.name for part in native_parts(compilers, targets)][3:]

    assert names([ZIG, ZIG], ["x86_64-linux"]) == ["ziglang"]
    assert names([ZIG], ["x86_64-linux", "x86-windows"]) == ["ziglang", "mingw-w64 runtime"]
    said = "cc cc (Debian 12.2.0) 12.2.0\nCopyright (C) 2022"
    assert names([said, ZIG], ["x86_64-linux"]) == ["cc", "ziglang"]
    (own,) = native_parts([said], ["x86_64-windows"])[3:]
    assert (own.version, own.license) == ("cc (Debian 12.2.0) 12.2.0", "")
    for parts in (native_parts([said, "clang "], []), python_parts("0.7.0")):
        assert valid(bill_of_materials("Axis", GUID, parts).decode()) is None


def test_the_notices_are_those_of_the_compiler() -> None:
    found = find_spec("ziglang")
    assert found is not None
    zig = Path(str(found.origin)).parent
    for own, theirs in (("zig.txt", "LICENSE"), ("mingw-w64.txt", "lib/libc/mingw/COPYING")):
        lines = [(path / name).read_text(encoding="utf-8").split() for path, name in ((LICENSES, own), (zig, theirs))]
        assert lines[0] == lines[1]


def test_pythonfmu_without_its_licence_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hybridsep.fmi.pythonfmu_limits.metadata.files", lambda name: [])
    with pytest.raises(FmuError, match=r"pythonfmu's LICENSE, .* is not installed: reinstall it"):
        pythonfmu_license()
