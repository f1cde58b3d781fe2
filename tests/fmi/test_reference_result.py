"""Reference input and result of each native archive, simulated by fmpy."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import fmpy
import numpy as np
import pytest
from built_once import BuiltFmus, each_kind
from fmpy.util import read_csv, read_ref_opt_file
from reference_models import library_model, library_models

from hybridsep.fmi.archive import build_fmu
from hybridsep.fmi.extras import RELATED_FOLDER
from hybridsep.fmi.reference import reference_files
from hybridsep.fmi.spec import FmuSpec, fmu_names
from hybridsep.machines.machine import load_machine, machine_names

NAMES = [(machine, name) for machine in machine_names() for name in fmu_names(load_machine(machine))]
TOLERANCE = {"HybridPredictor": 1e-11, "SepCompensator": 1e-9, "FeedDrive": 1e-11, "ReferenceTrajectory": 1e-11}
"""m and m/s, as each FMU's page says."""


@pytest.mark.slow
@pytest.mark.parametrize(("machine", "name"), each_kind(NAMES))
def test_fmpy_gets_the_reference_result(
    machine: str, name: str, fmus: BuiltFmus, folders: Callable[[str], Path]
) -> None:
    path, documentation = fmus(name), folders(name) / "documentation"
    base = folders(name) / RELATED_FOLDER / name
    options = read_ref_opt_file(f"{base}_ref.opt")
    expected = read_csv(f"{base}_ref.csv")
    inputs = read_csv(f"{base}_in.csv") if Path(f"{base}_in.csv").exists() else None
    outputs = [v.name for v in fmpy.read_model_description(str(path)).modelVariables if v.causality == "output"]
    assert list(expected.dtype.names or ()) == ["time", *outputs]
    result = fmpy.simulate_fmu(
        str(path),
        start_time=options["StartTime"],
        stop_time=options["StopTime"],
        output_interval=options["StepSize"],
        input=inputs,
        output=outputs,
    )
    assert len(result) == len(expected)
    model = fmu_names(load_machine(machine))[name]
    for output in outputs:
        np.testing.assert_allclose(
            result[output].astype(float), expected[output], rtol=0, atol=TOLERANCE[model], err_msg=output
        )
    if model == "SepCompensator":
        assert set(expected["sep_state"]) == {1.0, 2.0}
        assert 0 < expected["rms_h"][-1] < 3e-4
    last = (folders(name) / RELATED_FOLDER / f"{name}_ref.csv").read_text(encoding="utf-8").splitlines()[-1].split(",")
    if model == "HybridPredictor":
        assert last[1 + outputs.index("hybrid_active")] == "1"  # as fmi-standard.org has it
        assert expected["hybrid_active"][-1] == 1.0
        assert 0 < expected["rms_h"][-1] < 1e-4
    page = (documentation / "index.html").read_text(encoding="utf-8")
    assert f"<sup>−{-np.log10(TOLERANCE[model]):.0f}</sup> m" in page
    links = re.findall(r'href="([^"]+)"', page)
    assert len(links) >= 4
    for link in links:
        assert (documentation / link).is_file()


@pytest.mark.slow
@pytest.mark.parametrize(("machine", "name"), each_kind(NAMES))
def test_the_library_gives_the_reference_result(machine: str, name: str, folders: Callable[[str], Path]) -> None:
    """The files hold what the FMU gave when it was built."""
    axis, base = load_machine(machine), folders(name) / RELATED_FOLDER / name
    model = fmu_names(axis)[name]
    reference = library_model(FmuSpec.of(axis, model))
    expected = np.genfromtxt(f"{base}_ref.csv", delimiter=",", skip_header=1)
    inputs = (
        np.genfromtxt(f"{base}_in.csv", delimiter=",", skip_header=1) if Path(f"{base}_in.csv").exists() else expected
    )
    found = []
    for row in inputs.tolist():
        found.append(reference.outputs())
        reference.sample(*row[1:])
    np.testing.assert_allclose(found, expected[:, 1:], rtol=0, atol=TOLERANCE[model])


@pytest.mark.slow
def test_the_reference_is_short_and_the_same_every_time() -> None:
    machine = load_machine("spring_mass_damper")
    spec = FmuSpec.of(machine, "HybridPredictor")
    files = reference_files(spec, *library_models(spec))
    assert files == reference_files(spec, *library_models(spec))
    names = [f"HybridPredictor_{end}" for end in ("in.csv", "ref.csv", "ref.opt")]
    assert sorted(files) == [f"{RELATED_FOLDER}/{file}" for file in (*names, "reference.exp")]
    assert b"StopTime, 0.6\n" in files[f"{RELATED_FOLDER}/HybridPredictor_ref.opt"]
    assert sum(map(len, files.values())) < 120_000


@pytest.mark.slow
def test_the_reference_of_a_late_measurement_is_late() -> None:
    """Its compensator does as well as without delay: it is told what it gets."""
    machine = load_machine("spring_mass_damper")
    rms = []
    for late in (0, 5):
        changed = machine.changed("compensator", {"measurement_delay": late})
        spec = FmuSpec.of(changed, "SepCompensator")
        files = reference_files(spec, *library_models(spec))
        table = np.genfromtxt(BytesIO(files[f"{RELATED_FOLDER}/SepCompensator_ref.csv"]), delimiter=",", names=True)
        rms.append(float(table["rms_e"][-1]))
    assert rms[1] == pytest.approx(rms[0], rel=0.2)


@pytest.mark.slow
def test_given_samples_are_the_reference_of_their_trajectory(tmp_path: Path) -> None:
    machine = load_machine("spring_mass_damper")
    samples = [0.1, 0.2, 0.3]
    path = build_fmu(machine, "ReferenceTrajectory", tmp_path, targets=("host",), samples=samples)
    with zipfile.ZipFile(path) as archive:
        rows = archive.read(f"{RELATED_FOLDER}/ReferenceTrajectory_ref.csv").decode().splitlines()
    assert rows[1:5] == ["0.0,0.1", "0.001,0.2", "0.002,0.3", "0.003,0.3"]
    result = fmpy.simulate_fmu(str(path), stop_time=0.01, output_interval=1e-3)
    np.testing.assert_array_equal(result["r"][:4], [0.1, 0.2, 0.3, 0.3])


@pytest.mark.slow
def test_windows_that_no_short_run_can_show_have_no_reference(tmp_path: Path) -> None:
    machine = load_machine("spring_mass_damper")
    large = machine.changed("predictor", {"Np": 1001})
    path = build_fmu(large, "HybridPredictor", tmp_path, targets=("host",))
    with zipfile.ZipFile(path) as archive:
        files = archive.namelist()
        assert [file for file in files if file.startswith(RELATED_FOLDER)] == [f"{RELATED_FOLDER}/fmi-ls-manifest.xml"]
        assert "documentation/fmi-ls-ref.txt" not in files
        assert b"reference.exp" not in archive.read("documentation/index.html")
