"""Licences and notices of what is in an FMU."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import pytest
from built_once import PYTHON

from hybridsep import build_fmu, load_machine
from hybridsep.base.errors import FmuError
from hybridsep.base.files import data_folder

LICENSES = data_folder("fmu_src") / "c" / "licenses"


def test_the_licences_of_a_python_fmu(python_fmu: Callable[[str], Path]) -> None:
    with zipfile.ZipFile(python_fmu(PYTHON[0])) as archive:
        assert b"BSD 3-Clause" in archive.read("documentation/licenses/license.txt")
        assert b"MIT License" in archive.read("documentation/licenses/pythonfmu.txt")


def test_the_notices_are_those_of_the_compiler() -> None:
    found = find_spec("ziglang")
    assert found is not None
    zig = Path(str(found.origin)).parent
    for own, theirs in (("zig.txt", "LICENSE"), ("mingw-w64.txt", "lib/libc/mingw/COPYING")):
        lines = [(path / name).read_text(encoding="utf-8").split() for path, name in ((LICENSES, own), (zig, theirs))]
        assert lines[0] == lines[1]


def test_pythonfmu_without_its_licence_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hybridsep.fmi.python.metadata.files", lambda name: [])
    with pytest.raises(FmuError, match=r"pythonfmu's LICENSE, .* is not installed: reinstall it"):
        build_fmu(load_machine("spring_mass_damper"), "FeedDrivePy", tmp_path, "python")
