"""Interruption test of each command, by Ctrl-C, kill -9 or a full disk at random moments: every file is whole.

Each command first runs undisturbed, for its duration and its files, whose bytes do not depend on the run. Then it runs
again and again over older files of the same names. Ctrl-C and kill -9 come at uniformly random moments; the disk, a
tmpfs in a user namespace, has room for a uniformly random part of the new files.

``python benchmarks/interruptions.py --moments 50`` takes two hours on an idle machine, ``--commands backtest cosim``
some minutes.
"""

from __future__ import annotations

import argparse
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from hybridsep.plants.trajectory import staircase

COMMANDS = {
    "demo": ["demo", "--out", "."],
    "build": ["build", "-m", "spring_mass_damper", "--target", "host", "--out", "."],
    "backtest": ["backtest", "../log.csv", "-m", "spring_mass_damper", "--out", "batches.csv"],
    "cosim": ["cosim", "--flavour", "python", "--out", "run.csv", "--figure", "run.png"],
}
"""Run in the folder of their results."""

WAYS = ("ctrl-c", "kill -9", "full disk")
MAIN = [sys.executable, "-c", "import hybridsep_main, os; os.write(1, b'x'); hybridsep_main.main()"]
"""The command line, which says that Python has started and loaded the entry point: before, Ctrl-C is Python's."""
OLD_END = b"\nthis is the older file\n"
"""Suffix of an older file's content, which keeps its kind recognisable."""

ON_A_DISK = """
size=$1 disk=$2 old=$3 copy=$4; shift 4
mount -t tmpfs -o size="$size" none "$disk" && cp -a "$old/." "$disk" && cd "$disk" || exit 99
"$@"; status=$?
cp -a . "$copy"; exit $status
"""
"""Run a command on a disk of its own, which holds the older files, and copy it before it is gone."""


@dataclass
class Outcome:
    """Results of the runs of one command that were ended in one way."""

    runs: int = 0
    undisturbed: int = 0
    slowest: float = 0.0
    faults: list[str] = field(default_factory=list)


class Case:
    """One command, its new files and its older ones."""

    def __init__(self, name: str, place: Path) -> None:
        self.name, self.arguments = name, [*MAIN, *COMMANDS[name]]
        self.folder, self.old = place / name, place / f"{name}_old"
        self.folder.mkdir()
        begun = time.monotonic()
        subprocess.run(self.arguments, cwd=self.folder, check=True, stdout=subprocess.DEVNULL)
        self.duration = time.monotonic() - begun
        self.new = contents(self.folder)
        shutil.copytree(self.folder, self.old)
        for path in self.new:
            with (self.old / path).open("ab") as file:
                file.write(OLD_END)

    def interrupted(self, moment: float, number: int) -> tuple[int, float, str]:
        """Send a signal ``moment`` s after the start; return status, seconds until the end, standard error."""
        shutil.rmtree(self.folder)
        shutil.copytree(self.old, self.folder)
        process = subprocess.Popen(
            self.arguments,
            cwd=self.folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            # A background job of a shell ignores Ctrl-C, and so would its children.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )
        assert process.stdout is not None
        process.stdout.read(1)
        time.sleep(moment)
        sent = time.monotonic()
        process.send_signal(number)
        _, err = process.communicate()
        return process.returncode, time.monotonic() - sent, err

    def on_a_full_disk(self, share: float) -> tuple[int, float, str]:
        """Run on a disk with room for the older files and a share of the new ones."""
        size = sum(map(len, self.new.values()))
        room = size + len(self.new) * 4096 + int(share * size)
        disk = self.folder.with_name("disk")
        disk.mkdir(exist_ok=True)
        shutil.rmtree(self.folder)
        self.folder.mkdir()
        unshare = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", ON_A_DISK, "sh"]
        places = [str(room), str(disk), str(self.old), str(self.folder)]
        done = subprocess.run([*unshare, *places, *self.arguments], capture_output=True, text=True, check=False)
        return done.returncode, 0.0, done.stderr

    def faults(self, way: str, status: int, err: str) -> list[str]:
        """Record what is wrong after a run."""
        found = contents(self.folder)
        faults = [f"{path} is missing" for path in self.new if path not in found]
        for path, content in found.items():
            if path.name.startswith(".hybridsep-"):
                if way != "kill -9":  # which leaves no time to remove it
                    faults.append(f"{path} is left")
            elif path not in self.new:
                faults.append(f"{path} is new")
            elif content not in (self.new[path], self.new[path] + OLD_END):
                faults.append(f"{path} is neither the old nor the new file")
        expected = {"ctrl-c": (0, 130), "kill -9": (0, -signal.SIGKILL), "full disk": (0, 2)}[way]
        if status not in expected:
            faults.append(f"exit status {status}")
        if "Traceback" in err or "ignored" in err:
            faults.append(f"on standard error: {err.strip().splitlines()[-1]}")
        if (way == "ctrl-c" and status == 130 and "interrupted" not in err) or (status == 2 and "error: " not in err):
            faults.append("nothing on standard error")
        return faults


def contents(folder: Path) -> dict[Path, bytes]:
    """Return all files below a folder."""
    return {path.relative_to(folder): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def write_log(path: Path) -> None:
    """Write a log of a minute: a drive that lags behind the staircase."""
    x_d = np.tile(staircase()[:-1], 10)
    x = np.concatenate((np.zeros(3), x_d[:-3]))
    np.savetxt(path, np.column_stack((np.arange(len(x)) * 1e-3, x_d, x)), "%.9g", ",", header="t,x_d,x", comments="")


def sweep(case: Case, way: str, moments: int, rng: np.random.Generator, console: Console) -> Outcome:
    """Disturb a command ``moments`` times."""
    outcome = Outcome()
    for moment in rng.uniform(0.0, 1.0, moments):
        if way == "full disk":
            status, took, err = case.on_a_full_disk(moment)
        else:
            number = signal.SIGINT if way == "ctrl-c" else signal.SIGKILL
            status, took, err = case.interrupted(moment * case.duration, number)
        outcome.runs += 1
        outcome.undisturbed += status == 0
        outcome.slowest = max(outcome.slowest, took)
        faults = case.faults(way, status, err)
        for fault in faults:
            console.print(f"{case.name}, {way}, {moment:.3f}: {fault}", highlight=False)
        outcome.faults += faults
    return outcome


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--moments", type=int, default=50, help="runs of each command for each way to end it")
    parser.add_argument("--commands", nargs="+", choices=COMMANDS, default=list(COMMANDS))
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS))
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    console = Console()
    table = Table(title=f"{options.moments} random moments each")
    for column in ("command", "takes [s]", "ended by", "had ended before", "slowest stop [s]", "faults"):
        table.add_column(column)
    failed = False
    with tempfile.TemporaryDirectory() as place:
        write_log(Path(place) / "log.csv")
        for name in options.commands:
            case = Case(name, Path(place))
            for way in options.ways:
                outcome = sweep(case, way, options.moments, np.random.default_rng(options.seed), console)
                slowest = f"{outcome.slowest:.2f}" if way == "ctrl-c" else ""
                row = (way, f"{outcome.undisturbed} of {outcome.runs}", slowest, str(len(outcome.faults)))
                table.add_row(name, f"{case.duration:.1f}", *row)
                failed |= bool(outcome.faults)
                console.print(name, *row, sep=", ", highlight=False)
    console.print(table)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
