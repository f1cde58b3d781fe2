"""Output files of the command line: nothing of the user's is overwritten; arguments are checked first."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from command_line import Run, write_log
from log_files import write

from hybridsep.app.console import written_before
from hybridsep.demo.cases import demo_files
from hybridsep.machines.machine import machine_name, machine_path

MACHINE = "spring_mass_damper"


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return write_log(tmp_path / "log.csv", n=1000)


def own_machine(folder: Path) -> Path:
    path = folder / "machine.toml"
    path.write_bytes(machine_path(MACHINE).read_bytes())
    return path


def command_file(folder: Path) -> Path:
    return write(folder / "command.csv", {"t": np.arange(200) * 1e-3, "x_d": np.zeros(200)})


def refusal(run: Run, *arguments: object) -> str:
    """Run a command that must be refused with one line; return it without line breaks."""
    status, out, err = run(*arguments)
    assert (status, out) == (2, ""), err
    assert err.startswith("error: ")
    assert len(err.strip().splitlines()) == 1
    return err.strip()


# An output that is an input ----------------------------------------------------------------------------------------

LINKS = pytest.mark.parametrize(
    "link", [lambda file, other: None, os.symlink, os.link], ids=["itself", "symbolic", "hard"]
)


def linked(link: Callable[[Path, Path], object], file: Path, suffix: str) -> Path:
    """Return another name of a file, or its own."""
    other = file.with_name(f"other{suffix}")
    link(file, other)
    return other if other.exists() else file


@LINKS
@pytest.mark.parametrize("force", [[], ["--force"]])
def test_backtest_does_not_overwrite_its_log_or_machine(
    hybridsep: Run, tmp_path: Path, log: Path, link: Callable[[Path, Path], object], force: list[str]
) -> None:
    machine = own_machine(tmp_path)
    for file, what in ((log, "log"), (machine, "machine file")):
        before = file.read_bytes()
        out = linked(link, file, f"_{what}.csv")
        err = refusal(hybridsep, "backtest", log, "-m", machine, "--out", out, *force)
        assert f"--out {out} is the same file as the {what} {file}; choose another name" in err
        assert file.read_bytes() == before


@LINKS
def test_cosim_does_not_overwrite_what_it_reads(
    hybridsep: Run, tmp_path: Path, link: Callable[[Path, Path], object]
) -> None:
    trajectory = command_file(tmp_path)
    before = trajectory.read_bytes()
    out = linked(link, trajectory, ".csv")
    arguments = ("--trajectory", trajectory, "--out", out)
    assert f"--out {out} is the same file as the trajectory {trajectory}" in refusal(hybridsep, "cosim", *arguments)
    assert trajectory.read_bytes() == before
    outputs = ("--out", tmp_path / "run.npz", "--figure", tmp_path / "run.png")
    (tmp_path / "run.png").symlink_to(tmp_path / "run.npz")
    assert f"is the same file as --out {outputs[1]}" in refusal(hybridsep, "cosim", *outputs)


def test_build_does_not_overwrite_its_machine(hybridsep: Run, tmp_path: Path) -> None:
    machine = own_machine(tmp_path)
    before = machine.read_bytes()
    (tmp_path / "FeedDrivePy.fmu").symlink_to(machine)
    arguments = ("FeedDrivePy", "-m", machine, "--flavour", "python", "--out", tmp_path)
    assert f"FeedDrivePy.fmu is the same file as the machine file {machine}" in refusal(hybridsep, "build", *arguments)
    assert machine.read_bytes() == before


# An existing file --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [
        ("backtest", "{log}", "-m", MACHINE, "--out", "{there}"),
        ("cosim", "--trajectory", "{log}", "--out", "{there}"),
        ("cosim", "--trajectory", "{log}", "--figure", "{there}"),
        ("build", "FeedDrive", "--out", "{folder}"),
        ("init", "{there}"),
        ("demo", "--out", "{folder}"),
        ("fit", "{log}", "--out", "{folder}"),
    ],
    ids=lambda arguments: f"{arguments[0]} {arguments[-2]}",
)
def test_an_existing_file_needs_force(hybridsep: Run, tmp_path: Path, log: Path, arguments: tuple[str, ...]) -> None:
    folder = tmp_path / "there"
    folder.mkdir()
    names = {"build": "FeedDrive.fmu", "demo": "summary.json", "init": "axis.toml", "fit": "machine.toml"}
    there = folder / names.get(arguments[0], "run.png" if "--figure" in arguments else "run.csv")
    there.write_text("my own")
    words = [word.format(log=log, there=there, folder=folder) for word in arguments]
    assert f"{there} exists; choose another name, or overwrite it with --force" in refusal(hybridsep, *words)
    assert (there.read_text(), list(folder.iterdir())) == ("my own", [there])
    if arguments[0] in ("backtest", "init"):
        assert hybridsep(*words, "--force")[0] == 0
        assert there.read_text(encoding="utf-8") != "my own"


@pytest.mark.slow
def test_a_later_fit_of_a_log_replaces_its_files_and_no_others(hybridsep: Run, tmp_path: Path, log: Path) -> None:
    out = tmp_path / "axis"
    arguments = ("fit", log, "--Np", 20, "--out", out)
    for _ in range(2):
        assert hybridsep(*arguments)[0] == 0
    (other := log.with_name("other.csv")).write_bytes(log.read_bytes())
    assert "machine.toml exists" in refusal(hybridsep, "fit", other, *arguments[2:])
    machine = out / "machine.toml"
    edited = machine.read_text(encoding="utf-8") + "# mine\n"
    machine.write_text(edited, encoding="utf-8")
    assert f"{machine} exists; choose another name" in refusal(hybridsep, *arguments)
    assert machine.read_text(encoding="utf-8") == edited
    assert written_before(out / "fit.json", [log]) == {path for path in out.iterdir() if path != machine}


def test_logs_of_two_days_have_a_folder_each() -> None:
    days = [machine_name(Path(f"logs/spindle.2026-11-{day}.csv")) for day in (26, 27)]
    assert days == ["spindle_2026_11_26", "spindle_2026_11_27"]
    assert machine_name(Path("my_axis.csv.gz"), "X") == "my_axis_X"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (b"x" * 226 + b".csv", "an axis's name must have at most 100 letters"),
        (b"spindel\xe9.csv", "the name of a file that is read must be in UTF-8, got"),
    ],
    ids=["long", "Latin-1"],
)
@pytest.mark.skipif(sys.platform != "linux", reason="names of files are bytes")
def test_names_that_cannot_be_written_are_refused_before_the_work(
    hybridsep: Run, tmp_path: Path, log: Path, monkeypatch: pytest.MonkeyPatch, name: bytes, message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    log.rename(tmp_path / os.fsdecode(name))
    monkeypatch.setattr("hybridsep.logs.log.read_log", None)
    assert message in refusal(hybridsep, "fit", os.fsdecode(name))


# All arguments before any work -------------------------------------------------------------------------------------


def test_weights_that_are_none_are_refused_before_a_loop_is_run(
    hybridsep: Run, tmp_path: Path, log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are loaded once, where the FMU is built."""

    def run(*_: object, **__: object) -> None:
        raise AssertionError("a loop is run")

    monkeypatch.setattr("hybridsep.cosim.loop.cosimulate", run)
    said = refusal(hybridsep, "cosim", "--weights", str(log), "--out", str(tmp_path / "run.csv"))
    assert "a saved state of kind 'predictor' was expected" in said
    assert not (tmp_path / "run.csv").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["build", "--target", "sparc"], "no target sparc; there are host"),
        (["build", "HybridPredictor", "--weights", "{log}"], "a saved state of kind 'predictor' was expected"),
        (
            ["build", "FeedDrive", "--unit", "furlong"],
            "unit must be one of m, mm, um, nm, in, rad, mrad, urad, deg, rev, got 'furlong'",
        ),
        (["cosim", "--predictor", "{log}"], "log.csv is not a readable FMU"),
        (["cosim", "--plant", "none.fmu"], "no FMU at none.fmu; build it first"),
        (["cosim", "--plant", "{fmu}"], "HybridPredictorPy.fmu is no plant: it has no input x_d"),
        (["cosim", "--compensate", "physics", "--predictor", "{fmu}"], "is no compensator: it has no output x_dm"),
        (
            ["cosim", "--unit", "furlong"],
            "unit must be one of m, mm, um, nm, in, rad, mrad, urad, deg, rev, got 'furlong'",
        ),
        (["backtest", "{log}", "-m", MACHINE, "--out", "{folder}"], "--out must be a file, got the folder"),
    ],
)
def test_arguments_are_checked_before_any_work(
    hybridsep: Run,
    tmp_path: Path,
    log: Path,
    python_fmu: Callable[[str], Path],
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    message: str,
) -> None:
    def work(*_: object, **__: object) -> None:
        raise AssertionError("work has begun")

    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    for module in ("hybridsep.fmi.archive", "hybridsep.fmi.archive"):
        monkeypatch.setattr(f"{module}.build_fmu", work)
    monkeypatch.setattr("hybridsep.evaluate.backtest.backtest", work)
    names = {"log": log, "folder": folder, "fmu": python_fmu("HybridPredictorPy")}
    assert message in refusal(hybridsep, *(argument.format(**names) for argument in arguments))
    assert [path for path in folder.rglob("*") if path.is_file()] == []


def test_a_log_that_ends_badly_costs_no_result(hybridsep: Run, tmp_path: Path, log: Path) -> None:
    out = tmp_path / "batches.csv"
    assert hybridsep("backtest", log, "-m", MACHINE, "--out", out)[0] == 0
    before = out.read_bytes()
    with log.open("a") as file:
        file.write("1.0,0.0,broken\n")
    again = ("backtest", log, "-m", MACHINE, "--out", out, "--force")
    assert "column 'x' must be a number, got 'broken'" in refusal(hybridsep, *again)
    assert out.read_bytes() == before


def test_the_demos_list_of_files_needs_no_demo(tmp_path: Path) -> None:
    files = demo_files(tmp_path, full=True)
    assert len(files) == len(set(files)) == 4 + 3 * (4 + 1 + 3 + 1)


def test_a_file_that_has_the_folders_name_is_named(hybridsep: Run, tmp_path: Path, log: Path) -> None:
    before = log.read_bytes()
    for out in (log, log / "deeper"):
        err = refusal(hybridsep, "fit", log, "--out", out)
        assert f"--out {out / 'machine.toml'}: {log} is a file, not a folder; choose another" in err
    assert log.read_bytes() == before
