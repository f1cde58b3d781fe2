"""HybridPredictors without their windows, for tools that choke on so many variables: otherwise the same FMU."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from built_once import BuiltFmus
from c_core import TABLES, CModel
from command_line import Run
from fmpy import read_model_description
from fmpy.validation import validate_fmu

from hybridsep import build_fmu, load_machine
from hybridsep.cosim.fmu import FmuInstance
from hybridsep.fmi.compile import TARGETS, host_target

WINDOWS = ("x_d_window", "x_pb_window", "x_h_window", "x_h_std_window")
FLAVOURS = [("HybridPredictor", "native", "2"), ("HybridPredictorFmi3", "native", "3")]
FLAVOURS.append(("HybridPredictorPy", "python", "2"))
OUTPUTS = ("x_d", "x_pb", "x_h", "x_h_std", "e_servo", "rms_h")


def bare(name: str, flavour: str, fmi: str, out: Path) -> Path:
    machine = load_machine("spring_mass_damper")
    if flavour == "python":
        return build_fmu(machine, name, out, flavour, windows=False)
    return build_fmu(machine, name, out, flavour, targets=("host",), fmi=fmi, windows=False)


def run(path: Path) -> list[list[float]]:
    """Return the outputs over three windows, the last of them after a restored state."""
    shown = []
    with FmuInstance(path) as fmu:
        fmu.begin({"x_d_ahead": 0.0})
        fmu.finish()
        saved = b""
        for k in (*range(240), *range(200, 320)):
            if k == 200 and not saved:
                saved = fmu.save()
            elif k == 200:
                fmu.restore(saved)
            fmu.set("x_d_ahead", 1e-3 * np.sin(0.05 * k))
            fmu.set("x_meas", 1e-3 * np.sin(0.05 * (k - 103)) + 1e-6 * (k % 7))
            fmu.step(k * 1e-3, 1e-3)
            shown.append([fmu.get(name) for name in OUTPUTS])
    return shown


@pytest.mark.parametrize(("name", "flavour", "fmi"), FLAVOURS)
def test_nothing_but_the_windows_is_missing(fmus: BuiltFmus, tmp_path: Path, name: str, flavour: str, fmi: str) -> None:
    path = bare(name, flavour, fmi, tmp_path)
    assert validate_fmu(str(path)) == []
    found, whole = (
        {variable.name: variable for variable in read_model_description(str(file)).modelVariables}
        for file in (path, fmus(name))
    )
    assert [key for key in whole if key not in found] == [key for key in whole if key.partition("[")[0] in WINDOWS]
    assert [key for key in found if key not in whole] == []
    for key, variable in found.items():
        if key != "time":  # the last one of FMI 3.0, behind the windows
            assert variable.valueReference == whole[key].valueReference
    assert run(path) == run(fmus(name))


@pytest.mark.parametrize("name", ["HybridPredictor", "HybridPredictorPy"])
def test_windows_are_listed_in_the_order_of_their_samples(fmus: BuiltFmus, name: str) -> None:
    names = [variable.name for variable in read_model_description(str(fmus(name))).modelVariables]
    for window in WINDOWS:
        assert [n for n in names if n.startswith(f"{window}[")] == [f"{window}[{i}]" for i in range(1, 101)]


def test_the_sources_have_no_windows_either() -> None:
    table = replace(TABLES["predictor"], name="predictor_bare", windows=False)
    TABLES.setdefault(table.name, table)
    model, whole = CModel("predictor_bare"), CModel("predictor")
    assert len(whole.values) - len(model.values) == 4 * 100
    for each in (model, whole):
        each.initialise()
        for k in range(250):
            each["x_d_ahead"] = 1e-3 * np.sin(0.05 * k)
            each["x_meas"] = 1e-3 * np.sin(0.05 * (k - 103))
            each.step(k * 1e-3)
    assert [model[name] for name in OUTPUTS] == [whole[name] for name in OUTPUTS]


def test_build_leaves_them_out_where_it_is_asked(hybridsep: Run, tmp_path: Path) -> None:
    options = ("-m", "spring_mass_damper", "--target", TARGETS[host_target()].folder, "--no-windows")
    status, _, _ = hybridsep("build", "HybridPredictor", "SepCompensator", *options, "--out", tmp_path)
    assert status == 0
    xml = read_model_description(str(tmp_path / "HybridPredictor.fmu"))
    assert not [v.name for v in xml.modelVariables if re.search(r"_window", v.name)]
    status, _, err = hybridsep("build", "SepCompensator", *options, "--out", tmp_path / "none")
    assert status != 0
    assert "--no-windows is for a HybridPredictor, this would build SepCompensator; leave it out" in err
