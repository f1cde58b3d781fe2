#!/usr/bin/python3
"""Display of the simulated machine: homes it, does what HSEP_PROGRAM says, and samples all periods.

HSEP_PROGRAM is a G-code file, or a Python file whose function ``drive(machine)`` uses :class:`Machine`. The samples go
to HSEP_SAMPLES, as halsampler writes them, below a line with their names, so that hybridsep reads the file as it is.
LinuxCNC's own Python runs it.
"""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
import time
from pathlib import Path

import linuxcnc
from sampled_columns import COLUMNS

WAIT = 60.0
"""Time after which what is waited for will not come, s."""


class Machine:
    """LinuxCNC's commands, each until it is done."""

    def __init__(self) -> None:
        self.command, self.status, self.errors = linuxcnc.command(), linuxcnc.stat(), linuxcnc.error_channel()

    def until(self, what, most: float = WAIT) -> None:
        """Wait for what is true of the status."""
        begin = time.monotonic()
        while True:
            self.status.poll()
            if what(self.status):
                return
            found = self.errors.poll()
            if found:
                raise SystemExit(f"LinuxCNC: {found[1]}")
            if time.monotonic() - begin > most:
                raise SystemExit("what was waited for did not come")
            time.sleep(0.002)

    def on(self) -> None:
        """Switch on and home."""
        self.command.state(linuxcnc.STATE_ESTOP_RESET)
        self.command.wait_complete()
        self.command.state(linuxcnc.STATE_ON)
        self.command.wait_complete()
        self.until(lambda status: status.enabled)
        self.command.mode(linuxcnc.MODE_MANUAL)
        self.command.wait_complete()
        self.command.teleop_enable(0)
        self.command.wait_complete()
        self.command.home(-1)
        self.until(lambda status: all(status.homed[: status.joints]))

    def off(self) -> None:
        """Switch off, in motion too."""
        self.command.state(linuxcnc.STATE_OFF)
        self.command.wait_complete()
        self.until(lambda status: not status.enabled)

    def start(self, program: str) -> None:
        """Start a G-code file."""
        self.command.mode(linuxcnc.MODE_AUTO)
        self.command.wait_complete()
        self.command.program_open(str(Path(program).resolve()))
        self.command.auto(linuxcnc.AUTO_RUN, 0)
        self.until(lambda status: status.interp_state != linuxcnc.INTERP_IDLE)

    def finish(self) -> None:
        """Wait for the end of a program."""
        self.until(lambda status: status.interp_state == linuxcnc.INTERP_IDLE)

    def mdi(self, line: str) -> None:
        """Do a line of G-code."""
        self.command.mode(linuxcnc.MODE_MDI)
        self.command.wait_complete()
        self.command.mdi(line)
        self.command.wait_complete(WAIT)


def main() -> None:
    """Run the program, and stop LinuxCNC by ending."""
    program = os.environ["HSEP_PROGRAM"]
    with Path(os.environ["HSEP_SAMPLES"]).open("w") as samples:
        samples.write(" ".join(COLUMNS) + "\n")
        samples.flush()
        sampler = subprocess.Popen(["halsampler", "-t"], stdout=samples)
        try:
            machine = Machine()
            machine.on()
            if program.endswith(".py"):
                runpy.run_path(program)["drive"](machine)
            else:
                machine.start(program)
                machine.finish()
            time.sleep(0.3)
            subprocess.run(["halcmd", "show", "param", "*.tmax"], check=True)
        finally:
            sampler.terminate()
            sampler.wait()


if __name__ == "__main__":
    sys.exit(main())
