"""``hybridsep system``: one file with FMUs, connections and parameters."""

from importlib import import_module
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from built_once import content

from hybridsep import FmuInstance, load_machine, staircase
from hybridsep.fmi.archive import build_fmu
from hybridsep.fmi.ssp import build_system

etree: Any = import_module("lxml.etree")  # comes with fmpy, has no types
SSD = "{http://ssp-standard.org/SSP1/SystemStructureDescription}"
SSV = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"
OMS = "{https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd}"
SCHEMAS = {".ssd": "SystemStructureDescription.xsd", ".ssv": "SystemStructureParameterValues.xsd"}


@pytest.fixture(scope="module", params=["spring_mass_damper", "als25010_y compensated"])
def archive(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    name, _, compensated = request.param.partition(" ")
    machine, path = load_machine(name), tmp_path_factory.mktemp("system") / "axis.ssp"
    command = staircase(machine.T_s)[:2000]
    return build_system(machine, path, command, compensate="hybrid" if compensated else None, targets=("host",))


def test_the_documents_keep_to_the_schemas(archive: Path) -> None:
    files = content(archive)
    assert next(iter(files)) == "SystemStructure.ssd"
    checked = [name for name in files if Path(name).suffix in SCHEMAS]
    assert len(checked) == 4
    folder = Path(fmpy.__file__).parent / "ssp" / "schema"
    for name in checked:
        etree.XMLSchema(file=str(folder / SCHEMAS[Path(name).suffix])).assertValid(etree.fromstring(files[name]))


def test_the_structure_is_that_of_the_fmus(archive: Path, tmp_path: Path) -> None:
    """Connectors, units and parameters are the FMUs', whose start values the sets repeat."""
    files = content(archive)
    root = etree.fromstring(files["SystemStructure.ssd"])
    wired = {(wire.get("endElement"), wire.get("endConnector")) for wire in root.iter(f"{SSD}Connection")}
    for component in root.iter(f"{SSD}Component"):
        path = tmp_path / "one.fmu"
        path.write_bytes(files[component.get("source")])
        variables = {v.name: v for v in fmpy.read_model_description(str(path)).modelVariables}
        connectors = {c.get("name"): c for c in component.iter(f"{SSD}Connector")}
        scalars = {name: v for name, v in variables.items() if v.type != "Enumeration"}
        signals = [name for name, v in scalars.items() if v.causality in ("input", "output")]
        assert list(connectors) == [name for name in signals if name != "x_load"]  # which nothing in it tells
        for name, connector in connectors.items():
            assert connector.get("kind") == variables[name].causality
            assert connector[0].tag.rpartition("}")[2] == variables[name].type
            assert connector[0].get("unit") == variables[name].unit
            assert variables[name].causality == "output" or (component.get("name"), name) in wired
        (binding,) = component.iter(f"{SSD}ParameterBinding")
        given = etree.fromstring(files[binding.get("source")]).iter(f"{SSV}Parameter")
        parameters = {parameter.get("name"): parameter[0] for parameter in given}
        assert list(parameters) == [n for n, v in scalars.items() if v.causality == "parameter"]
        for name, value in parameters.items():
            assert value.get("value") == variables[name].start
            assert value.get("unit") == variables[name].unit


@pytest.mark.parametrize("compensate", [None, "hybrid"])
def test_every_fmu_starts_where_the_trajectory_does(tmp_path: Path, compensate: str | None) -> None:
    """Its start values alone do, in a tool that carries nothing before the first step."""
    machine, shift, command = load_machine("spring_mass_damper"), 0.11, staircase()[:400]
    sent, runs = ("x_dm" if compensate else "x_d"), []
    for place in (0.0, shift):
        where, x_d = tmp_path / f"{place}.ssp", command + place
        path = build_system(machine, where, x_d, compensate=compensate, targets=("host",))
        fmus = {}
        for name, data in content(path).items():
            if name.endswith(".fmu"):
                (tmp_path / Path(name).name).write_bytes(data)
                fmus[Path(name).stem] = FmuInstance(tmp_path / Path(name).name)
        reference, look_ahead, drive = (
            next(fmu for name, fmu in fmus.items() if name.startswith(kind)) for kind in ("Ref", ("Hyb", "Sep"), "Feed")
        )
        rows = []
        for fmu in fmus.values():
            fmu.initialise()
        if compensate:
            assert look_ahead.get("compensate") == ["off", "physics", "hybrid"].index(compensate)
        for k in range(500):
            rows.append([look_ahead.get(sent) - place, drive.get("x") - place])
            for sink, name, source, output in (
                (look_ahead, "x_d_ahead", reference, "r"),
                (look_ahead, "x_meas", drive, "x_meas"),
                (drive, "x_d", look_ahead, sent),
            ):
                sink.set(name, source.get(output))
            for fmu in fmus.values():
                fmu.step(k * machine.T_s, machine.T_s)
        for fmu in fmus.values():
            fmu.close()
        runs.append(np.array(rows))
    np.testing.assert_allclose(runs[1], runs[0], rtol=0, atol=1e-9)
    assert np.abs(np.diff(runs[1], axis=0)).max() < 1e-3  # nothing jumps


@pytest.mark.slow
def test_every_tag_is_one_that_omsimulator_takes(archive: Path) -> None:
    """It refuses a file for one tag that it does not know, as ``ssd:SystemGeometry``, however legal."""
    root = etree.fromstring(content(archive)["SystemStructure.ssd"])
    (system,), (experiment,) = root.iter(f"{SSD}System"), root.iter(f"{SSD}DefaultExperiment")
    tags = [element.tag.removeprefix(SSD) for element in system]
    assert tags == ["Elements", "Connections", "Annotations"]
    for component in system.iter(f"{SSD}Component"):
        assert {part.tag.removeprefix(SSD) for part in component} == {"Connectors", "ParameterBindings"}
    for annotated, told in ((system, "FixedStepMaster"), (experiment, None)):
        (information,) = annotated.find(f"{SSD}Annotations").iter(f"{OMS}SimulationInformation")
        assert [child.tag.removeprefix(OMS) for child in information] == ([told] if told else [])
    assert information.get("resultFile").endswith("_res.mat")


@pytest.mark.slow
@pytest.mark.usefixtures("short_references")
def test_ssp_2_has_the_twins_of_fmi_3(tmp_path: Path) -> None:
    """SSP 2.0 has the namespaces of 1.0; without its version and the types of FMI 3.0 it is the same document."""
    machine, command = load_machine("spring_mass_damper"), staircase()[:100]
    old, new = (
        content(build_system(machine, tmp_path / f"{ssp}.ssp", command, targets=["host"], compensate="hybrid", ssp=ssp))
        for ssp in ("1", "2")
    )
    names = {name: name.replace(".fmu", "Fmi3.fmu") for name in old}
    assert list(new) == list(names.values())
    for name, twin in names.items():
        if name.endswith(".fmu"):
            (tmp_path / "one.fmu").write_bytes(new[twin])
            assert fmpy.read_model_description(str(tmp_path / "one.fmu")).fmiVersion == "3.0"
            continue
        text = new[twin].decode().replace("Fmi3.fmu", ".fmu").replace("Float64", "Real").replace("Int32", "Integer")
        assert text.replace('version="2.0"', 'version="1.0"') == old[name].decode()
        assert new[twin] != old[name]


def test_the_same_system_has_the_same_bytes(tmp_path: Path) -> None:
    machine, command = load_machine("spring_mass_damper"), staircase()[:100]
    paths = [build_system(machine, tmp_path / f"{i}.ssp", command, targets=("host",)) for i in range(2)]
    assert paths[0].read_bytes() == paths[1].read_bytes()
    fmu = build_fmu(machine, "HybridPredictor", tmp_path, targets=("host",), windows=False)
    assert content(paths[0])["resources/HybridPredictor.fmu"] == fmu.read_bytes()
