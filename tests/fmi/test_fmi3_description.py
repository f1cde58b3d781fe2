"""XML files of the FMI 3.0 FMUs against schemas, fmpy's checks and the rules, and the rules against damaged ones."""

from __future__ import annotations

import zipfile
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import fmpy
import pytest
from built_once import FMI3, NATIVE, BuiltFmus, each_kind
from fmi3_rules import Archive, violations
from fmpy.validation import validate_fmu

from hybridsep.base.files import data_folder
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
