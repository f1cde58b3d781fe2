"""The command line in this process, and a log to give to it."""

import math
import re
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest
from programs import output_of
from quick_fits import with_short_references
from staircase_data import commanded, measured

from hybridsep.app import cli, console


class Run:
    """Runs ``hybridsep`` with arguments in this process; returns exit status, stdout and stderr."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
        self.monkeypatch, self.capsys = monkeypatch, capsys
        with_short_references(monkeypatch)

    def __call__(self, *arguments: object) -> tuple[int, str, str]:
        self.monkeypatch.setattr(sys, "argv", ["hybridsep", *map(str, arguments)])
        self.monkeypatch.setenv("COLUMNS", "200")
        self.monkeypatch.setattr(console, "_SILENT", math.inf)  # what stderr has depends on no processor's speed
        status = 0
        try:
            cli.main()
        except SystemExit as stop:
            status = int(stop.code or 0)
        out, err = self.capsys.readouterr()
        return status, out, err

    def done(self, *arguments: object) -> str:
        """Run a command that must succeed; return its standard output."""
        status, out, err = self(*arguments)
        assert status == 0, f"{arguments}: {err}"
        return out

    def refused(self, *arguments: object) -> str:
        """Run a command that must be refused and print nothing; return what it says."""
        status, out, err = self(*arguments)
        assert (status, out) == (2, ""), err
        return err


def predictor(**values: object) -> list[str]:
    """Return the options that set entries of ``[predictor]``; a name ends in ``_`` where it is a word of Python's."""
    return [word for name, one in values.items() for word in ("--set", f"predictor.{name.rstrip('_')}={one}")]


def run_line(text: str, hybridsep: Run) -> None:
    """Run a line as a shell would."""
    program, *arguments = shlex.split(text)
    if program == "hybridsep":
        hybridsep.done(*arguments)
    else:
        assert program == "python", text
        output_of(sys.executable, *arguments)


def run_page(page: Path, hybridsep: Run) -> None:
    """Run the command lines of a page in the current folder."""
    for block in re.findall(r"```sh\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
        for text in block.splitlines():
            run_line(text, hybridsep)


def write_log(path: Path, *, n: int = 2500, header: str = "t,x_d,x", scale: float = 1.0) -> Path:
    return write_rows(path, commanded()[:n] * scale, measured(0)[:n] * scale, header=header)


def write_rows(path: Path, x_d: np.ndarray, x: np.ndarray, *, header: str = "t,x_d,x_meas") -> Path:
    columns = np.column_stack((np.arange(len(x)) * 1e-3, x_d, x))
    np.savetxt(path, columns, delimiter=",", header=header, comments="", fmt="%.17g")
    return path
