"""``modelDescription.xml`` of an FMI 2.0 co-simulation FMU: a template, filled from machine and variable table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

from ..base.version import __version__
from .content import author, copyright_notice, fmu_title, generation_time, paper_note
from .experiment import stop_time
from .flavours import FMI_VERSIONS
from .fmu import Fmu
from .variables import INTERPOLATED, Variable

__all__ = [
    "add_items",
    "begun",
    "build_description",
    "document",
    "model_description",
    "template",
    "types_of",
    "unit_elements",
    "variable_attributes",
    "xml_text",
]

_TEMPLATES = Path(__file__).parent / "templates"


def model_description(fmu: Fmu, guid: str, generation_tool: str, *, native: bool) -> bytes:
    """Return the XML document, the same bytes for the same arguments.

    Parameters
    ----------
    fmu : Fmu
        The machine's sampling interval and trajectory make the default experiment.
    guid : str
        Follows from the content; see :mod:`hybridsep.fmi.content`.
    generation_tool : str
    native : bool
        Whether the FMU is made of C sources, which take their memory from the importer's functions, extrapolate inputs
        and need no more than their own binary; otherwise it needs a Python.
    """
    table = fmu.table.shown
    root = begun("modelDescription.xml", fmu, table, {"guid": guid}, generation_tool)
    simulation, _, types, _, _, variables, structure = root
    simulation.attrib |= {
        "needsExecutionTool": xml_text(not native),
        "canInterpolateInputs": xml_text(native and bool(INTERPOLATED[fmu.table.model])),
        "canNotUseMemoryManagementFunctions": xml_text(not native),
    }
    if native:
        ET.SubElement(ET.SubElement(simulation, "SourceFiles"), "File", name="all.c")
    for variable, attributes in types_of(table):
        add_items(ET.SubElement(ET.SubElement(types, "SimpleType", attributes), "Enumeration"), variable)
    if not len(types):
        root.remove(types)
    for reference, variable in enumerate(table):
        own, values = variable_attributes(variable, reference, integers=("Integer", "Enumeration"))
        ET.SubElement(ET.SubElement(variables, "ScalarVariable", own), variable.kind, values)
    _fill_structure(structure, table)
    return document(root)


def begun(file: str, fmu: Fmu, table: Sequence[Variable], token: Mapping[str, str], generation_tool: str) -> ET.Element:
    """Return a template with what all versions of FMI say alike: names, units and the default experiment.

    Parameters
    ----------
    file : str
        The template.
    fmu, generation_tool
        As :func:`model_description` has them.
    table : sequence of Variable
    token : mapping
        What the version calls the GUID → the GUID.
    """
    machine, model, name, root = fmu.machine, fmu.table.model, fmu.table.name, template(file)
    simulation, units, _, _, experiment, _, _ = root
    root.attrib |= {
        "modelName": name,
        **token,
        "description": fmu_title(machine, model) + paper_note(machine, model),
        "version": __version__,
        "author": author(),
        "copyright": copyright_notice(),
        "generationTool": generation_tool,
        "generationDateAndTime": generation_time(),
    }
    simulation.set("modelIdentifier", name)
    used = {variable.unit for variable in table}
    units[:] = [unit for unit in unit_elements() if unit.get("name") in used]
    experiment.attrib |= {"stopTime": xml_text(stop_time(fmu)), "stepSize": xml_text(machine.T_s)}
    return root


def build_description(name: str, fmi: str = FMI_VERSIONS[0]) -> bytes:
    """Return ``buildDescription.xml`` (FMI 3.0's, which FMI 2.0 tools read too): how the sources are compiled.

    Parameters
    ----------
    name : str
        Model identifier.
    fmi : {"2", "3"}
        Version of FMI, whose headers put the identifier before the functions' names unless a definition says not to.
    """
    root = template("buildDescription.xml")
    root[0].set("modelIdentifier", name)
    meaning = "for a shared library: the FMI functions have their plain names; left out to link FMUs into one program"
    plain = {"2": ("FMI2_FUNCTION_PREFIX", ""), "3": ("FMI3_OVERRIDE_FUNCTION_PREFIX", "1")}[fmi]
    attributes = dict(zip(("name", "value"), plain, strict=True)) | {"optional": "true", "description": meaning}
    ET.SubElement(root[0][0], "PreprocessorDefinition", attributes)
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


def types_of(table: Sequence[Variable]) -> list[tuple[Variable, dict[str, str]]]:
    """Return the enumerations, each of which has a type of its own, with the attributes of that type."""
    items = [variable for variable in table if variable.items]
    return [(variable, {"name": variable.type_name, "description": variable.description}) for variable in items]


def add_items(parent: ET.Element, variable: Variable) -> None:
    """Add the items of an enumeration to its type."""
    for value, (item, meaning) in enumerate(zip(variable.items, variable.item_meanings, strict=True)):
        ET.SubElement(parent, "Item", name=item, value=str(value), description=meaning)


def variable_attributes(
    variable: Variable, reference: int, *, integers: Sequence[str]
) -> tuple[dict[str, str], dict[str, str]]:
    """Return the attributes of a variable, and the attributes of its type.

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
        # in a tool's flat list a description stands alone
        "description": f"{variable.group}: {variable.description}" if variable.group else variable.description,
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
