"""FMUs of others: what is none, or has no library for this platform, is refused in one line."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from built_once import BuiltFmus

from hybridsep import FmuInstance
from hybridsep.base.errors import FmuError

Change = Callable[[bytes], bytes]


@pytest.fixture(scope="module")
def native(fmus: BuiltFmus) -> Path:
    return fmus("FeedDrive")


def changed(archive: Path, target: Path, changes: dict[str, Change]) -> Path:
    """Copy an archive with other content of the members whose names end so."""
    with zipfile.ZipFile(archive) as old, zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            content = old.read(name)
            for ending, change in changes.items():
                content = change(content) if name.endswith(ending) else content
            new.writestr(name, content)
    return target


def test_archives_that_are_none(native: Path, tmp_path: Path) -> None:
    content, path = native.read_bytes(), tmp_path / "Cut.fmu"
    for kept in (0, 10, len(content) // 2, len(content) - 30):
        path.write_bytes(content[:kept])
        with pytest.raises(FmuError, match=r"Cut\.fmu is not a readable FMU: "):
            FmuInstance(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("readme.txt", "")
    with pytest.raises(FmuError, match=r"Cut\.fmu is not a readable FMU: .*modelDescription\.xml"):
        FmuInstance(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda _: b"<html></html>", r"Odd\.fmu is not a readable FMU: "),
        (lambda xml: xml[:-40], r"Odd\.fmu is not a readable FMU: "),
        (lambda xml: xml.replace(b'causality="input"', b'causality="exput"'), r"is not a readable FMU: .*causality"),
        (
            lambda xml: xml.replace(b"CoSimulation", b"ModelExchange"),
            r"is not a readable FMU|must be an FMI 2\.0 or 3\.0 co",
        ),
    ],
)
def test_descriptions(native: Path, tmp_path: Path, change: Change, message: str) -> None:
    path = changed(native, tmp_path / "Odd.fmu", {"modelDescription.xml": change})
    with pytest.raises(FmuError, match=message) as caught:
        FmuInstance(path)
    assert len(str(caught.value)) < 300
    assert "\n" not in str(caught.value)


def test_libraries_of_other_platforms(native: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(native) as old, zipfile.ZipFile(tmp_path / "Far.fmu", "w") as new:
        for name in old.namelist():
            new.writestr(name.replace("linux64", "darwin64"), old.read(name))
    with pytest.raises(FmuError, match=r"linux64/FeedDrive\.so is missing, there are binaries for darwin64"):
        FmuInstance(tmp_path / "Far.fmu")


def test_a_missing_function_is_named(native: Path, tmp_path: Path) -> None:
    path = changed(native, tmp_path / "Odd.fmu", {".so": lambda so: so.replace(b"fmi2DoStep\0", b"fmi2DoStop\0")})
    with pytest.raises(FmuError, match=r"Odd\.fmu cannot be loaded: .*undefined symbol: fmi2DoStep"):
        FmuInstance(path)
