"""Failures of the command line: one line on standard error and an exit status."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import Run, predictor, write_log
from log_files import columns, write

from hybridsep.cosim.adapters import FmuDrive

MACHINE = "spring_mass_damper"
POSIX = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals and devices")
MAIN = [sys.executable, "-c", "import sys; from hybridsep.__main__ import main; sys.exit(main())"]
DIGITS = "9" * 5000
MACHINE_FILE = """
name = "axis"
title = "An axis"
sources = ["a test"]
T_s = 0.001
[[physics.mode]]
f_n = 25.0
zeta = 0.05
alpha = 24674.0
"""


def refusal(run: Run, *arguments: object) -> str:
    """Run a command that must fail with one line; return it."""
    status, out, err = run(*arguments)
    assert (status, out) == (2, ""), err
    assert "Traceback" not in err
    assert err.startswith("error: ")
    assert len(err.strip().splitlines()) == 1
    assert len(err) < 1000
    return err


def deep_header(n: int) -> bytes:
    """Return an ``.npy`` header whose shape is nested n-fold."""
    text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {'-' * n}1}}\n".encode()
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


# Hostile files -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("T_s = 0.001", f"T_s = {DIGITS}", "is not valid TOML: Exceeds the limit (4300"),
        ("T_s = 0.001", f"T_s = 0x{'f' * 5000}", "T_s must be a number, got a value of type int that is too long"),
        ("T_s = 0.001", f"T_s = {'[' * 5000}{']' * 5000}", "is not valid TOML: "),
        ("T_s = 0.001", f"T_s{'.a' * 5000} = 1", "T_s must be a number, got a value of type dict"),
        ("T_s = 0.001", "T_s = 1e-300", ""),
        ("T_s = 0.001", "T_s = 5e-324", ""),
        ('title = "An axis"', f"title = 0x{'f' * 5000}", "title must be "),
        ("An axis", "An \\uFFFE axis", "title must be one line of printable text that XML 1.0 allows"),
        ("An axis", "An \\uFFFF axis", "title must be one line of printable text that XML 1.0 allows"),
        ("a test", "a \\uFFFE test", "sources[1] must be one line of printable text that XML 1.0"),
    ],
    ids=lambda value: value[:25] if isinstance(value, str) else None,
)
def test_hostile_machine_files(hybridsep: Run, tmp_path: Path, old: str, new: str, message: str) -> None:
    assert MACHINE_FILE.count(old) == 1
    machine = tmp_path / "machine.toml"
    machine.write_text(MACHINE_FILE.replace(old, new), encoding="utf-8")
    assert message in refusal(hybridsep, "cosim", "-m", machine)


@pytest.mark.parametrize("t", [[0.0, 5e-324, 1e-323, 1.5e-323], [0.0, 1e-310, 2e-310], [-1e308, 0.0, 1e308]])
def test_times_that_cannot_be_divided_by(hybridsep: Run, tmp_path: Path, t: list[float]) -> None:
    log = write(tmp_path / "log.npz", {"t": t, "x_d": np.zeros(len(t)), "x": np.zeros(len(t))})
    assert "time 't' must be " in refusal(hybridsep, "backtest", log, "-m", MACHINE)


def test_a_given_interval_that_cannot_be_divided_by(hybridsep: Run, tmp_path: Path) -> None:
    log = write(tmp_path / "log.csv", {"x_d": np.zeros(9), "x": np.zeros(9)})
    for T_s in ("5e-324", "1e-300", DIGITS):
        refusal(hybridsep, "backtest", log, "-m", MACHINE, "--T_s", T_s)


def test_numbers_of_5000_digits(hybridsep: Run, tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text(f"t,x_d,x\n0,0,0\n0.001,0,{DIGITS}\n0.002,0,0\n")
    assert "column 'x' must be finite, got inf" in refusal(hybridsep, "backtest", log, "-m", MACHINE)
    assert "lambda must be finite" in refusal(hybridsep, "cosim", "--set", f"predictor.lambda={DIGITS}")
    assert "seed must be 0 … 2147483647, got" in refusal(hybridsep, "cosim", "--set", f"plant.seed={'9' * 300}")
    assert "seed must be a number, got" in refusal(hybridsep, "cosim", "--set", f"plant.seed={'9' * 4000}")


@pytest.mark.parametrize("n", [3000, 5000])
def test_a_nested_header_in_an_npz(hybridsep: Run, tmp_path: Path, n: int) -> None:
    log = write(tmp_path / "log.npz", columns())
    with zipfile.ZipFile(log) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(log, "w") as archive:
        for name, member in (members | {"t.npy": deep_header(n)}).items():
            archive.writestr(name, member)
    assert "log.npz: column 't' is truncated, damaged or not an array" in refusal(
        hybridsep, "backtest", log, "-m", MACHINE
    )


# What nobody foresaw -----------------------------------------------------------------------------------------------


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
    assert message in refusal(hybridsep, "backtest", log, "-m", MACHINE)
    if not isinstance(error, (MemoryError, OSError)):
        monkeypatch.setenv("HYBRIDSEP_DEBUG", "1")
        with pytest.raises(type(error)):
            hybridsep("backtest", log, "-m", MACHINE)


def test_memory_that_there_is_not(hybridsep: Run, tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.csv", n=300)
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (8 << 30, before[1]))
    try:
        sizes = predictor(Np=100_000, p=5000)
        status, out, err = hybridsep("backtest", log, "-m", MACHINE, *sizes)
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)
    assert (status, out) == (2, "")
    assert err.startswith("error: ")
    assert len(err.strip().splitlines()) == 1


# Standard output ---------------------------------------------------------------------------------------------------


def command(*arguments: object, **keywords: Any) -> subprocess.CompletedProcess[Any]:
    done: subprocess.CompletedProcess[Any] = subprocess.run(
        [*MAIN, *map(str, arguments)], check=False, **{"capture_output": True} | keywords
    )
    return done


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("arguments", [["--help"], ["backtest", "{log}", "-m", MACHINE, "--json"]])
def test_a_full_standard_output(tmp_path: Path, arguments: list[str]) -> None:
    log = write_log(tmp_path / "log.csv", n=300)
    with Path("/dev/full").open("wb") as full:
        done = command(
            *(argument.format(log=log) for argument in arguments),
            capture_output=False,
            stdout=full,
            stderr=subprocess.PIPE,
        )
    assert done.returncode == 2
    assert done.stderr.decode() == "error: cannot read or write standard output: No space left on device\n"


@pytest.mark.slow
@POSIX
def test_a_reader_that_has_gone(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.csv", n=300)
    read, written = os.pipe()
    os.close(read)
    done = command("backtest", log, "-m", MACHINE, capture_output=False, stdout=written, stderr=subprocess.PIPE)
    os.close(written)
    assert done.returncode == 1
    assert b"error" not in done.stderr


@pytest.mark.slow
def test_an_ascii_terminal(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.csv", n=1000)
    ascii_only = {**os.environ, "PYTHONIOENCODING": "ascii", "COLUMNS": "200"}
    done = command("backtest", log, "-m", MACHINE, env=ascii_only)
    assert done.returncode == 0, done.stderr
    assert b"prediction error in ?m against" in done.stdout
    done = command("backtest", log, "-m", MACHINE, *predictor(p=200), env=ascii_only)
    assert done.returncode == 2
    assert b"p must be 1 ? Np = 100, got 200" in done.stderr


@pytest.mark.slow
@POSIX
@pytest.mark.parametrize("streams", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_closed_standard_streams(tmp_path: Path, streams: str) -> None:
    out = tmp_path / "machine.toml"
    shell = f'exec "$0" -m hybridsep init "$1" {streams}'
    done = subprocess.run(["sh", "-c", shell, sys.executable, str(out)], capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    assert "[physics" in out.read_text(encoding="utf-8")


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
