"""Every archive's modelDescription against the rules of FMI 2.0, section 2.2, and the rules against damaged ones."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from built_once import NATIVE, PYTHON, BuiltFmus, each_kind
from fmi2_rules import variables_of, violations

from hybridsep.base.files import data_folder
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
    "Predictor": ["Look-ahead and residual model", "Residual model with averaging", "Physics model"],
    "Compensator": ["Look-ahead and residual model", "Residual model with averaging", "Compensation", "Physics model"],
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
        *("Inputs", "Outputs", "Look-ahead and residual model", "Residual model with averaging", "Compensation"),
        "Physics model",
    ]
    assert "<td>x_h_std</td><td>Real, m</td><td>um</td>" in page
    assert "0 zoh (zero-order hold: constant until the next sample), 1 foh (" in page
