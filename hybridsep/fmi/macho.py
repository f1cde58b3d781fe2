"""Universal Mach-O file of libraries for several processors.

A universal file is a big-endian header and the libraries themselves, unchanged, each at a place that its processor's
pages divide. The header: the number 0xCAFEBABE and the count, then for each library its processor (type and subtype, as
in its own header), offset, size and the alignment's power of two.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from ..base.errors import FmuError

__all__ = ["universal"]

_UNIVERSAL = 0xCAFEBABE
_MACHO_64 = 0xFEEDFACF
_ALIGNMENT = 14  # 16 KiB, the page of Apple's ARM processors; x86 has 4 KiB


def universal(libraries: Sequence[bytes]) -> bytes:
    """Return the universal file of some 64-bit Mach-O libraries.

    Parameters
    ----------
    libraries : sequence of bytes
        One for each processor.

    Raises
    ------
    FmuError
        If one is no 64-bit Mach-O file, or two are for the same processor.
    """
    processors = []
    for library in libraries:
        magic, cpu, subtype = struct.unpack_from("<3I", library.ljust(12, b"\0"))
        if magic != _MACHO_64:
            raise FmuError(
                f"a universal file is made of 64-bit Mach-O libraries, got one that begins with {library[:4]!r}"
            )
        processors.append((cpu, subtype))
    if len(set(processors)) < len(processors):
        raise FmuError(f"a universal file has one library for each processor, got {processors}")
    page = 1 << _ALIGNMENT
    header = struct.pack(">2I", _UNIVERSAL, len(libraries))
    body = b""
    for library, (cpu, subtype) in zip(libraries, processors, strict=True):
        offset = page + len(body)
        header += struct.pack(">5I", cpu, subtype, offset, len(library), _ALIGNMENT)
        body += library.ljust(-(-len(library) // page) * page, b"\0")
    return header.ljust(page, b"\0") + body
