"""XML files of the FMI 3.0 FMUs against schemas, fmpy's checks and the rules, and the rules against damaged ones."""

from __future__ import annotations

import copy
import zipfile
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import fmpy
import pytest
from built_once import FMI3, NATIVE, BuiltFmus, each_kind
from fmi3_rules import RULES, Archive, violations
from fmpy.validation import validate_fmu

from hybridsep.base.data_files import data_folder
from hybridsep.fmi.compile import ALL_TARGETS, TARGETS, placed
from hybridsep.fmi.description import ICON_FILE, TERMINALS, build_description, fmi3_description, terminals_and_icons
from hybridsep.fmi.spec import FmuSpec, fmu_names
from hybridsep.machines.machine import load_machine

etree: Any = import_module("lxml.etree")  # comes with fmpy, has no types

SCHEMAS = {
    "modelDescription.xml": "fmi3ModelDescription.xsd",
    "terminalsAndIcons/terminalsAndIcons.xml": "fmi3TerminalsAndIcons.xsd",
    "sources/buildDescription.xml": "fmi3BuildDescription.xsd",
}


def opened(path: Path) -> Archive:
    """Return the XML files of an FMU."""
    with zipfile.ZipFile(path) as archive:
        model, terminals, build = (ET.fromstring(archive.read(name)) for name in SCHEMAS)
        return Archive(model, terminals, build, archive.namelist())


@pytest.mark.slow
@pytest.mark.parametrize("name", each_kind(FMI3))
def test_schemas_checkers_and_rules_have_no_finding(fmus: BuiltFmus, name: str) -> None:
    path = fmus(name)
    assert validate_fmu(str(path)) == []
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        for file, schema in SCHEMAS.items():
            xsd = etree.XMLSchema(file=str(Path(fmpy.__file__).parent / "schema" / "fmi3" / schema))
            xsd.assertValid(etree.parse(archive.open(file)))
    assert violations(opened(path)) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", each_kind(FMI3))
def test_the_archive_is_complete(fmus: BuiltFmus, name: str) -> None:
    with zipfile.ZipFile(fmus(name)) as archive:
        files = set(archive.namelist())
        page = archive.read("documentation/index.html").decode()
        assert archive.read(ICON_FILE).startswith(b"\x89PNG\r\n\x1a\n")
        assert archive.read("sources/hsep_fmu.h").decode().count(f"#define FMI3_FUNCTION_PREFIX {name}_") == 1
    assert {f"binaries/x86_64-linux/{name}.so", "sources/all.c", "documentation/licenses/license.txt"} <= files
    assert not [file for file in files if "linux64" in file or "fmi2" in Path(file).name or file == "model.png"]
    for variable in fmpy.read_model_description(str(fmus(name))).modelVariables:
        size = f"[{variable.shape[0]}]" if variable.shape else ""
        assert f"<td>{variable.name}</td><td>{variable.type}{size}" in page


@pytest.mark.slow
@pytest.mark.parametrize("name", each_kind(FMI3))
def test_types_are_described_by_their_items_alone(fmus: BuiltFmus, name: str) -> None:
    """fmpy up to 0.3.23 raises a TypeError where an EnumerationType has a description."""
    for found in opened(fmus(name)).model.iter("EnumerationType"):
        assert list(found.attrib) == ["name"]
        assert all(item.get("description") for item in found)


def test_binaries_lie_where_fmi_3_has_them() -> None:
    found = placed(dict.fromkeys(ALL_TARGETS, b""), "Axis", "3")
    assert sorted(found) == sorted(f"{key}/Axis{TARGETS[key].suffix}" for key in ALL_TARGETS)


@pytest.mark.slow
@pytest.mark.parametrize(("new", "old"), each_kind(list(zip(FMI3, NATIVE, strict=True))))
def test_the_twins_have_the_same_interface(fmus: BuiltFmus, new: str, old: str) -> None:
    """Names, causalities, units, ranges and starts; windows are arrays, and there is the time beside them."""
    described, before = (fmpy.read_model_description(str(fmus(name))) for name in (new, old))
    types = {"Real": "Float64", "Integer": "Int32", "Enumeration": "Enumeration", "Boolean": "Boolean"}
    expected, windows = [], dict[str, int]()
    for variable in before.modelVariables:
        name, bracket, _ = variable.name.partition("_window[")
        if bracket:
            windows[f"{name}_window"] = windows.get(f"{name}_window", 0) + 1
            if windows[f"{name}_window"] > 1:
                continue
        shown = variable.name.partition("[")[0] if bracket else variable.name
        expected.append((shown, types[variable.type], *attributes(variable)))
    found = [(v.name, v.type, *attributes(v)) for v in described.modelVariables]
    assert found[:-1] == expected
    assert found[-1][:4] == ("time", "Float64", "independent", "continuous")
    assert {v.name: v.shape[0] for v in described.modelVariables if v.shape} == windows
    assert [v.valueReference for v in described.modelVariables] == list(range(len(found)))
    assert described.instantiationToken != before.guid
    dependencies = [
        [(u.variable.name, [d.name for d in u.dependencies]) for u in (*which.outputs, *which.initialUnknowns)]
        for which in (described, before)
    ]
    assert dependencies[0] == dependencies[1]


def attributes(variable: Any) -> tuple[object, ...]:
    names = (
        "causality",
        "variability",
        "initial",
        "unit",
        "displayUnit",
        "start",
        "min",
        "max",
        "nominal",
        "description",
    )
    return tuple(getattr(variable, name) for name in names)


def test_terminals_of_two_fmus_fit_each_other(fmus: BuiltFmus) -> None:
    """A member is an output of one of the FMUs and an input of the other."""
    causality = {}
    for model in TERMINALS:
        for variable in fmpy.read_model_description(str(fmus(f"{model}Fmi3"))).modelVariables:
            causality[model, variable.name] = variable.causality
    pairs = [
        ("ReferenceTrajectory", "HybridPredictor", "reference"),
        ("ReferenceTrajectory", "SepCompensator", "reference"),
        ("HybridPredictor", "FeedDrive", "drive"),
        ("SepCompensator", "FeedDrive", "drive"),
    ]
    for one, other, terminal in pairs:
        first, second = TERMINALS[one][terminal], TERMINALS[other][terminal]
        assert first.keys() == second.keys()
        for member in first:
            assert {causality[one, first[member]], causality[other, second[member]]} == {"input", "output"}


def test_a_rotary_axis_keeps_the_rules(tmp_path: Path) -> None:
    text = (data_folder("models") / "emps.toml").read_text(encoding="utf-8").replace("T_s =", 'unit = "rad"\nT_s =', 1)
    path = tmp_path / "table.toml"
    path.write_text(text + "[drive_limits]\nvelocity = 1.0\nacceleration = 9.0\njerk = 900.0\n", encoding="utf-8")
    machine = load_machine(path)
    for name, model in fmu_names(machine, fmi="3").items():
        xml = ET.fromstring(fmi3_description(FmuSpec.of(machine, model, fmi="3"), "{1}", "tool"))
        assert xml.find("ModelVariables/Float64[@unit='rad']") is not None
        build, icons = ET.fromstring(build_description(name, "3")), ET.fromstring(terminals_and_icons(model))
        assert violations(Archive(xml, icons, build, [ICON_FILE, "sources/all.c"])) == []


X_H, TYPE = ".//*[@name='x_h']", "TypeDefinitions/EnumerationType"
DAMAGES: dict[str, list[tuple[str, str, Any]]] = {
    "model_types": [
        ("model", "CoSimulation", {"modelIdentifier": "a-b"}),
        ("model", "CoSimulation", {"canReturnEarlyAfterIntermediateUpdate": "true"}),
        ("model", "CoSimulation", {"canGetAndSetFMUState": "false"}),
        ("model", "ModelVariables", "+Clock"),
        ("model", ".", {"instantiationToken": " "}),
        ("model", ".", "-CoSimulation"),
    ],
    "shared_with_fmi_2": [
        ("model", "UnitDefinitions", "+Unit"),
        ("model", "LogCategories", "+Category"),
        ("model", "DefaultExperiment", {"stepSize": "0"}),
        ("model", "DefaultExperiment", {"stopTime": "-1"}),
    ],
    "type_definitions": [
        ("model", "TypeDefinitions", "+EnumerationType"),
        ("model", TYPE, {"name": "input_hold"}),
        ("model", f"{TYPE}/Item", {"value": "1"}),
        ("model", f"{TYPE}/Item", {"name": "foh"}),
    ],
    "declared_types": [
        ("model", ".//*[@name='input_hold']", {"declaredType": "Hold"}),
        ("model", ".//*[@name='input_hold']", {"declaredType": None}),
        ("model", X_H, {"declaredType": "InputHold"}),
    ],
    "unit_references": [
        ("model", X_H, {"unit": "mile"}),
        ("model", X_H, {"displayUnit": "ms"}),
        ("model", X_H, {"unit": None}),
    ],
    "variable_names": [
        ("model", X_H, {"name": "x_pb"}),
        ("model", X_H, {"name": "x h"}),
        ("model", ".//*[@name='batch']", {"name": "der(batch)"}),
    ],
    "value_references": [("model", X_H, {"valueReference": "1"})],
    "combinations": [
        ("model", ".//*[@name='time']", {"causality": "local"}),
        ("model", X_H, {"causality": "independent", "variability": "continuous", "initial": None}),
        ("model", X_H, {"variability": "fixed"}),
        ("model", X_H, {"initial": "exact"}),
        ("model", X_H, {"start": "0"}),
        ("model", ".//*[@name='time']", {"start": "0"}),
        ("model", ".//*[@name='x_meas']", {"start": None}),
        ("model", ".//*[@name='x_meas']", {"initial": "exact"}),
        ("model", ".//*[@name='batch']", {"variability": "continuous"}),
        ("model", ".//*[@name='Np']", {"variability": "discrete"}),
    ],
    "ranges": [
        ("model", ".//*[@name='Np']", {"start": "0"}),
        ("model", ".//*[@name='Np']", {"min": "5", "max": "4"}),
        ("model", ".//*[@name='Np']", {"max": "3000000000"}),
        ("model", ".//*[@name='lambda']", {"start": "1e13"}),
        ("model", ".//*[@name='input_hold']", {"start": "2"}),
        ("model", X_H, {"nominal": "0"}),
    ],
    "dimensions": [
        ("model", ".//*[@name='x_h_window']/Dimension", {"valueReference": "2"}),
        ("model", ".//*[@name='x_h_window']/Dimension", {"start": None}),
        ("model", ".//*[@name='x_h_window']/Dimension", {"start": None, "valueReference": "2"}),
        ("model", ".//*[@name='x_h_window']/Dimension", {"start": "0"}),
        ("model", ".//*[@name='x_h_window']", {"start": "0 0"}),
    ],
    "model_exchange_alone": [
        ("model", X_H, {"reinit": "true"}),
        ("model", ".//*[@name='x_meas']", {"canHandleMultipleSetPerTimeInstant": "true"}),
    ],
    "structure": [
        ("model", "ModelStructure", "+Output"),
        ("model", "ModelStructure", "-InitialUnknown"),
        ("model", "ModelStructure/Output", {"valueReference": "0"}),
        ("model", ".//*[@name='x_h_window']", {"causality": "output"}),
    ],
    "dependencies": [
        ("model", "ModelStructure/Output", {"dependencies": "90000"}),
        ("model", "ModelStructure/Output", {"dependencies": "1 1"}),
        ("model", "ModelStructure/Output", {"dependencies": "3"}),
        ("model", "ModelStructure/Output", {"dependencies": "1", "dependenciesKind": "dependent fixed"}),
        ("model", "ModelStructure/InitialUnknown", {"dependencies": "3"}),
    ],
    "build_configuration": [
        ("build", "BuildConfiguration", {"modelIdentifier": "Other"}),
        ("build", "BuildConfiguration/SourceFileSet", "+SourceFile"),
        ("build", "BuildConfiguration/SourceFileSet/SourceFile", {"name": "none.c"}),
        ("build", "BuildConfiguration/SourceFileSet", {"compilerOptions": "-O1"}),
    ],
    "pictures": [
        ("terminals", "GraphicalRepresentation/CoordinateSystem", {"x1": "100.0"}),
        ("terminals", "GraphicalRepresentation/Icon", {"y1": "200.0"}),
    ],
    "terminals": [
        ("terminals", "Terminals", "+Terminal"),
        ("terminals", "Terminals/Terminal/TerminalMemberVariable", {"variableName": "other"}),
        ("terminals", "Terminals/Terminal/TerminalMemberVariable", {"memberName": None}),
        ("terminals", "Terminals/Terminal", "+TerminalMemberVariable"),
    ],
}
"""By rule: a file, an element, and attributes to change (None: leave out), a child to double or add (``+``), or to
remove (``-``)."""


@pytest.mark.parametrize(("rule", "n"), [(rule, n) for rule, damages in DAMAGES.items() for n in range(len(damages))])
def test_what_breaks_a_rule_is_found(fmus: BuiltFmus, rule: str, n: int) -> None:
    archive = opened(fmus("HybridPredictorFmi3"))
    file, place, change = DAMAGES[rule][n]
    element = getattr(archive, file).find(place)
    assert element is not None
    if isinstance(change, str):
        child = element.find(change[1:])
        if change[0] == "+":
            element.append(ET.Element(change[1:], name="added") if child is None else copy.deepcopy(child))
        else:
            assert child is not None
            element.remove(child)
    else:
        for name, value in change.items():
            element.attrib.pop(name, None)
            element.attrib.update({} if value is None else {name: value})
    assert [found for found in violations(archive) if found.startswith(f"{rule}: ")]


def test_every_rule_is_broken_by_one_of_the_damages() -> None:
    assert list(DAMAGES) == list(RULES)
