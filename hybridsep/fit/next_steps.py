"""What to do after ``hybridsep fit``, as lines to paste."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path

from ..base.settings import DRIVE_LIMIT_ENTRIES, Limits
from ..fmi.builds import other_platforms
from .fit import Fit

__all__ = ["next_steps"]


def next_steps(found: Fit, files: Mapping[str, Path], again: str, fmi: str) -> list[str]:
    """Return the lines.

    Parameters
    ----------
    found : Fit
    files : mapping
        Of :func:`~hybridsep.fit.files.fit_files`.
    again : str
        Command line of this fit.
    fmi : str
        Version of its FMUs.
    """
    machine = found.machine
    file, state = shlex.quote(str(files["machine file"])), shlex.quote(str(files["trained predictor"]))
    lines = ["", "Next, to paste:"]

    def step(says: str, *commands: str) -> None:
        lines.extend([f"  # {says}", *(f"  hybridsep {command}" for command in commands)])

    limits = machine.drive_limits
    if machine.plant is None:
        lines.append(f"  # no plant to try with: {found.plant.get('reason', '')}")
    elif limits is not None:
        # What was learned of the axis helps on a plant that has its disturbances, and on no other.
        warm = f" --weights {state}" if "mode" in found.plant["entries"] else ""
        step(
            "the compensated axis, on the identified model: to try with, results are optimistic",
            f"cosim -m {file} --compensate off",
            f"cosim -m {file} --compensate hybrid{warm}",
        )
        step("the same as one file for tools that read SSP", f"system -m {file} --compensate{warm}")
    else:
        step("prediction, on the identified model: to try with, results are optimistic", f"cosim -m {file}")
        step("the same as one file for tools that read SSP", f"system -m {file}")
    if limits is not None and limits.estimated:
        names = [(one.name, getattr(limits, entry)) for entry, one in DRIVE_LIMIT_ENTRIES.items()]
        known = [f"--{name} {value:g}" for name, value in names[: len(Limits.parameters())]]
        lines.append("  # a compensator FMU for the drive; the limits are estimates: put in your drive's")
        lines.append(f"  {again} {' '.join(known)}")
    native = next((path for what, path in files.items() if what.startswith("native FMU")), None)
    note = other_platforms(native, files["machine file"], files["trained predictor"], fmi) if native else ""
    if note:
        says, _, command = note.rpartition(": ")
        lines += [f"  # {says}", f"  {command}"]
    lines.append("  # your own compensator, sample by sample, in Python: docs/howto/python.md")
    return lines
