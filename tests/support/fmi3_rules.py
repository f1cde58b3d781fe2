"""Rules of FMI 3.0 for co-simulation that its schemas cannot say, of an FMU's three XML files.

They are the static rules of VDMCheck3 (INTO-CPS, a formal model of the standard) that concern an FMU for co-simulation
alone, each by what it asks, and what the standard asks beyond them: an independent variable, display units, nominal
values, icons that are there, and members of terminals that can be connected.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from xml.etree import ElementTree as ET

import fmi2_rules
from fmi2_naming import is_structured

FLOATS = ("Float32", "Float64")
INTEGERS = {f"{sign}Int{bits}": (sign, bits) for sign in ("", "U") for bits in (8, 16, 32, 64)}
TYPES = (*FLOATS, *INTEGERS, "Boolean", "String", "Binary", "Enumeration", "Clock")

CAUSALITIES: dict[str, dict[str, tuple[str, ...]]] = {
    "structuralParameter": {"fixed": ("exact",), "tunable": ("exact",)},
    "parameter": {"fixed": ("exact",), "tunable": ("exact",)},
    "calculatedParameter": {"fixed": ("calculated", "approx"), "tunable": ("calculated", "approx")},
    "input": {"discrete": (), "continuous": ()},
    "independent": {"continuous": ()},
    **{
        name: {
            "constant": ("exact",),
            "discrete": ("calculated", "exact", "approx"),
            "continuous": ("calculated", "exact", "approx"),
        }
        for name in ("output", "local")
    },
}
CAUSALITIES["local"] |= {"fixed": ("calculated", "approx"), "tunable": ("calculated", "approx")}
"""Causality → variability → values of ``initial``, the default first; none where it must be left out."""


@dataclass(frozen=True)
class Archive:
    """The XML files of an FMU, and the names of all of its files."""

    model: ET.Element
    terminals: ET.Element
    build: ET.Element
    files: Collection[str]

    @property
    def variables(self) -> list[ET.Element]:
        return self.model.findall("ModelVariables/*")

    @property
    def types(self) -> dict[str, ET.Element]:
        return {str(element.get("name")): element for element in self.model.iterfind("TypeDefinitions/*")}


Rule = Callable[[Archive], Iterator[str]]

RULES: dict[str, Rule] = {}
"""By name; each yields what it finds wrong."""


def violations(archive: Archive) -> list[str]:
    """Return what is wrong with an FMU, each with the name of its rule."""
    return [f"{name}: {finding}" for name, rule in RULES.items() for finding in rule(archive)]


def _rule(function: Rule) -> Rule:
    RULES[function.__name__] = function
    return function


def _repeated(names: Iterable[object]) -> list[object]:
    return [name for name, count in Counter(names).items() if count > 1]


def _of_structure(archive: Archive, part: str) -> list[ET.Element]:
    return archive.model.findall(f"ModelStructure/{part}")


def _initial(variable: ET.Element) -> str | None:
    """Return the value of ``initial``, the default where it is left out."""
    allowed = CAUSALITIES.get(variable.get("causality", "local"), {}).get(_variability(variable), ())
    return variable.get("initial") or (allowed[0] if allowed else None)


def _variability(variable: ET.Element) -> str:
    usual = "continuous" if variable.tag in FLOATS else "discrete"
    parameter = variable.get("causality", "").lower().endswith("parameter")
    return variable.get("variability") or ("fixed" if parameter else usual)


@_rule
def model_types(archive: Archive) -> Iterator[str]:
    kinds = [element for element in archive.model if element.tag in ("ModelExchange", "CoSimulation")]
    if not kinds:
        yield "neither ModelExchange nor CoSimulation"
    for kind in kinds:
        if not re.fullmatch(r"[A-Za-z_]\w*", kind.get("modelIdentifier", ""), re.ASCII):
            yield f"modelIdentifier {kind.get('modelIdentifier')!r} is no name in C"
        says = {name: kind.get(name) == "true" for name in kind.attrib}
        if says.get("canReturnEarlyAfterIntermediateUpdate") and not says.get("providesIntermediateUpdate"):
            yield "canReturnEarlyAfterIntermediateUpdate without providesIntermediateUpdate"
        if says.get("canSerializeFMUState") and not says.get("canGetAndSetFMUState"):
            yield "canSerializeFMUState without canGetAndSetFMUState"
        clocks = [variable for variable in archive.variables if variable.tag == "Clock"]
        if clocks and not says.get("hasEventMode"):
            yield "clocks without hasEventMode"
    for name in ("modelName", "instantiationToken"):
        if not archive.model.get(name, "").strip():
            yield f"{name} is empty"


@_rule
def shared_with_fmi_2(archive: Archive) -> Iterator[str]:
    """Units, log categories and the default experiment follow the rules of FMI 2.0."""
    for rule in (fmi2_rules.units, fmi2_rules.categories_and_tools, fmi2_rules.default_experiment):
        yield from rule(archive.model)


@_rule
def type_definitions(archive: Archive) -> Iterator[str]:
    names = [str(element.get("name")) for element in archive.model.iterfind("TypeDefinitions/*")]
    for name in _repeated(names):
        yield f"type {name} is defined twice"
    for name in sorted({str(variable.get("name")) for variable in archive.variables} & set(names)):
        yield f"type {name} has the name of a variable"
    for element in archive.types.values():
        for what in ("name", "value"):
            for repeated in _repeated(item.get(what) for item in element.iterfind("Item")):
                yield f"type {element.get('name')} has the {what} {repeated} twice"


@_rule
def declared_types(archive: Archive) -> Iterator[str]:
    for variable in archive.variables:
        declared = variable.get("declaredType")
        if variable.tag == "Enumeration" and declared is None:
            yield f"{variable.get('name')} is an Enumeration without a declared type"
        if declared is not None and getattr(archive.types.get(declared), "tag", None) != f"{variable.tag}Type":
            yield f"{variable.get('name')} has the type {declared}, which is not defined as {variable.tag}Type"


@_rule
def unit_references(archive: Archive) -> Iterator[str]:
    defined = {
        str(unit.get("name")): {unit.get("name"), *(shown.get("name") for shown in unit.iterfind("DisplayUnit"))}
        for unit in archive.model.iterfind("UnitDefinitions/Unit")
    }
    for element in (*archive.types.values(), *archive.variables):
        unit, display = element.get("unit"), element.get("displayUnit")
        if unit is not None and unit not in defined:
            yield f"{element.get('name')} has the unit {unit}, which is not defined"
        if display is not None and display not in defined.get(str(unit), ()):
            yield f"{element.get('name')} has the display unit {display}, which {unit} has not"


@_rule
def variable_names(archive: Archive) -> Iterator[str]:
    names = [str(element.get("name")) for element in archive.model.iterfind("ModelVariables//*[@name]")]
    for name in _repeated(names):
        yield f"variable {name} is defined twice"
    for variable in archive.variables:
        name = str(variable.get("name"))
        if archive.model.get("variableNamingConvention") == "structured" and not is_structured(name):
            yield f"{name} is no structured name"
        if name.startswith("der(") and variable.tag not in FLOATS:
            yield f"{name} is a derivative, but no float"


@_rule
def value_references(archive: Archive) -> Iterator[str]:
    for reference in _repeated(variable.get("valueReference") for variable in archive.variables):
        yield f"value reference {reference} is used twice"


@_rule
def combinations(archive: Archive) -> Iterator[str]:
    independent = [v.get("name") for v in archive.variables if v.get("causality") == "independent"]
    if len(independent) != 1:
        yield f"one variable must be the independent one, got {independent}"
    for variable in archive.variables:
        name, causality, variability = variable.get("name"), variable.get("causality", "local"), _variability(variable)
        allowed = CAUSALITIES.get(causality, {}).get(variability)
        if allowed is None:
            yield f"{name} is {variability} and {causality}"
            continue
        if variable.tag not in FLOATS and variability == "continuous":
            yield f"{name} is continuous, but no float"
        if variable.get("initial") is not None and variable.get("initial") not in allowed:
            yield f"{name} is {causality} and {variability} with initial = {variable.get('initial')}"
        needs = causality == "input" or _initial(variable) in ("exact", "approx")
        if needs != (variable.get("start") is not None):
            yield f"{name} {'needs a' if needs else 'has a'} start value: {causality}, {_initial(variable)}"


def _bounds(archive: Archive, variable: ET.Element) -> tuple[float, float]:
    """Return the least and the largest value, the type's where a variable names none."""
    least, most = -float("inf"), float("inf")
    if variable.tag in INTEGERS or variable.tag == "Enumeration":
        sign, bits = INTEGERS.get(variable.tag, ("", 64))
        least, most = (0, 2**bits - 1) if sign else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    declared = archive.types.get(variable.get("declaredType", ""))
    for element in (declared, variable):
        if element is not None:
            least, most = float(element.get("min", least)), float(element.get("max", most))
    return least, most


@_rule
def ranges(archive: Archive) -> Iterator[str]:
    for variable in archive.variables:
        name = variable.get("name")
        if variable.tag not in (*FLOATS, *INTEGERS, "Enumeration"):
            continue
        least, most = _bounds(archive, variable)
        starts = [float(start) for start in variable.get("start", "").split()]
        if not least <= most:
            yield f"{name} has min {least} > max {most}"
        if variable.tag in INTEGERS:
            sign, bits = INTEGERS[variable.tag]
            if most >= 2 ** (bits - (not sign)) or least < (0 if sign else -(2 ** (bits - 1))):
                yield f"{name} has a range beyond {variable.tag}"
        if any(not least <= start <= most for start in starts):
            yield f"{name} starts at {starts}, outside {least} … {most}"
        items = archive.types.get(variable.get("declaredType", ""), ET.Element("none")).iterfind("Item")
        values = {float(str(item.get("value"))) for item in items}
        if variable.tag == "Enumeration" and not set(starts) <= values:
            yield f"{name} starts at {starts}, which is no item of its type"
        if float(variable.get("nominal", 1)) <= 0.0:
            yield f"{name} has the nominal value {variable.get('nominal')}"


@_rule
def dimensions(archive: Archive) -> Iterator[str]:
    by_reference = {variable.get("valueReference"): variable for variable in archive.variables}
    for variable in archive.variables:
        size = 1
        for dimension in variable.iterfind("Dimension"):
            start, reference = dimension.get("start"), dimension.get("valueReference")
            if (start is None) == (reference is None):
                yield f"{variable.get('name')} must have a dimension with either a start or a value reference"
                continue
            other = None if reference is None else by_reference.get(reference)
            if reference is not None and (other is None or other.get("causality") != "structuralParameter"):
                yield f"{variable.get('name')} has a size that is no structural parameter: {reference}"
                continue
            size *= int(str(start if other is None else other.get("start")))
        if size < 1:
            yield f"{variable.get('name')} has no element"
        starts = variable.get("start", "").split()
        if variable.find("Dimension") is not None and len(starts) not in (0, 1, size):
            yield f"{variable.get('name')} has {len(starts)} starts for {size} elements"


@_rule
def model_exchange_alone(archive: Archive) -> Iterator[str]:
    exchange = archive.model.find("ModelExchange") is not None
    for variable in archive.variables:
        for attribute in ("reinit", "canHandleMultipleSetPerTimeInstant"):
            if variable.get(attribute) == "true" and not exchange:
                yield f"{variable.get('name')} has {attribute}, which is for model exchange"


@_rule
def structure(archive: Archive) -> Iterator[str]:
    outputs = {v.get("valueReference") for v in archive.variables if v.get("causality") == "output"}
    unknown = {
        v.get("valueReference")
        for v in archive.variables
        if v.get("causality") == "calculatedParameter"
        or (v.get("causality") == "output" and _initial(v) in ("approx", "calculated"))
    }
    for part, expected in (("Output", outputs), ("InitialUnknown", unknown)):
        listed = [element.get("valueReference") for element in _of_structure(archive, part)]
        if set(listed) != expected or _repeated(listed):
            yield f"{part} must be of {sorted(map(str, expected))}, got {listed}"


@_rule
def dependencies(archive: Archive) -> Iterator[str]:
    by_reference = {variable.get("valueReference"): variable for variable in archive.variables}
    unknown = {element.get("valueReference") for element in _of_structure(archive, "InitialUnknown")}
    for part in ("Output", "InitialUnknown"):
        for element in _of_structure(archive, part):
            what = f"{part} {element.get('valueReference')}"
            on, kinds = element.get("dependencies"), element.get("dependenciesKind")
            if kinds is not None and (on is None or len(on.split()) != len(kinds.split())):
                yield f"{what} has other than as many kinds as dependencies"
            for reference in _repeated((on or "").split()):
                yield f"{what} depends on {reference} twice"
            for reference in (on or "").split():
                known = by_reference.get(reference)
                if known is None:
                    yield f"{what} depends on the value reference {reference}, which there is not"
                elif part == "InitialUnknown" and reference in unknown:
                    yield f"{what} depends on {known.get('name')}, which is unknown, too"
                elif part == "Output" and known.get("causality") not in ("input", "independent"):
                    yield f"{what} depends on {known.get('name')}, which is no known of a step"


@_rule
def build_configuration(archive: Archive) -> Iterator[str]:
    identifiers = {kind.get("modelIdentifier") for kind in archive.model.iterfind("CoSimulation")}
    for configuration in archive.build.iterfind("BuildConfiguration"):
        if configuration.get("modelIdentifier") not in identifiers:
            yield f"modelIdentifier {configuration.get('modelIdentifier')} is not the model description's"
    for sources in archive.build.iterfind("BuildConfiguration/SourceFileSet"):
        names = [file.get("name") for file in sources.iterfind("SourceFile")]
        for name in _repeated(names):
            yield f"source file {name} is named twice"
        for name in names:
            if f"sources/{name}" not in archive.files:
                yield f"source file {name} is not there"
        if sources.get("compilerOptions") is not None and sources.get("compiler") is None:
            yield "compilerOptions without a compiler"


@_rule
def pictures(archive: Archive) -> Iterator[str]:
    for name in ("CoordinateSystem", "Icon"):
        for element in archive.terminals.iterfind(f"GraphicalRepresentation/{name}"):
            x1, y1, x2, y2 = (float(str(element.get(corner))) for corner in ("x1", "y1", "x2", "y2"))
            if not (x1 < x2 and y1 < y2):
                yield f"{name} must go from the lower left to the upper right, got {element.attrib}"
            if name == "Icon" and "terminalsAndIcons/icon.png" not in archive.files:
                yield "terminalsAndIcons/icon.png is not there"


@_rule
def terminals(archive: Archive) -> Iterator[str]:
    variables = {variable.get("name") for variable in archive.variables}
    found = archive.terminals.findall("Terminals/Terminal")
    for name in _repeated(terminal.get("name") for terminal in found):
        yield f"terminal {name} is defined twice"
    for terminal in found:
        members = terminal.findall("TerminalMemberVariable")
        for member in members:
            if member.get("variableName") not in variables:
                yield f"terminal {terminal.get('name')} has the variable {member.get('variableName')}, not declared"
            if terminal.get("matchingRule") in ("plug", "bus") and member.get("memberName") is None:
                yield f"terminal {terminal.get('name')} is a {terminal.get('matchingRule')} whose members need names"
        for name in _repeated(member.get("memberName") for member in members):
            yield f"terminal {terminal.get('name')} has the member {name} twice"
