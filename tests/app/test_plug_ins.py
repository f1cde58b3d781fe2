"""Commands of plug-ins: found by their entry points, named where they are not installed, imported by nothing."""

import ast
from importlib.metadata import EntryPoint

import pytest
from command_line import Run
from places import ROOT

from hybridsep.app import cli


@pytest.mark.parametrize("name", cli.PLUG_INS)
def test_a_plug_in_that_is_not_installed_is_named(name: str, hybridsep: Run) -> None:
    status, out, err = hybridsep(name, "--help")
    assert (status, out) == (2, "")
    assert f"pip install ./plugins/{name} in a checkout (hybridsep-{name} once released)" in err
    assert (ROOT / "plugins" / name / "pyproject.toml").is_file()


def test_a_plug_in_that_is_installed_is_a_command(hybridsep: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    point = EntryPoint("modal", "json:dumps", "hybridsep.commands")
    monkeypatch.setattr(EntryPoint, "load", lambda _: _shown)
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: [point] * (group == point.group))
    assert hybridsep("modal", "3")[:2] == (0, "got 3\n")
    assert "Show a number." in hybridsep("--help")[1]


def _shown(number: int) -> None:
    """Show a number."""
    print(f"got {number}")


def test_nothing_of_the_core_imports_a_plug_in() -> None:
    for path in (ROOT / "hybridsep").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            named = [one.name for one in node.names] if isinstance(node, ast.Import) else []
            named += [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
            assert not any(one.startswith("hybridsep_") for one in named), path
