"""Output files of the command line: no input or file of another kind is overwritten; arguments are checked first."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from command_line import Run, write_log
from log_files import columns, write

from hybridsep import HybridPredictor, load_machine
from hybridsep.app.overwrite import BATCHES, FIGURE, FMU, RUN, STATE, SUMMARY
from hybridsep.cosim.run import COMPENSATOR, PREDICTOR, save_columns
from hybridsep.demo import demo
from hybridsep.machines.machine import machine_path

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
    arguments = ("--trajectory", trajectory, "--flavour", "python", "--out", out)
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


def test_demo_does_not_overwrite_its_recording(hybridsep: Run, tmp_path: Path) -> None:
    recording = write(tmp_path / "recording.csv", {"t": [0, 1], "qg": [0, 0], "qm": [0, 0]})
    (tmp_path / "staircase.csv").hardlink_to(recording)
    err = refusal(hybridsep, "demo", "--emps", recording, "--out", tmp_path)
    assert f"staircase.csv is the same file as the recording {recording}" in err


# An existing file of another kind ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["notes.toml", "other.csv", "batches.npz"])
def test_another_kind_needs_force(hybridsep: Run, tmp_path: Path, log: Path, name: str) -> None:
    out = tmp_path / name
    if name.endswith(".toml"):
        own_machine(tmp_path).rename(out)
    else:
        write(out, columns())
    before = out.read_bytes()
    arguments = ("backtest", log, "-m", MACHINE, "--out", out)
    err = refusal(hybridsep, *arguments)
    assert f"--out {out} exists and is no CSV of hybridsep backtest; choose another name, or overwrite it with" in err
    assert out.read_bytes() == before
    assert hybridsep(*arguments, "--force")[0] == 0
    assert out.read_text().startswith("t,rms_pb")
    assert hybridsep(*arguments)[0] == 0  # its own kind needs no force


def test_cosim_and_build_ask_too(hybridsep: Run, tmp_path: Path) -> None:
    trajectory = command_file(tmp_path)
    log, picture, archive = tmp_path / "log.csv", tmp_path / "picture.png", tmp_path / "FeedDrivePy.fmu"
    write(log, columns())
    picture.write_bytes(b"\xff\xd8 a photograph with the wrong name")
    write(tmp_path / "arrays.npz", columns()).rename(archive)
    kept = {path: path.read_bytes() for path in (log, picture, archive)}
    common = ("cosim", "--trajectory", trajectory, "--flavour", "python")
    assert "is no result of hybridsep cosim" in refusal(hybridsep, *common, "--out", log)
    assert "--figure" in (err := refusal(hybridsep, *common, "--figure", picture))
    assert "is no PNG" in err
    build = ("build", "FeedDrivePy", "--flavour", "python", "--out", tmp_path)
    assert "is no FMU of hybridsep" in refusal(hybridsep, *build)
    assert {path: path.read_bytes() for path in kept} == kept
    for _ in range(2):
        assert hybridsep(*build, "--force")[0] == 0
    assert hybridsep(*build)[0] == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [("init", "{out}", "--tau", "0.006"), ("identify", "{log}", "--out", "{out}")],
    ids=["init", "identify"],
)
def test_an_edited_machine_file_needs_force(
    hybridsep: Run, tmp_path: Path, log: Path, arguments: tuple[str, ...]
) -> None:
    out = tmp_path / "axis.toml"
    again = [part.format(out=out, log=log) for part in arguments]
    for _ in range(2):  # as it was written it may be replaced
        assert hybridsep(*again)[0] == 0
    assert hybridsep("init", out, "--tau", "0.007")[0] == 0
    written = out.read_text(encoding="utf-8")
    out.write_bytes(written.replace("\n", "\r\n").encode())  # line ends are no edit
    assert hybridsep(*again)[0] == 0
    edited = out.read_text(encoding="utf-8") + "\n[drive_limits]\nv_max = 0.5\n"
    out.write_text(edited, encoding="utf-8")
    err = refusal(hybridsep, *again)
    assert f"{out} exists and has been edited since `hybridsep {arguments[0]}` wrote it; choose another name" in err
    assert "or overwrite it and lose the edits with --force" in err
    assert out.read_text(encoding="utf-8") == edited
    assert hybridsep(*again, "--force")[0] == 0
    assert "v_max" not in out.read_text(encoding="utf-8")
    own_machine(tmp_path).rename(out)
    assert f"{out} exists and is no machine file that hybridsep wrote" in refusal(hybridsep, *again)


def test_demo_asks_before_it_works(hybridsep: Run, tmp_path: Path) -> None:
    (tmp_path / "summary.json").write_text('{"my": "results"}')
    assert "summary.json exists and is no summary of hybridsep demo" in refusal(hybridsep, "demo", "--out", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["summary.json"]


def test_kinds_are_recognised_and_others_are_not(tmp_path: Path, python_fmu: Callable[[str], Path]) -> None:
    ours = {
        RUN: [tmp_path / "a.csv", tmp_path / "a.npz", tmp_path / "b.csv", tmp_path / "b.npz"],
        STATE: [tmp_path / "a.state"],
        FMU: [python_fmu("FeedDrivePy")],
    }
    for path in ours[RUN]:
        names = (PREDICTOR if path.stem == "a" else COMPENSATOR).columns
        save_columns({name: np.zeros(3) for name in names}, path)
    HybridPredictor(load_machine(MACHINE).model).save(ours[STATE][0])
    every = [path for paths in ours.values() for path in paths]
    for kind in (BATCHES, RUN, FIGURE, FMU, STATE, SUMMARY):
        assert [path for path in every if kind.recognises(path)] == ours.get(kind, [])


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
        (["demo", "--emps", "missing.mat"], "missing.mat: there is no such file"),
        (["demo", "--emps", "{log}"], "log.csv: columns 'qg' (x_d), 'qm' (x) are missing"),
        (["demo", "--flavour", "cobol"], "flavour must be one of native, python, got 'cobol'"),
        (["build", "--target", "sparc"], "no target sparc; there are host"),
        (["build", "HybridPredictor", "--weights", "{log}"], "a saved state of kind 'predictor' was expected"),
        (
            ["build", "FeedDrive", "--unit", "furlong"],
            "unit must be one of m, mm, um, nm, in, rad, mrad, urad, deg, rev, got 'furlong'",
        ),
        (["build", "FeedDrive", "--Ts", "-1"], "T_s must be"),
        (["cosim", "--predictor", "{log}"], "log.csv is not a readable FMU"),
        (["cosim", "--plant", "none.fmu"], "no FMU at none.fmu; build it first"),
        (["cosim", "--plant", "{fmu}"], "HybridPredictorPy.fmu is no plant: it has no input x_d"),
        (["cosim", "--compensate", "physics", "--predictor", "{fmu}"], "is no compensator: it has no output x_dm"),
        (
            ["cosim", "--unit", "furlong"],
            "unit must be one of m, mm, um, nm, in, rad, mrad, urad, deg, rev, got 'furlong'",
        ),
        (["cosim", "--Ts", "0"], "T_s must be"),
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
    for module in ("hybridsep.fmi.archive", "hybridsep.fmi.builds"):
        monkeypatch.setattr(f"{module}.build_fmu", work)
    monkeypatch.setattr("hybridsep.evaluate.backtest.backtest_stream", work)
    names = {"log": log, "folder": folder, "fmu": python_fmu("HybridPredictorPy")}
    assert message in refusal(hybridsep, *(argument.format(**names) for argument in arguments))
    assert [path for path in folder.rglob("*") if path.is_file()] == []


def test_a_log_that_ends_badly_costs_no_result(hybridsep: Run, tmp_path: Path, log: Path) -> None:
    out = tmp_path / "batches.csv"
    assert hybridsep("backtest", log, "-m", MACHINE, "--out", out)[0] == 0
    before = out.read_bytes()
    with log.open("a") as file:
        file.write("1.0,0.0,none\n")
    assert "column 'x' must be a number, got 'none'" in refusal(hybridsep, "backtest", log, "-m", MACHINE, "--out", out)
    assert out.read_bytes() == before


def test_the_demos_list_of_files_needs_no_demo(tmp_path: Path) -> None:
    files = demo.demo_files(tmp_path, "python", full=True, emps=True)
    assert len(files) == len(set(files)) == 5 + 3 * (4 + 1 + 3 + 1)


def test_a_file_that_has_the_folders_name_is_named(hybridsep: Run, tmp_path: Path, log: Path) -> None:
    before = log.read_bytes()
    for out in (log, log / "deeper"):
        err = refusal(hybridsep, "fit", log, "--out", out)
        assert f"--out {out / 'machine.toml'}: a file has the name of the folder {out}; choose another" in err
    assert log.read_bytes() == before
