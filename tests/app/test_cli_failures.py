"""Failures of the command line: one line on standard error and an exit status."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.signal
from command_line import Run, write_log
from log_files import columns, write

from hybridsep import cosimulate
from hybridsep.base.interrupt import interrupts_between_calls, uninterrupted
from hybridsep.fmi.processes import Processes

MACHINE = "spring_mass_damper"
POSIX = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals and devices")
MAIN = [sys.executable, "-c", "import sys; from hybridsep_main import main; sys.exit(main())"]
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
        ("T_s = 0.001", f"T_s{'.a' * 5000} = 1", "T_s must be a number, got a value of type dict that is too long"),
        ("T_s = 0.001", "T_s = 1e-300", ""),
        ("T_s = 0.001", "T_s = 5e-324", ""),
        ('title = "An axis"', f"title{'.a' * 5000} = 1", "title: "),
        ('title = "An axis"', f"title = 0x{'f' * 5000}", "title: "),
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
    assert message in refusal(hybridsep, "cosim", "-m", machine, "--flavour", "python")


@pytest.mark.parametrize("t", [[0.0, 5e-324, 1e-323, 1.5e-323], [0.0, 1e-310, 2e-310], [-1e308, 0.0, 1e308]])
def test_times_that_cannot_be_divided_by(hybridsep: Run, tmp_path: Path, t: list[float]) -> None:
    log = write(tmp_path / "log.npz", {"t": t, "x_d": np.zeros(len(t)), "x": np.zeros(len(t))})
    assert "time 't' must be " in refusal(hybridsep, "backtest", log, "-m", MACHINE)


def test_a_given_interval_that_cannot_be_divided_by(hybridsep: Run, tmp_path: Path) -> None:
    log = write(tmp_path / "log.csv", {"x_d": np.zeros(9), "x": np.zeros(9)})
    for T_s in ("5e-324", "1e-300", DIGITS):
        refusal(hybridsep, "backtest", log, "-m", MACHINE, "--Ts", T_s)


def test_numbers_of_5000_digits(hybridsep: Run, tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text(f"t,x_d,x\n0,0,0\n0.001,0,{DIGITS}\n0.002,0,0\n")
    assert "column 'x' must be finite, got inf" in refusal(hybridsep, "backtest", log, "-m", MACHINE)
    assert "lambda must be finite" in refusal(hybridsep, "cosim", "--lam", DIGITS)
    assert "seed must be 0 … 2147483647, got" in refusal(hybridsep, "cosim", "--seed", "9" * 300)
    assert "seed must be a number, got" in refusal(hybridsep, "cosim", "--seed", "9" * 4000)


@pytest.mark.parametrize("n", [3000, 5000])
def test_a_nested_header_in_an_npz(hybridsep: Run, tmp_path: Path, n: int) -> None:
    log = write(tmp_path / "log.npz", columns())
    with zipfile.ZipFile(log) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(log, "w") as archive:
        for name, member in (members | {"t.npy": deep_header(n)}).items():
            archive.writestr(name, member)
    assert "log.npz: column 't' is truncated or damaged" in refusal(hybridsep, "backtest", log, "-m", MACHINE)


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

    monkeypatch.setattr("hybridsep.evaluate.backtest.backtest_stream", fail)
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
        sizes = ("--Np", 100_000, "--p", 100_000)
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


@POSIX
def test_a_reader_that_has_gone(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.csv", n=300)
    read, written = os.pipe()
    os.close(read)
    done = command("backtest", log, "-m", MACHINE, capture_output=False, stdout=written, stderr=subprocess.PIPE)
    os.close(written)
    assert (done.returncode, done.stderr) == (1, b"")


def test_an_ascii_terminal(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.csv", n=1000)
    ascii_only = {**os.environ, "PYTHONIOENCODING": "ascii", "COLUMNS": "200"}
    done = command("backtest", log, "-m", MACHINE, env=ascii_only)
    assert done.returncode == 0, done.stderr
    assert b"prediction error in um against" in done.stdout
    done = command("backtest", log, "-m", MACHINE, "--p", 200, env=ascii_only)
    assert done.returncode == 2
    assert b"p must be 1 ... Np = 100, got 200" in done.stderr


# Ctrl-C ------------------------------------------------------------------------------------------------------------

SAID = "interrupted: nothing is half written, files are either as they were or complete"


def interrupted(arguments: list[object], moment: Callable[[], object]) -> tuple[int, str]:
    """Send Ctrl-C to a command once ``moment()`` is true; return its status and its standard error."""
    process = subprocess.Popen(
        [*MAIN, *map(str, arguments)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        # A background job of a shell ignores Ctrl-C, and so would its children.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    while not moment() and process.poll() is None:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    sent = time.monotonic()
    _, err = process.communicate(timeout=60)
    assert time.monotonic() - sent < 10.0  # a second where nothing else runs: benchmarks/interruptions.py
    return process.returncode, err


@POSIX
def test_ctrl_c_while_the_library_is_loaded() -> None:
    begun = time.monotonic()
    status, err = interrupted(["demo"], lambda: time.monotonic() > begun + 0.5)
    assert (status, err) == (130, "interrupted\n")


@POSIX
def test_ctrl_c_during_the_demo(tmp_path: Path) -> None:
    """The demo's FMUs are Python ones: a KeyboardInterrupt inside them would be fmi2Fatal."""
    out = tmp_path / "demo"
    last = out / "staircase.csv"
    status, err = interrupted(["demo", "--flavour", "python", "--seeds", 1, "--out", out], last.exists)
    assert (status, err.strip()) == (130, SAID)
    assert not [path for path in out.rglob("*") if path.name.startswith(".")]
    lines = last.read_text().splitlines()
    assert len({line.count(",") for line in lines}) == 1
    assert len(lines) == 6002


@POSIX
@pytest.mark.skipif(find_spec("ziglang") is None, reason="needs ziglang")
def test_ctrl_c_during_a_build_ends_the_compilers(tmp_path: Path) -> None:
    """All platforms: about ten seconds of compiling, two of them at a time."""
    out, temporary = tmp_path / "dist", tmp_path / "temporary"
    temporary.mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TMPDIR", str(temporary))
        status, err = interrupted(["build", "HybridPredictor", "--out", out], lambda: list(temporary.rglob("all.c")))
    assert (status, err.strip()) == (130, SAID)
    assert list(out.iterdir()) == []
    assert list(temporary.rglob("all.c")) == []


@POSIX
def test_processes_stop_together(tmp_path: Path) -> None:
    processes = Processes()
    sleeper = [sys.executable, "-c", "import time; time.sleep(600)"]
    with ThreadPoolExecutor(2) as pool:
        running = [pool.submit(processes.run, sleeper, tmp_path) for _ in range(2)]
        while len(processes._running) < 2:
            time.sleep(0.01)
        processes.stop()
        assert [future.result()[0] for future in running] == [-signal.SIGTERM] * 2
    with pytest.raises(InterruptedError):
        processes.run(sleeper, tmp_path)


@POSIX
def test_ctrl_c_in_the_middle_of_a_step_of_a_python_fmu(
    hybridsep: Run, tmp_path: Path, python_fmu: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "run.csv"
    out.write_bytes(b"t,x_d,x,x_meas,x_pb,x_hold,x_h,active\r\n")
    before, calls, original = out.read_bytes(), 0, scipy.signal.lfilter

    def lfilter(*arguments: Any, **keywords: Any) -> Any:
        """Send Ctrl-C from inside the FMU, whose prediction of a window calls this."""
        nonlocal calls
        calls += 1
        if calls == 5:
            os.kill(os.getpid(), signal.SIGINT)
        return original(*arguments, **keywords)

    ahead, plant = python_fmu("HybridPredictorPy"), python_fmu("FeedDrivePy")
    monkeypatch.setattr("scipy.signal.lfilter", lfilter)
    for name, module in list(sys.modules.items()):  # libraries of FMUs that another test has loaded
        if name.startswith("hybridsep_") and hasattr(module, "lfilter"):
            monkeypatch.setattr(module, "lfilter", lfilter)
    status, _, err = hybridsep("cosim", "--predictor", ahead, "--plant", plant, "--out", out)
    assert (status, calls) == (130, 5)
    assert err.strip() == SAID
    assert out.read_bytes() == before
    assert list(tmp_path.iterdir()) == [out]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@POSIX
def test_ctrl_c_from_a_script_is_a_keyboard_interrupt(python_fmu: Callable[[str], Path]) -> None:
    fmus = python_fmu("HybridPredictorPy"), python_fmu("FeedDrivePy")

    def interrupt(k: int, n: int) -> None:
        if k > n // 2:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        cosimulate(*fmus, np.zeros(500), progress=interrupt)
    assert cosimulate(*fmus, np.zeros(500)).summary()["n_samples"] == 500


def test_a_call_ends_before_ctrl_c_is_raised() -> None:
    steps: list[str] = []

    @uninterrupted
    def call() -> None:
        signal.raise_signal(signal.SIGINT)
        steps.append("ended")

    @uninterrupted
    def insist() -> None:
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        steps.append("not reached")

    for function in (call, insist):
        with pytest.raises(KeyboardInterrupt), interrupts_between_calls():
            function()
    assert steps == ["ended"]
    with interrupts_between_calls():
        uninterrupted(steps.clear)()
    assert steps == []
