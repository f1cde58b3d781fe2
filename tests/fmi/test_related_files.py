"""Files beside the model: the reference experiment (LS-REF), what the FMU needs, where it comes from."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import fmpy
import numpy as np
import pytest
from built_once import FMI3, NATIVE, PYTHON, BuiltFmus
from c_compiler import FMI_HEADERS, compiler
from elf import symbols
from fmpy.util import read_csv
from ls_ref_rules import FOLDER, findings

from hybridsep import build_fmu, load_machine
from hybridsep.base.errors import FmuError
from hybridsep.fmi.extras import RESOURCE_DATA_FILE
from hybridsep.fmi.spec import generation_time

RUN = ["HybridPredictor", *(name for name in (*FMI3, *PYTHON) if "_" not in name)]
"""FMUs of the default machine; ``test_reference_result`` runs all native ones of FMI 2.0."""


def content(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.mark.parametrize("name", [*NATIVE, *FMI3, *PYTHON])
def test_every_fmu_carries_its_reference_experiment(fmus: BuiltFmus, name: str) -> None:
    files = content(fmus(name))
    assert findings(files) == []
    root = ET.fromstring(files[f"{FOLDER}/fmi-ls-manifest.xml"])
    roles = [one.get("role") for one in root]
    assert roles.count("experiment/smoke-test") == roles.count("result") == 1
    assert b"1e-11 m" in files["documentation/fmi-ls-ref.txt"] or name.startswith("Sep")


@pytest.mark.slow
@pytest.mark.parametrize("name", RUN)
def test_fmpy_reruns_the_experiment_to_the_stated_tolerance(fmus: BuiltFmus, tmp_path: Path, name: str) -> None:
    """From the manifest alone, as a tool would that knows nothing of the FMU."""
    folder = Path(fmpy.extract(str(fmus(name)), unzipdir=str(tmp_path), include=lambda file: file.startswith(FOLDER)))
    related = ET.parse(folder / FOLDER / "fmi-ls-manifest.xml").getroot()
    (source,) = (one.get("source") for one in related if str(one.get("role")).startswith("experiment"))
    one = ET.parse(folder / FOLDER / str(source)).getroot()[0]
    parts = {part.tag: part.attrib for part in one}
    tables = {
        tag: read_csv(str(folder / FOLDER / attributes["source"]))
        for tag, attributes in parts.items()
        if tag in ("Stimuli", "References")
    }
    expected, times = tables["References"], parts["TransientSimulation"]
    names = list(expected.dtype.names or ())[1:]
    result: Any = fmpy.simulate_fmu(
        str(fmus(name)),
        start_time=float(times["startTime"]),
        stop_time=float(times["stopTime"]),
        output_interval=float(times["stepSize"]),
        input=tables.get("Stimuli"),
        output=names,
    )
    assert len(result) == len(expected)
    tolerance = float(str(one.get("tolerance")))
    (agreement,) = map(float, re.findall(r"within (\S+) m ", str(one.get("description"))))
    assert agreement <= 1e-9 < tolerance
    for output in names:
        found = result[output].astype(float)
        np.testing.assert_allclose(found, expected[output], rtol=0, atol=agreement, err_msg=output)
        bound = tolerance * np.abs(expected[output]).max()
        assert np.abs(found - expected[output]).max() <= bound, output


@pytest.mark.parametrize("name", ["FeedDrive", "FeedDriveFmi3", "FeedDrivePy"])
def test_what_an_fmu_needs_is_said(fmus: BuiltFmus, name: str) -> None:
    """FMI 3.0 asks for the file wherever something is needed; the C run-time of old Windows is."""
    files = content(fmus(name))
    text = files["documentation/externalDependencies.txt"].decode()
    for word in ("Python", "NumPy", "SciPy", "LD_PRELOAD") if name.endswith("Py") else ("glibc", "Universal C Runtime"):
        assert word in text
    assert b'href="externalDependencies.txt"' in files["documentation/index.html"]


@pytest.mark.parametrize("name", ["HybridPredictor", "HybridPredictorFmi3", "HybridPredictorPy"])
def test_author_copyright_and_date(fmus: BuiltFmus, name: str) -> None:
    root = ET.fromstring(content(fmus(name))["modelDescription.xml"])
    assert root.get("license") == "BSD-3-Clause"
    assert root.get("author") == "the hybridsep authors"
    licence = content(fmus(name))["documentation/licenses/license.txt"].decode().splitlines()
    assert root.get("copyright") in licence
    assert re.fullmatch(r"20\d\d-\d\d-\d\dT00:00:00Z", str(root.get("generationDateAndTime")))


def test_the_date_is_never_the_clocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    assert generation_time() == generation_time()
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86399")
    assert generation_time() == "1970-01-01T23:59:59Z"
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "today")
    with pytest.raises(FmuError, match="SOURCE_DATE_EPOCH must be a number of seconds since 1970, got 'today'"):
        generation_time()


def test_the_internal_step_is_named_where_it_is_fixed(fmus: BuiltFmus) -> None:
    steps = {
        name: fmpy.read_model_description(str(fmus(f"{name}Fmi3"))).coSimulation.fixedInternalStepSize
        for name in ("HybridPredictor", "SepCompensator", "ReferenceTrajectory", "FeedDrive")
    }
    assert {name: step and float(step) for name, step in steps.items()} == {
        **dict.fromkeys(("HybridPredictor", "SepCompensator", "ReferenceTrajectory"), 1e-3),
        "FeedDrive": None,
    }


@pytest.mark.parametrize("name", ["HybridPredictor", "HybridPredictorFmi3"])
def test_the_page_tells_ranges_and_how_to_compile(fmus: BuiltFmus, name: str) -> None:
    page = content(fmus(name))["documentation/index.html"].decode()
    assert re.search(r"<td>Np</td><td>Int\w+</td><td></td><td>100</td><td>1 … 100000</td>", page)
    assert "<td>-1 or 0 … 1000000</td>" in page
    assert "width=device-width" in page
    assert "div,pre{overflow-x:auto}" in page  # table and code scroll on a phone; looked at in chromium, 390 px wide
    assert page.count("<div><table>") == 1


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the command is for Linux")
@pytest.mark.parametrize("name", ["FeedDrive", "FeedDriveFmi3"])
def test_the_command_on_the_page_compiles_the_sources(fmus: BuiltFmus, tmp_path: Path, name: str) -> None:
    with zipfile.ZipFile(fmus(name)) as archive:
        archive.extractall(tmp_path)
    (tmp_path / "headers").symlink_to(FMI_HEADERS)
    page = (tmp_path / "documentation" / "index.html").read_text(encoding="utf-8")
    (command,) = re.findall(r"<pre>cc (.*?)</pre>", page, re.DOTALL)
    subprocess.run([*compiler(), *shlex.split(command.replace("\\\n", " "))], cwd=tmp_path, check=True)
    exported = {symbol.name for symbol in symbols(tmp_path / f"{name}.so", dynamic=True) if symbol.defined}
    assert f"fmi{'3' if name.endswith('3') else '2'}DoStep" in exported


def test_a_fitted_fmu_says_where_it_comes_from(tmp_path: Path) -> None:
    origin = {"log": [{"file": "my_axis.csv", "sha256": "ab" * 32}], "settings": {"Np": 100}, "judged": {"rms_h": 7e-7}}
    path = build_fmu(load_machine("emps"), "HybridPredictor_emps", tmp_path, targets=("host",), origin=origin)
    files = content(path)
    assert findings(files) == []
    root = ET.fromstring(files[RESOURCE_DATA_FILE])
    spaces = "{http://ssp-standard.org/SSPTraceability1/"
    assert root.tag == f"{spaces}SimulationResourceMetaData}}SimulationResourceMetaData"
    assert root.get("version") == "1.0.0"
    (classified,) = root
    assert classified.tag == f"{spaces}SSPTraceabilityCommon}}Classification"
    entries = {entry.get("keyword"): entry.text for entry in classified}
    guid = ET.fromstring(files["modelDescription.xml"]).get("guid")
    assert entries == {
        "model.guid": guid,
        "log.1.file": "my_axis.csv",
        "log.1.sha256": "ab" * 32,
        "settings.Np": "100",
        "judged.rms_h": "7e-07",
    }
    related = files[f"{FOLDER}/fmi-ls-manifest.xml"].decode()
    assert "../org.ssp-standard.ssp-traceability.srmd/resourceMetaData.srmd" in related
