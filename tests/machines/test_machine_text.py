"""Machine files as text: written and read again; messages of TOML."""

from pathlib import Path

import pytest

from hybridsep import load_machine, machine_names
from hybridsep.base.errors import MachineError
from hybridsep.base.settings import PARAMETERS
from hybridsep.machines.machine import machine_from_table, machine_path
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


TEXT = machine_path("spring_mass_damper").read_text(encoding="utf-8")


def test_a_byte_order_mark_is_skipped(tmp_path: Path) -> None:
    (tmp_path / "machine.toml").write_text(TEXT, encoding="utf-8-sig")
    assert load_machine(tmp_path / "machine.toml") == load_machine("spring_mass_damper")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("\n".join(f"k{i} = 1" for i in range(2000)), r"k8 is not an entry .* … and 1991 more"),
        ('"a\\nb" = 1', r"'a\\nb' is not an entry"),
        (f"name = '{'x' * 100_000}-'", r"name must be .* got 'x{59}… \(100003 characters\)"),
        ("a = [" + "[" * 100_000, "is not valid TOML: "),
        (f"T_s = {'9' * 5000}", r"is not valid TOML: Exceeds the limit \(4300"),
        (f"T_s = 0x{'f' * 5000}", "T_s must be a number, got a value of type int that is too long"),
        (f"T_s{'.a' * 5000} = 1", "T_s must be a number, got a value of type dict"),
        ('title = "An \\uFFFE axis"', "title must be one line of printable text that XML 1.0 allows"),
        ('sources = ["a \\uFFFF test"]', r"sources must be a list, each entry one line of printable text"),
    ],
)
def test_messages_are_one_line_of_a_reasonable_length(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "machine.toml"
    path.write_text(text)
    with pytest.raises(MachineError, match=message) as caught:
        load_machine(path)
    assert len(str(caught.value)) < 1000
    assert "\n" not in str(caught.value)
