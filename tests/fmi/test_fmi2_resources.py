"""Resources of a native FMU: their location, and files that change."""

from __future__ import annotations

import ctypes
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from c_compiler import C_SOURCES, include_flags, run_compiler
from fmi2_driving import library_of
from fmi2_library import ERROR, OK, Allocate, Callbacks


@pytest.mark.parametrize("form", ["uri", "one slash", "localhost", "plain path", "spaces not encoded"])
def test_resources_in_a_folder_with_an_odd_name(folders: Callable[[str], Path], tmp_path: Path, form: str) -> None:
    folder = tmp_path / "a b %41 100% größe 位置#1"
    folder.symlink_to(folders("ReferenceTrajectory"), target_is_directory=True)
    path = folder / "resources"
    uri = {
        "uri": path.as_uri(),
        "one slash": path.as_uri().replace("file:///", "file:/"),
        "localhost": path.as_uri().replace("file:///", "FILE://localhost/") + "/",
        "plain path": str(path),
        "spaces not encoded": path.as_uri().replace("%20", " "),
    }[form]
    fmu = library_of(folders("ReferenceTrajectory"))
    component = fmu.instantiate(resources=uri)
    assert component is not None
    assert fmu.EnterInitializationMode(component) == OK
    assert fmu.ExitInitializationMode(component) == OK, fmu.messages
    for k in range(200):
        assert fmu.DoStep(component, k * 1e-3, 1e-3, 1) == OK
    assert fmu.get(component, "r") == pytest.approx(0.01, abs=1e-9)
    fmu.FreeInstance(component)
    assert not fmu.blocks


def test_missing_resources_are_told_when_they_are_needed(folders: Callable[[str], Path], tmp_path: Path) -> None:
    shutil.copy(folders("ReferenceTrajectory") / "resources" / "variables.bin", tmp_path)
    fmu = library_of(folders("ReferenceTrajectory"))
    component = fmu.instantiate(resources=tmp_path.as_uri())
    assert fmu.EnterInitializationMode(component) == OK
    assert fmu.ExitInitializationMode(component) == ERROR
    assert f"trajectory_0.bin must be in the resources ({tmp_path}/) and readable" in fmu.messages[-1][2]
    fmu.FreeInstance(component)


def test_a_location_that_is_no_uri_of_a_file_is_not_used(folders: Callable[[str], Path]) -> None:
    fmu = library_of(folders("ReferenceTrajectory"))
    component = fmu.instantiate(resources="http://example.org/%s")
    assert "must be a file: URI on this machine, got http://example.org/%%s" in fmu.messages[-1][2]
    assert fmu.EnterInitializationMode(component) == OK
    assert fmu.ExitInitializationMode(component) == OK  # those beside the library are
    fmu.FreeInstance(component)


def test_a_resource_that_grows_during_the_initialization_is_refused(
    folders: Callable[[str], Path], tmp_path: Path
) -> None:
    """The importer's own allocation is what happens between the two looks at the file."""
    resources = shutil.copytree(folders("ReferenceTrajectory") / "resources", tmp_path / "resources")
    file = resources / "trajectory_0.bin"
    content = file.read_bytes()
    count = int.from_bytes(content[8:16], "little")
    longer = content[:8] + (count + 4000).to_bytes(8, "little") + content[16:] + content[-8:] * 4000
    fmu = library_of(folders("ReferenceTrajectory"))

    def growing(number: int, size: int) -> int | None:
        if number * size > 8 * count:  # the state's block
            file.write_bytes(longer)
        return fmu.callbacks.allocate(number, size)  # type: ignore[no-any-return]

    callbacks = Callbacks(fmu.callbacks.logger, Allocate(growing), fmu.callbacks.free, None, None)
    component = fmu.instantiate(resources=resources.as_uri(), callbacks=callbacks)
    assert component is not None
    assert fmu.EnterInitializationMode(component) == OK
    assert fmu.ExitInitializationMode(component) == ERROR
    assert "has changed meanwhile: initialise again" in fmu.messages[-1][2]
    assert fmu.ExitInitializationMode(component) == OK  # it has changed for good
    fmu.FreeInstance(component)
    assert not fmu.blocks


def test_uris_of_windows(tmp_path: Path) -> None:
    root = C_SOURCES / "fmi"
    library = tmp_path / "uri.so"
    run_compiler(["-shared", "-fPIC", "-O1", *include_flags(), "-o", library, root / "hsep_uri.c"])
    convert = ctypes.CDLL(str(library)).hsep_uri_folder
    for uri, windows, expected in (
        ("file:///C:/a%20b/resources", 1, "C:/a b/resources/"),
        ("file:/c|/x/", 1, "c:/x/"),
        ("file://server/share/x", 1, "//server/share/x/"),
        ("file://server/share/x", 0, None),
        ("C:\\x\\", 1, "C:\\x\\"),
        ("file:///C:/x", 0, "/C:/x/"),
        ("file:///a%2", 0, "/a%2/"),
        ("file:///a%00b", 0, None),
        ("file:", 0, None),
        ("", 0, None),
    ):
        folder = ctypes.create_string_buffer(len(uri) + 2)
        assert convert(uri.encode(), windows, folder) == (expected is not None)
        if expected is not None:
            assert folder.value.decode() == expected
