"""FMU of a rotary axis: radians for metres, shown in degrees."""

from __future__ import annotations

from pathlib import Path

import fmpy
import pytest

from hybridsep import build_fmu, load_machine
from hybridsep.base.errors import MachineError
from hybridsep.base.files import data_folder
from hybridsep.fmi.spec import table_of


def rotary(folder: Path, machine: str = "emps") -> Path:
    text = (data_folder("models") / f"{machine}.toml").read_text(encoding="utf-8")
    path = folder / "table.toml"
    path.write_text(text.replace("T_s =", 'unit = "rad"\nT_s =', 1), encoding="utf-8")
    return path


def test_units(tmp_path: Path) -> None:
    machine = load_machine(rotary(tmp_path))
    table = {v.name: v for v in table_of(machine, "HybridPredictor", "HybridPredictor").variables}
    assert (table["x_h"].unit, table["x_h"].display_unit) == ("rad", "deg")
    assert (table["e_servo"].unit, table["e_servo"].display_unit) == ("rad", "urad")
    assert (table["lambda"].unit, table["T_s"].unit, table["mode[1].f_n"].unit) == ("rad2", "s", "Hz")
    assert not {variable.unit for variable in table.values()} & {"m", "m2", "m/s"}


def test_the_fmu_is_valid(tmp_path: Path) -> None:
    path = build_fmu(load_machine(rotary(tmp_path)), "HybridPredictorPy_emps", tmp_path, flavour="python")
    description = fmpy.read_model_description(path, validate=True)
    units = {unit.name: unit for unit in description.unitDefinitions}
    assert units["rad"].baseUnit.rad == 1
    assert "m" not in units
    positions = {v.name: (v.unit, v.displayUnit) for v in description.modelVariables}
    assert positions["x_d_ahead"] == ("rad", "deg")


def test_a_plant_is_a_linear_axis(tmp_path: Path) -> None:
    with pytest.raises(MachineError, match=r"a plant of kind feed_drive must have unit = 'm': it is a linear axis"):
        load_machine(rotary(tmp_path, "spring_mass_damper"))
    path = rotary(tmp_path)
    path.write_text(path.read_text(encoding="utf-8").replace('"rad"', '"deg"'), encoding="utf-8")
    with pytest.raises(MachineError, match="unit must be m or rad, got 'deg'"):
        load_machine(path)
