"""Table ``resources/variables.bin`` of a native FMU: what a library that serves all FMUs of a kind reads of one.

Layout, little-endian: ``HSEPVAR2``; as u64 the size of the file in bytes, the number of the kind's interface, the
number of modes, whether the axis is rotary, and the samples of each window, 0 if it has none; the GUID in 48 bytes,
filled with zeros; as float64 the start values of single variables and of the modes' numbers; the CRC-32 of all before
as u64.
"""

from __future__ import annotations

import struct
import zlib

from .c_header import interface_number, layout_of
from .fmu_table import FmuTable

__all__ = ["TABLE_FILE", "table_file"]

TABLE_FILE = "variables.bin"
_HEAD = struct.Struct("<8s5Q48s")
_CHECKSUM = struct.Struct("<Q")
_MAGIC = b"HSEPVAR2"


def table_file(table: FmuTable, guid: str) -> bytes:
    """Return the content of the file.

    Parameters
    ----------
    table : FmuTable
    guid : str
        The modelDescription's.
    """
    layout = layout_of(table.variables)
    starts = struct.pack(f"<{len(layout.starts)}d", *layout.starts)
    size = _HEAD.size + len(starts) + _CHECKSUM.size
    n_modes = len(layout.modes) // 4
    numbers = size, interface_number(table.kind), n_modes, int(table.is_angular), layout.window
    content = _HEAD.pack(_MAGIC, *numbers, guid.encode()) + starts
    return content + _CHECKSUM.pack(zlib.crc32(content))
