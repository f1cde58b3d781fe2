"""Documents of an FMU: ``modelDescription.xml``, ``buildDescription.xml``, FMI 3.0's terminals, pages and icon.

A template is filled from machine and variable table. An FMI 3.0 FMU has the table of FMI 2.0 with other types, windows
as arrays that are outputs, Np as the structural parameter that sizes them, and the time. A terminal is a plug, by which
a tool connects whole FMUs: members of the same name of two terminals of one kind belong together. ``reference`` carries
the commanded position ahead of the drive, ``drive`` the command of the drive and its measured position.
"""

import html
import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from string import Template
from xml.etree import ElementTree as ET

from ..base.version import VERSION_DATE, __version__
from .reference import AGREEMENT
from .spec import AUTHOR, COPYRIGHT, FmuSpec
from .variables import INTERPOLATED, FmuTable, Variable, layout_of

_TEMPLATES = Path(__file__).parent / "templates"

_FMI3_TYPES = {"Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "Enumeration": "Enumeration"}
_WHOLE = ("Integer", "Int32", "UInt64", "Enumeration")  # kinds whose numbers are whole

_TIME = Variable("time", "Real", "independent", "continuous", "simulation time", unit="s")


def described_variables(table: FmuTable, fmi: str) -> list[tuple[Variable, int | None]]:
    """Return the variables by their value references, each with the length of its array, None if it is scalar.

    Of FMI 2.0 the table's. Of FMI 3.0, with its types: single ones, then the modes, then windows, then the time;
    where there are windows, Np sizes them.
    """
    if fmi == "2":
        return [(variable, None) for variable in table.shown]
    layout = layout_of(table.shown)
    found: list[tuple[Variable, int | None]] = [(variable, None) for variable in layout.started]
    for one, *more in layout.windows:  # only an output can be connected
        found.append((replace(one, name=one.name.partition("[")[0], causality="output"), 1 + len(more)))
    of_type = [(replace(one, kind=_FMI3_TYPES[one.kind]), size) for one, size in (*found, (_TIME, None))]
    if layout.windows:
        Np = [variable.name for variable, _ in of_type].index("Np")
        of_type[Np] = (replace(of_type[Np][0], kind="UInt64", causality="structuralParameter"), None)
    return of_type


def model_description(spec: FmuSpec, guid: str, generation_tool: str) -> bytes:
    """Return the XML document, the same bytes for the same arguments.

    The machine's sampling interval and trajectory make the default experiment. The GUID follows from the content, see
    :mod:`hybridsep.fmi.spec`; FMI 3.0 has it as the instantiation token.
    """
    fmi3, model, name = spec.fmi == "3", spec.table.model, spec.table.name
    described = described_variables(spec.table, spec.fmi)
    table = [variable for variable, _ in described]
    root = _template("modelDescription3.xml" if fmi3 else "modelDescription.xml")
    simulation, units, types, _, experiment, variables, structure = root
    root.attrib |= {
        "modelName": name,
        "instantiationToken" if fmi3 else "guid": guid,
        "description": spec.title,
        "version": __version__,
        "author": AUTHOR,
        "copyright": COPYRIGHT,
        "generationTool": generation_tool,
        "generationDateAndTime": f"{VERSION_DATE}T00:00:00Z",
    }
    simulation.set("modelIdentifier", name)
    if not fmi3:
        # C sources take their memory from the importer, extrapolate inputs and need no more than their own binary
        native = spec.flavour == "native"
        simulation.attrib |= {
            "needsExecutionTool": _text(not native),
            "canInterpolateInputs": _text(native and bool(INTERPOLATED[model])),
            "canNotUseMemoryManagementFunctions": _text(not native),
        }
        if not native and model == "HybridPredictor":  # its steps are whole samples
            simulation.set("canHandleVariableCommunicationStepSize", "false")
        if native:
            ET.SubElement(ET.SubElement(simulation, "SourceFiles"), "File", name="all.c")
    if fmi3 and model != "FeedDrive":  # whose steps divide the communication step; all others sample at T_s
        simulation.set("fixedInternalStepSize", _text(spec.machine.T_s))
    used = {variable.unit for variable in table}
    units[:] = [unit for unit in unit_elements() if unit.get("name") in used]
    experiment.attrib |= {"stopTime": _text(spec.stop_time), "stepSize": _text(spec.machine.T_s)}
    for variable in (one for one in table if one.items):
        if fmi3:  # fmpy up to 0.3.23 reads no EnumerationType that has a description; variable and items have theirs
            parent = ET.SubElement(types, "EnumerationType", name=variable.type_name)
        else:
            own = {"name": variable.type_name, "description": variable.description}
            parent = ET.SubElement(ET.SubElement(types, "SimpleType", own), "Enumeration")
        for value, (item, meaning) in enumerate(zip(variable.items, variable.item_meanings, strict=True)):
            ET.SubElement(parent, "Item", name=item, value=str(value), description=meaning)
    if not len(types):
        root.remove(types)
    place = {variable.name: str(i if fmi3 else i + 1) for i, variable in enumerate(table)}
    for reference, (variable, size) in enumerate(described):
        own, values = _variable_attributes(variable, reference)
        if not fmi3:
            ET.SubElement(ET.SubElement(variables, "ScalarVariable", own), variable.kind, values)
            continue
        element = ET.SubElement(variables, variable.kind, own | values)
        if size is not None:
            ET.SubElement(element, "Dimension", valueReference=place["Np"])
    # Outputs have no direct feedthrough; what they depend on at initialization
    key, tags = ("valueReference", ("Output", "InitialUnknown")) if fmi3 else ("index", ("Unknown", "Unknown"))
    parents = (structure, structure) if fmi3 else structure
    for parent, tag, initially in zip(parents, tags, (False, True), strict=True):
        for variable in (one for one in table if one.causality == "output"):
            dependencies = " ".join(place[name] for name in variable.initially_from if initially)
            ET.SubElement(parent, tag, {key: place[variable.name], "dependencies": dependencies})
    return document(root)


def build_description(name: str, fmi: str) -> bytes:
    """Return ``buildDescription.xml`` (FMI 3.0's, which FMI 2.0 tools read too): how the sources are compiled.

    FMI's headers put the model identifier before the functions' names unless a definition says not to.
    """
    root = _template("buildDescription.xml")
    root[0].set("modelIdentifier", name)
    plain = {"2": ("FMI2_FUNCTION_PREFIX", ""), "3": ("FMI3_OVERRIDE_FUNCTION_PREFIX", "1")}[fmi]
    root[0][0][1].attrib |= dict(zip(("name", "value"), plain, strict=True))
    return document(root)


def unit_elements() -> list[ET.Element]:
    """Return the definitions of all units, each with its name and base unit, as FMI 2.0 writes them."""
    return list(_template("modelDescription.xml").iter("Unit"))


def _template(name: str) -> ET.Element:
    return ET.fromstring((_TEMPLATES / name).read_bytes())


def document(root: ET.Element) -> bytes:
    """Return a document, indented."""
    ET.indent(root)
    document: bytes = ET.tostring(root, encoding="UTF-8", xml_declaration=True)
    return document + b"\n"


def _text(value: object) -> str:
    """Write a number so that it reads back the same, and a bool as XML does."""
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _variable_attributes(variable: Variable, reference: int) -> tuple[dict[str, str], dict[str, str]]:
    """Return the attributes of a variable, with its value reference, and the attributes of its type."""
    own = {
        "name": variable.name,
        "valueReference": str(reference),
        # in a tool's flat list a description stands alone
        "description": f"{variable.group}: {variable.description}" if variable.group else variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
    }
    if variable.causality in ("parameter", "structuralParameter"):
        own["initial"] = "exact"
    elif variable.causality not in ("input", "independent"):
        own["initial"] = "calculated"
    values = {"declaredType": variable.type_name} if variable.items else {}
    if variable.unit not in (None, "1"):
        values["unit"] = str(variable.unit)
        if variable.display_unit:
            values["displayUnit"] = variable.display_unit
    number = int if variable.kind in _WHOLE else float
    least = variable.minimum
    if least is not None and variable.automatic is not None:
        least = min(least, variable.automatic)
    for key, bound in (("min", least), ("max", variable.maximum), ("nominal", variable.nominal)):
        if bound is not None and variable.kind != "Boolean":
            values[key] = _text(number(bound))
    if variable.start is not None:
        values["start"] = _text(variable.start if variable.kind == "Boolean" else number(variable.start))
    return own, values


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


def terminals_and_icons(model: str) -> bytes:
    """Return the document of a model (``HybridPredictor``, ``FeedDrive``, …)."""
    root = _template("terminalsAndIcons.xml")
    for name, members in TERMINALS[model].items():
        attributes = {"name": name, "matchingRule": "plug", "terminalKind": f"hybridsep.{name}"}
        terminal = ET.SubElement(root[1], "Terminal", attributes, description=_DESCRIPTIONS[name])
        for member, variable in members.items():
            attributes = {"variableName": variable, "memberName": member, "variableKind": "signal"}
            ET.SubElement(terminal, "TerminalMemberVariable", attributes)
    return document(root)


# Pages ----------------------------------------------------------------------------------------------------------------

_SOURCES = {
    "ReferenceTrajectory": (
        "C.-H. Chou, M. Duan, C. E. Okwudire: A linear hybrid model for enhanced servo error pre-compensation of feed "
        "drives with unmodeled nonlinear dynamics; the limits of eq. (14), the moves of its figures",
        "hybridsep computes the samples, one every T_s; the figures do not print the spiral's size",
    )
}
"""Sources of models that do not depend on the machine."""


def icon(model: str) -> bytes:
    """Return the PNG of a model's icon."""
    return (_TEMPLATES.with_name("icons") / f"{model}.png").read_bytes()


def filled(template: str, **values: object) -> str:
    """Return a file of ``fmi/templates`` with ``$name`` replaced by values, which are HTML in HTML."""
    return Template((_TEMPLATES / template).read_text(encoding="utf-8")).substitute(values)


def documentation(
    spec: FmuSpec, needs: str, dependencies: str, reference: Collection[str], *, limits: str = "", sources: str = ""
) -> dict[str, bytes]:
    """Return the pages of an FMU, ``documentation/index.html`` among them: archive name → content.

    ``spec``: the machine's sources are listed, and types named as its version of FMI has them; ``needs``,
    ``dependencies``: requirements of the FMU: one sentence, and in detail, the text of ``externalDependencies.txt``;
    ``reference``: collection: files of its reference run; empty if it has none; ``limits``, ``sources``: section on
    the limits of the FMU's flavour, and on compiling its sources, HTML.
    """
    model, name = spec.table.model, spec.table.name
    table = [
        one if size is None else replace(one, kind=f"{one.kind}[Np]")
        for one, size in described_variables(spec.table, spec.fmi)
    ]
    rows = "\n".join(
        f'<tbody>\n<tr><th colspan="6" scope="rowgroup">{html.escape(heading)}</th></tr>\n{_rows(group)}\n</tbody>'
        for heading, group in grouped_table(table).items()
    )
    run = {"name": name, "digits": AGREEMENT.get(model, 11), "inputs": ""}
    if model != "ReferenceTrajectory":
        run["inputs"] = f', fed with <a href="reference/{name}_in.csv">{name}_in.csv</a>'
    named = _SOURCES.get(model, spec.machine.sources) or ("none is named in the machine file",)
    # FMU between trajectory and drive on the wiring diagram, and its output to the drive
    partner, command = (model, "x_dm") if model == "SepCompensator" else ("HybridPredictor", "x_d")
    page = _section(
        "index",
        name=name,
        title=html.escape(spec.title),
        needs=html.escape(needs),
        computes=_section(model, steps=_section("steps"), residual=_section("residual")),
        partner=partner,
        command=command,
        rows=rows,
        reference=_section("reference", **run) if reference else "",
        limits=limits,
        compiling=sources,
        sources="\n".join(f"<li>{html.escape(source)}</li>" for source in named),
    )
    files = {"index.html": f"{page}\n", "externalDependencies.txt": dependencies}
    return {f"documentation/{file}": text.encode() for file, text in files.items()}


def _section(template: str, **values: object) -> str:
    return filled(f"{template}.html", **values).rstrip("\n")


def compile_note(name: str, fmi: str) -> str:
    """Return the section on compiling the sources of an FMU with a model identifier, HTML."""
    # with which the standard's headers give the FMI functions their plain names
    plain = {"2": "-DFMI2_FUNCTION_PREFIX=", "3": "-DFMI3_OVERRIDE_FUNCTION_PREFIX"}[fmi]
    return _section("compile", name=name, version=f"{fmi}.0", plain=plain)


def _rows(group: list[tuple[str, str, str, str, str, str]]) -> str:
    return "\n".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in group)


def grouped_table(table: Iterable[Variable]) -> dict[str, list[tuple[str, str, str, str, str, str]]]:
    """Return ``(name, type and unit, display unit, start, range, meaning)`` by heading; items with what they mean."""
    in_one_row: dict[str, Variable] = {}  # of a window the first one as ``name[i]``
    for variable in table:
        in_one_row.setdefault(re.sub(r"^(\w+_window)\[\d+\]", r"\1[i]", variable.name), variable)
    groups: dict[str, list[tuple[str, str, str, str, str, str]]] = {}
    for name, variable in in_one_row.items():
        pairs = enumerate(zip(variable.items, variable.item_meanings, strict=True))
        items = ", ".join(f"{number} {item} ({meaning})" for number, (item, meaning) in pairs)
        meaning = f"{variable.description}: {items}" if items else variable.description
        kind = variable.kind if variable.unit in (None, "1") else f"{variable.kind}, {variable.unit}"
        start = "" if variable.start is None else f"{variable.start:.10g}"
        if variable.kind == "Boolean":
            start = start and str(variable.start).lower()
        row = (name, kind, variable.display_unit or "", start, _range(variable), meaning)
        groups.setdefault(variable.heading, []).append(row)
    return groups


def _range(variable: Variable) -> str:
    """Return the allowed values, an automatic choice and the least value that is not 0 included."""
    if variable.minimum is None or variable.maximum is None or variable.kind == "Boolean":
        return ""
    least = f"0 or {variable.nonzero:g}" if variable.nonzero else f"{variable.minimum:.10g}"
    if variable.minimum == variable.maximum:
        return least
    if variable.automatic is not None:
        least = f"{variable.automatic:g} or {least}"
    return f"{least} … {variable.maximum:.10g}"
