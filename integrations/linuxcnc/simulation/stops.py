"""What an operator does in motion: feed hold, feed override, compensation off and on, machine off, jogging.

For run.py, under LinuxCNC's own Python.
"""

from __future__ import annotations

import subprocess
import time

import linuxcnc


def drive(machine) -> None:
    """Run the circle with all of it."""
    machine.start("circle.ngc")
    time.sleep(0.7)
    machine.command.auto(linuxcnc.AUTO_PAUSE)  # feed hold
    time.sleep(0.4)
    machine.command.auto(linuxcnc.AUTO_RESUME)
    time.sleep(0.4)
    for override in (0.3, 1.5, 1.0):
        machine.command.feedrate(override)
        time.sleep(0.3)
    for enable in ("0", "1"):  # compensation off and on again in motion
        for axis in ("x", "y"):
            subprocess.run(["halcmd", "setp", "hsep." + axis + ".enable", enable], check=True)
        time.sleep(0.4)
    machine.finish()

    machine.start("circle.ngc")
    time.sleep(0.7)
    machine.command.abort()
    time.sleep(0.5)
    machine.off()  # at rest, then in motion
    machine.on()
    machine.start("circle.ngc")
    time.sleep(1.0)
    machine.off()
    time.sleep(0.3)
    machine.on()

    machine.command.mode(linuxcnc.MODE_MANUAL)
    machine.command.wait_complete()
    for joint, velocity in ((0, 40.0), (0, -40.0), (1, 30.0)):  # reversed in motion
        machine.command.teleop_enable(0)
        machine.command.wait_complete()
        machine.command.jog(linuxcnc.JOG_CONTINUOUS, True, joint, velocity)
        time.sleep(0.4)
    for joint in (0, 1):
        machine.command.jog(linuxcnc.JOG_STOP, True, joint)
    time.sleep(0.5)
    machine.mdi("G0 X0 Y0")
    machine.mdi("T1 M6 G43")  # a tool change in the middle of it
    machine.mdi("G1 F1000 X5 Y5")
