"""Variables of the FMUs as modelDescription.xml has them: groups, units, windows, terminals, twins of the versions."""

import re
import zipfile
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from built_once import FMI3, NATIVE, BuiltFmus, each_kind
from command_line import Run
from fmpy.validation import validate_fmu
from machine_files import changed_machine
from stream import WINDOWS

from hybridsep.base.errors import FmuError, MachineError, SignalError
from hybridsep.cosim.fmu import FmuInstance
from hybridsep.fmi.archive import build_fmu
from hybridsep.fmi.description import TERMINALS
from hybridsep.fmi.reference import REFERENCE_FOLDER
from hybridsep.fmi.spec import fmu_names, table_of
from hybridsep.fmi.variables import INTERPOLATED
from hybridsep.machines.machine import Machine, load_machine

pytestmark = pytest.mark.usefixtures("short_references")

MACHINE = load_machine("spring_mass_damper")


def variables_of(path: Path) -> dict[str, Any]:
    return {variable.name: variable for variable in fmpy.read_model_description(str(path)).modelVariables}


LOOK_AHEAD = ("Look-ahead and residual model", "Residual model with averaging")
GROUPS: dict[str, tuple[str, ...]] = {
    "HybridPredictor": (*LOOK_AHEAD, "Physics model"),
    "SepCompensatorFmi3": (*LOOK_AHEAD, "Compensation", "Physics model"),
    "FeedDrive": ("Drive", "Encoder"),
    "FeedDrive_als25010_x": ("Disturbance", "Command", "Encoder", "Physics model"),
    "ReferenceTrajectory": ("Trajectory",),
}


@pytest.mark.parametrize("name", GROUPS)
def test_parameters_are_grouped_and_described_alone(fmus: BuiltFmus, name: str) -> None:
    """A tool's flat list shows the paper's names, m or p; group and meaning stand in each description, items too."""
    variables = variables_of(fmus(name)).values()
    parts = [str(v.description).partition(": ") for v in variables if v.causality == "parameter"]
    found = [group for group, _, _ in parts]
    assert tuple(dict.fromkeys(found)) == GROUPS[name]
    assert sorted(found, key=GROUPS[name].index) == found
    assert all(len(meaning.split()) > 2 for _, _, meaning in parts)
    types = fmpy.read_model_description(str(fmus(name))).typeDefinitions
    for one in types:
        assert all(item.description for item in one.items or ())
        assert not (one.description and "Fmi3" in name)  # fmpy up to 0.3.23 raises a TypeError there


def test_the_page_has_groups_ranges_display_units_and_what_items_mean(fmus: BuiltFmus) -> None:
    with zipfile.ZipFile(fmus("SepCompensator")) as archive:
        page = archive.read("documentation/index.html").decode()
    headings = re.findall(r'scope="rowgroup">([^<]+)</th>', page)
    assert headings == ["Inputs", "Outputs", *LOOK_AHEAD, "Compensation", "Physics model"]
    assert "<td>x_h_std</td><td>Real, m</td><td>um</td>" in page
    assert "0 zoh (zero-order hold: constant until the next sample), 1 foh (" in page
    assert re.search(r"<td>Np</td><td>Int\w+</td><td></td><td>50</td><td>1 … 100000</td>", page)
    assert "<td>-1 or 0 … 1000000</td>" in page


def test_the_internal_step_is_named_where_it_is_fixed(fmus: BuiltFmus) -> None:
    for name in ("HybridPredictor", "SepCompensator", "ReferenceTrajectory", "FeedDrive"):
        step = fmpy.read_model_description(str(fmus(f"{name}Fmi3"))).coSimulation.fixedInternalStepSize
        assert step is None if name == "FeedDrive" else float(step) == 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("name", GROUPS)
def test_all_inputs_are_real(fmus: BuiltFmus, name: str) -> None:
    """Masters set every input by setReal; a compensator's reset is a tunable parameter, which may be set in a run."""
    variables = variables_of(fmus(name))
    assert {one.type for one in variables.values() if one.causality == "input"} <= {"Real", "Float64"}
    if name.startswith("SepCompensator"):
        reset = variables["reset"]
        assert (reset.type, reset.causality, reset.variability) == ("Boolean", "parameter", "tunable")


@pytest.mark.parametrize("name", ["HybridPredictor", "SepCompensator"])
def test_each_continuous_input_takes_a_derivative(fmus: BuiltFmus, name: str) -> None:
    """As canInterpolateInputs says; a load is constant over a step, so it is discrete."""
    inputs = [one for one in variables_of(fmus(name)).values() if one.causality == "input"]
    assert fmpy.read_model_description(str(fmus(name))).coSimulation.canInterpolateInputs
    assert [one.name for one in inputs if one.variability == "continuous"] == list(INTERPOLATED[name])


@pytest.mark.parametrize(("new", "old"), each_kind(list(zip(FMI3, NATIVE, strict=True))))
def test_the_twins_have_the_same_interface(fmus: BuiltFmus, new: str, old: str) -> None:
    """Names, causalities, units, ranges and starts; windows are arrays of Np samples, and there is the time."""
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
        sizes = shown == "Np" and "HybridPredictor" in new
        other: dict[str, Any] = {"causality": "output"} if bracket else {}
        if sizes:  # fmpy reads no range of this type
            other = {"causality": "structuralParameter", "min": None, "max": None}
        expected.append((shown, "UInt64" if sizes else types[variable.type], *attributes(variable, **other)))
    found = [(v.name, v.type, *attributes(v)) for v in described.modelVariables]
    assert found[:-1] == expected
    assert found[-1][:4] == ("time", "Float64", "independent", "continuous")
    arrays = [v for v in described.modelVariables if v.shape]
    assert {v.name: v.shape[0] for v in arrays} == windows
    assert {one.variable.name for v in arrays for one in v.dimensions} == ({"Np"} if arrays else set())
    assert [v.valueReference for v in described.modelVariables] == list(range(len(found)))
    dependencies = [
        [
            (u.variable.name, [d.name for d in u.dependencies])
            for u in (*which.outputs, *which.initialUnknowns)
            if not u.variable.shape
        ]
        for which in (described, before)
    ]
    assert dependencies[0] == dependencies[1]


def attributes(variable: Any, **others: str | None) -> tuple[object, ...]:
    names = "causality variability initial unit displayUnit start min max nominal description"
    return tuple(others.get(name, getattr(variable, name)) for name in names.split())


def test_terminals_of_two_fmus_fit_each_other(fmus: BuiltFmus) -> None:
    """A member is an output of one of the FMUs and an input of the other."""
    variables = {model: variables_of(fmus(f"{model}Fmi3")) for model in TERMINALS}
    for look_ahead in ("HybridPredictor", "SepCompensator"):
        plugged = ("ReferenceTrajectory", look_ahead, "reference"), (look_ahead, "FeedDrive", "drive")
        for one, other, terminal in plugged:
            first, second = TERMINALS[one][terminal], TERMINALS[other][terminal]
            assert first.keys() == second.keys()
            for member in first:
                found = {variables[one][first[member]].causality, variables[other][second[member]].causality}
                assert found == {"input", "output"}


# Without windows ---------------------------------------------------------------------------------------------------


def outputs_of(path: Path) -> list[list[float]]:
    """Return the outputs over three windows, the last of them after a restored state."""
    shown = []
    with FmuInstance(path) as fmu:
        fmu.initialise({"x_d_ahead": 0.0})
        saved = b""
        for k in (*range(240), *range(200, 320)):
            if k == 200 and not saved:
                saved = fmu.save()
            elif k == 200:
                fmu.restore(saved)
            fmu.set("x_d_ahead", 1e-3 * np.sin(0.05 * k))
            fmu.set("x_meas", 1e-3 * np.sin(0.05 * (k - 103)) + 1e-6 * (k % 7))
            fmu.step(k * 1e-3, 1e-3)
            shown.append([fmu.get(name) for name in ("x_d", "x_pb", "x_h", "x_h_std", "e_servo", "rms_h")])
    return shown


@pytest.mark.parametrize("name", ["HybridPredictor", "HybridPredictorFmi3"])
def test_windows_can_be_left_out_and_nothing_else_is_missing(
    fmus: BuiltFmus, tmp_path: Path, name: str, hybridsep: Run
) -> None:
    """For tools that choke on many variables; where they are, they stand in the order of their samples."""
    fmi = "3" if name.endswith("3") else "2"
    path = build_fmu(MACHINE, name, tmp_path, targets=("host",), fmi=fmi, windows=False)
    assert validate_fmu(str(path)) == []
    found, whole = variables_of(path), variables_of(fmus(name))
    left_out = [key for key in whole if key not in found]
    places = [""] if fmi == "3" else [f"[{i}]" for i in range(1, 101)]
    assert left_out == [key + place for key in WINDOWS for place in places]
    assert set(found) < set(whole)
    for key, variable in found.items():
        if key != "time":  # the last one of FMI 3.0, after the windows
            assert variable.valueReference == whole[key].valueReference
    assert outputs_of(path) == outputs_of(fmus(name))
    if name == "HybridPredictor":
        before = path.read_bytes()
        path.unlink()
        hybridsep.done("build", name, "--target", "host", "--no-windows", "--out", tmp_path)
        assert path.read_bytes() == before


# Rotary axes and trajectories --------------------------------------------------------------------------------------


def rotary(folder: Path, machine: str = "emps", more: str = "") -> Machine:
    return load_machine(changed_machine(folder / "table.toml", machine, ("T_s =", 'unit = "rad"\nT_s ='), more=more))


def test_a_rotary_axis_has_radians_for_metres(tmp_path: Path) -> None:
    machine = rotary(tmp_path, more="[drive_limits]\nvelocity = 1.0\nacceleration = 9.0\njerk = 900.0\n")
    table = {v.name: v for v in table_of(machine, "HybridPredictor", "HybridPredictor").variables}
    assert (table["x_h"].unit, table["x_h"].display_unit) == ("rad", "deg")
    assert (table["e_servo"].unit, table["e_servo"].display_unit) == ("rad", "urad")
    assert (table["lambda"].unit, table["T_s"].unit, table["mode[1].f_n"].unit) == ("rad2", "s", "Hz")
    for flavour, fmi in (("native", "3"), ("python", "2")):
        for name in fmu_names(machine, flavour, fmi):
            path = build_fmu(machine, name, tmp_path, flavour, fmi=fmi)
            assert validate_fmu(str(path)) == []
            units = {unit.name for unit in fmpy.read_model_description(str(path)).unitDefinitions}
            assert "rad" in units
            assert not units & {"m", "m2", "m/s"}
    with pytest.raises(MachineError, match=r"a plant of kind feed_drive or stage must have unit = 'm'"):
        rotary(tmp_path, "spring_mass_damper")


@pytest.mark.slow
@pytest.mark.parametrize(("samples", "fmi"), [(None, "2"), ([0.1, 0.2, 0.3], "2"), ([0.1, 0.2, 0.3], "3")])
def test_a_trajectory_declares_what_it_plays(tmp_path: Path, samples: list[float] | None, fmi: str) -> None:
    """At the interval of its samples only; the user's own, where it was built with some, are the reference."""
    name, played = "ReferenceTrajectory" + "Fmi3" * (fmi == "3"), 3 + (samples is not None)
    path = build_fmu(MACHINE, name, tmp_path, targets=("host",), samples=samples, fmi=fmi)
    variables = variables_of(path)
    T_s, trajectory = variables["T_s"], variables["trajectory"]
    assert T_s.start == T_s.min == T_s.max == "0.001"
    items = ["staircase", "spiral_x", "spiral_y", "samples"][:played]
    assert [item.name for item in trajectory.declaredType.items] == items
    assert (trajectory.min, trajectory.max) == ("0", str(played - 1))
    with zipfile.ZipFile(path) as archive:
        page = archive.read("documentation/index.html").decode()
        rows = archive.read(f"{REFERENCE_FOLDER}/{name}_ref.csv").decode().splitlines()
    assert f"<td>0 … {played - 1}</td>" in page
    assert ("samples with which" in page) == (samples is not None)
    for number in range(5):
        with FmuInstance(path) as instance:
            instance.set("trajectory", number)
            if number < played:
                instance.initialise()
            else:
                with pytest.raises(FmuError, match="trajectory"):
                    instance.initialise()
    with FmuInstance(path) as instance, pytest.raises(FmuError, match=r"T_s must be 0\.001 s"):
        instance.initialise({"T_s": 0.002})
    if samples:
        assert rows[1:5] == ["0.0,0.1", "0.001,0.2", "0.002,0.3", "0.003,0.3"]
        result = fmpy.simulate_fmu(str(path), stop_time=0.01, output_interval=1e-3)
        np.testing.assert_array_equal(result["r"][:4], [*samples, samples[-1]])
        with pytest.raises(SignalError, match="samples"):
            build_fmu(MACHINE, name, tmp_path, targets=("host",), samples=[0.0, np.nan], fmi=fmi)
