"""Rules of FMI 2.0.x, section 2.2, that the schema of ``modelDescription.xml`` cannot say; sections as in 2.0.

They are the rules of VDMCheck2 (INTO-CPS, a formal model of the standard), and what the standard asks beyond them: base
types of references, nominal values, display units, dependencies.
"""

from __future__ import annotations

import datetime
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from xml.etree import ElementTree as ET

from fmi2_naming import array_gaps, is_structured
from fmi2_variables import Variable

Rule = Callable[[ET.Element], Iterator[str]]

RULES: dict[str, Rule] = {}
"""By name; each yields what it finds wrong."""


def violations(root: ET.Element) -> list[str]:
    """Return what is wrong with a description, each with the name of its rule."""
    return [f"{name}: {finding}" for name, rule in RULES.items() for finding in rule(root)]


def _rule(function: Rule) -> Rule:
    RULES[function.__name__] = function
    return function


def variables_of(root: ET.Element) -> list[Variable]:
    """Return the variables in their order."""
    types = {element.get("name", ""): element for element in root.iterfind("TypeDefinitions/SimpleType")}
    return [Variable(element, types) for element in root.iterfind("ModelVariables/ScalarVariable")]


def _repeated(names: Iterable[object]) -> list[object]:
    return [name for name, count in Counter(names).items() if count > 1]


# 2.2.1: attributes, 4.3.1: co-simulation --------------------------------------------------------------------------


@_rule
def attributes(root: ET.Element) -> Iterator[str]:
    if root.get("fmiVersion") != "2.0":
        yield f"fmiVersion must be 2.0, got {root.get('fmiVersion')}"
    for name in ("modelName", "guid"):
        if not root.get(name, "").strip():
            yield f"{name} is empty"
    moment = root.get("generationDateAndTime")
    if moment is not None:
        try:
            datetime.datetime.strptime(moment, "%Y-%m-%dT%H:%M:%SZ").replace(tzinfo=datetime.timezone.utc)
        except ValueError:
            yield f"generationDateAndTime must be YYYY-MM-DDThh:mm:ssZ, got {moment}"


@_rule
def model_types(root: ET.Element) -> Iterator[str]:
    kinds = [element for kind in ("ModelExchange", "CoSimulation") for element in root.iterfind(kind)]
    if not kinds:
        yield "neither ModelExchange nor CoSimulation"
    for kind in kinds:
        identifier = kind.get("modelIdentifier", "")
        if not re.fullmatch(r"[A-Za-z_]\w*", identifier, re.ASCII):
            yield f"modelIdentifier {identifier!r} is no name in C"
        for name in _repeated(file.get("name") for file in kind.iterfind("SourceFiles/File")):
            yield f"source file {name} is named twice"
        if (kind.get("canSerializeFMUstate"), kind.get("canGetAndSetFMUstate")) in (("true", "false"), ("true", None)):
            yield "canSerializeFMUstate without canGetAndSetFMUstate"


# 2.2.2: units -----------------------------------------------------------------------------------------------------


@_rule
def units(root: ET.Element) -> Iterator[str]:
    found = root.findall("UnitDefinitions/Unit")
    for name in _repeated(unit.get("name") for unit in found):
        yield f"unit {name} is defined twice"
    for unit in found:
        for name in _repeated(shown.get("name") for shown in unit.iterfind("DisplayUnit")):
            yield f"display unit {name} of {unit.get('name')} is defined twice"
        for element in unit:
            if float(element.get("factor", 1)) == 0.0:
                yield f"unit {unit.get('name')} has the factor 0"


@_rule
def unit_references(root: ET.Element) -> Iterator[str]:
    defined = {
        unit.get("name"): {unit.get("name"), *(shown.get("name") for shown in unit.iterfind("DisplayUnit"))}
        for unit in root.iterfind("UnitDefinitions/Unit")
    }
    types = [(kind, t.get("name")) for t in root.iterfind("TypeDefinitions/SimpleType") for kind in t]
    for kind, name in (*types, *((v.kind, v.name) for v in variables_of(root))):
        unit, display = kind.get("unit"), kind.get("displayUnit")
        if unit is not None and unit not in defined:
            yield f"{name} has the unit {unit}, which is not defined"
        elif display is not None and display not in defined.get(unit, ()):
            yield f"{name} has the display unit {display}, which {unit} has not"


# 2.2.3: types -----------------------------------------------------------------------------------------------------


@_rule
def type_names(root: ET.Element) -> Iterator[str]:
    names = [element.get("name") for element in root.iterfind("TypeDefinitions/SimpleType")]
    for name in _repeated(names):
        yield f"type {name} is defined twice"
    for name in sorted({variable.name for variable in variables_of(root)} & set(filter(None, names))):
        yield f"type {name} has the name of a variable"


@_rule
def enumeration_items(root: ET.Element) -> Iterator[str]:
    for element in root.iterfind("TypeDefinitions/SimpleType"):
        for what in ("name", "value"):
            for repeated in _repeated(item.get(what) for item in element.iterfind("Enumeration/Item")):
                yield f"type {element.get('name')} has the {what} {repeated} twice"


@_rule
def declared_types(root: ET.Element) -> Iterator[str]:
    for variable in variables_of(root):
        declared = variable.kind.get("declaredType")
        if variable.base == "Enumeration" and declared is None:
            yield f"{variable.name} is an Enumeration without a declared type"
        if declared is None:
            continue
        if variable.type is None:
            yield f"{variable.name} has the type {declared}, which is not defined"
        elif variable.type.tag != variable.base:
            yield f"{variable.name} is {variable.base}, its type {declared} {variable.type.tag}"


@_rule
def ranges(root: ET.Element) -> Iterator[str]:
    for variable in variables_of(root):
        least, most, start = (variable.number(name) for name in ("min", "max", "start"))
        if least is not None and most is not None and not least <= most:
            yield f"{variable.name} has min {least} > max {most}"
        for number in (least, most, start):
            if variable.base == "Integer" and number is not None and abs(number) >= 2**31:
                yield f"{variable.name} has {number}, which is no 32-bit integer"
        for name, own, outer in (("min", variable.own("min"), 1), ("max", variable.own("max"), -1)):
            bound = None if variable.type is None else variable.type.get(name)
            if own is not None and bound is not None and outer * float(own) < outer * float(bound):
                yield f"{variable.name} has {name} {own} outside its type's {bound}"
        if start is not None and not ((least is None or least <= start) and (most is None or start <= most)):
            yield f"{variable.name} starts at {start}, outside {least} … {most}"
        if start is not None and variable.base == "Enumeration" and start not in variable.items:
            yield f"{variable.name} starts at {start:g}, which is no item of its type"
        nominal = variable.number("nominal")
        if nominal is not None and not nominal > 0.0:
            yield f"{variable.name} has the nominal value {nominal}"


# 2.2.4 to 2.2.6: log categories, default experiment, vendor annotations ---------------------------------------------


@_rule
def categories_and_tools(root: ET.Element) -> Iterator[str]:
    for what, path in (("log category", "LogCategories/Category"), ("tool", "VendorAnnotations/Tool")):
        for name in _repeated(element.get("name") for element in root.iterfind(path)):
            yield f"{what} {name} is named twice"


@_rule
def default_experiment(root: ET.Element) -> Iterator[str]:
    element = root.find("DefaultExperiment")
    given = {} if element is None else {name: float(text) for name, text in element.attrib.items()}
    start, stop = given.get("startTime", 0.0), given.get("stopTime")
    step, tolerance = given.get("stepSize"), given.get("tolerance")
    if stop is not None and not stop > start:
        yield f"stopTime {stop} must be > startTime {start}"
    if step is not None and not 0.0 < step < (float("inf") if stop is None else stop - start):
        yield f"stepSize {step} must be > 0 and below the experiment's length"
    if tolerance is not None and not tolerance > 0.0:
        yield f"tolerance {tolerance} must be > 0"


# 2.2.7: variables -------------------------------------------------------------------------------------------------


@_rule
def variable_names(root: ET.Element) -> Iterator[str]:
    names = [variable.name for variable in variables_of(root)]
    for name in _repeated(names):
        yield f"variable {name} is defined twice"
    if root.get("variableNamingConvention") == "structured":
        for variable in variables_of(root):
            if not is_structured(variable.name):
                yield f"{variable.name} is no structured name"
            if variable.name.startswith("der(") and variable.base != "Real":
                yield f"{variable.name} is a derivative, but no Real"
        yield from array_gaps(names)


@_rule
def combinations(root: ET.Element) -> Iterator[str]:
    for variable in variables_of(root):
        yield from variable.misfits()
    independent = [variable.name for variable in variables_of(root) if variable.causality == "independent"]
    if len(independent) > 1:
        yield f"{', '.join(independent)} are all the independent variable"


@_rule
def aliases(root: ET.Element) -> Iterator[str]:
    groups: dict[tuple[str, str], list[Variable]] = {}
    for variable in variables_of(root):
        base = "Integer" if variable.base == "Enumeration" else variable.base
        groups.setdefault((base, variable.reference), []).append(variable)
    for (_, reference), group in groups.items():
        constants = [variable for variable in group if variable.variability == "constant"]
        for wrong, what in (
            (sum(variable.settable for variable in group) > 1, "more than one variable to set"),
            (sum(variable.start is not None for variable in group if variable not in constants) > 1, "several starts"),
            (len({variable.start for variable in constants}) > 1, "several constants"),
            (len(constants) not in (0, len(group)), "constants and others"),
            (len({variable.kind.get("unit") for variable in group}) > 1, "several units"),
            (
                any(v.causality == "independent" for v in group) and any(v.settable for v in group),
                "the independent variable and one to set",
            ),
        ):
            if wrong:
                yield f"value reference {reference} has {what}: {', '.join(v.name for v in group)}"


@_rule
def model_exchange_alone(root: ET.Element) -> Iterator[str]:
    exchange, variables = root.find("ModelExchange") is not None, variables_of(root)
    states = {variable.kind.get("derivative") for variable in variables} - {None}
    for index, variable in enumerate(variables, start=1):
        if variable.kind.get("reinit") is not None and not (exchange and str(index) in states):
            yield f"{variable.name} has reinit, but is no state of a model exchange"
        multiple = variable.element.get("canHandleMultipleSetPerTimeInstant")
        if multiple == "true" and not (exchange and variable.causality == "input"):
            yield f"{variable.name} has canHandleMultipleSetPerTimeInstant, but is no input of a model exchange"


@_rule
def derivatives(root: ET.Element) -> Iterator[str]:
    variables = variables_of(root)
    for index, variable in enumerate(variables, start=1):
        state = variable.kind.get("derivative")
        if state is None:
            continue
        if not 1 <= int(state) <= len(variables) or int(state) == index:
            yield f"{variable.name} is the derivative of variable {state}, which there is not"
        elif variable.variability != "continuous" or variables[int(state) - 1].variability != "continuous":
            yield f"{variable.name} is the derivative of {variables[int(state) - 1].name}: both must be continuous"


# 2.2.8: model structure -------------------------------------------------------------------------------------------


@_rule
def structure(root: ET.Element) -> Iterator[str]:
    variables = variables_of(root)
    listed = {
        part: [int(unknown.get("index", 0)) for unknown in root.iterfind(f"ModelStructure/{part}/Unknown")]
        for part in ("Outputs", "Derivatives", "InitialUnknowns")
    }
    derived = {i for i, v in enumerate(variables, start=1) if v.kind.get("derivative") is not None}
    states = {int(variables[i - 1].kind.get("derivative", 0)) for i in derived}
    outputs = {i for i, v in enumerate(variables, start=1) if v.causality == "output"}
    unknown = {
        i
        for i, v in enumerate(variables, start=1)
        if v.causality == "calculatedParameter"
        or (i in outputs | states | derived and v.initial in ("approx", "calculated"))
    }
    for part, expected in (("Outputs", outputs), ("InitialUnknowns", unknown)):
        if set(listed[part]) != expected or len(listed[part]) != len(expected):
            yield f"{part} must be {sorted(expected)}, got {listed[part]}"
    if not set(listed["Derivatives"]) <= derived:
        yield f"Derivatives must be of {sorted(derived)}, got {listed['Derivatives']}"
    if any(here >= following for here, following in pairwise(listed["InitialUnknowns"])):
        yield "InitialUnknowns are not in the order of the variables"
    for part in ("Outputs", "InitialUnknowns"):
        if (element := root.find(f"ModelStructure/{part}")) is not None and not len(element):
            yield f"{part} is empty: it must be left out"


@_rule
def dependencies(root: ET.Element) -> Iterator[str]:
    variables = variables_of(root)
    states = {variable.kind.get("derivative") for variable in variables}
    for part in ("Outputs", "Derivatives", "InitialUnknowns"):
        initially = part == "InitialUnknowns"
        allowed = {"dependent", "constant"} | (set() if initially else {"fixed", "tunable", "discrete"})
        for unknown in root.iterfind(f"ModelStructure/{part}/Unknown"):
            what = f"{part}: unknown {unknown.get('index')}"
            on, kinds = unknown.get("dependencies"), unknown.get("dependenciesKind")
            if kinds is not None and (on is None or len(on.split()) != len(kinds.split())):
                yield f"{what} has {len(kinds.split())} kinds for other than as many dependencies"
            if kinds is not None and not set(kinds.split()) <= allowed:
                yield f"{what} has kinds of dependencies beside {', '.join(sorted(allowed))}: {kinds}"
            for index in map(int, (on or "").split()):
                if not 1 <= index <= len(variables):
                    yield f"{what} depends on variable {index}, which there is not"
                elif not variables[index - 1].known(initially=initially, state=str(index) in states):
                    yield f"{what} depends on {variables[index - 1].name}, which is unknown itself"
            for name in _repeated((on or "").split()):
                yield f"{what} depends on {name} twice"
