"""Writer of machine files: what is written is read as the same machine."""

from pathlib import Path

import pytest

from hybridsep import load_machine, machine_names
from hybridsep.base.settings import PARAMETERS
from hybridsep.machines.machine import machine_from_table
from hybridsep.machines.text import machine_text


@pytest.mark.parametrize("name", machine_names())
def test_a_written_machine_is_read_again(name: str, tmp_path: Path) -> None:
    machine = load_machine(name)
    path = tmp_path / "axis.toml"
    path.write_text(machine_text(machine, ["identified", "two lines\nof text"]), encoding="utf-8")
    assert load_machine(path) == machine
    assert path.read_text(encoding="utf-8").startswith("# identified\n# two lines\n# of text\nname = ")


def test_text_with_quotes_and_no_sources(tmp_path: Path) -> None:
    physics = {"spring_mass_damper": {"m": 2.0, "c": 30.0, "k": 2e4}}
    machine = machine_from_table({"name": "a", "title": 'the "old" axis \\ Y', "physics": physics})
    path = tmp_path / "axis.toml"
    path.write_text(machine_text(machine), encoding="utf-8")
    assert load_machine(path) == machine
    assert load_machine(path).sources == ()


def test_units_stand_beside_the_entries() -> None:
    text = machine_text(load_machine("als25010_x"))
    assert f"f_n = 20.52{'':<19}# {PARAMETERS['f_n'].unit}".replace(" ", "") in text.replace(" ", "")
    assert "Np = 100\n" in text


def test_units_of_a_rotary_axis_are_angles() -> None:
    limits = {"velocity": 3.0, "acceleration": 30.0, "jerk": 2e3, "change_max": 0.1}
    physics = {"spring_mass_damper": {"m": 2.0, "c": 30.0, "k": 2e4}}
    machine = machine_from_table(
        {"name": "a", "unit": "rad", "title": "Table", "physics": physics, "drive_limits": limits}
    )
    text = "".join(machine_text(machine).split())
    assert "velocity=3.0#rad/sacceleration=30.0#rad/s2jerk=2000.0#rad/s3change_max=0.1#rad" in text
