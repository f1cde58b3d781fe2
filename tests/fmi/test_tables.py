"""Tables of native FMUs: one library for all FMUs of a kind, which reads what it is from the resources."""

from __future__ import annotations

import shutil
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import fuzz_tables
import pytest
from built_once import BuiltFmus
from c_compiler import needs_sanitisers
from fmi2_driving import library_of, steps
from fmi2_library import OK, Library

from hybridsep.fmi.c_header import c_sources, fmi_headers
from hybridsep.fmi.compile import TARGETS, compiled, compiler_for, host_target

SANITIZERS = ("-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")

HEAD = 96
"""Bytes before the start values."""

Folders = Callable[[str], Path]


def test_a_kind_has_one_library(fmus: BuiltFmus) -> None:
    """Of drives there are two kinds, with modes and without."""
    libraries = {}
    for name in (
        "HybridPredictor",
        "HybridPredictor_emps",
        "FeedDrive",
        "FeedDrive_als25010_x",
        "FeedDrive_als25010_y",
    ):
        with zipfile.ZipFile(fmus(name)) as archive:
            libraries[name] = archive.read(f"binaries/{TARGETS[host_target()].folder}/{name}.so")
    assert libraries["HybridPredictor"] == libraries["HybridPredictor_emps"]
    assert libraries["FeedDrive_als25010_x"] == libraries["FeedDrive_als25010_y"]
    assert len(set(libraries.values())) == 3


def trace(library: Library, resources: Path) -> list[bytes]:
    """Return all Reals of an instance while it steps, and its state at the end."""
    component = library.instantiate(resources=resources.as_uri())
    assert component is not None
    assert library.EnterInitializationMode(component) == OK
    found = [library.reals(component)]
    assert library.ExitInitializationMode(component) == OK
    for k in range(0, 700, 50):
        if "x_meas" in library.causalities and library.causalities["x_meas"] == "input":
            steps(library, component, k, k + 50)
        else:
            for i in range(k, k + 50):
                assert library.set(component, "x_d", 1e-3 * (i % 100)) == OK
                assert library.DoStep(component, i * 1e-3, 1e-3, 1) == OK
        found.append(library.reals(component))
    found.append(library.save(component))
    library.FreeInstance(component)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param("HybridPredictor", marks=pytest.mark.nightly), "FeedDrive_als25010_x"])
def test_a_table_is_what_the_header_is(folders: Folders, tmp_path: Path, name: str) -> None:
    """The library with a compiled-in table has the same outputs and states, bit for bit."""
    folder = folders(name)
    sources = {path.name: path.read_bytes() for path in (folder / "sources").iterdir() if path.suffix in (".c", ".h")}
    job = (name, host_target())
    own = tmp_path / f"{name}.so"
    own.write_bytes(dict(compiled({job: (compiler_for(host_target()), {**sources, **fmi_headers()})}))[job])
    compiled_in = Library(own, folder / "modelDescription.xml")
    assert trace(library_of(folder), folder / "resources") == trace(compiled_in, folder / "resources")


@pytest.mark.parametrize(
    ("location", "warned"),
    [
        (None, ""),
        ("", "must be a file: URI on this machine"),
        ("file:", "must be a file: URI on this machine"),
        ("http://example.org/x", "must be a file: URI on this machine"),
        (
            "file:///nowhere/at/all",
            "fmuResourceLocation, that beside the library is used; got /nowhere/at/all/",
        ),
    ],
)
def test_resources_are_found_beside_the_library(folders: Folders, location: str | None, warned: str) -> None:
    library = library_of(folders("HybridPredictor_emps"))
    component = library.instantiate(resources=location)
    assert component is not None
    assert [message for _, _, message in library.messages if (warned and warned in message) or not warned] == [
        message for _, _, message in library.messages
    ]
    assert bool(library.messages) == bool(warned)
    library.FreeInstance(component)
    assert not library.blocks


def test_the_path_of_the_library_may_have_any_letters(folders: Folders, tmp_path: Path) -> None:
    folder = tmp_path / "a b %41 100% größe 位置#1"
    shutil.copytree(folders("FeedDrive"), folder)
    library = library_of(folder)
    component = library.instantiate(resources=None)
    assert component is not None
    library.FreeInstance(component)


def test_without_a_table_the_folders_are_named(folders: Folders, tmp_path: Path) -> None:
    folder = folders("FeedDrive")
    alone = shutil.copy(next((folder / "binaries" / "linux64").iterdir()), tmp_path)
    library = Library(Path(alone), folder / "modelDescription.xml")
    assert library.instantiate(resources="file:///no/such") is None
    (_, _, message) = library.messages[-1]
    assert message.startswith("fmi2Instantiate: there is no variables.bin, which must be in the FMU's resources; ")
    assert message.endswith(f"; beside the library: {tmp_path}/../../resources/; fmuResourceLocation: /no/such/")
    assert not library.blocks


def with_checksum(table: bytes) -> bytes:
    return table[:-8] + struct.pack("<Q", zlib.crc32(table[:-8]))


def changed(table: bytes, place: int, form: str, value: float) -> bytes:
    """Return a table with one number changed and the checksum that fits."""
    content = bytearray(table)
    struct.pack_into(f"<{form}", content, place, value)
    return with_checksum(bytes(content))


@pytest.mark.parametrize(
    ("mutate", "message"),
    [
        (lambda table: b"", "it is no such file"),
        (lambda table: b"HSEPVAR1" + table[8:], "it is no such file"),
        (lambda table: table[:40], "it is no such file"),
        (lambda table: changed(table, 16, "Q", 5), "of another kind of FMU or another version than this library"),
        (lambda table: table[:-8], "it is damaged or truncated"),
        (lambda table: table + bytes(8), "it is damaged or truncated"),
        (lambda table: changed(table, 8, "Q", 5), "it is damaged or truncated"),
        (lambda table: changed(table, 24, "Q", 0), "it is damaged or truncated"),
        (lambda table: changed(table, 24, "Q", 2**62), "it is damaged or truncated"),
        (lambda table: changed(table, 32, "Q", 2), "it is damaged or truncated"),
        (lambda table: changed(table, 48, "Q", 0), "it is damaged or truncated"),
        (lambda table: changed(table, 88, "Q", 2**64 - 1), "it is damaged or truncated"),
        (lambda table: changed(table, 40, "Q", 99), "its windows must be of Np samples, or left out"),
        (lambda table: table[:HEAD] + b"\1" + table[HEAD + 1 :], "it is damaged: the checksum differs"),
        (lambda table: table[:53] + b"x" + table[54:], "it is damaged: the checksum differs"),
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


def test_a_table_of_another_fmu_has_another_guid(folders: Folders) -> None:
    library = library_of(folders("HybridPredictor"))
    assert library.instantiate(resources=(folders("HybridPredictor_emps") / "resources").as_uri()) is None
    assert "fmuGUID must be {" in library.messages[-1][2]
    assert library.instantiate(resources=(folders("FeedDrive") / "resources").as_uri()) is None
    assert "it is of another kind of FMU" in library.messages[-1][2]


@pytest.mark.slow
@needs_sanitisers
@pytest.mark.parametrize("kind", ["HybridPredictor", pytest.param("StageDrive", marks=pytest.mark.nightly)])
def test_mutated_tables_under_sanitizers(tmp_path: Path, kind: str) -> None:
    """``python tests/support/fuzz_tables.py`` has all kinds, and goes on for longer."""
    held, said = fuzz_tables.fuzz(kind, tmp_path, 1000)
    assert held, said


@pytest.mark.slow
@needs_sanitisers
def test_the_fuzzer_finds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A table that is taken without its checksum is a finding."""
    sources = dict(c_sources())
    text = sources["hsep_table_file.c"].decode()
    assert "sum == hsep_crc(" in text
    sources["hsep_table_file.c"] = text.replace("sum == hsep_crc(", "sum != UINT64_C(1) + hsep_crc(").encode()
    monkeypatch.setattr(fuzz_tables, "c_sources", lambda: sources)
    held, said = fuzz_tables.fuzz("FeedDrive", tmp_path, 3000)
    assert not held
    assert "a damaged table was taken" in said
