"""Contour error of G-code programs in LinuxCNC, on simulated drives: without, physics, hybrid cold and warm.

    python integrations/linuxcnc/simulation/contour.py --out cnc [--user NAME] [circle spiral pocket]

It needs LinuxCNC 2.9 with its headers (Debian: linuxcnc-uspace, linuxcnc-uspace-dev) and installs two HAL components;
LinuxCNC itself refuses root, so that root names an ordinary ``--user``. Half a minute a program.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from sampled_columns import AXES, COLUMNS

from hybridsep.base.signals import Array
from hybridsep.cosim.contour import Contour
from hybridsep.evaluate.figures import contour_figure
from hybridsep.plants.path import PlanarPath

HERE = Path(__file__).resolve().parent
CASES: dict[str, dict[str, int] | None] = {
    "without": None,
    "off": {"ENABLE": 0},
    "physics": {"MODEL": 1},
    "hybrid cold": {},
    "hybrid warm": {},
}
"""Cases by name, with the entries of machine.ini's [HSEP] that they change; None: without the component."""


@dataclass(frozen=True)
class Samples:
    """Samples of all servo periods in motion.

    Attributes
    ----------
    out, delayed, fb, pos : (n, 2) array, mm
        Command to the drives, the command as it came, and measured and true positions.
    state : (n, 2) array
        The component's.
    n_lost, n_late : int
        Samples that the sampler has lost, and periods that began half a period late or more.
    """

    out: Array
    delayed: Array
    fb: Array
    pos: Array
    state: Array
    n_lost: int
    n_late: int

    @classmethod
    def read(cls, path: Path) -> Samples:
        """Read a file of run.py's."""
        table = np.loadtxt(path, skiprows=1)
        columns = dict(zip(COLUMNS, table.T, strict=True))
        pairs = {
            name: np.column_stack([columns[f"{axis}_{name}"] for axis in AXES])
            for name in ("out", "delayed", "fb", "pos", "state")
        }
        moving = np.flatnonzero(np.abs(np.diff(pairs["delayed"], axis=0)).sum(axis=1) > 0.0)
        part = slice(moving[0], moving[-1] + 80)
        n_lost = int(table[-1, 0] - table[0, 0]) + 1 - len(table)
        late = columns["overruns"][part]
        return cls(**{name: pair[part] for name, pair in pairs.items()}, n_lost=n_lost, n_late=int(late[-1] - late[0]))

    def contour(self, radius: float = np.nan) -> Contour:
        """Return the true positions along the commanded path, m; ``radius`` is that of a circle about X0 Y0, m."""
        commanded, reached = (1e-3 * (pair @ np.array([1.0, 1.0j])) for pair in (self.delayed, self.pos))
        centre = np.where(np.abs(np.abs(commanded) - radius) < 2e-5, 0j, complex(np.nan))
        return Contour.of(replace(PlanarPath.of(commanded), centre=centre), reached, 1e-3)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the programs, print the table and draw the errors."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", nargs="*", default=["circle", "spiral", "pocket"])
    parser.add_argument("--out", type=Path, required=True, help="folder for logs, machine files and figures")
    parser.add_argument("--user", help="ordinary user that LinuxCNC runs as, for root")
    given = parser.parse_args(arguments)
    given.out.mkdir(parents=True, exist_ok=True)
    install(given.out)
    print("| contour error, µm: RMS (99.9 %, largest) | " + " | ".join(CASES) + " |\n|---|" + "---|" * len(CASES))
    late: dict[str, list[str]] = {}
    for program in given.programs:
        samples = run_cases(program, given.out, given.user)
        contours = {case: one.contour(0.02 if program == "circle" else np.nan) for case, one in samples.items()}
        cells = ["{:.1f} ({:.0f}, {:.0f})".format(*one.figures().values()) for one in contours.values()]
        print(f"| {program} | " + " | ".join(cells) + " |", flush=True)
        drawn = {case.replace(" ", "_"): one for case, one in contours.items() if case != "without"}
        contour_figure(drawn, f"{program}.ngc in LinuxCNC", given.out / f"{program}.png")
        late[program] = [f"{one.n_late} of {len(one.pos)}" for one in samples.values()]
        lost = sum(one.n_lost for one in samples.values())
        if lost:
            print(f"{lost} samples were lost", file=sys.stderr)
    print("\n| periods that began late | " + " | ".join(CASES) + " |\n|---|" + "---|" * len(CASES))
    for program, cells in late.items():
        print(f"| {program} | " + " | ".join(cells) + " |")


def install(out: Path) -> None:
    """Write the component and the axes, and install it and the simulated drive."""
    hybridsep("hal", *(str(HERE / f"{axis}.toml") for axis in AXES), "--out", str(out / "hal"))
    for source in (out / "hal" / "hsep.c", HERE / "hsep_sim_drive.comp"):
        command = ["halcompile", "--install", str(source.resolve())]
        subprocess.run(command if os.geteuid() == 0 else ["sudo", *command], check=True, capture_output=True)


def run_cases(program: str, out: Path, user: str | None) -> dict[str, Samples]:
    """Run a program in all cases; the warm one has learned what the cold one has seen."""
    found = {}
    for case, entries in CASES.items():
        log = out / f"{program}_{case.replace(' ', '_')}.txt"
        if case == "hybrid warm":
            train(out / f"{program}_hybrid_cold.txt", out)
        run(f"{program}.ngc", log, out, entries, user)
        found[case] = Samples.read(log)
        if case == "hybrid warm":
            for axis in AXES:
                (out / "hal" / axis / "weights.bin").unlink()
    return found


def train(log: Path, out: Path) -> None:
    """Give the axes what a predictor learns from a log."""
    for axis in AXES:
        machine, state = str(HERE / f"{axis}.toml"), str(out / f"{axis}.state")
        columns = ("--x_d", f"{axis}_out", "--x", f"{axis}_fb", "--unit", "mm", "--T_s", "0.001")
        hybridsep("backtest", str(log), "--machine", machine, *columns, "--save", state)
        hybridsep("hal", machine, "--out", str(out / "hal"), "--weights", state)


def run(program: str, log: Path, out: Path, entries: Mapping[str, int] | None, user: str | None) -> str:
    """Run LinuxCNC once, with entries of [HSEP] changed, or without the component; return what it printed."""
    folder = out.resolve() / "run"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(HERE, folder)
    for axis in AXES:
        shutil.copytree(out / "hal" / axis, folder / axis)
    text = (folder / "machine.ini").read_text(encoding="utf-8")
    if entries is None:
        text = text.replace("HALFILE = component.hal", "HALFILE = without.hal")
    else:
        for name, number in entries.items():
            text = re.sub(rf"^{name} = .*$", f"{name} = {number}", text, flags=re.MULTILINE)
    (folder / "machine.ini").write_text(text, encoding="utf-8")
    environment = {**os.environ, "HSEP_PROGRAM": program, "HSEP_SAMPLES": str(folder / "samples.txt")}
    command = ["linuxcnc", "-r", "machine.ini"]
    if user is not None:
        for path in (folder, *folder.rglob("*")):
            shutil.chown(path, user)
        command = ["runuser", "-u", user, "--", "env", f"HOME={folder}", *command]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300.0)
    printed = done.stdout + done.stderr
    if done.returncode != 0 or not (folder / "samples.txt").is_file():
        raise SystemExit(f"linuxcnc {program} failed:\n{printed}")
    shutil.copyfile(folder / "samples.txt", log)
    return printed


def hybridsep(*arguments: str) -> None:
    """Run a command of hybridsep."""
    command = [sys.executable, "-c", "from hybridsep.app.cli import main; main()", *arguments, "--force"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"hybridsep {' '.join(arguments)}: {done.stderr}")


if __name__ == "__main__":
    main()
