"""Machine files as text: byte-order mark, messages about thousands of entries."""

from pathlib import Path

import pytest

from hybridsep.base.errors import MachineError
from hybridsep.machines.machine import load_machine, machine_path

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
