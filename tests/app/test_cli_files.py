"""Output files of the command line: nothing of the user's is overwritten; arguments are checked first."""

import os
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from built_once import BuiltFmus
from command_line import Run, write_log
from library_stream import trained_state
from log_files import write
from machine_files import changed_machine

from hybridsep.app.console import written_before

MACHINE = "spring_mass_damper"


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return write_log(tmp_path / "log.csv", n=1000)


def refusal(run: Run, *arguments: object) -> str:
    """Run a command that must be refused with one line; return it without line breaks."""
    err = run.refused(*arguments)
    assert err.startswith("error: ")
    assert len(err.strip().splitlines()) == 1
    return err.strip()


# An output that is an input ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("link", [os.symlink, os.link, None], ids=["symbolic", "hard", "itself"])
def test_what_is_read_is_not_overwritten(
    hybridsep: Run, tmp_path: Path, log: Path, link: Callable[[Path, Path], object] | None
) -> None:
    machine = changed_machine(tmp_path / "machine.toml", MACHINE)
    trajectory = write(tmp_path / "command.csv", {"t": np.arange(200) * 1e-3, "x_d": np.zeros(200)})
    for file, what, option, command in (
        (log, "log", "--save", ("backtest", log, "-m", machine, "--force")),
        (trajectory, "trajectory", "--out", ("cosim", "--trajectory", trajectory)),
    ):
        before, out = file.read_bytes(), file if link is None else tmp_path / f"other_{what}.csv"
        if link is not None:
            link(file, out)
        said = refusal(hybridsep, *command, option, out)
        assert f"{option} {out} is the same file as the {what} {file}; choose another" in said
        assert file.read_bytes() == before
    outputs = ("--out", tmp_path / "run.npz", "--figure", tmp_path / "run.png")
    (tmp_path / "run.png").symlink_to(tmp_path / "run.npz")
    assert f"is the same file as --out {outputs[1]}" in refusal(hybridsep, "cosim", *outputs)


def test_build_does_not_overwrite_its_machine(hybridsep: Run, tmp_path: Path) -> None:
    machine = changed_machine(tmp_path / "machine.toml", MACHINE)
    before = machine.read_bytes()
    (tmp_path / "FeedDrivePy.fmu").symlink_to(machine)
    arguments = ("FeedDrivePy", "-m", machine, "--flavour", "python", "--out", tmp_path)
    assert f"FeedDrivePy.fmu is the same file as the machine file {machine}" in refusal(hybridsep, "build", *arguments)
    assert machine.read_bytes() == before


# An existing file --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [
        ("backtest", "{log}", "-m", MACHINE, "--save", "{there}"),
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
        hybridsep.done(*words, "--force")
        assert there.read_text(encoding="utf-8") != "my own"


@pytest.mark.slow
@pytest.mark.usefixtures("quick_fit")
def test_a_later_fit_of_a_log_replaces_its_files_and_no_others(hybridsep: Run, tmp_path: Path, log: Path) -> None:
    out = tmp_path / "axis"
    arguments = ("fit", log, "--Np", 50, "--out", out)
    for _ in range(2):
        hybridsep.done(*arguments)
    (other := log.with_name("other.csv")).write_bytes(log.read_bytes())
    assert "machine.toml exists" in refusal(hybridsep, "fit", other, *arguments[2:])
    machine = out / "machine.toml"
    edited = machine.read_text(encoding="utf-8") + "# mine\n"
    machine.write_text(edited, encoding="utf-8")
    assert f"{machine} exists; choose another name" in refusal(hybridsep, *arguments)
    assert machine.read_text(encoding="utf-8") == edited
    assert written_before(out / "fit.json", [log]) == {path for path in out.iterdir() if path != machine}


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (b"x" * 226 + b".csv", "an axis's name must have at most 100 letters"),
        (b"spindel\xe9.csv", "must have a name in UTF-8; rename it"),
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


DIGITS = "9" * 4000
UNITS = "unit must be one of m, mm, um, nm, in, rad, mrad, urad, deg, rev, got 'furlong'"
USERS = "--weights is for one HybridPredictor or SepCompensator, this would build"
REFUSED = [
    ("backtest {log} -m robot", "error: no machine 'robot'"),
    ("backtest {log} {m} --set predictor.p=200", "p must be 1 … Np = 100, got 200"),
    ("backtest {log} {m} --set predictor.lambda=0", "lambda must be 1e-40 … 1e+12 m2, got 0"),
    ("backtest {log} {m} --x pos", "column 'pos' (x) is missing, the file has 't', 'x_d', 'x'; name it: --x NAME"),
    ("backtest {log} {m} --unit furlong", UNITS),
    ("backtest nothing.csv {m}", "nothing.csv"),
    ("backtest {log} {m} --report {folder}", "--report must end in .html"),
    ("backtest {log} {m} --figure a.jpg", "--figure must end in .png or .pdf or .svg, got 'a.jpg'"),
    ("backtest {log} {m} --save a.bin", "--save must end in .state or .csv or .npz"),
    ("backtest {log} {m} --report page.pdf", "--report must end in"),
    ("build SepCompensator -m emps", "; emps has no [drive_limits], which a"),
    ("build SepCompensatorPy --flavour python", "there are HybridPredictorPy, FeedDrivePy"),
    ("build Robot --flavour python", "no FMU Robot of spring_mass_damper; there are HybridPredictorPy"),
    ("build --flavour cobol", "flavour must be one of"),
    ("build --fmi 4", "the version of FMI must be one of 2, 3, got '4'"),
    ("build --fmi 3 --flavour python", "FMUs of the Python flavour are of FMI 2 only"),
    ("build --target sparc", "no target sparc; there are host"),
    ("build FeedDriveFmi3 --target host", "; FMUs of FMI 3.0 need --fmi 3"),
    ("build FeedDrivePy --flavour python --out {log}", "is a file, not a folder"),
    ("build HybridPredictor --weights {log}", "a saved state of kind 'predictor' was expected"),
    ("build FeedDrive --unit furlong", UNITS),
    ("cosim -m emps", "emps has no [plant], which hybridsep fit writes from a log of the axis, or name a plant"),
    ("cosim --trajectory zigzag", "zigzag"),
    ("cosim --unit furlong", UNITS),
    ("cosim --out run.xlsx", "--out must end in .csv or .npz, got 'run.xlsx'"),
    ("cosim --out {log}/run.csv", "is a file, not a folder"),
    ("cosim --out {folder}", "--out must be a file, got the folder"),
    ("cosim --figure run.pdf", "--figure must end in .png, got 'run.pdf'"),
    ("cosim --set predictor.Np=10", "p must be 1 … Np = 10, got 50"),
    ("cosim --compensate magic", "--compensate must be one of off, physics, hybrid, got 'magic'"),
    ("cosim --compensate hybrid --set compensator.p=51", "p must be 1 … Np = 50, got 51"),
    ("cosim --compensate hybrid -m emps --plant p.fmu", "emps has no [drive_limits], which a compensator must keep"),
    ("cosim --compensate hybrid --predictor none.fmu", "no FMU at none.fmu; build it first"),
    ("cosim --compensate physics --predictor {fmu}", "is no compensator: it has no output x_dm"),
    ("cosim --predictor {log}", "log.csv is not a readable FMU"),
    ("cosim --plant {fmu}", "HybridPredictorPy.fmu is no plant: it has no input x_d"),
    ("cosim --weights w.state --predictor p.fmu", "--weights go into an FMU that is built here"),
    ("cosim --set plant.seed=99999999999", "plant.seed: seed must be 0 … 2147483647, got 99999999999"),
    (f"cosim --set plant.seed={DIGITS}", "seed must be "),
    (f"cosim --set predictor.lambda={DIGITS}", "lambda must be "),
    ("cosim --set plant.sed=1", "plant.sed is not an entry of a machine file"),
    ("cosim --set predictor=1", "predictor must be a table, got 1"),
    ("cosim --set predictor.p", "an entry is set as in predictor.p=20, got 'predictor.p'"),
    ("cosim --set plant.seed=1 --plant p.fmu", "is for an FMU that is built here; leave out --plant"),
    ("cosim als25010_x --path part.ngc", "two machines and a path belong together, got 1:"),
    ("cosim als25010_x als25010_y", "got 2 and none"),
    ("cosim als25010_x als25010_y --path part.ngc -m emps --compensate off", "are for one axis"),
    ("cosim als25010_x emps --path part.ngc", "machine emps has no [plant]"),
    ("cosim als25010_x als25010_y --path part.ngc --figure part.ngc", "--figure must end in .png"),
    ("build --weights {trained}", f"{USERS} HybridPredictor, SepCompensator; name one"),
    ("build FeedDrive --weights {trained}", f"{USERS} none"),
    ("build HybridPredictor --weights no.state", "cannot read or write no.state: No such file"),
    ("build -m emps --weights {trained}", "HybridPredictor.state was not trained for machine emps: it has "),
    ("build FeedDrive --trajectory x.csv", "--trajectory is for one ReferenceTrajectory, this would build none"),
    ("build --flavour python --target host", "--target is for native FMUs; with --flavour python leave it"),
    ("build --for plc", "--for must be twincat, got plc"),
    ("build --for twincat --flavour python", "--for twincat is for native FMUs"),
    ("build ReferenceTrajectory --for twincat", "ReferenceTrajectory plays files"),
    ("system -m emps", "machine emps has no [plant], which hybridsep fit writes"),
    ("system --out axis.zip", "--out must end in .ssp"),
    ("system --compensate best", "--compensate must be one of off, physics, hybrid, got 'best'"),
    ("system --ssp 3", "the version of SSP must be one of 1, 2, got '3'"),
    ("system --trajectory nothing.csv", "nothing.csv"),
    ("header emps", "; add them, or write a predictor's"),
    ("hal emps", "emps has no [drive_limits], which a compensator must keep"),
    ("hal als25010_x als25010_x", "each axis must have a name of its own"),
    ("hal als25010_x als25010_y --weights {trained}", "--weights belong to one axis"),
    ("hal als25010_x --out x,y", "at which loadrt takes axes= apart"),
    ("hal als25010_x --out a$b", "at which loadrt takes axes= apart"),
    ("fit {log} --p 5,lots", "--p must be whole numbers with commas, got '5,lots'"),
    ("fit {log} --look-ahead 60", "--look-ahead must be a time with its unit, such as 60ms or 0.06s, got '60'"),
    ("fit {log} --Np 20 --p 50", "p must be 1 … Np = 20, got 50"),
    ("fit {log} --out {folder} --name no-name", "name (--name) must be"),
    ("fit {log} --out {log}/deeper", "log.csv is a file, not a folder; choose another"),
]


@pytest.mark.parametrize(("command", "message"), REFUSED, ids=[command[:60] for command, _ in REFUSED])
def test_arguments_are_checked_before_any_work(
    hybridsep: Run,
    tmp_path: Path,
    log: Path,
    fmus: BuiltFmus,
    monkeypatch: pytest.MonkeyPatch,
    command: str,
    message: str,
) -> None:
    def work(*_: object, **__: object) -> None:
        raise AssertionError("work has begun")

    folder, before = tmp_path / "here.csv", log.read_bytes()
    folder.mkdir()
    monkeypatch.chdir(folder)
    for place in ("fmi.archive.build_fmu", "fitting.replay.backtest", "cosim.loop.cosimulate"):
        monkeypatch.setattr(f"hybridsep.{place}", work)
    names = {"log": log, "folder": folder, "fmu": fmus("HybridPredictorPy"), "m": f"-m {MACHINE}"}
    names["trained"] = trained_state("HybridPredictor")
    said = refusal(hybridsep, *command.format(**names).split())
    assert message in said
    assert len(said.replace(str(tmp_path), "")) < 1000
    assert [path for path in folder.rglob("*") if path.is_file()] == []
    assert log.read_bytes() == before


def test_weights_that_are_none_are_refused_before_a_loop_is_run(
    hybridsep: Run, log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are loaded once, where the FMU is built."""
    monkeypatch.setattr("hybridsep.cosim.loop.cosimulate", None)
    assert "a saved state of kind 'predictor' was expected" in refusal(hybridsep, "cosim", "--weights", log)


def test_a_log_that_ends_badly_costs_no_result(hybridsep: Run, tmp_path: Path, log: Path) -> None:
    out = tmp_path / "run.csv"
    hybridsep.done("backtest", log, "-m", MACHINE, "--save", out)
    before = out.read_bytes()
    with log.open("a") as file:
        file.write("1.0,0.0,broken\n")
    again = ("backtest", log, "-m", MACHINE, "--save", out, "--force")
    assert "column 'x' must be a number, got 'broken'" in refusal(hybridsep, *again)
    assert out.read_bytes() == before
