"""Help of the commands: examples, each of which is run; commands of plug-ins."""

import ast
import shlex
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest
from command_line import Run, write_rows
from places import ROOT
from staircase_data import commanded, measured

from hybridsep import load_machine
from hybridsep.app import cli
from hybridsep.app.cli import EXAMPLES
from hybridsep.machines.text import machine_text


@pytest.fixture(scope="module")
def axis(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the examples name: a log, a program, machine files, a trained predictor."""
    folder = tmp_path_factory.mktemp("examples")
    part = np.r_[:400, 999:1399]  # a move in each half
    write_rows(folder / "my_axis.csv", commanded()[part], measured(0)[part])
    machine = load_machine("spring_mass_damper").changed("predictor", {"Np": 50, "p": 20, "q": 1})
    for name in ("my_axis", "x", "y"):
        (folder / name).mkdir()
        text = machine_text(machine.changed("", {"name": name}))
        (folder / name / "machine.toml").write_text(text, encoding="utf-8")
    predictor = machine.new_predictor()
    x_d, x = commanded()[:100], measured(0)[:100]
    for begin in (0, 50):
        predictor.predict(x_d[begin : begin + 50])
        predictor.update(x[begin : begin + 50])
    predictor.save(folder / "my_axis" / "trained.state")
    (folder / "part.ngc").write_text("F1200 G2 X0 Y0 I1\n", encoding="utf-8")
    return folder


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
@pytest.mark.parametrize(
    "name",
    [  # the demonstration takes half a minute, and test_demo runs it
        pytest.param(name, marks=pytest.mark.nightly if name == "demo" else ()) for name in sorted(EXAMPLES)
    ],
)
def test_each_command_has_two_examples_that_run(
    hybridsep: Run, axis: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 1)  # other processes would load all that this one has
    lines = EXAMPLES[name]
    assert len(set(lines)) == 2
    for i, line in enumerate(lines):
        words = shlex.split(line)
        assert words[:2] == ["hybridsep", name]
        folder = tmp_path / str(i)
        folder.mkdir()
        for path in axis.rglob("*"):
            if path.is_file() and path.name not in (words[-1] if name == "example-log" else ""):
                place = folder / path.relative_to(axis)
                place.parent.mkdir(exist_ok=True)
                place.write_bytes(path.read_bytes())
        if name == "fit":  # which makes it
            (folder / "my_axis" / "machine.toml").unlink()
            (folder / "my_axis" / "trained.state").unlink()
        monkeypatch.chdir(folder)
        status, _, err = hybridsep(*words[1:])
        assert status == 0, err


def test_help_has_examples(hybridsep: Run) -> None:
    status, out, _ = hybridsep("fit", "--help")
    assert status == 0
    assert "  hybridsep fit my_axis.csv --Np 100\n" in out


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
