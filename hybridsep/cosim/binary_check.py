"""Checks of a shared library before it is loaded: format, processor, and that the file holds what its headers say.

A truncated library is mapped all the same, and ends the process by SIGBUS where it is read beyond its end.
"""

from __future__ import annotations

import platform
import struct
from collections.abc import Callable
from pathlib import Path

__all__ = ["check_binary"]

_X86_64, _ARM64 = "x86-64", "ARM64"
_PROCESSORS = {"x86_64": _X86_64, "amd64": _X86_64, "aarch64": _ARM64, "arm64": _ARM64}
"""Processors by :func:`platform.machine`, in small letters."""

_ELF_MACHINES = {62: _X86_64, 183: _ARM64, 3: "x86", 40: "ARM", 243: "RISC-V"}
_PE_MACHINES = {0x8664: _X86_64, 0xAA64: _ARM64, 0x14C: "x86"}
_MACHO_MACHINES = {0x01000007: _X86_64, 0x0100000C: _ARM64}

_ELF_SHARED, _ELF_LOAD, _ELF_DYNAMIC = 3, 1, 2
_MACHO_64, _MACHO_FAT, _MACHO_SEGMENT = 0xFEEDFACF, 0xCAFEBABE, 0x19
_PARTS_MAX = 64
"""Most processors of a universal Mach-O file; Java's class files begin with the same number."""


def check_binary(path: Path, system: str | None = None, machine: str | None = None) -> None:
    """Check a shared library's headers.

    Parameters
    ----------
    path : Path
    system, machine : str, optional
        As :func:`platform.system` and :func:`platform.machine` name them; this computer's if left out.

    Raises
    ------
    ValueError
        If it is none for this computer, or truncated.
    """
    system, machine = system or platform.system(), (machine or platform.machine()).lower()
    reader, kind = _READERS.get(system, (_elf, "ELF"))
    content = path.read_bytes()
    try:
        processors = reader(content)
    except struct.error:
        raise ValueError(f"is truncated: its {len(content)} bytes end within a header") from None
    wanted = _PROCESSORS.get(machine, machine)
    if wanted not in processors:
        raise ValueError(
            f"is for {' and '.join(processors) or 'no known processor'}, this computer needs {kind} for {wanted}"
        )


def _elf(content: bytes) -> list[str]:
    """Return the processor of an ELF library."""
    if content[:4] != b"\x7fELF":
        raise ValueError(f"is no ELF library: it begins with {content[:4]!r}")
    if content[4:6] != b"\x02\x01":
        raise ValueError("is no 64-bit little-endian ELF library")
    kind, machine, _, _, programs, sections, _, _, size, n, section_size, n_sections = struct.unpack_from(
        "<HHIQQQIHHHHH", content, 16
    )
    if kind != _ELF_SHARED:
        raise ValueError(f"is no shared ELF library, but of type {kind}")
    _within(content, sections, section_size * n_sections, "section headers")
    if size != 56 and n:
        raise ValueError(f"is damaged: its program headers must have 56 bytes, got {size}")
    kinds = set()
    for i in range(n):
        part, _, offset, _, _, in_file, in_memory, _ = struct.unpack_from("<IIQQQQQQ", content, programs + size * i)
        kinds.add(part)
        if part in (_ELF_LOAD, _ELF_DYNAMIC):
            _within(content, offset, in_file, "segments")
            if in_memory < in_file:
                raise ValueError(f"is damaged: a segment of {in_file} bytes takes {in_memory} in memory")
    if not {_ELF_LOAD, _ELF_DYNAMIC} <= kinds:
        raise ValueError("is damaged: it has no segment to load, or none for the dynamic linker")
    return [_ELF_MACHINES.get(machine, f"processor {machine}")]


def _pe(content: bytes) -> list[str]:
    """Return the processor of a Windows DLL."""
    if content[:2] != b"MZ":
        raise ValueError(f"is no DLL: it begins with {content[:4]!r}")
    (start,) = struct.unpack_from("<I", content, 0x3C)
    signature, machine, n, _, _, _, optional, _ = struct.unpack_from("<4sHHIIIHH", content, start)
    if signature != b"PE\0\0":
        raise ValueError("is no DLL: it has no PE header")
    for i in range(n):
        size, offset = struct.unpack_from("<II", content, start + 24 + optional + 40 * i + 16)
        _within(content, offset, size, "sections")
    return [_PE_MACHINES.get(machine, f"processor {machine}")]


def _macho(content: bytes) -> list[str]:
    """Return the processors of a Mach-O library, or of several in a universal file."""
    magic, n = struct.unpack_from(">II", content)
    if magic != _MACHO_FAT:
        return [_thin_macho(content)]
    if n > _PARTS_MAX:
        raise ValueError(f"is no universal Mach-O library: it would have {n} processors")
    processors = []
    for i in range(n):
        _, _, offset, size, _ = struct.unpack_from(">5I", content, 8 + 20 * i)
        _within(content, offset, size, "libraries")
        processors.append(_thin_macho(content[offset : offset + size]))
    return processors


def _thin_macho(content: bytes) -> str:
    magic, cpu, _, _, n, size = struct.unpack_from("<6I", content)
    if magic != _MACHO_64:
        raise ValueError(f"is no 64-bit Mach-O library: it begins with {content[:4]!r}")
    _within(content, 32, size, "load commands")
    place = 32
    for _ in range(n):
        command, length = struct.unpack_from("<2I", content, place)
        if length < 8 or place + length > 32 + size:
            raise ValueError("is damaged: a load command is longer than all of them")
        if command == _MACHO_SEGMENT:
            offset, in_file = struct.unpack_from("<2Q", content, place + 40)
            _within(content, offset, in_file, "segments")
        place += length
    return _MACHO_MACHINES.get(cpu, f"processor {cpu:#x}")


def _within(content: bytes, offset: int, size: int, what: str) -> None:
    if offset + size > len(content):
        raise ValueError(f"is truncated: its {what} end at byte {offset + size}, the file has {len(content)}")


_READERS: dict[str, tuple[Callable[[bytes], list[str]], str]] = {
    "Linux": (_elf, "ELF"),
    "Windows": (_pe, "a DLL"),
    "Darwin": (_macho, "Mach-O"),
}
"""Formats of shared libraries by :func:`platform.system`."""
