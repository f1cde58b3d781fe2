"""Documents of an FMU: ``modelDescription.xml`` of FMI 2.0 and 3.0, ``buildDescription.xml``, and FMI 3.0's terminals.

A template is filled from machine and variable table. An FMI 3.0 FMU has the table of FMI 2.0 with other types, windows
as arrays, and the time. A terminal is a plug, by which a tool connects whole FMUs: members of the same name of two
terminals of one kind belong together. ``reference`` carries the commanded position ahead of the drive, ``drive`` the
command of the drive and its measured position.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree as ET

from ..base.version import __version__
from .c_header import layout_of
from .flavours import FMI_VERSIONS
from .spec import AUTHOR, COPYRIGHT, FmuSpec, generation_time
from .variables import INTERPOLATED, FmuTable, Variable

__all__ = [
    "ICON_FILE",
    "TERMINALS",
    "TERMINALS_FILE",
    "build_description",
    "document",
    "fmi3_description",
    "fmi3_variables",
    "model_description",
    "template",
    "terminals_and_icons",
    "unit_elements",
    "xml_text",
]

_TEMPLATES = Path(__file__).parent / "templates"


def model_description(spec: FmuSpec, guid: str, generation_tool: str) -> bytes:
    """Return the XML document, the same bytes for the same arguments.

    Parameters
    ----------
    spec : FmuSpec
        The machine's sampling interval and trajectory make the default experiment.
    guid : str
        Follows from the content; see :mod:`hybridsep.fmi.spec`.
    generation_tool : str
    """
    # C sources take their memory from the importer, extrapolate inputs and need no more than their own binary
    table, native = spec.table.shown, spec.flavour == "native"
    root = _begun("modelDescription.xml", spec, table, {"guid": guid}, generation_tool)
    simulation, _, types, _, _, variables, structure = root
    simulation.attrib |= {
        "needsExecutionTool": xml_text(not native),
        "canInterpolateInputs": xml_text(native and bool(INTERPOLATED[spec.table.model])),
        "canNotUseMemoryManagementFunctions": xml_text(not native),
    }
    if native:
        ET.SubElement(ET.SubElement(simulation, "SourceFiles"), "File", name="all.c")
    for variable, attributes in _types_of(table):
        _add_items(ET.SubElement(ET.SubElement(types, "SimpleType", attributes), "Enumeration"), variable)
    if not len(types):
        root.remove(types)
    for reference, variable in enumerate(table):
        own, values = _variable_attributes(variable, reference, integers=("Integer", "Enumeration"))
        ET.SubElement(ET.SubElement(variables, "ScalarVariable", own), variable.kind, values)
    _fill_structure(structure, table)
    return document(root)


def _begun(
    file: str, spec: FmuSpec, table: Sequence[Variable], token: Mapping[str, str], generation_tool: str
) -> ET.Element:
    """Return a template with what all versions of FMI say alike: names, units and the default experiment.

    Parameters
    ----------
    file : str
        The template.
    spec, generation_tool
        As :func:`model_description` has them.
    table : sequence of Variable
    token : mapping
        What the version calls the GUID → the GUID.
    """
    name, root = spec.table.name, template(file)
    simulation, units, _, _, experiment, _, _ = root
    root.attrib |= {
        "modelName": name,
        **token,
        "description": spec.title,
        "version": __version__,
        "author": AUTHOR,
        "copyright": COPYRIGHT,
        "generationTool": generation_tool,
        "generationDateAndTime": generation_time(),
    }
    simulation.set("modelIdentifier", name)
    used = {variable.unit for variable in table}
    units[:] = [unit for unit in unit_elements() if unit.get("name") in used]
    experiment.attrib |= {"stopTime": xml_text(spec.stop_time), "stepSize": xml_text(spec.machine.T_s)}
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


def _types_of(table: Sequence[Variable]) -> list[tuple[Variable, dict[str, str]]]:
    """Return the enumerations, each of which has a type of its own, with the attributes of that type."""
    items = [variable for variable in table if variable.items]
    return [(variable, {"name": variable.type_name, "description": variable.description}) for variable in items]


def _add_items(parent: ET.Element, variable: Variable) -> None:
    """Add the items of an enumeration to its type."""
    for value, (item, meaning) in enumerate(zip(variable.items, variable.item_meanings, strict=True)):
        ET.SubElement(parent, "Item", name=item, value=str(value), description=meaning)


def _variable_attributes(
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


_TYPES = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "Enumeration": "Enumeration"}

_TIME = Variable("time", "Real", "independent", "continuous", "simulation time", unit="s")


@dataclass(frozen=True)
class _Fmi3Variable:
    """One FMI 3.0 variable; its value reference is its place in the list.

    Attributes
    ----------
    variable : Variable
        With a type of FMI 3.0 as its kind.
    size : int or None
        Number of elements of an array of one dimension; None if it is scalar.
    """

    variable: Variable
    size: int | None = None

    @property
    def shown(self) -> Variable:
        """As a table of the interface shows it: an array's type with its size."""
        own = self.variable
        return own if self.size is None else replace(own, kind=f"{own.kind}[{self.size}]")


def fmi3_variables(table: FmuTable) -> list[_Fmi3Variable]:
    """Return the variables: single ones, then the modes, then windows, then the time.

    Parameters
    ----------
    table : FmuTable
    """
    layout = layout_of(table.shown)
    found = [_Fmi3Variable(variable) for variable in (*layout.scalars, *layout.modes)]
    for window in layout.windows:
        name = window[0].name.partition("[")[0]
        found.append(_Fmi3Variable(replace(window[0], name=name), size=len(window)))
    found.append(_Fmi3Variable(_TIME))
    return [replace(each, variable=replace(each.variable, kind=_TYPES[each.variable.kind])) for each in found]


_OWN_STEPS = ("FeedDrive",)
"""Models whose internal steps divide the communication step; all others sample at T_s."""


def fmi3_description(spec: FmuSpec, token: str, generation_tool: str) -> bytes:
    """Return the XML document of a native FMU, the same bytes for the same arguments.

    Parameters
    ----------
    spec : FmuSpec
        The machine's sampling interval and trajectory make the default experiment.
    token : str
        The instantiation token, which follows from the content; see :mod:`hybridsep.fmi.spec`.
    generation_tool : str
    """
    table = fmi3_variables(spec.table)
    own_table = [each.variable for each in table]
    named = {"instantiationToken": token}
    root = _begun("modelDescription3.xml", spec, own_table, named, generation_tool)
    simulation, _, types, _, _, variables, structure = root
    if spec.table.model not in _OWN_STEPS:
        simulation.set("fixedInternalStepSize", xml_text(spec.machine.T_s))
    for variable, attributes in _types_of(own_table):
        # fmpy up to 0.3.23 reads no EnumerationType that has a description; the variable and the items have theirs
        del attributes["description"]
        _add_items(ET.SubElement(types, "EnumerationType", attributes), variable)
    if not len(types):
        root.remove(types)
    for reference, each in enumerate(table):
        own, values = _variable_attributes(each.variable, reference, integers=("Int32", "Enumeration"))
        element = ET.SubElement(variables, each.variable.kind, own | values)
        if each.size is not None:
            ET.SubElement(element, "Dimension", start=str(each.size))
    _fill_fmi3_structure(structure, table)
    return document(root)


def _fill_fmi3_structure(structure: ET.Element, table: Sequence[_Fmi3Variable]) -> None:
    """Name the outputs, which have no direct feedthrough, and their dependencies at initialization."""
    reference = {each.variable.name: str(i) for i, each in enumerate(table)}
    outputs = [each.variable for each in table if each.variable.causality == "output"]
    for variable in outputs:
        ET.SubElement(structure, "Output", valueReference=reference[variable.name], dependencies="")
    for variable in outputs:
        dependencies = " ".join(reference[name] for name in variable.initially_from)
        attributes = {"valueReference": reference[variable.name], "dependencies": dependencies}
        ET.SubElement(structure, "InitialUnknown", attributes)


TERMINALS_FILE = "terminalsAndIcons/terminalsAndIcons.xml"
ICON_FILE = "terminalsAndIcons/icon.png"

TERMINALS: Mapping[str, Mapping[str, Mapping[str, str]]] = {
    "HybridPredictor": {"reference": {"command": "x_d_ahead"}, "drive": {"command": "x_d", "measured": "x_meas"}},
    "SepCompensator": {"reference": {"command": "x_d_ahead"}, "drive": {"command": "x_dm", "measured": "x_meas"}},
    "FeedDrive": {"drive": {"command": "x_d", "measured": "x_meas"}},
    "ReferenceTrajectory": {"reference": {"command": "r"}},
}
"""Model → terminal → member → variable."""

_DESCRIPTIONS = {
    "reference": "commanded position, a look-ahead early",
    "drive": "command of the drive and measured position",
}
_EXTENT = 100.0
"""Half the width and height of the icon, in the coordinates of the terminals' file."""


def terminals_and_icons(model: str) -> bytes:
    """Return the document of a model.

    Parameters
    ----------
    model : str
        ``HybridPredictor``, ``FeedDrive``, …
    """
    root = ET.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    picture = ET.SubElement(root, "GraphicalRepresentation")
    corners = {"x1": -_EXTENT, "y1": -_EXTENT, "x2": _EXTENT, "y2": _EXTENT}
    extent = {name: repr(place) for name, place in corners.items()}
    ET.SubElement(picture, "CoordinateSystem", extent, suggestedScalingFactorTo_mm="0.1")
    ET.SubElement(picture, "Icon", extent)
    terminals = ET.SubElement(root, "Terminals")
    for name, members in TERMINALS[model].items():
        attributes = {"name": name, "matchingRule": "plug", "terminalKind": f"hybridsep.{name}"}
        terminal = ET.SubElement(terminals, "Terminal", attributes, description=_DESCRIPTIONS[name])
        for member, variable in members.items():
            attributes = {"variableName": variable, "memberName": member, "variableKind": "signal"}
            ET.SubElement(terminal, "TerminalMemberVariable", attributes)
    return document(root)
