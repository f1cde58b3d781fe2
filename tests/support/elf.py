"""Symbols of an ELF file, without binutils, which a machine with only Python does not have."""

import struct
from dataclasses import dataclass
from pathlib import Path

_SECTION = struct.Struct("<IIQQQQIIQQ")
_SYMBOL = struct.Struct("<IBBHQQ")
_SYMTAB, _DYNSYM = 2, 11
_SECTION_OR_FILE = (3, 4)
_WRITABLE = 1
_COMMON = 0xFFF2


@dataclass(frozen=True)
class Symbol:
    """One symbol: its place, whether the file defines it, whether it is seen from outside and can be written to."""

    name: str
    value: int
    defined: bool
    exported: bool
    writable: bool


def symbols(path: Path, *, dynamic: bool = False) -> list[Symbol]:
    """Return the symbols of a 64-bit little-endian object file, or those a shared library shows its importer."""
    content = path.read_bytes()
    if content[:6] != b"\x7fELF\x02\x01":
        raise ValueError(f"{path.name} is not a 64-bit little-endian ELF file")
    (place,) = struct.unpack_from("<Q", content, 40)
    size, count = struct.unpack_from("<HH", content, 58)
    sections = [_SECTION.unpack_from(content, place + i * size) for i in range(count)]
    found = []
    for _, kind, _, _, offset, length, link, *_ in sections:
        if kind != (_DYNSYM if dynamic else _SYMTAB):
            continue
        names = content[sections[link][4] :]
        for at in range(offset + _SYMBOL.size, offset + length, _SYMBOL.size):
            name, info, _, index, value, _ = _SYMBOL.unpack_from(content, at)
            if info & 15 in _SECTION_OR_FILE:
                continue
            writable = index == _COMMON or (0 < index < count and bool(sections[index][2] & _WRITABLE))
            text = names[name : names.index(b"\0", name)].decode()
            found.append(Symbol(text, value, defined=index != 0, exported=info >> 4 != 0, writable=writable))
    return found
