"""Machine files as text: byte-order mark, deeply nested keys, messages about thousands of entries."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from hybridsep.base.errors import MachineError
from hybridsep.machines.machine import load_machine, machine_path

TEXT = machine_path("spring_mass_damper").read_text(encoding="utf-8")
QUICKLY = 2.0  # s; a key nested 100 000 deep took 8


def test_a_byte_order_mark_is_skipped(tmp_path: Path) -> None:
    (tmp_path / "machine.toml").write_text(TEXT, encoding="utf-8-sig")
    assert load_machine(tmp_path / "machine.toml") == load_machine("spring_mass_damper")


@pytest.mark.parametrize(
    "text",
    [
        f"{'.'.join('a' * 100_000)} = 1",
        f"[{'.'.join('a' * 100_000)}]",
        "x = 1\n" + ".".join(["'a'"] * 100_000) + " = 1",
        "[" + " . ".join(['"a"'] * 100_000) + "]",
    ],
    ids=["bare", "table", "literal", "quoted"],
)
def test_a_deeply_nested_key_is_refused_at_once(tmp_path: Path, text: str) -> None:
    path = tmp_path / "machine.toml"
    path.write_text(text)
    begin = time.perf_counter()
    with pytest.raises(MachineError, match=r"machine\.toml is not valid TOML: a key must have at most 100 dots"):
        load_machine(path)
    assert time.perf_counter() - begin < QUICKLY


def test_dots_elsewhere_are_no_key(tmp_path: Path) -> None:
    path = tmp_path / "machine.toml"
    path.write_text(f"# {'.' * 500}\n" + TEXT.replace('title = "', f'title = "{"." * 500}', 1))
    assert load_machine(path).title.startswith("." * 500)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("\n".join(f"k{i} = 1" for i in range(2000)), r"k8 is not an entry .* … and 1991 more"),
        (f"{'x' * 100_000} = 1", r"'x{59}… \(100002 characters\) is not an entry of a machine file"),
        ('"a\\nb" = 1', r"'a\\nb' is not an entry"),
        (f"name = '{'x' * 100_000}-'", r"name: .* got 'x{59}… \(100003 characters\)"),
        ("a = [" + "[" * 100_000, "is not valid TOML: "),
    ],
)
def test_messages_are_one_line_of_a_reasonable_length(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "machine.toml"
    path.write_text(text)
    with pytest.raises(MachineError, match=message) as caught:
        load_machine(path)
    assert len(str(caught.value)) < 1000
    assert "\n" not in str(caught.value)
