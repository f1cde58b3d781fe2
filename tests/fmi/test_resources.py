"""Resources of native FMUs: where they are found, the table that tells a library which FMU it is, files that change."""

import ctypes
import shutil
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import pytest
from built_once import BuiltFmus
from c_compiler import C_SOURCES, include_flags, run_compiler
from fmi_library import ERROR, OK, library_of

from hybridsep.fmi.compile import TARGETS, host_target

Folders = Callable[[str], Path]

HEAD = 96  # bytes of a table before the start values


@pytest.mark.parametrize(
    ("version", "form", "warned"),
    [
        *(
            ("", form, "")
            for form in ("{uri}", "{uri_with_one_slash}", "FILE://localhost{quoted}/", "{path}", "{spaces}")
        ),
        *(("", form, "must be a file: URI on this machine") for form in ("", "file:")),
        ("", "http://example.org/%s", "must be a file: URI on this machine, got http://example.org/%%s"),
        ("", "file:///nowhere/at/all", "fmuResourceLocation, that beside the library is used; got /nowhere/at/all/"),
        *((version, None, "") for version in ("", "Fmi3")),
        *(("Fmi3", form, "") for form in ("{path}/", "{path}")),
        ("Fmi3", "", "resourcePath must be a folder on this machine"),
        ("Fmi3", "/nowhere/at/all", "no variables.bin in resourcePath"),
        ("Fmi3", "http://example.org/%s", "resourcePath must be a folder on this machine"),
    ],
)
def test_resources_are_found_where_they_are_said_or_beside_the_library(
    folders: Folders, tmp_path: Path, version: str, form: str | None, warned: str
) -> None:
    folder = tmp_path / "a b %41 100% größe 位置#1 :// x"
    folder.parent.mkdir(parents=True, exist_ok=True)
    shutil.copytree(folders(f"ReferenceTrajectory{version}"), folder)
    path, fmu = folder / "resources", library_of(folder)
    uri = path.as_uri()
    forms = {"uri": uri, "uri_with_one_slash": uri.replace("///", "/"), "quoted": uri.removeprefix("file://")}
    forms["spaces"] = uri.replace("%20", " ")
    instance = fmu.instantiate(resources=None if form is None else form.format(**forms, path=path))
    assert instance is not None, fmu.messages
    assert len(fmu.messages) == bool(warned)
    assert all(warned in message for _, _, message in fmu.messages)
    assert fmu.begin(instance) == fmu.ExitInitializationMode(instance) == OK
    for k in range(200):
        assert fmu.do_step(instance, k * 1e-3, 1e-3) == OK
    assert fmu.get(instance, "r") == pytest.approx(0.01, abs=1e-9)
    fmu.FreeInstance(instance)
    assert not fmu.blocks


def test_uris_of_windows(tmp_path: Path) -> None:
    library = tmp_path / "uri.so"
    sources = [C_SOURCES / "model" / f"hsep_{one}.c" for one in ("resource", "text")]
    run_compiler(["-shared", "-fPIC", "-O1", *include_flags(), "-o", library, *sources])
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
        found = folder.value.decode() if convert(uri.encode(), windows, folder) else None
        assert found == expected


# The table ---------------------------------------------------------------------------------------------------------


def test_a_kind_has_one_library(fmus: BuiltFmus) -> None:
    """Of drives there are two kinds, with modes and without."""
    libraries = {}
    kinds = (("HybridPredictor", "HybridPredictor_emps"), ("FeedDrive_als25010_x", "FeedDrive_als25010_y"))
    for name in ("FeedDrive", *kinds[0], *kinds[1]):
        with zipfile.ZipFile(fmus(name)) as archive:
            libraries[name] = archive.read(f"binaries/{TARGETS[host_target()].folder}/{name}.so")
    assert all(libraries[one] == libraries[other] for one, other in kinds)
    assert len(set(libraries.values())) == 3


def test_without_a_table_the_folders_are_named(folders: Folders, tmp_path: Path) -> None:
    shutil.copytree(folders("FeedDrive"), tmp_path / "fmu")
    shutil.rmtree(tmp_path / "fmu" / "resources")
    library = library_of(tmp_path / "fmu")
    assert library.instantiate(resources="file:///no/such") is None
    (_, _, message) = library.messages[-1]
    assert message.startswith("fmi2Instantiate: there is no variables.bin, which must be in the FMU's resources; ")
    beside = f"{tmp_path}/fmu/binaries/linux64/../../resources/"
    assert message.endswith(f"; beside the library: {beside}; fmuResourceLocation: /no/such/")
    assert not library.blocks


def changed(table: bytes, place: int, form: str, value: float) -> bytes:
    """Return a table with one number changed and the checksum that fits."""
    content = bytearray(table)
    struct.pack_into(f"<{form}", content, place, value)
    return bytes(content[:-8]) + struct.pack("<Q", zlib.crc32(content[:-8]))


@pytest.mark.parametrize(
    ("mutate", "message"),
    [
        (lambda table: b"", "it is no such file"),
        (lambda table: b"HSEPVAR1" + table[8:], "it is no such file"),
        (lambda table: changed(table, 16, "Q", 5), "of another kind of FMU or another version than this library"),
        (lambda table: table[:-8], "it is damaged or truncated"),
        (lambda table: table + bytes(8), "it is damaged or truncated"),
        (lambda table: changed(table, 8, "Q", 5), "it is damaged or truncated"),
        (lambda table: changed(table, 24, "Q", 2**62), "it is damaged or truncated"),
        (lambda table: changed(table, 40, "Q", 99), "its windows must be of Np samples, or left out"),
        (lambda table: table[:HEAD] + b"\1" + table[HEAD + 1 :], "it is damaged: the checksum differs"),
        (lambda table: changed(table, HEAD, "d", float("nan")), "a start value is not finite"),
        (lambda table: changed(table, HEAD + 8 * 13, "d", 0.0), "Np must be 1 … 100000, got 0"),
        (lambda table: changed(table, HEAD + 8 * 13, "d", 1.5), "Np must be a whole number, got 1.5"),
        (lambda table: changed(table, len(table) - 40, "d", -1.0), "mode[1].f_n must be 0.001 … 100000 Hz, got -1.0"),
    ],
)
def test_a_bad_table_is_refused(
    folders: Folders, tmp_path: Path, mutate: Callable[[bytes], bytes], message: str
) -> None:
    folder = folders("HybridPredictor")
    (tmp_path / "variables.bin").write_bytes(mutate((folder / "resources" / "variables.bin").read_bytes()))
    library = library_of(folder)
    assert library.instantiate(resources=tmp_path.as_uri()) is None
    said = library.messages[-1][2].replace("%%", "%")
    assert said.startswith("fmi2Instantiate: variables.bin must be the table of this FMU: ")
    assert message in said
    assert said.endswith(f"; got {tmp_path}/")
    assert not library.blocks


# Other files -------------------------------------------------------------------------------------------------------


def test_missing_resources_are_told_when_they_are_needed(folders: Folders, tmp_path: Path) -> None:
    shutil.copy(folders("ReferenceTrajectory") / "resources" / "variables.bin", tmp_path)
    fmu = library_of(folders("ReferenceTrajectory"))
    instance = fmu.instantiate(resources=tmp_path.as_uri())
    assert fmu.begin(instance) == OK
    assert fmu.ExitInitializationMode(instance) == ERROR
    assert f"trajectory_0.bin must be in the resources ({tmp_path}/) and readable" in fmu.messages[-1][2]
    fmu.FreeInstance(instance)


@pytest.mark.parametrize(
    ("more", "said"), [(4000, "has changed meanwhile"), (-1, "has changed meanwhile"), (0, ""), (None, "it is damaged")]
)
def test_a_resource_that_changes_during_the_initialization(
    folders: Folders, tmp_path: Path, more: int | None, said: str
) -> None:
    """The importer's own allocation is what happens between the two looks at the file."""
    resources = shutil.copytree(folders("ReferenceTrajectory") / "resources", tmp_path / "resources")
    file = resources / "trajectory_0.bin"
    content = file.read_bytes()
    count = int.from_bytes(content[8:16], "little")
    n = count + (more or 0)
    other = content[:8] + n.to_bytes(8, "little") + content[16:24] + (content[24:] + content[-8:] * 4000)[: 8 * n]
    fmu = library_of(folders("ReferenceTrajectory"))

    def changing(number: int, size: int) -> int | None:
        if number * size > 8 * count:  # the state's block
            file.write_bytes(b"" if more is None else other)
        return fmu.callbacks.allocateMemory(number, size)  # type: ignore[no-any-return]

    callbacks = fmu.with_memory(changing)
    instance = fmu.instantiate(resources=resources.as_uri(), callbacks=callbacks)
    assert fmu.begin(instance) == OK
    assert fmu.ExitInitializationMode(instance) == (ERROR if said else OK)
    if said:
        assert said in fmu.messages[-1][2]
    if more:
        assert fmu.ExitInitializationMode(instance) == OK  # it has changed for good
    fmu.FreeInstance(instance)
    assert not fmu.blocks
