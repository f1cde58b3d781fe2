"""Software bill of materials of an FMU, CycloneDX 1.6: what its binaries and its Python files were made from.

It is the same for the same FMU: no date, and a serial number that follows from the content. In the archive it lies in
``extra/``, where FMI keeps files of others by their reverse domain; importers pass over it.
"""

from __future__ import annotations

import json
import uuid
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..base.version import __version__

if TYPE_CHECKING:
    from cyclonedx.model.component import Component

__all__ = ["BILL_FILE", "Part", "bill_of_materials", "native_parts", "python_parts"]

BILL_FILE = "extra/org.cyclonedx/bom.json"


@dataclass(frozen=True)
class Part:
    """A component of an FMU.

    Attributes
    ----------
    name, version, description : str
    license : str
        SPDX identifier; "" where it is not known.
    url : str
        Where it comes from; "" for our own.
    package : str
        Its package URL, or "".
    program : bool
        Whether it is a program, not a library.
    """

    name: str
    version: str
    description: str
    license: str
    url: str = ""
    package: str = ""
    program: bool = False


_FMI = "https://github.com/modelica/fmi-standard"
_HEADERS = "headers that the binaries were compiled with"
_C_PARTS = (
    Part("hybridsep C sources", __version__, "the model and its FMI functions, as in sources", "BSD-3-Clause"),
    Part("FMI 2.0 headers", "2.0", _HEADERS, "BSD-2-Clause", _FMI),
    Part("FMI 3.0 headers", "3.0", _HEADERS, "BSD-2-Clause", _FMI),
)
_MINGW = Part(
    "mingw-w64 runtime",
    "",
    "start-up code and C library functions in the Windows binaries, as the compiler brings them",
    "ZPL-2.1",
    "https://www.mingw-w64.org",
)


def native_parts(compilers: Collection[str], targets: Collection[str]) -> list[Part]:
    """Return what a native FMU is made of.

    Parameters
    ----------
    compilers : collection of str
        Names of :class:`hybridsep.fmi.compiler.Compiler`.
    targets : collection of str
        Keys of :data:`hybridsep.fmi.compiler.TARGETS`.
    """
    parts = list(_C_PARTS)
    for name in sorted(set(compilers)):
        tool, _, said = name.partition(" ")
        if tool == "ziglang":
            what = "compiler of the binaries, whose run-time library is in them"
            parts.append(Part(tool, said, what, "MIT", "https://ziglang.org", f"pkg:pypi/{tool}@{said}", program=True))
            if any("windows" in target for target in targets):
                parts.append(_MINGW)
        else:
            parts.append(Part(tool, said.partition("\n")[0], "compiler of the binaries", "", program=True))
    return parts


def python_parts(version: str) -> list[Part]:
    """Return what a Python FMU is made of, with this version of pythonfmu."""
    what, url = "module and binaries between FMI and Python", "https://github.com/NTNU-IHB/PythonFMU"
    return [
        Part("hybridsep", __version__, "slave, and the part of the library that it needs", "BSD-3-Clause"),
        Part("pythonfmu", version, what, "MIT", url, f"pkg:pypi/pythonfmu@{version}"),
    ]


def bill_of_materials(name: str, guid: str, parts: Sequence[Part]) -> bytes:
    """Return the bill of an FMU.

    Parameters
    ----------
    name : str
        Model identifier.
    guid : str
        The modelDescription's, in braces.
    parts : sequence of Part
    """
    # a tenth of a second, which only a build has to spend
    from cyclonedx.model.bom import Bom, BomMetaData
    from cyclonedx.model.component import Component, ComponentType
    from cyclonedx.output.json import JsonV1Dot6

    serial = uuid.uuid5(uuid.UUID(guid), repr(sorted(parts, key=lambda part: part.name)))
    whole = Component(type=ComponentType.APPLICATION, name=name, version=guid.strip("{}"), bom_ref=name)
    bill = Bom(serial_number=serial, metadata=BomMetaData(component=whole))
    for part in parts:
        bill.components.add(_component(part))
    bill.register_dependency(whole, bill.components)
    content = json.loads(JsonV1Dot6(bill).output_as_string())
    del content["metadata"]["timestamp"]  # optional in the format, not in its library
    return (json.dumps(content, indent=1, sort_keys=True) + "\n").encode()


def _component(part: Part) -> Component:
    from cyclonedx.model import ExternalReference, ExternalReferenceType, XsUri
    from cyclonedx.model.component import Component, ComponentType
    from cyclonedx.model.license import DisjunctiveLicense
    from packageurl import PackageURL

    return Component(
        type=ComponentType.APPLICATION if part.program else ComponentType.LIBRARY,
        name=part.name,
        version=part.version or None,
        description=part.description,
        bom_ref=part.name,
        purl=PackageURL.from_string(part.package) if part.package else None,
        licenses=[DisjunctiveLicense(id=part.license)] if part.license else [],
        external_references=[ExternalReference(type=ExternalReferenceType.WEBSITE, url=XsUri(part.url))]
        if part.url
        else [],
    )
