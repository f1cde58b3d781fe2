"""Help of the commands: examples, each of which is run."""

import shlex
from pathlib import Path

import numpy as np
import pytest
from command_line import Run, write_rows
from staircase_data import commanded, measured

from hybridsep import load_machine
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
