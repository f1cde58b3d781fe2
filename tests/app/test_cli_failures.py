"""What commands say where no figure comes: failures, and progress where standard error is no terminal."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from command_line import Run, write_log
from places import ROOT

from hybridsep.app import console
from hybridsep.app.console import progress_bar
from hybridsep.cosim.loop import FmuDrive

MACHINE = "spring_mass_damper"
POSIX = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals and devices")
MAIN = [sys.executable, "-c", "import sys; from hybridsep.__main__ import main; sys.exit(main())"]


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (MemoryError("Unable to allocate 74.5 GiB"), "out of memory: Unable to allocate 74.5 GiB; use a smaller Np"),
        (MemoryError(), "out of memory; use a smaller Np, p or q, or a shorter log"),
        (TypeError("a\nb"), "unexpected TypeError: a b; this is a fault of hybridsep"),
        (RecursionError("x" * 5000), "please report it with the command and its files (HYBRIDSEP_DEBUG=1 shows where"),
        (OSError(28, "No space left on device", "a.csv"), "cannot read or write a.csv: No space left on device"),
    ],
)
def test_what_is_left_is_one_line(
    hybridsep: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception, message: str
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("hybridsep.fitting.replay.backtest", fail)
    monkeypatch.delenv("HYBRIDSEP_DEBUG", raising=False)
    log = write_log(tmp_path / "log.csv", n=300)
    err = hybridsep.refused("backtest", log, "-m", MACHINE)
    assert err.startswith("error: ")
    assert message in err
    assert len(err) < 1000
    assert err.count("\n") == 1
    if not isinstance(error, (MemoryError, OSError)):
        monkeypatch.setenv("HYBRIDSEP_DEBUG", "1")
        with pytest.raises(type(error)):
            hybridsep("backtest", log, "-m", MACHINE)


# Standard output ---------------------------------------------------------------------------------------------------


def command(*arguments: object, **keywords: Any) -> subprocess.CompletedProcess[Any]:
    done: subprocess.CompletedProcess[Any] = subprocess.run(
        [*MAIN, *map(str, arguments)], check=False, **{"capture_output": True} | keywords
    )
    return done


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("argument", ["--help", "example-log"])
def test_a_full_standard_output(tmp_path: Path, argument: str) -> None:
    with Path("/dev/full").open("wb") as full:
        done = command(argument, capture_output=False, stdout=full, stderr=subprocess.PIPE, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.decode() == "error: cannot read or write standard output: No space left on device\n"


@pytest.mark.slow
@POSIX
def test_a_reader_that_has_gone(tmp_path: Path) -> None:
    read, written = os.pipe()
    os.close(read)
    done = command("example-log", capture_output=False, stdout=written, stderr=subprocess.PIPE, cwd=tmp_path)
    os.close(written)
    assert done.returncode == 1
    assert b"error" not in done.stderr


@pytest.mark.slow
def test_an_ascii_terminal(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.csv", n=300)
    ascii_only = {**os.environ, "PYTHONIOENCODING": "ascii", "COLUMNS": "200"}
    done = command("backtest", log, "-m", MACHINE, env=ascii_only)
    assert done.returncode == 0, done.stderr
    assert b"RMS [?m]" in done.stdout


def test_ctrl_c_is_one_line_and_status_130(hybridsep: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    step = FmuDrive.step

    def interrupt(drive: FmuDrive, k: int, *arguments: float) -> None:
        if k == 1000:
            signal.raise_signal(signal.SIGINT)
        step(drive, k, *arguments)

    monkeypatch.setattr(FmuDrive, "step", interrupt)
    status, out, err = hybridsep("cosim", "--out", tmp_path / "run.csv")
    said = "interrupted: nothing is half written, files are either as they were or complete"
    assert (status, out, err.splitlines()[-1]) == (130, "", said)
    assert not list(tmp_path.iterdir())


class Clock:
    """Time that a test sets, s."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(console, "monotonic", clock)
    return clock


def test_a_line_for_each_stage_and_for_each_pause(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bar(False) as advance:
        for k in range(300):  # 30 s, two stages
            clock.now += 0.1
            advance("first" if k < 100 else "second", k / 300)
        advance("done", 1.0)
    out, err = capsys.readouterr()
    lines = err.splitlines()
    assert out == ""
    assert [line.split("] ")[1] for line in lines] == ["first", "first", *["second"] * 4]
    assert all(re.fullmatch(r"\[ *\d+%\] \w+", line) for line in lines)


def test_what_is_quick_and_what_prints_json_says_nothing(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    for quiet, seconds in ((False, 1.9), (True, 60.0)):
        with progress_bar(quiet) as advance:
            advance("stage", 0.0)
            clock.now += seconds
            advance("next stage", 0.5)
            advance("done", 1.0)
    assert capsys.readouterr() == ("", "")


def test_demo_and_readme_say_how_long_it_takes(hybridsep: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("hybridsep.demo.cases.demo", interrupted)
    status, out, err = hybridsep("demo", "--out", tmp_path / "demo")
    assert (status, out) == (130, "")
    assert err.startswith("note: this takes about 10 seconds of processor time")
    _, found, after = (ROOT / "README.md").read_text(encoding="utf-8").partition("hybridsep demo --out demo\n```\n")
    assert found
    assert "the demo itself has 10 seconds" in " ".join(after[:800].split())
