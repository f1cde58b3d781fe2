"""Reference run of each archive, by fmpy and by the library; what fmpy does by default."""

import re
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from built_once import FMI3, NATIVE, PYTHON, BuiltFmus, content, each_kind
from fmpy.util import read_csv, read_ref_opt_file
from stream import OUTPUTS

from hybridsep.fmi.archive import build_fmu
from hybridsep.fmi.reference import REFERENCE_FOLDER
from hybridsep.machines.machine import load_machine
from hybridsep.plants.trajectory import staircase

MACHINE = load_machine("spring_mass_damper")
RUN = [*NATIVE, *(name for name in (*FMI3, *PYTHON) if "_" not in name)]
RUN.remove("SepCompensator_als25010_x")


@pytest.mark.slow
@pytest.mark.parametrize("name", each_kind(RUN))
def test_fmpy_repeats_the_run_to_the_stated_tolerance(fmus: BuiltFmus, tmp_path: Path, name: str) -> None:
    """From only its files, as a tool would that knows nothing of the FMU."""
    fmpy.extract(str(fmus(name)), unzipdir=str(tmp_path))
    folder = tmp_path / REFERENCE_FOLDER
    given = folder / f"{name}_in.csv"
    assert {path.stem.removeprefix(name) for path in folder.iterdir()} == {"_ref", *(["_in"] if given.exists() else [])}
    expected, options = read_csv(str(folder / f"{name}_ref.csv")), read_ref_opt_file(f"{folder}/{name}_ref.opt")
    variables = fmpy.read_model_description(str(tmp_path)).modelVariables
    outputs = [v.name for v in variables if v.causality == "output" and not v.shape]
    assert list(expected.dtype.names or ()) == ["time", *outputs]
    result: Any = fmpy.simulate_fmu(
        str(fmus(name)),
        start_time=options["StartTime"],
        stop_time=options["StopTime"],
        output_interval=options["StepSize"],
        input=read_csv(str(given)) if given.exists() else None,
        output=outputs,
    )
    assert len(result) == len(expected)
    agreement = 1e-9 if name.startswith("Sep") else 1e-11
    for output in outputs:
        found = result[output].astype(float)
        np.testing.assert_allclose(found, expected[output], rtol=0, atol=agreement, err_msg=output)
        assert np.abs(found - expected[output]).max() <= options["RelTol"] * np.abs(expected[output]).max(), output
    if "sep_state" in outputs:
        assert set(expected["sep_state"]) == {1.0, 2.0}
        assert 0 < expected["rms_h"][-1] < 3e-4
    elif "hybrid_active" in outputs:
        last = (folder / f"{name}_ref.csv").read_text(encoding="utf-8").splitlines()[-1].split(",")
        assert last[1 + outputs.index("hybrid_active")] == "1"  # as fmi-standard.org has it
        assert 0 < expected["rms_h"][-1] < 1e-4
    documentation = tmp_path / "documentation"
    page = (documentation / "index.html").read_text(encoding="utf-8")
    assert f"<sup>−{-np.log10(agreement):.0f}</sup> m" in page
    links = re.findall(r'href="([^"]+)"', page)
    assert len(links) >= 3
    assert all((documentation / link).is_file() for link in links)


@pytest.mark.slow
def test_the_reference_is_short_and_that_of_a_late_measurement_is_late(fmus: BuiltFmus, tmp_path: Path) -> None:
    """Its compensator does as well as without delay: it is told what it gets."""
    files = content(fmus("HybridPredictor"))
    assert b"StopTime, 0.6\n" in files[f"{REFERENCE_FOLDER}/HybridPredictor_ref.opt"]
    assert sum(len(data) for file, data in files.items() if file.startswith(REFERENCE_FOLDER)) < 120_000
    late = MACHINE.changed("compensator", {"measurement_delay": 5})
    paths = fmus("SepCompensator"), build_fmu(late, "SepCompensator", tmp_path, targets=("host",))
    last_rows = [content(path)[f"{REFERENCE_FOLDER}/SepCompensator_ref.csv"].splitlines()[-1] for path in paths]
    rms = [float(row.split(b",")[1 + OUTPUTS["SepCompensator"].index("rms_e")]) for row in last_rows]
    assert rms[1] == pytest.approx(rms[0], rel=0.2)


@pytest.mark.slow
def test_windows_that_no_short_run_can_show_have_no_reference(tmp_path: Path) -> None:
    large = MACHINE.changed("predictor", {"Np": 1001})
    files = content(build_fmu(large, "HybridPredictor", tmp_path, targets=("host",)))
    assert not [file for file in files if file.startswith(REFERENCE_FOLDER)]
    assert b"Check it" not in files["documentation/index.html"]


@pytest.mark.parametrize("name", each_kind([*NATIVE, "FeedDrivePy"]))
def test_the_default_experiment_is_the_whole_trajectory(fmus: BuiltFmus, name: str) -> None:
    stop = float(fmpy.read_model_description(str(fmus(name))).defaultExperiment.stopTime)
    end = {"emps": 10.0}.get(name.rpartition("_")[2], 6.0 + (0.2 if "Sep" in name else 0.1))
    assert stop == pytest.approx(end, abs=0.011)


@pytest.mark.slow
def test_the_default_step_of_an_importer_does_no_harm(fmus: BuiltFmus) -> None:
    """It reaches the end in steps of 4 ms, fmpy's for 4 s; the paper's model goes to 20 mm then, on a sine of 10 mm."""
    t = np.arange(0.0, 4.1, 1e-3)
    signals = np.zeros(len(t), dtype=[("time", float), ("x_d_ahead", float), ("x_meas", float)])
    signals["time"], signals["x_d_ahead"] = t, 0.01 * np.sin(2 * np.pi * t)
    signals["x_meas"] = np.where(t > 0.1, 0.0101 * np.sin(2 * np.pi * (t - 0.1) - 0.02), 0.0)
    result = fmpy.simulate_fmu(str(fmus("HybridPredictor")), stop_time=4.0, input=signals, output=["x_h"])
    assert result["time"][-1] == pytest.approx(4.0, abs=1e-9)
    assert 9.9e-3 < np.abs(result["x_h"]).max() < 10.2e-3


@pytest.mark.slow
def test_fmpy_reads_arrays_and_sets_enumerations(fmus: BuiltFmus) -> None:
    rows = [(k * 1e-3, position, position) for k, position in enumerate(staircase()[:600])]
    inputs = np.array(rows, dtype=[(name, np.float64) for name in ("time", "x_d_ahead", "x_meas")])
    how = {"stop_time": 0.5, "step_size": 1e-3, "output_interval": 1e-3, "input": inputs}
    result = fmpy.simulate_fmu(
        str(fmus("HybridPredictorFmi3")),
        output=["x_d", "x_d_window", "hybrid_active"],
        start_values={"input_hold": "1", "averaging": "true", "mode[1].zeta": "0.06"},
        **how,
    )
    assert result["x_d_window"].shape == (501, 100)
    np.testing.assert_array_equal(result["x_d_window"][200:301:100].ravel(), staircase()[100:300])
    fmu = str(fmus("SepCompensatorFmi3"))
    result = fmpy.simulate_fmu(fmu, output=["sep_state"], start_values={"compensate": "1"}, **how)
    assert set(result["sep_state"]) == {1}  # its plan, or what is left of one
