"""Damaged files given to the command line: each must be read or refused in one line, and none may end the process.

``python -m benchmarks.hostile --n 3000 --fmus 1000`` takes an hour; ``--kinds npz fmu`` some of it. Each file goes to
``hybridsep backtest`` (logs, machine files, saved states) or ``hybridsep cosim`` (FMUs) in a process of its own. The
processes, and those that the commands start for themselves, are forked from one that has loaded the libraries, which
takes a hundredth of the time; ``--start`` starts the latter as users have them. Findings are kept, with their commands.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import io
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import IO, Any

from rich.console import Console
from rich.table import Table

from benchmarks.mutations import KINDS, MACHINE, good_log, log_text, mutated, originals
from hybridsep.app import cli
from hybridsep.base import apart

TIME_MAX = 120
"""Time after which a run counts as hung, s."""

MEMORY_MAX = 8 * 2**30
"""Address space of a run, bytes, so that a damaged length does not take the machine's memory."""

MESSAGE_MAX = 900
"""Largest length of a message, in characters."""

SAID = ("error: ", "warning: ", "note: ", "handled: ", "fixed: ", "Inconsistency detected by ld.so: ")
"""Beginnings of the lines that a refusal consists of; the last one is of the system's loader, which a library ends."""

PASSED = ("read", "refused")
LIBRARIES = (
    *("fmpy.fmi2", "h5py", "scipy.io", "asammdf", "nptdms", "pyarrow.parquet", "pyarrow.ipc", "openpyxl"),
    *("hybridsep.cosim.loop", "hybridsep.cosim.fmus"),
)
LOG_OPTIONS: tuple[list[str], ...] = (["--as-is"], ["--fix"], [])


@dataclass
class Summary:
    """Outcomes of the runs of one kind."""

    outcomes: Counter[str] = field(default_factory=Counter)
    longest: int = 0
    slowest: float = 0.0


class Forked:
    """Stand-in for subprocess.Popen, with as much of it as :mod:`hybridsep.base.apart` uses."""

    def __init__(self, *_: Any, stderr: int | None = None, **__: Any) -> None:
        (job, self_in), (self_out, answers) = os.pipe(), os.pipe()
        self.pid = os.fork()
        if not self.pid:
            if stderr is not None:
                os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
            _become(job, answers, apart.serve)
        os.close(job)
        os.close(answers)
        self.stdin: IO[bytes] = os.fdopen(self_in, "wb")
        self.stdout: IO[bytes] = os.fdopen(self_out, "rb")
        self.status: int | None = None

    def wait(self) -> int:
        """Return the exit status once it has ended."""
        if self.status is None:
            self.status = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        return self.status

    def kill(self) -> None:
        """End it, if it has not ended."""
        if self.status is None:
            os.kill(self.pid, signal.SIGKILL)


def _become(standard_input: int, standard_output: int, work: Callable[[], object]) -> None:
    """Do the work of a child in a forked process, and end it."""
    status = 1
    try:
        os.dup2(standard_input, 0)
        os.dup2(standard_output, 1)
        sys.stdin, sys.stdout = io.TextIOWrapper(os.fdopen(0, "rb")), io.TextIOWrapper(os.fdopen(1, "wb"))
        work()
        sys.stdout.flush()
        status = 0
    except BaseException as error:
        os.write(2, f"{type(error).__name__}: {error}\n".encode())
    finally:
        os._exit(status)


def main(given: Sequence[str] | None = None) -> int:
    """Run all kinds; return 1 if there are findings."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=int, default=3000, help="files of each kind but FMUs")
    parser.add_argument("--fmus", type=int, default=1000, help="FMUs")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--start", action="store_true", help="start the commands' own processes instead of forking")
    parser.add_argument("--keep", type=Path, default=Path("hostile_findings"), help="folder for findings")
    options = parser.parse_args(given)
    if not options.start:
        for library in LIBRARIES:
            importlib.import_module(library)
        apart.subprocess = _ForkingSubprocess  # type: ignore[assignment, attr-defined]
    found = {}
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "good.csv").write_bytes(log_text(good_log()))
        _load(_command("text", folder / "good.csv", folder, Random(0)))
        for kind in options.kinds:
            n = options.fmus if kind == "fmu" else options.n
            found[kind] = attack(kind, n, options.seed, folder, options.keep)
            sys.stderr.write(f"{kind}: {dict(found[kind].outcomes)}\n")
    report(found)
    return int(any(set(summary.outcomes) - set(PASSED) for summary in found.values()))


def _load(arguments: Sequence[str]) -> None:
    """Run a command here, so that what it imports is loaded."""
    sys.argv = ["hybridsep", *arguments]
    with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
        cli.main()


class _ForkingSubprocess:
    """Stand-in for the module subprocess."""

    PIPE, DEVNULL = subprocess.PIPE, subprocess.DEVNULL
    Popen = Forked


def attack(kind: str, n: int, seed: int, folder: Path, keep: Path) -> Summary:
    """Give damaged files of a kind to the command line."""
    chance, files, summary = Random(f"{kind} {seed}"), originals(kind, folder), Summary()
    for name, content in files:
        (folder / name).write_bytes(content)
        outcome, _, said = run(_command(kind, folder / name, folder, Random(0)), folder)
        if outcome != "read":
            raise SystemExit(f"the intact {name} was not read: {said}")
    for i in range(n):
        if i % 250 == 0:
            sys.stderr.write(f"{kind}: {i} of {n}\n")
        name, content = chance.choice(files)
        target = folder / f"damaged_{name}"
        target.write_bytes(mutated(kind, content, chance))
        command = _command(kind, target, folder, chance)
        outcome, seconds, said = run(command, folder)
        summary.outcomes[outcome] += 1
        summary.slowest = max(summary.slowest, seconds)
        if outcome == "refused":
            summary.longest = max(summary.longest, len(said))
        if outcome not in PASSED:
            keep.mkdir(exist_ok=True)
            (keep / f"{kind}_{seed}_{i}_{name}").write_bytes(target.read_bytes())
            with (keep / "findings.txt").open("a") as notes:
                notes.write(f"{kind} {i} {outcome}: hybridsep {' '.join(command)}\n{said}\n\n")
    return summary


def _command(kind: str, file: Path, folder: Path, chance: Random) -> list[str]:
    """Return the arguments of the command that reads a file."""
    good = str(folder / "good.csv")
    if kind == "fmu":
        role = "--plant" if "FeedDrive" in file.name else "--predictor"
        other = "HybridPredictor" if role == "--plant" else "FeedDrive"
        given = {role: str(file), "--plant" if role == "--predictor" else "--predictor": str(folder / f"{other}.fmu")}
        return ["cosim", "--trajectory", good, *(part for pair in given.items() for part in pair)]
    settings = ["--Np", "20", "--p", "3", "--q", "2"]
    if kind == "machine":
        return ["backtest", good, "-m", str(file), "--as-is", *settings]
    if kind == "state":
        trust = str("True" in file.name).lower()
        return ["backtest", good, "-m", MACHINE, "--weights", str(file), "--as-is", "--trust", trust, *settings]
    return ["backtest", str(file), "-m", MACHINE, *chance.choice(LOG_OPTIONS), *settings]


def run(arguments: Sequence[str], folder: Path) -> tuple[str, float, str]:
    """Run the command line in a forked process; return the outcome, the time, s, and what it said on standard error."""
    begin = time.monotonic()
    with tempfile.TemporaryFile() as errors:
        pid = os.fork()
        if not pid:
            _run_and_exit(arguments, folder, errors.fileno())
        status = _wait(pid, begin + TIME_MAX)
        errors.seek(0)
        said = errors.read().decode(errors="replace").strip()
    seconds = time.monotonic() - begin
    if status is None:
        return "hung", seconds, said
    if status < 0:
        return "killed", seconds, f"{signal.Signals(-status).name} {said}"
    if "error: unexpected " in said or "fault of hybridsep" in said or "Traceback" in said:
        return "unexpected", seconds, said
    if status == 0:
        return "read", seconds, said
    lines = said.replace(str(folder), "").splitlines() or [""]  # the last one, below what the intake finds
    tidy = status == 2 and all(line.startswith(SAID) and len(line) <= MESSAGE_MAX for line in lines)
    return ("refused", seconds, lines[-1]) if tidy else ("untidy", seconds, said)


def _run_and_exit(arguments: Sequence[str], folder: Path, errors: int) -> None:
    """Become the command line."""
    os.setpgid(0, 0)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_MAX, MEMORY_MAX))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.chdir(folder)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.dup2(errors, 2)
    status = 1
    try:
        sys.argv = ["hybridsep", *arguments]
        cli.main()
        status = 0
    except SystemExit as stop:
        status = stop.code if isinstance(stop.code, int) else 1
    finally:
        sys.stderr.flush()
        os._exit(status)


def _wait(pid: int, until: float) -> int | None:
    """Return the exit status of a process; None if it hangs, after its group was ended."""
    pause = 1e-3
    while True:
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        if time.monotonic() > until:
            os.killpg(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
            return None
        time.sleep(pause)
        pause = min(2 * pause, 0.05)


def report(found: dict[str, Summary]) -> None:
    """Print the outcomes by kind."""
    table = Table("kind", "read", "refused", "unexpected", "killed", "hung", "untidy", "longest message", "slowest [s]")
    for kind, summary in found.items():
        counts = [str(summary.outcomes[outcome]) for outcome in (*PASSED, "unexpected", "killed", "hung", "untidy")]
        table.add_row(kind, *counts, str(summary.longest), f"{summary.slowest:.1f}")
    Console(width=120).print(table)


if __name__ == "__main__":
    sys.exit(main())
