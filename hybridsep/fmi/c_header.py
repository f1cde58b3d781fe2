"""C header, sources and table of a native FMU, all from the table that modelDescription.xml is made of.

FMUs of a kind differ in their GUID, the number of modes, the length of the windows and start values. In a source FMU
the header ``hsep_fmu.h`` has them; a library that serves all FMUs of a kind reads them from
``resources/variables.bin``.

Layout of that file, little-endian: ``HSEPVAR2``; as u64 the size of the file in bytes, the number of the kind's
interface, the number of modes, whether the axis is rotary, and the samples of each window, 0 if it has none; the GUID
in 48 bytes, filled with zeros; as float64 the start values of all variables but the windows'; the CRC-32 of all before
as u64.
"""

import hashlib
import json
import re
import struct
import zlib
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from ..base.files import data_folder
from ..base.parameters import angular_unit
from .flavours import FMI_VERSIONS, filled
from .variables import INTERPOLATED, FmuTable, Value, Variable, layout_of

_MODE = {"f_n": 1.0, "zeta": 1.0, "alpha": 1.0, "beta": 0.0}
_ANY: Mapping[str, Value] = defaultdict(lambda: 1)

KINDS: Mapping[str, FmuTable] = {
    table.kind: table
    for table in (
        FmuTable("HybridPredictor", "", _ANY, (_MODE,)),
        FmuTable("SepCompensator", "", _ANY, (_MODE,)),
        FmuTable("FeedDrive", "", _ANY),
        FmuTable("FeedDrive", "", _ANY, (_MODE,)),
        FmuTable("ReferenceTrajectory", "", _ANY),
    )
}
"""Kinds of FMU, each with a table that stands for all FMUs of it."""


def kind_header(kind: str) -> str:
    """Return the header with which a library serves all FMUs of a kind, of :data:`KINDS`."""
    table = "/* The table of each FMU, its GUID and start values, is in its resources (hsep_opening.c). */\n"
    return _header(kind, f"every {kind}", f"{table}#define HSEP_TABLE_IN_RESOURCES 1\n")


def c_header(table: FmuTable, guid: str, fmi: str = FMI_VERSIONS[0], weights: bytes | None = None) -> str:
    """Return the header of one FMU, with its table and, instead of the resources' file, the content of its weights."""
    layout = layout_of(table.variables)
    starts = ",\n".join(
        f"    {start!r} /* {variable.name} */" for start, variable in zip(layout.starts, layout.started, strict=True)
    )
    said = "/* What was learned before, weights.bin: no file is needed for a warm start. */\n"
    learned = f"{said}{c_bytes('hsep_embedded_weights', weights)}\n\n" if weights else ""
    embedded = (
        ",\n    .weights = hsep_embedded_weights,\n    .weights_size = sizeof hsep_embedded_weights" if weights else ""
    )
    sizes = {"n_modes": len(layout.modes) // len(_MODE), "window": layout.window, "angular": int(table.is_angular)}
    parts = {"guid": json.dumps(guid), "starts": starts, "learned": learned, "embedded": embedded}
    text = filled("table.h", fmi=fmi, name=table.name, **sizes, **parts)
    return _header(table.kind, table.name, text)


def _interface_number(kind: str) -> int:
    """Return a number of 64 bits that tells the interface of a kind from all others, and from other versions'."""
    return int.from_bytes(hashlib.sha256(_interface(kind).encode()).digest()[:8], "little")


def _header(kind: str, whose: str, table: str) -> str:
    """Return a header: the interface of a kind, then a table or where it is."""
    model, number = re.sub("(?<=[a-z])(?=[A-Z])", "_", kind).upper(), f"{_interface_number(kind):016X}"
    return filled("fmu.h", whose=whose, model=model, number=number, interface=_interface(kind), table=table)


def _interface(kind: str) -> str:
    """Return what all FMUs of a kind share: value references and the rows of the table."""
    layout, model = layout_of(KINDS[kind].variables), KINDS[kind].model
    slopes = INTERPOLATED[model]
    assert slopes == tuple(variable.name for variable in layout.scalars[: len(slopes)])  # their places are the inputs'
    places = [f"    HSEP_VR_{variable.name} = {i}" for i, variable in enumerate(layout.scalars)]
    if layout.modes:
        places.append(f"    HSEP_VR_mode = {len(layout.scalars)}")
    windows = [window[0].name.partition("[")[0] for window in layout.windows]
    first = "HSEP_N_SCALARS + HSEP_MODE_NUMBERS * (context)->n_modes"
    macros = "".join(f"#define HSEP_VR_{one.name}(context) ({first} + {i})\n" for i, one in enumerate(layout.last))
    macros += "".join(
        f"#define HSEP_VR_{name}(context) ({first} + HSEP_N_LAST + {i} * (context)->window)\n"
        for i, name in enumerate(windows)
    )
    one = layout.modes[: len(_MODE)]
    rows = [_row(variable, variable.name) for variable in layout.scalars]
    rows += [_row(variable, variable.name.partition(".")[2]) for variable in one]
    rows += [_row(variable, variable.name) for variable in layout.last]
    rows += [_row(window[0], name) for window, name in zip(layout.windows, windows, strict=True)]
    sizes = {"n_interpolated": len(slopes), "n_scalars": len(layout.scalars), "has_modes": int(bool(layout.modes))}
    sizes |= {"n_last": len(layout.last), "n_windows": len(windows), "n_rows": len(rows)}
    length, references = "HSEP_VR_Np" if windows else 0, ",\n".join(places)
    parts = {"macros": macros, "rows": ",\n".join(f"    {row}" for row in rows)}
    return filled("interface.h", model=json.dumps(model), length=length, references=references, **sizes, **parts)


def c_bytes(name: str, content: bytes) -> str:
    """Return the definition of an array with these bytes."""
    text = ",\n    ".join(", ".join(map(str, content[i : i + 32])) for i in range(0, len(content), 32))
    return f"static const unsigned char {name}[{len(content)}] = {{\n    {text}}};"


def _row(variable: Variable, name: str) -> str:
    unit = "" if variable.unit in (None, "1") else str(variable.unit)
    fields = [
        *map(json.dumps, (name, unit, angular_unit(unit) or "")),
        f"HSEP_{variable.kind.upper()}",
        f"HSEP_{variable.causality.upper()}",
        str(int(variable.variability == "tunable")),
        "-HUGE_VAL" if variable.minimum is None else repr(float(variable.minimum)),
        "HUGE_VAL" if variable.maximum is None else repr(float(variable.maximum)),
        repr(float(variable.nonzero)),
        "HUGE_VAL" if variable.automatic is None else repr(float(variable.automatic)),
        str(int(variable.learned)),
    ]
    return "{" + ", ".join(fields) + "}"


FMI_HEADERS = {
    "2": ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
    "3": ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
}
"""Headers of each version of FMI, the one that includes the others first."""


@cache
def c_sources(versions: Collection[str] = FMI_VERSIONS) -> dict[str, bytes]:
    """Return our C files by name, with ``all.c`` first; ``hsep_fmu.h`` and the FMI headers are not among them.

    They have the functions of these versions of FMI: a library has both, a source FMU its own.
    """
    root = data_folder("fmu_src") / "c"
    others = [f"fmi{version}" for version in FMI_VERSIONS if version not in versions]
    paths = sorted(path for path in root.rglob("*.[ch]") if path.parent.name not in ("examples", *others))
    ours = {path.name: path.read_bytes() for path in paths}
    return {"all.c": all_c([file for file in ours if file.endswith(".c")]).encode(), **ours}


def all_c(files: Sequence[str]) -> str:
    """Return the C file that includes all others, in which only the FMI functions have external linkage."""
    includes = "".join(f'#include "{file}"\n' for file in files)
    return f"""/* The whole FMU as one translation unit: compile only this file, with your FMI headers. */
#define HSEP_API static inline /* see hsep_api.h */

{includes}"""


def fmi_headers(versions: Collection[str] = FMI_VERSIONS) -> dict[str, bytes]:
    """Return the FMI headers for shared libraries, as fmpy carries them, with the line ends of a text file."""
    fmpy = find_spec("fmpy")  # which loads slowly
    assert fmpy is not None
    assert fmpy.origin is not None
    folder = Path(fmpy.origin).parent / "c-code"
    files = [file for version in versions for file in FMI_HEADERS[version]]
    return {file: (folder / file).read_bytes().replace(b"\r\n", b"\n") for file in files}


TABLE_FILE = "variables.bin"
_HEAD = struct.Struct("<8s5Q48s")
_CHECKSUM = struct.Struct("<Q")
_MAGIC = b"HSEPVAR2"


def table_file(table: FmuTable, guid: str) -> bytes:
    """Return the content of :data:`TABLE_FILE`."""
    layout = layout_of(table.variables)
    starts = struct.pack(f"<{len(layout.starts)}d", *layout.starts)
    size = _HEAD.size + len(starts) + _CHECKSUM.size
    numbers = size, _interface_number(table.kind), len(layout.modes) // 4, int(table.is_angular), layout.window
    content = _HEAD.pack(_MAGIC, *numbers, guid.encode()) + starts
    return content + _CHECKSUM.pack(zlib.crc32(content))
