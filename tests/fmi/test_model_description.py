"""Every archive's modelDescription against the rules of FMI 2.0, section 2.2, and the rules against damaged ones."""

from __future__ import annotations

import copy
import re
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
from built_once import NATIVE, PYTHON, BuiltFmus, each_kind
from fmi2_rules import RULES, variables_of, violations

from hybridsep.base.data_files import data_folder
from hybridsep.fmi.description import model_description
from hybridsep.fmi.flavours import FLAVOURS
from hybridsep.fmi.spec import FmuSpec, fmu_names
from hybridsep.machines.machine import Machine, load_machine


def description_of(path: Path) -> ET.Element:
    with zipfile.ZipFile(path) as archive:
        return ET.fromstring(archive.read("modelDescription.xml"))


@pytest.mark.slow
@pytest.mark.parametrize("name", each_kind([*NATIVE, *PYTHON]))
def test_archives_keep_the_rules_of_the_standard(fmus: BuiltFmus, name: str) -> None:
    path = fmus(name)
    root = description_of(path)
    assert violations(root) == []
    with zipfile.ZipFile(path) as archive:
        files = archive.namelist()
    identifiers = [element.get("modelIdentifier") for element in root.iterfind("CoSimulation")]
    assert identifiers == [name]
    assert [file for file in files if Path(file).stem == name and file.startswith("binaries/linux64/")]
    for source in root.iterfind("CoSimulation/SourceFiles/File"):
        assert f"sources/{source.get('name')}" in files
    assert {"modelDescription.xml", "documentation/index.html", "model.png"} <= set(files)


GROUPS = {
    "Predictor": ["Look-ahead and residual model", "Residual model with trust", "Physics model"],
    "Compensator": ["Look-ahead and residual model", "Residual model with trust", "Compensation", "Physics model"],
    "Drive": ["Drive", "Encoder"],
    "Drive_als25010_x": ["Disturbance", "Command", "Encoder", "Physics model"],
    "Trajectory": ["Trajectory"],
}


@pytest.mark.parametrize(
    ("name", "groups"),
    [
        ("HybridPredictor", "Predictor"),
        ("HybridPredictorPy", "Predictor"),
        ("SepCompensatorFmi3", "Compensator"),
        ("FeedDrive", "Drive"),
        ("FeedDrive_als25010_x", "Drive_als25010_x"),
        ("ReferenceTrajectory", "Trajectory"),
    ],
)
def test_parameters_are_grouped_and_described_alone(fmus: BuiltFmus, name: str, groups: str) -> None:
    """A tool's flat list shows the paper's names, m or p; group and meaning stand in each description."""
    variables = description_of(fmus(name)).findall("ModelVariables/*")
    described = {v.get("name"): str(v.get("description")) for v in variables if v.get("causality") == "parameter"}
    parts = [text.partition(": ") for text in described.values()]
    found = [group for group, _, _ in parts]
    assert [group for i, group in enumerate(found) if group not in found[:i]] == GROUPS[groups]
    assert sorted(found, key=GROUPS[groups].index) == found
    assert all(len(meaning.split()) > 2 for _, _, meaning in parts)
    assert {"FeedDrive": {"m", "c", "k"}, "HybridPredictor": {"p", "q", "lambda"}}.get(name, set()) <= described.keys()


def test_a_rotary_axis_keeps_the_rules(rotary: Machine) -> None:
    for flavour in FLAVOURS:
        names = fmu_names(rotary, flavour)
        assert list(names.values()) == ["HybridPredictor", "SepCompensator"]
        for model in names.values():
            xml = model_description(FmuSpec.of(rotary, model, flavour=flavour), "{1}", "tool")
            assert violations(ET.fromstring(xml)) == []


@pytest.fixture
def rotary(tmp_path: Path) -> Machine:
    """A recorded axis in radians, with limits for a compensator."""
    text = (data_folder("models") / "emps.toml").read_text(encoding="utf-8").replace("T_s =", 'unit = "rad"\nT_s =', 1)
    path = tmp_path / "table.toml"
    path.write_text(text + "[drive_limits]\nvelocity = 1.0\nacceleration = 9.0\njerk = 900.0\n", encoding="utf-8")
    return load_machine(path)


DAMAGES: dict[str, list[tuple[str, Any]]] = {
    "attributes": [
        (".", {"guid": ""}),
        (".", {"modelName": " "}),
        (".", {"fmiVersion": "2.1"}),
        (".", {"generationDateAndTime": "2026-02-30T10:00:00Z"}),
    ],
    "model_types": [
        ("CoSimulation", {"modelIdentifier": "a-b"}),
        ("CoSimulation", {"modelIdentifier": "../../evil"}),
        ("CoSimulation", {"canGetAndSetFMUstate": "false"}),
        (".", "-CoSimulation"),
        ("CoSimulation/SourceFiles", "+File"),
    ],
    "units": [
        ("UnitDefinitions", "+Unit"),
        ("UnitDefinitions/Unit", "+DisplayUnit"),
        ("UnitDefinitions/Unit/DisplayUnit", {"factor": "0"}),
    ],
    "unit_references": [
        (".//*[@name='x_h']/Real", {"unit": "mile"}),
        (".//*[@name='x_h']/Real", {"displayUnit": "ms"}),
        (".//*[@name='x_h']/Real", {"unit": None}),
    ],
    "type_names": [
        ("TypeDefinitions", "+SimpleType"),
        ("TypeDefinitions/SimpleType", {"name": "input_hold"}),
        ("TypeDefinitions/SimpleType", {"name": "x_h"}),
    ],
    "enumeration_items": [
        (".//Enumeration[Item]", "+Item"),
        (".//Item", {"value": "1"}),
        (".//Item", {"name": "foh"}),
    ],
    "declared_types": [
        (".//*[@name='input_hold']/Enumeration", {"declaredType": "hold"}),
        (".//*[@name='input_hold']/Enumeration", {"declaredType": None}),
        (".//*[@name='x_h']/Real", {"declaredType": "InputHold"}),
    ],
    "ranges": [
        (".//*[@name='Np']/Integer", {"start": "0"}),
        (".//*[@name='Np']/Integer", {"min": "5", "max": "4"}),
        (".//*[@name='Np']/Integer", {"max": "3000000000"}),
        (".//*[@name='lambda']/Real", {"start": "1e13"}),
        (".//*[@name='input_hold']/Enumeration", {"start": "2", "max": "2"}),
        (".//*[@name='x_h']/Real", {"nominal": "0"}),
    ],
    "categories_and_tools": [("LogCategories", "+Category")],
    "default_experiment": [
        ("DefaultExperiment", {"stopTime": "0"}),
        ("DefaultExperiment", {"stepSize": "0"}),
        ("DefaultExperiment", {"stepSize": "1e9"}),
        ("DefaultExperiment", {"tolerance": "-1"}),
    ],
    "variable_names": [
        (".//*[@name='x_h']", {"name": "x_pb"}),
        (".//*[@name='x_h']", {"name": "x h"}),
        (".//*[@name='x_h']", {"name": "1x"}),
        (".//*[@name='batch']", {"name": "der(batch)"}),
        (".//*[@name='x_h_window[2]']", {"name": "x_h_window[2000]"}),
        (".//*[@name='x_h']", {"name": "x_h_window[101]"}),
    ],
    "combinations": [
        (".//*[@name='x_h']", {"variability": "fixed"}),
        (".//*[@name='x_h']", {"initial": "exact"}),
        (".//*[@name='x_h']/Real", {"start": "0"}),
        (".//*[@name='x_meas']", {"initial": "exact"}),
        (".//*[@name='x_meas']/Real", {"start": None}),
        (".//*[@name='Np']", {"variability": "discrete"}),
        (".//*[@name='Np']", {"initial": "calculated"}),
        (".//*[@name='Np']/Integer", {"start": None}),
        (".//*[@name='batch']", {"variability": "continuous"}),
        (".//*[@name='batch']", {"causality": "independent", "variability": "continuous", "initial": None}),
    ],
    "aliases": [
        (".//*[@name='x_d_ahead']", {"valueReference": "1"}),
        (".//*[@name='t_init']", {"valueReference": "2"}),
    ],
    "model_exchange_alone": [
        (".//*[@name='x_h']/Real", {"reinit": "true"}),
        (".//*[@name='x_meas']", {"canHandleMultipleSetPerTimeInstant": "true"}),
    ],
    "derivatives": [
        (".//*[@name='x_h']/Real", {"derivative": "4"}),
        (".//*[@name='x_h']/Real", {"derivative": "9000"}),
    ],
    "structure": [
        ("ModelStructure/Outputs/Unknown", {"index": "1"}),
        ("ModelStructure/Outputs", "+Unknown"),
        ("ModelStructure/InitialUnknowns", "-Unknown"),
        ("ModelStructure/InitialUnknowns/Unknown", {"index": "4"}),
        (".//*[@name='x_h_window[1]']", {"causality": "output"}),
    ],
    "dependencies": [
        ("ModelStructure/Outputs/Unknown", {"dependencies": "0"}),
        ("ModelStructure/Outputs/Unknown", {"dependencies": "90000"}),
        ("ModelStructure/Outputs/Unknown", {"dependencies": "1 1"}),
        ("ModelStructure/Outputs/Unknown", {"dependencies": "3"}),
        ("ModelStructure/Outputs/Unknown", {"dependencies": "1", "dependenciesKind": "dependent fixed"}),
        ("ModelStructure/InitialUnknowns/Unknown", {"dependencies": "1", "dependenciesKind": "fixed"}),
    ],
}
"""By rule: an element, and attributes to change (None: leave out), a child to double (``+``) or to remove (``-``)."""


@pytest.mark.parametrize(("rule", "n"), [(rule, n) for rule, damages in DAMAGES.items() for n in range(len(damages))])
def test_what_breaks_a_rule_is_found(fmus: BuiltFmus, rule: str, n: int) -> None:
    root = description_of(fmus("HybridPredictor"))
    place, change = DAMAGES[rule][n]
    element = root.find(place)
    assert element is not None
    if isinstance(change, str):
        child = element.find(change[1:])
        assert child is not None
        if change[0] == "+":
            element.append(copy.deepcopy(child))
        else:
            element.remove(child)
    else:
        element.attrib.update({name: value for name, value in change.items() if value is not None})
        for name in (name for name, value in change.items() if value is None):
            del element.attrib[name]
    assert [found for found in violations(root) if found.startswith(f"{rule}: ")]


def test_every_rule_is_broken_by_one_of_the_damages() -> None:
    assert list(DAMAGES) == list(RULES)


@pytest.mark.parametrize("name", ["HybridPredictor", "SepCompensatorPy", "FeedDrive_als25010_x", "ReferenceTrajectory"])
def test_each_item_of_an_enumeration_has_a_description(fmus: BuiltFmus, name: str) -> None:
    root = description_of(fmus(name))
    assert [variable.name for variable in variables_of(root) if variable.base == "Enumeration"]
    for item in root.iterfind("TypeDefinitions/SimpleType/Enumeration/Item"):
        assert item.get("description")


def test_the_page_has_groups_display_units_and_what_items_mean(fmus: BuiltFmus) -> None:
    with zipfile.ZipFile(fmus("SepCompensator")) as archive:
        page = archive.read("documentation/index.html").decode()
    headings = re.findall(r'scope="rowgroup">([^<]+)</th>', page)
    assert headings == [
        *("Inputs", "Outputs", "Look-ahead and residual model", "Residual model with trust", "Compensation"),
        "Physics model",
    ]
    assert "<td>x_h_std</td><td>Real, m</td><td>um</td>" in page
    assert "0 zoh (zero-order hold: constant until the next sample), 1 foh (" in page
