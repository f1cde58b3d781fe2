"""``modelDescription.xml`` of an FMI 2.0 co-simulation FMU: a template, filled from machine and variable table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from numpy.typing import ArrayLike

from ..base.version import __version__
from ..machines.machine import Machine
from .content import fmu_title, paper_note
from .experiment import stop_time
from .flavours import FMI_VERSIONS
from .variables import INTERPOLATED, Variable, variables_of

__all__ = [
    "add_items",
    "build_description",
    "document",
    "model_description",
    "template",
    "unit_elements",
    "variable_attributes",
    "xml_text",
]

_TEMPLATES = Path(__file__).parent / "templates"


def model_description(
    machine: Machine,
    description: Mapping[str, Any],
    guid: str,
    generation_tool: str,
    *,
    native: bool,
    samples: ArrayLike | None = None,
) -> bytes:
    """Return the XML document, the same bytes for the same arguments.

    Parameters
    ----------
    machine : Machine
        Its sampling interval and trajectory make the default experiment.
    description : mapping
        ``model``, ``name``, ``parameters`` and ``modes``; the name is also the model identifier.
    guid : str
        Follows from the content; see :mod:`hybridsep.fmi.content`.
    generation_tool : str
    native : bool
        Whether the FMU is made of C sources, which take their memory from the importer's functions, extrapolate inputs
        and need no more than their own binary; otherwise it needs a Python.
    samples : (n,) array_like, m, optional
        Trajectory that a ReferenceTrajectory was built with.
    """
    model, name, table = str(description["model"]), str(description["name"]), variables_of(description)
    root = template("modelDescription.xml")
    simulation, units, types, _, experiment, variables, structure = root
    root.attrib |= {
        "modelName": name,
        "guid": guid,
        "description": fmu_title(machine, model) + paper_note(machine, model),
        "version": __version__,
        "generationTool": generation_tool,
    }
    simulation.attrib |= {
        "modelIdentifier": name,
        "needsExecutionTool": xml_text(not native),
        "canInterpolateInputs": xml_text(native and bool(INTERPOLATED[model])),
        "canNotUseMemoryManagementFunctions": xml_text(not native),
    }
    if native:
        ET.SubElement(ET.SubElement(simulation, "SourceFiles"), "File", name="all.c")
    used = {variable.unit for variable in table}
    for unit in [unit for unit in units if unit.get("name") not in used]:
        units.remove(unit)
    _add_types(types, table)
    if not len(types):
        root.remove(types)
    stop = stop_time(machine, description, samples)
    experiment.attrib |= {"stopTime": xml_text(stop), "stepSize": xml_text(machine.T_s)}
    for reference, variable in enumerate(table):
        _add_variable(variables, reference, variable)
    _fill_structure(structure, table)
    return document(root)


def build_description(name: str, fmi: str = FMI_VERSIONS[0]) -> bytes:
    """Return ``buildDescription.xml`` (FMI 3.0's, which FMI 2.0 tools read too): how the sources are compiled.

    Parameters
    ----------
    name : str
        Model identifier.
    fmi : {"2", "3"}
        Version of FMI; 3.0's headers put the identifier before the functions' names unless a definition says not to.
    """
    root = template("buildDescription.xml")
    root[0].set("modelIdentifier", name)
    if fmi == "3":
        meaning = (
            "for a shared library: the FMI functions have their plain names; left out to link FMUs into one program"
        )
        attributes = {"name": "FMI3_OVERRIDE_FUNCTION_PREFIX", "value": "1", "optional": "true"}
        ET.SubElement(root[0][0], "PreprocessorDefinition", attributes, description=meaning)
    return document(root)


def unit_elements() -> list[ET.Element]:
    """Return the definitions of all units, each with its name and base unit, as FMI 2.0 writes them."""
    return list(template("modelDescription.xml").iter("Unit"))


def template(name: str) -> ET.Element:
    """Return the root of a template."""
    return ET.fromstring((_TEMPLATES / name).read_bytes())


def document(root: ET.Element) -> bytes:
    """Return a document, indented."""
    ET.indent(root)
    document: bytes = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
    return document + b"\n"


def xml_text(value: object) -> str:
    """Write a number so that it reads back the same, and a bool as XML does."""
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _add_types(definitions: ET.Element, table: Sequence[Variable]) -> None:
    """Name the values of the enumerations; each variable has a type of its own."""
    for variable in (variable for variable in table if variable.items):
        attributes = {"name": variable.type_name, "description": variable.description}
        add_items(ET.SubElement(ET.SubElement(definitions, "SimpleType", attributes), "Enumeration"), variable)


def add_items(parent: ET.Element, variable: Variable) -> None:
    """Add the items of an enumeration to its type."""
    for value, (item, meaning) in enumerate(zip(variable.items, variable.item_meanings, strict=True)):
        ET.SubElement(parent, "Item", name=item, value=str(value), description=meaning)


def _add_variable(parent: ET.Element, reference: int, variable: Variable) -> None:
    own, values = variable_attributes(variable, reference, integers=("Integer", "Enumeration"))
    ET.SubElement(ET.SubElement(parent, "ScalarVariable", own), variable.kind, values)


def variable_attributes(
    variable: Variable, reference: int, *, integers: Sequence[str]
) -> tuple[dict[str, str], dict[str, str]]:
    """Return the attributes of a variable, and those of its type.

    Parameters
    ----------
    variable : Variable
    reference : int
        Value reference.
    integers : sequence of str
        Kinds whose numbers are whole.
    """
    own = {
        "name": variable.name,
        "valueReference": str(reference),
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
    }
    if variable.causality == "parameter":
        own["initial"] = "exact"
    elif variable.causality not in ("input", "independent"):
        own["initial"] = "calculated"
    values = {"declaredType": variable.type_name} if variable.items else {}
    if variable.unit not in (None, "1"):
        values["unit"] = str(variable.unit)
        if variable.display_unit:
            values["displayUnit"] = variable.display_unit
    number = int if variable.kind in integers else float
    for key, bound in (("min", _least(variable)), ("max", variable.maximum), ("nominal", variable.nominal)):
        if bound is not None and variable.kind != "Boolean":
            values[key] = xml_text(number(bound))
    if variable.start is not None:
        values["start"] = xml_text(variable.start if variable.kind == "Boolean" else number(variable.start))
    return own, values


def _least(variable: Variable) -> float | None:
    """Return the least value, an automatic choice included."""
    if variable.minimum is None or variable.automatic is None:
        return variable.minimum
    return min(variable.minimum, variable.automatic)


def _fill_structure(structure: ET.Element, table: Sequence[Variable]) -> None:
    """Name the outputs, which have no direct feedthrough, and their dependencies at initialization."""
    outputs, unknowns = structure
    place = {variable.name: str(i) for i, variable in enumerate(table, start=1)}
    for variable in (variable for variable in table if variable.causality == "output"):
        ET.SubElement(outputs, "Unknown", index=place[variable.name], dependencies="")
        dependencies = " ".join(place[name] for name in variable.initially_from)
        ET.SubElement(unknowns, "Unknown", index=place[variable.name], dependencies=dependencies)
