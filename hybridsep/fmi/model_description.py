"""``modelDescription.xml`` of an FMI 2.0 co-simulation FMU, from its variable table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree as ET

from .variables import Variable

__all__ = ["FmuInfo", "build_description", "model_description"]

_UNITS: dict[str, dict[str, int]] = {
    # FMI unit → exponents of the SI base units
    "m": {"m": 1},
    "m2": {"m": 2},
    "m/s": {"m": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "m/s3": {"m": 1, "s": -3},
    "s": {"s": 1},
    "Hz": {"s": -1},
    "1/s": {"s": -1},
    "1/s2": {"s": -2},
    "1/m": {"m": -1},
    "kg": {"kg": 1},
    "N.s/m": {"kg": 1, "s": -1},
    "N/m": {"kg": 1, "s": -2},
    "N.s2/m2": {"kg": 1, "m": -1},
    "N/m2": {"kg": 1, "m": -1, "s": -2},
}
_DISPLAY_UNITS = {"m": {"mm": 1e3, "um": 1e6}, "m/s": {"mm/s": 1e3}, "s": {"ms": 1e3}}


@dataclass(frozen=True)
class FmuInfo:
    """Content of the modelDescription besides the variables.

    Attributes
    ----------
    name : str
        Model name and identifier, the stem of the archive.
    description : str
        One line.
    guid : str
        Follows from the content; see :mod:`hybridsep.fmi.content`.
    step_size : float
        Of the default experiment, s.
    stop_time : float
        Of the default experiment, s.
    needs_execution_tool : bool
        Whether the FMU needs more than its own binary, here a Python.
    generation_tool, version : str
    source_files : tuple of str
        Files to compile, below ``sources/``; empty if there are none. An FMU of C sources takes its memory
        from the importer's functions.
    interpolates : bool
        Whether inputs may have a time derivative.
    """

    name: str
    description: str
    guid: str
    step_size: float
    stop_time: float
    needs_execution_tool: bool
    generation_tool: str
    version: str
    source_files: tuple[str, ...] = ()
    interpolates: bool = False


def model_description(info: FmuInfo, table: Sequence[Variable]) -> bytes:
    """Return the XML document, the same bytes for the same arguments.

    Parameters
    ----------
    info : FmuInfo
    table : sequence of Variable
        The value reference of each is its place.
    """
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=info.name,
        guid=info.guid,
        description=info.description,
        version=info.version,
        license="BSD-3-Clause",
        generationTool=info.generation_tool,
        variableNamingConvention="structured",
        numberOfEventIndicators="0",
    )
    simulation = ET.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=info.name,
        needsExecutionTool=_text(info.needs_execution_tool),
        canHandleVariableCommunicationStepSize="true",
        canInterpolateInputs=_text(info.interpolates),
        canNotUseMemoryManagementFunctions=_text(not info.source_files),
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
    )
    if info.source_files:
        files = ET.SubElement(simulation, "SourceFiles")
        for file in info.source_files:
            ET.SubElement(files, "File", name=file)
    _unit_definitions(root, table)
    _type_definitions(root, table)
    categories = ET.SubElement(root, "LogCategories")
    for status in ("Warning", "Discard", "Error", "Fatal"):
        ET.SubElement(
            categories, "Category", name=f"logStatus{status}", description=f"messages with status fmi2{status}"
        )
    ET.SubElement(categories, "Category", name="logAll", description="all messages")
    ET.SubElement(
        root, "DefaultExperiment", startTime="0", stopTime=_text(info.stop_time), stepSize=_text(info.step_size)
    )
    variables = ET.SubElement(root, "ModelVariables")
    for reference, variable in enumerate(table):
        _scalar_variable(variables, reference, variable)
    _structure(root, table)
    return _document(root)


def build_description(name: str, source_files: Sequence[str]) -> bytes:
    """Return ``buildDescription.xml`` (FMI 3.0's, which FMI 2.0 tools read too): how the sources are compiled.

    Parameters
    ----------
    name : str
        Model identifier.
    source_files : sequence of str
        Below ``sources/``.
    """
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=name)
    files = ET.SubElement(configuration, "SourceFileSet", language="C99")
    for file in source_files:
        ET.SubElement(files, "SourceFile", name=file)
    return _document(root)


def _document(root: ET.Element) -> bytes:
    ET.indent(root)
    document: bytes = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
    return document + b"\n"


def _text(value: object) -> str:
    """Write a number so that it reads back the same, and a bool as XML does."""
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _unit_definitions(root: ET.Element, table: Sequence[Variable]) -> None:
    used = {variable.unit for variable in table} - {None, "1"}
    definitions = ET.SubElement(root, "UnitDefinitions")
    for unit in (unit for unit in _UNITS if unit in used):
        element = ET.SubElement(definitions, "Unit", name=unit)
        ET.SubElement(element, "BaseUnit", {base: str(exponent) for base, exponent in _UNITS[unit].items()})
        for display, factor in _DISPLAY_UNITS.get(unit, {}).items():
            ET.SubElement(element, "DisplayUnit", name=display, factor=_text(factor))


def _type_definitions(root: ET.Element, table: Sequence[Variable]) -> None:
    """Name the values of the enumerations; each variable has a type of its own, called like it."""
    enumerations = [variable for variable in table if variable.items]
    if not enumerations:
        return
    definitions = ET.SubElement(root, "TypeDefinitions")
    for variable in enumerations:
        element = ET.SubElement(ET.SubElement(definitions, "SimpleType", name=variable.name), "Enumeration")
        for value, item in enumerate(variable.items):
            ET.SubElement(element, "Item", name=item, value=str(value))


def _scalar_variable(parent: ET.Element, reference: int, variable: Variable) -> None:
    attributes = {
        "name": variable.name,
        "valueReference": str(reference),
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
    }
    if variable.causality == "parameter":
        attributes["initial"] = "exact"
    elif variable.causality != "input":
        attributes["initial"] = "calculated"
    element = ET.SubElement(parent, "ScalarVariable", attributes)
    values = {"declaredType": variable.name} if variable.items else {}
    if variable.unit not in (None, "1"):
        values["unit"] = str(variable.unit)
        if variable.display_unit:
            values["displayUnit"] = variable.display_unit
    for key, number in (("min", variable.minimum), ("max", variable.maximum), ("nominal", variable.nominal)):
        if number is not None and variable.kind != "Boolean":
            values[key] = _text(float(number) if variable.kind == "Real" else int(number))
    if variable.start is not None:
        values["start"] = _text(float(variable.start) if variable.kind == "Real" else variable.start)
    ET.SubElement(element, variable.kind, values)


def _structure(root: ET.Element, table: Sequence[Variable]) -> None:
    """Add ModelStructure: outputs without direct feedthrough, and their dependencies at initialization."""
    place = {variable.name: str(i) for i, variable in enumerate(table, start=1)}
    outputs = [variable for variable in table if variable.causality == "output"]
    structure = ET.SubElement(root, "ModelStructure")
    unknowns = ET.SubElement(structure, "Outputs")
    for variable in outputs:
        ET.SubElement(unknowns, "Unknown", index=place[variable.name], dependencies="")
    unknowns = ET.SubElement(structure, "InitialUnknowns")
    for variable in outputs:
        dependencies = " ".join(place[name] for name in variable.initially_from)
        ET.SubElement(unknowns, "Unknown", index=place[variable.name], dependencies=dependencies)
