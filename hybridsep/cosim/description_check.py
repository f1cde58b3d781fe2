"""Checks of a modelDescription.xml before its FMU is unpacked: well-formed, version, co-simulation, plain names."""

from __future__ import annotations

import re
from collections.abc import Mapping
from xml.parsers import expat

from ..base.errors import FmuError, brief, first_line

__all__ = ["check_description"]

_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,199}")
"""Grammar of a modelIdentifier: a name in C (FMI 2.0, section 2.2.1)."""

_VERSION = re.compile(r"2\.0|3\.0(\.[0-9]{1,5})?")
"""Versions of FMI that are run."""

_DEPTH_MAX = 50
"""Deepest nesting of elements; FMI 2.0's have 5 levels, vendors' annotations some more."""


def check_description(name: str, text: bytes) -> str:
    """Return the model identifier for co-simulation.

    Parameters
    ----------
    name : str
        The archive's, for messages.
    text : bytes
        The modelDescription.xml.

    Raises
    ------
    FmuError
        If it is no FMI 2.0 or 3.0 co-simulation FMU, or one that is damaged.
    """
    elements = _elements(name, text)
    root, attributes = elements[0]
    if root != "fmiModelDescription":
        raise FmuError(f"{name} is not a readable FMU: its description is an XML file of {brief(root)}")
    version = attributes.get("fmiVersion", "none")
    if not _VERSION.fullmatch(version):
        raise FmuError(f"{name} must be an FMI 2.0 or 3.0 FMU, got FMI {version:.20}")
    slaves = [attributes for element, attributes in elements[1:] if element == "CoSimulation"]
    if not slaves:
        raise FmuError(f"{name} must be a co-simulation FMU, got one for model exchange only")
    identifier = slaves[-1].get("modelIdentifier", "")
    if not _IDENTIFIER.fullmatch(identifier):
        raise FmuError(f"{name} must not be loaded: its modelIdentifier must be a name in C, got {brief(identifier)}")
    return identifier


def _elements(name: str, text: bytes) -> list[tuple[str, Mapping[str, str]]]:
    """Return the root and the elements below it; no document types, which hold entities that grow or name files."""
    found: list[tuple[str, Mapping[str, str]]] = []
    depth = 0

    def start(element: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > _DEPTH_MAX:
            raise FmuError(f"{name} is not a readable FMU: its description is nested more than {_DEPTH_MAX} deep")
        if depth <= 2:
            found.append((element, attributes))

    def end(_element: str) -> None:
        nonlocal depth
        depth -= 1

    def refuse(*_: object) -> None:
        raise FmuError(f"{name} must not be loaded: its description has a DOCTYPE, which FMI's have not")

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(text, True)
    except (expat.ExpatError, ValueError, LookupError) as error:  # of an unknown encoding, too
        if isinstance(error, FmuError):
            raise
        raise FmuError(f"{name} is not a readable FMU: its description is no XML: {first_line(error)}") from error
    return found
