"""C sources of the native FMUs: ours, one file that includes them all, and the FMI headers they are compiled with."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from ..base.data_files import data_folder
from ..base.errors import FmuError
from .flavours import FMI_VERSIONS

__all__ = ["FMI_HEADERS", "all_c", "c_sources", "fmi_headers"]

FMI_HEADERS = {
    "2": ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
    "3": ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
}
"""Headers of each version of FMI, the one that includes the others first."""


@cache
def c_sources(versions: Collection[str] = FMI_VERSIONS) -> dict[str, bytes]:
    """Return our C files by name, with ``all.c`` first; ``hsep_fmu.h`` and the FMI headers are not among them.

    Parameters
    ----------
    versions : collection of str
        Versions of FMI whose functions they have: a library has both, a source FMU its own.
    """
    root = data_folder("fmu_src") / "c"
    others = [f"fmi{version}" for version in FMI_VERSIONS if version not in versions]
    paths = sorted(path for path in root.rglob("*.[ch]") if path.parent.name not in ("examples", *others))
    ours = {path.name: path.read_bytes() for path in paths}
    return {"all.c": all_c([file for file in ours if file.endswith(".c")]).encode(), **ours}


def all_c(files: Sequence[str]) -> str:
    """Return the C file that includes all others, in which the FMI functions alone have external linkage."""
    includes = "".join(f'#include "{file}"\n' for file in files)
    return f"""/* The whole FMU as one translation unit: compile this file alone, with your FMI headers. */
#define HSEP_API static inline /* see hsep_api.h */

{includes}"""


def fmi_headers(versions: Collection[str] = FMI_VERSIONS) -> dict[str, bytes]:
    """Return the FMI headers for shared libraries, as fmpy carries them, with the line ends of a text file.

    Raises
    ------
    FmuError
        If fmpy is not installed.
    """
    found = find_spec("fmpy")
    if found is None or found.origin is None:
        raise FmuError("the FMI headers come with fmpy, which is not installed: pip install fmpy")
    folder = Path(found.origin).parent / "c-code"
    files = [file for version in versions for file in FMI_HEADERS[version]]
    return {file: (folder / file).read_bytes().replace(b"\r\n", b"\n") for file in files}
