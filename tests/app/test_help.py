"""Help of the commands: panels, and examples that are lines of theirs."""

from __future__ import annotations

import shlex

import pytest
import typer
from command_line import Run

from hybridsep.app.cli import EXAMPLES, app

COMMANDS = typer.main.get_command(app).commands  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_each_command_has_two_examples_that_it_takes(name: str) -> None:
    lines = EXAMPLES[name]
    assert len(set(lines)) == 2
    for line in lines:
        words = shlex.split(line)
        assert words[:2] == ["hybridsep", name]
        COMMANDS[name].make_context(name, words[2:])  # raises where it does not take them


def test_help_has_panels_and_examples(hybridsep: Run) -> None:
    status, out, _ = hybridsep("fit", "--help")
    assert status == 0
    heads = [line[:-1] for line in out.splitlines() if line.endswith(":") and not line.startswith(" ")]
    known, limits = "What is known of the axis", "Limits of the drive, for a compensator"
    assert heads[:2] == ["Arguments", "Options"]
    assert set(heads) == {"Arguments", "Options", "Reading the file", known, limits, "Output"} | set(heads[-1:])
    assert "  hybridsep fit my_axis.csv --Np 100\n" in out
