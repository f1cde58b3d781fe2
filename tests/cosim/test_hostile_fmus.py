"""Damaged and malicious FMUs: refused in one line before anything of them is unpacked or loaded, or run apart."""

from __future__ import annotations

import os
import signal
import stat
import struct
import tempfile
import warnings
import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from built_once import BuiltFmus
from command_line import Run

from hybridsep import FmuInstance
from hybridsep.base.apart import run_apart
from hybridsep.base.errors import FmuError, LogError
from hybridsep.cosim.binary_check import check_binary
from hybridsep.cosim.importer import faulty

Change = Callable[[bytes], bytes]


@pytest.fixture(scope="module")
def native(fmus: BuiltFmus) -> Path:
    return fmus("FeedDrive")


@pytest.fixture
def hybridsep(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    return Run(monkeypatch, capsys)


@pytest.fixture
def nothing_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for temporary files, in which none may be left."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def changed(archive: Path, target: Path, changes: dict[str, Change]) -> Path:
    """Copy an archive with other content of the members whose names end so."""
    with zipfile.ZipFile(archive) as old, zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            content = old.read(name)
            for ending, change in changes.items():
                content = change(content) if name.endswith(ending) else content
            new.writestr(name, content)
    return target


def with_member(archive: Path, target: Path, member: str | zipfile.ZipInfo, content: bytes = b"") -> Path:
    target.write_bytes(archive.read_bytes())
    with zipfile.ZipFile(target, "a", zipfile.ZIP_DEFLATED) as new, warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of a member that occurs twice
        new.writestr(member, content)
    return target


def link(name: str) -> zipfile.ZipInfo:
    member = zipfile.ZipInfo(name)
    member.create_system, member.external_attr = 3, (stat.S_IFLNK | 0o777) << 16
    return member


# Archives -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("member", "message"),
    [
        ("../evil", r"member '\.\./evil' has a path out of the archive"),
        ("resources/../../evil", "has a path out of the archive"),
        ("/tmp/evil", "member '/tmp/evil' has a path out of the archive"),
        ("C:/evil", "has a path with a drive or a backslash"),
        ("resources\\evil", "has a path with a drive or a backslash"),
        ("resources/a\nb", r"member 'resources/a\\nb' has a name that cannot be printed"),
        (link("resources/link"), "member 'resources/link' is a link or a device"),
        ("modelDescription.xml", "member 'modelDescription.xml' occurs twice"),
        ("modelDescription.xml/evil", "member 'modelDescription.xml' is file and folder"),
        (f"resources/{'x' * 9000}/../y", r"member 'resources/x{49}… \(9017 characters\) has a path out"),
    ],
)
@pytest.mark.usefixtures("nothing_left")
def test_members_that_must_not_be_unpacked(
    native: Path, tmp_path: Path, nothing_left: Path, member: str | zipfile.ZipInfo, message: str
) -> None:
    path = with_member(native, tmp_path / "Evil.fmu", member, b"/etc/passwd")
    with pytest.raises(FmuError, match=rf"Evil\.fmu must not be unpacked: its .*{message}"):
        FmuInstance(path)
    assert not list(nothing_left.iterdir())


@pytest.mark.slow
def test_a_bomb_is_not_unpacked(native: Path, tmp_path: Path, nothing_left: Path) -> None:
    path = with_member(native, tmp_path / "Bomb.fmu", "resources/zeros", bytes(150 * 2**20))
    with pytest.raises(FmuError, match=r"Bomb\.fmu must not be unpacked: its 0\.\d MB become 15\d MB, more than any"):
        FmuInstance(path)
    assert not list(nothing_left.iterdir())


def test_encrypted_and_foreign_methods(native: Path, tmp_path: Path) -> None:
    content = native.read_bytes()
    with zipfile.ZipFile(native) as archive:
        place = content.index(b"PK\x01\x02")
        first = archive.infolist()[0].filename
    for offset, value, message in ((8, 1, "is encrypted"), (10, 97, "is packed by method 97; FMI allows 0 .* and 8")):
        path = tmp_path / "Odd.fmu"
        path.write_bytes(content[: place + offset] + bytes([value]) + content[place + offset + 1 :])
        with pytest.raises(FmuError, match=rf"its member '{first}' {message}"):
            FmuInstance(path)


def test_archives_that_are_none(native: Path, tmp_path: Path) -> None:
    content, path = native.read_bytes(), tmp_path / "Cut.fmu"
    for kept in (0, 10, len(content) // 2, len(content) - 30):
        path.write_bytes(content[:kept])
        with pytest.raises(FmuError, match=r"Cut\.fmu is not a readable FMU: "):
            FmuInstance(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("readme.txt", "")
    with pytest.raises(FmuError, match=r"Cut\.fmu is not a readable FMU: it has no modelDescription\.xml"):
        FmuInstance(path)


# Descriptions -------------------------------------------------------------------------------------------------------

LAUGHS = "".join(f'<!ENTITY a{i + 1} "{f"&a{i};" * 10}">' for i in range(9))
BOMB = f'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a0 "ha">{LAUGHS}]><fmiModelDescription>&a9;</fmiModelDescription>'
FMI_3_1 = (
    '<?xml version="1.0"?><fmiModelDescription fmiVersion="3.1" modelName="m" instantiationToken="{}">'
    '<CoSimulation modelIdentifier="m"/><ModelVariables><Float64 name="x" valueReference="1"/></ModelVariables>'
    "</fmiModelDescription>"
)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda _: FMI_3_1.encode(), r"Odd\.fmu must be an FMI 2\.0 or 3\.0 FMU, got FMI 3\.1"),
        (lambda _: BOMB.encode(), r"Odd\.fmu must not be loaded: its description has a DOCTYPE"),
        (lambda _: BOMB.encode("utf-16"), r"Odd\.fmu must not be loaded: its description has a DOCTYPE"),
        (lambda _: b"<a>" * 100_000, r"its description is an XML file|nested more than 50 deep"),
        (lambda _: b"<html></html>", r"its description is an XML file of 'html'"),
        (lambda _: b"", r"Odd\.fmu is not a readable FMU: its description is no XML: no element found"),
        (lambda xml: xml[:-40], r"its description is no XML: "),
        (lambda _: b'<?xml version="1.0" encoding="klingon"?><a/>', r"its description is no XML: unknown encoding"),
        (
            lambda xml: xml.replace(b'fmiVersion="2.0"', b'fmiVersion="1.0"'),
            r"must be an FMI 2\.0 or 3\.0 FMU, got FMI 1\.0",
        ),
        (lambda xml: xml.replace(b"fmiVersion", b"version1"), r"must be an FMI 2\.0 or 3\.0 FMU, got FMI none"),
        (lambda xml: xml.replace(b"CoSimulation", b"ModelExchange"), r"must be a co-simulation FMU"),
        (lambda xml: xml.replace(b"<ModelVariables>", b"<Variables>"), r"is no XML: mismatched tag"),
    ],
)
def test_descriptions(native: Path, tmp_path: Path, change: Change, message: str) -> None:
    path = changed(native, tmp_path / "Odd.fmu", {"modelDescription.xml": change})
    with pytest.raises(FmuError, match=message) as caught:
        FmuInstance(path)
    assert len(str(caught.value)) < 300
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("identifier", ["../../evil", "/tmp/evil", "", "a b", "1a", "a" * 201, "Ä", "a.so"])
def test_a_model_identifier_is_a_name_in_c(native: Path, tmp_path: Path, identifier: str) -> None:
    attribute = f'modelIdentifier="{identifier}"'.encode()
    path = changed(
        native,
        tmp_path / "Evil.fmu",
        {"modelDescription.xml": lambda xml: xml.replace(b'modelIdentifier="FeedDrive"', attribute)},
    )
    with pytest.raises(FmuError, match=r"Evil\.fmu must not be loaded: its modelIdentifier must be a name in C, got '"):
        FmuInstance(path)


# Libraries ----------------------------------------------------------------------------------------------------------


def beginning(kept: float, content: bytes) -> bytes:
    return content[: int(kept * len(content))]


@pytest.mark.slow
def test_truncated_libraries(native: Path, tmp_path: Path, hybridsep: Run, nothing_left: Path) -> None:
    """A truncated library ended the process by SIGBUS."""
    for kept in (0.0, 0.0005, 0.3, 0.7, 0.999):
        path = changed(native, tmp_path / "Cut.fmu", {".so": partial(beginning, kept)})
        with pytest.raises(FmuError, match=r"Cut\.fmu cannot be loaded: binaries/linux64/FeedDrive\.so is (no|trunc)"):
            FmuInstance(path)
    status, _, err = hybridsep("cosim", "--plant", path, "--flavour", "python")
    assert status == 2
    assert len(err.strip().splitlines()) == 1
    assert "is truncated" in err
    assert not list(nothing_left.iterdir())


def test_libraries_of_other_platforms(native: Path, tmp_path: Path) -> None:
    other = changed(native, tmp_path / "Other.fmu", {".so": lambda so: so[:18] + b"\xb7\0" + so[20:]})
    with pytest.raises(FmuError, match=r"FeedDrive\.so is for ARM64, this computer needs ELF for x86-64"):
        FmuInstance(other)
    object_file = changed(native, tmp_path / "Object.fmu", {".so": lambda so: so[:16] + b"\1\0" + so[18:]})
    with pytest.raises(FmuError, match=r"FeedDrive\.so is no shared ELF library, but of type 1"):
        FmuInstance(object_file)
    with zipfile.ZipFile(native) as old, zipfile.ZipFile(tmp_path / "Far.fmu", "w") as new:
        for name in old.namelist():
            new.writestr(name.replace("linux64", "darwin64"), old.read(name))
    with pytest.raises(FmuError, match=r"linux64/FeedDrive\.so is missing, there are binaries for darwin64"):
        FmuInstance(tmp_path / "Far.fmu")


def test_libraries_of_all_formats(fmus: BuiltFmus, tmp_path: Path) -> None:
    """As pythonfmu brings them along: intact ones pass, truncated ones do not."""
    with zipfile.ZipFile(fmus("FeedDrivePy")) as archive:
        binaries = {name: archive.read(name) for name in archive.namelist() if name.startswith("binaries/")}
    systems = {"linux64": "Linux", "win64": "Windows"}
    for name, content in binaries.items():
        system = systems[name.split("/")[1]]
        path = tmp_path / "library"
        path.write_bytes(content)
        check_binary(path, system, "x86_64")
        with pytest.raises(ValueError, match=r"is for x86-64, this computer needs .* for riscv"):
            check_binary(path, system, "riscv")
        for kept in np.linspace(0.0, 0.95, 20):
            path.write_bytes(content[: int(kept * len(content))])
            with pytest.raises(ValueError, match=r"is (truncated|no )"):
                check_binary(path, system, "x86_64")
    assert len(binaries) == len(systems)


def macho(cpu: int, end: int) -> bytes:
    segment = struct.pack("<2I16s4Q4I", 0x19, 72, b"__TEXT", 0, 4096, 0, end, 5, 5, 0, 0)
    return (struct.pack("<8I", 0xFEEDFACF, cpu, 3, 6, 1, len(segment), 0, 0) + segment).ljust(4096, b"\0")


def test_mach_o(tmp_path: Path) -> None:
    path, thin = tmp_path / "library", macho(0x0100000C, 4096)
    path.write_bytes(thin)
    check_binary(path, "Darwin", "arm64")
    universal = struct.pack(">7I", 0xCAFEBABE, 1, 0x0100000C, 0, 4096, 4096, 12).ljust(4096, b"\0") + thin
    path.write_bytes(universal)
    check_binary(path, "Darwin", "arm64")
    for damaged, message in (
        (universal[:-1], "is truncated: its libraries end at byte 8192, the file has 8191"),
        (macho(0x0100000C, 4097), "is truncated: its segments end at byte 4097, the file has 4096"),
        (macho(0x01000007, 4096), "is for x86-64, this computer needs Mach-O for ARM64"),
        (universal[:4] + b"\xff" * 4, "would have 4294967295 processors"),
        (thin[:20], "its 20 bytes end within a header"),
        (thin[:36] + b"\xff" + thin[37:], "a load command is longer than all of them"),
    ):
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match=message):
            check_binary(path, "Darwin", "arm64")


# Runs apart ---------------------------------------------------------------------------------------------------------


def die() -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def fail(path: str) -> None:
    raise LogError(f"{path}: {tempfile.gettempdir()}")


def count(n: int, progress: Callable[[int, int], object]) -> list[int]:
    for k in range(n):
        progress(k, n)
    print("on standard error, as results go over standard output")
    return list(range(n))


@pytest.mark.slow
def test_a_run_apart(nothing_left: Path) -> None:
    seen: list[tuple[int, int]] = []
    assert run_apart(faulty("x.fmu"), count, 3, progress=lambda *done: seen.append(done)) == [0, 1, 2]
    assert seen == [(0, 3), (1, 3), (2, 3)]
    with pytest.raises(LogError, match=rf"a log: {nothing_left}/tmp"):
        run_apart(faulty("x.fmu"), fail, "a log")
    with pytest.raises(FmuError, match=r"x\.fmu ended its process with SIGSEGV: its library is faulty"):
        run_apart(faulty("x.fmu"), die)
    with pytest.raises(FmuError, match=r"x\.fmu ended its process with status 7"):
        run_apart(faulty("x.fmu"), os._exit, 7)
    assert not list(nothing_left.iterdir())


def offset_of(library: bytes, function: bytes) -> int:
    """Return where a function's instructions begin in an ELF library."""
    (sections,) = struct.unpack_from("<Q", library, 40)
    size, n = struct.unpack_from("<HH", library, 58)
    headers = [struct.unpack_from("<IIQQQQIIQQ", library, sections + i * size) for i in range(n)]
    _, _, _, _, symbols, length, names, *_ = next(header for header in headers if header[1] == 11)  # .dynsym
    name = library.index(b"\0" + function + b"\0", headers[names][4]) + 1 - headers[names][4]
    for place in range(symbols, symbols + length, 24):
        found, _, _, section, address, _ = struct.unpack_from("<IBBHQQ", library, place)
        if found == name:
            return int(address - headers[section][3] + headers[section][4])
    raise LookupError(function)


def test_a_missing_function_is_named(native: Path, tmp_path: Path) -> None:
    path = changed(native, tmp_path / "Odd.fmu", {".so": lambda so: so.replace(b"fmi2DoStep\0", b"fmi2DoStop\0")})
    with pytest.raises(FmuError, match=r"Odd\.fmu cannot be loaded: .*undefined symbol: fmi2DoStep"):
        FmuInstance(path)


@pytest.mark.slow
def test_a_library_that_crashes_is_one_line(native: Path, tmp_path: Path, hybridsep: Run, nothing_left: Path) -> None:
    """The first instructions of a step are an invalid one: headers and symbols are intact."""

    def spoil(content: bytes) -> bytes:
        place = offset_of(content, b"fmi2DoStep")
        return content[:place] + b"\x0f\x0b" * 4 + content[place + 8 :]

    path = changed(native, tmp_path / "Crash.fmu", {".so": spoil})
    status, out, err = hybridsep("cosim", "--plant", path, "--flavour", "python")
    assert (status, out) == (2, "")
    assert err.strip() == "error: Crash.fmu ended its process with SIGILL: its library is faulty"
    assert not list(nothing_left.iterdir())
