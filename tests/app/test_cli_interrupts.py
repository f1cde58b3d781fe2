"""Ctrl-C at any moment: one line, exit status 130, nothing half written."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import scipy.signal
from command_line import Run, write_log

from hybridsep import cosimulate
from hybridsep.base.interrupt import interrupts_between_calls, starting_processes, taken, uninterrupted
from hybridsep.cosim.run import PREDICTOR
from hybridsep.fmi.processes import run_together

MACHINE = "spring_mass_damper"
POSIX = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals and devices")
MAIN = [sys.executable, "-c", "import sys; from hybridsep_main import main; sys.exit(main())"]


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
    with process:
        try:
            _, err = process.communicate(timeout=60)
        finally:
            process.kill()
    took, blocked = time.monotonic() - sent, signal.pthread_sigmask(signal.SIG_BLOCK, [])
    # a second where nothing else runs: benchmarks/interruptions.py
    assert took < 10.0, f"{took:.1f} s, status {process.returncode}, signals blocked here: {blocked}\n{err}"
    return process.returncode, err


@pytest.mark.slow
@POSIX
def test_ctrl_c_while_the_library_is_loaded() -> None:
    begun = time.monotonic()
    status, err = interrupted(["demo"], lambda: time.monotonic() > begun + 0.5)
    assert status == 130
    assert err.splitlines()[-1] in ("interrupted", SAID)  # the longer one between loading two parts of it


@pytest.mark.slow
@POSIX
def test_ctrl_c_during_the_demo(tmp_path: Path) -> None:
    """The demo's FMUs are Python ones: a KeyboardInterrupt inside them would be fmi2Fatal."""
    out = tmp_path / "demo"
    last = out / "staircase.csv"
    status, err = interrupted(["demo", "--flavour", "python", "--out", out], last.exists)
    assert (status, err.strip().splitlines()[-1]) == (130, SAID)  # after the duration and the stages
    assert not [path for path in out.rglob("*") if path.name.startswith(".")]
    lines = last.read_text().splitlines()
    assert len({line.count(",") for line in lines}) == 1
    assert len(lines) == 6002


@pytest.mark.slow
@POSIX
@pytest.mark.skipif(find_spec("ziglang") is None, reason="needs ziglang")
def test_ctrl_c_during_a_build_ends_the_compilers(tmp_path: Path) -> None:
    """In a checkout that has kept no library: all platforms, about ten seconds, two of them at a time."""
    out, temporary = tmp_path / "dist", tmp_path / "temporary"
    temporary.mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TMPDIR", str(temporary))
        patch.setenv("HYBRIDSEP_LIBRARIES", str(tmp_path / "libraries"))
        arguments = ["build", "HybridPredictor", "--target", "all", "--out", out]
        status, err = interrupted(arguments, lambda: list(temporary.rglob("all.c")))
    said = err.strip().splitlines()[-1]  # after the platforms
    assert (status, said) == (130, SAID)
    assert not out.exists()
    assert list(temporary.rglob("all.c")) == []


@pytest.mark.slow
@POSIX
def test_ctrl_c_in_a_terminal_ends_the_processes_of_tune(tmp_path: Path) -> None:
    """A terminal sends it to all of them; half a minute of replays, two at a time."""
    log, out = write_log(tmp_path / "log.csv", n=6000), tmp_path / "tuned.toml"
    arguments = (
        "tune",
        log,
        "-m",
        MACHINE,
        "--trust",
        "true",
        "--p",
        "1:50:1",
        "--q",
        "0:8:1",
        "--jobs",
        "2",
        "--out",
        out,
    )
    process = subprocess.Popen(
        [*MAIN, *map(str, arguments)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    begun = time.monotonic()
    while time.monotonic() < begun + 60.0 and not (children.exists() and len(children.read_text().split()) >= 3):
        time.sleep(0.05)
        if not children.exists() and time.monotonic() > begun + 5.0:  # no /proc
            break
    time.sleep(2.0)  # one that comes while they start is lost
    os.killpg(process.pid, signal.SIGINT)
    try:
        _, err = process.communicate(timeout=10)
    except subprocess.TimeoutExpired:  # on a busy machine they start later
        os.killpg(process.pid, signal.SIGINT)
        _, err = process.communicate(timeout=60)
    assert (process.returncode, err.strip().splitlines()[-1]) == (130, SAID)
    assert not out.exists()
    while time.monotonic() < begun + 90.0 and group_lives(process.pid):
        time.sleep(0.05)
    assert not group_lives(process.pid)


def group_lives(pid: int) -> bool:
    """Whether a process of the group is left."""
    try:
        os.killpg(pid, 0)
    except ProcessLookupError:
        return False
    return True


@POSIX
def test_commands_end_with_the_first_that_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    failing = "import pathlib, sys, time\nwhile not pathlib.Path('pid').is_symlink(): time.sleep(0.01)\nsys.exit('no')"
    sleeping = "import os, time; os.symlink(str(os.getpid()), 'pid'); time.sleep(600)"
    never = "open('never', 'x')"
    commands = [([sys.executable, "-c", code], tmp_path) for code in (failing, sleeping, never)]
    assert run_together(commands) == {0: (1, "no\n")}
    with pytest.raises(ProcessLookupError):
        os.kill(int(str((tmp_path / "pid").readlink())), 0)
    assert [path.name for path in tmp_path.iterdir()] == ["pid"]


@pytest.mark.slow
@POSIX
def test_ctrl_c_in_the_middle_of_a_step_of_a_python_fmu(
    hybridsep: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "run.csv"
    out.write_bytes(",".join(PREDICTOR.columns).encode() + b"\r\n")
    before, calls, original = out.read_bytes(), 0, scipy.signal.lfilter

    def lfilter(*arguments: Any, **keywords: Any) -> Any:
        """Send Ctrl-C from inside the FMU, whose prediction of a window calls this twice."""
        nonlocal calls
        calls += 1
        if calls == 5:
            os.kill(os.getpid(), signal.SIGINT)
        return original(*arguments, **keywords)

    monkeypatch.setattr("scipy.signal.lfilter", lfilter)
    for name, module in list(sys.modules.items()):  # libraries of FMUs that another test has loaded
        if name.startswith("hybridsep_") and hasattr(module, "lfilter"):
            monkeypatch.setattr(module, "lfilter", lfilter)
    status, _, err = hybridsep("cosim", "--flavour", "python", "--trust", "false", "--out", out)
    assert (status, calls) == (130, 6)  # the step was finished, the next one not begun
    assert err.strip().splitlines()[-1] == SAID
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


@pytest.fixture
def importer_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Callable[[], ModuleType]]:
    """Return what takes a module's text and returns what imports it."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "imported", raising=False)

    def write(text: str) -> Callable[[], ModuleType]:
        (tmp_path / "imported.py").write_text(text)
        return lambda: import_module("imported")

    return write


@POSIX
def test_ctrl_c_waits_for_the_end_of_an_import(importer_of: Callable[[str], Callable[[], ModuleType]]) -> None:
    """Before 3.12 Python makes a RuntimeError of an exception in __set_name__, as matplotlib has it."""
    load = importer_of(
        "import signal\n"
        "class Name:\n"
        "    def __set_name__(self, *_):\n"
        "        signal.raise_signal(signal.SIGINT)\n"
        "class Named:\n"
        "    name = Name()\n"
    )
    imported, begun = [], time.monotonic()
    with pytest.raises(KeyboardInterrupt), interrupts_between_calls():  # noqa: PT012
        imported.append(load().Named)
        time.sleep(60.0)
    assert imported
    assert time.monotonic() < begun + 50.0
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@POSIX
def test_a_second_ctrl_c_does_not_wait_for_an_import(importer_of: Callable[[str], Callable[[], ModuleType]]) -> None:
    load = importer_of(
        "import signal, time\nsignal.raise_signal(signal.SIGINT)\ntime.sleep(0.5)\n"
        "signal.raise_signal(signal.SIGINT)\ntime.sleep(60.0)\n"
    )
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt), interrupts_between_calls():
        load()
    assert begun + 0.5 <= time.monotonic() < begun + 50.0


@POSIX
def test_ctrl_c_during_an_import_is_not_lost_where_processes_are_started(
    importer_of: Callable[[str], Callable[[], ModuleType]],
) -> None:
    """Which ignore it for a while."""
    load = importer_of("import signal\nsignal.raise_signal(signal.SIGINT)\n")
    steps, begun = [], time.monotonic()
    with pytest.raises(KeyboardInterrupt), interrupts_between_calls():  # noqa: PT012
        load()
        with starting_processes():
            time.sleep(0.2)
            steps.append("started")
        time.sleep(60.0)
    assert steps == ["started"]
    assert time.monotonic() < begun + 50.0


@POSIX
def test_ctrl_c_that_a_callback_loses_comes_again() -> None:
    begun = time.monotonic()
    callback = ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGINT))
    hook = sys.unraisablehook
    with pytest.raises(KeyboardInterrupt), interrupts_between_calls():  # noqa: PT012
        callback()
        time.sleep(60.0)
    assert time.monotonic() < begun + 50.0
    assert sys.unraisablehook is hook


@POSIX
def test_ctrl_c_that_waits_is_raised_at_the_end(importer_of: Callable[[str], Callable[[], ModuleType]]) -> None:
    load = importer_of("import signal\nsignal.raise_signal(signal.SIGINT)\n")
    with pytest.raises(KeyboardInterrupt), interrupts_between_calls():
        load()
    time.sleep(0.05)  # nothing comes behind it


def test_ctrl_c_of_which_a_library_makes_another_exception() -> None:
    with pytest.raises(KeyboardInterrupt), interrupts_between_calls():  # noqa: PT012
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt as error:
            raise ImportError("initialization failed") from error
    with pytest.raises(ImportError), interrupts_between_calls():
        raise ImportError("no module of this name")


@POSIX
def test_ctrl_c_in_whose_place_an_expected_error_came_is_raised_again() -> None:
    """As in a search for fonts: Python handles signals while it makes the message of a ValueError."""

    class Word(str):
        def __repr__(self) -> str:
            signal.raise_signal(signal.SIGINT)
            return "a word"

    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt), interrupts_between_calls():  # noqa: PT012
        with suppress(ValueError):
            int(Word("normal"))
        time.sleep(60.0)
    assert time.monotonic() < begun + 50.0


def test_ctrl_c_that_was_taken_is_not_raised_again() -> None:
    steps = []
    with interrupts_between_calls():
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt as error:
            taken(error)
        time.sleep(0.1)
        steps.append("went on")
    assert steps == ["went on"]
    with pytest.raises(BrokenPipeError), interrupts_between_calls():  # noqa: PT012
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt as error:
            taken(error)
        raise BrokenPipeError


@POSIX
def test_ctrl_c_does_not_wait_for_an_import_that_began_before(
    importer_of: Callable[[str], Callable[[], ModuleType]],
) -> None:
    """A script that is imported runs the co-simulation."""
    load = importer_of(
        "import signal\n"
        "from hybridsep.base.interrupt import interrupts_between_calls\n"
        "with interrupts_between_calls():\n"
        "    signal.raise_signal(signal.SIGINT)\n"
        "    raise AssertionError('not reached')\n"
    )
    with pytest.raises(KeyboardInterrupt):
        load()
