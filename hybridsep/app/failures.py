"""Failures of a command, reported as one line on standard error and an exit status; refused values of options by value.

Status 2 for an error, 130 after Ctrl-C, 1 where the reader of standard output has gone.
"""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import typer
from rich.console import Console
from typer.core import TyperGroup

from ..base.errors import HybridSepError, LogError, brief
from ..base.version import version_text

__all__ = ["DEBUG_VARIABLE", "Commands", "errors_console", "run"]

DEBUG_VARIABLE = "HYBRIDSEP_DEBUG"
"""Environment variable: if it is set, an unexpected error shows its traceback."""

errors_console = Console(stderr=True, emoji=False, markup=False, highlight=False)

_WANTED = {"int": "must be a whole number", "float": "must be a number"}
"""What an option takes, by the beginning of a type of typer's errors."""


class Commands(TyperGroup):
    """Commands whose refusal of an option's value names the value."""

    def invoke(self, ctx: typer.Context) -> Any:  # type: ignore[override]
        """Run the command that the arguments name."""
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            if type(error).__name__ == "MissingParameter" and getattr(error.param, "name", "") == "machine":
                error.message = _machine_files(sys.argv[2:])
            cause = error.__cause__
            if type(cause).__name__ == "ValidationError":  # of typer's converter; older versions name the value
                first = cause.errors()[0]  # type: ignore[union-attr]
                wanted = _WANTED.get(first["type"].partition("_")[0], error.message)
                error.message = f"{wanted}, got {brief(first['input'])}"
            raise
        except KeyboardInterrupt:
            errors_console.print("interrupted: nothing is half written, files are either as they were or complete")
            raise typer.Exit(130) from None


def _to_paste(error: HybridSepError) -> list[str]:
    """Return this command with each of the options that would put an error right, to paste."""
    options = error.options if isinstance(error, LogError) else ()
    given = shlex.join(sys.argv[1:])
    width = max((len(option) for option, _ in options), default=0)
    return [f"  hybridsep {given} {option:{width}}  # {meaning}" for option, meaning in options]


def _machine_files(arguments: Sequence[str]) -> str:
    """Return which machine files fit wrote for a command's log, or that it writes one, in words."""
    logs = [Path(one) for one in arguments if not one.startswith("-")]
    folders = [folder for log in logs for folder in (log.with_suffix(""), Path(log.stem), log.parent)]
    found = list(dict.fromkeys(str(one) for folder in folders if (one := folder / "machine.toml").is_file()))
    others = sorted(str(one) for one in Path().glob("*/machine.toml"))
    if found or others:
        return f"There is {' and '.join(found or others[:3])}: add -m {shlex.quote((found or others)[0])}"
    log = shlex.quote(str(logs[0])) if logs else "LOG"
    return f"It is the axis's machine file, which hybridsep fit {log} writes, or the name of one of the library's"


def run(app: Callable[[], object]) -> int:
    """Run a command line; return its exit status."""
    _open_closed()
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError):  # a replaced stream, which cannot be reconfigured
            stream.reconfigure(errors="replace")  # type: ignore[union-attr]
    try:
        status = _status(app)
        sys.stdout.flush()
        return status
    except BrokenPipeError:
        _abandon_stdout()
        return 1
    except HybridSepError as error:
        return _fail("\n".join([str(error), *_to_paste(error)]))
    except OSError as error:
        if error.filename is None:  # files name theirs
            _abandon_stdout()
        return _fail(f"cannot read or write {error.filename or 'standard output'}: {error.strerror or error}")
    except MemoryError as error:
        return _fail(f"out of memory: {error}; use a smaller Np, p or q, or a shorter log".replace(": ;", ";"))
    except Exception as error:
        if os.environ.get(DEBUG_VARIABLE):
            raise
        what = " ".join(f"{type(error).__name__}: {error}".split())
        return _fail(
            f"unexpected {what if len(what) <= 300 else what[:300] + '…'}; this is a fault of hybridsep "
            f"{version_text()}: please report it with the command and its files ({DEBUG_VARIABLE}=1 shows where it is)"
        )


def _open_closed() -> None:
    """Open the null device in the place of standard streams that the caller has closed (``>&-``).

    Otherwise Python has None there, and the next file that is opened gets what an FMU prints.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            descriptor = os.open(os.devnull, os.O_RDWR)
            os.set_inheritable(descriptor, True)
            setattr(sys, name, os.fdopen(descriptor, mode, encoding="utf-8"))


def _status(app: Callable[[], object]) -> int:
    try:
        app()
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else int(stop.code is not None)
    return 0


def _fail(message: str) -> int:
    errors_console.print("error: ", style="bold red", end="")
    errors_console.print(message, soft_wrap=True)
    return 2


def _abandon_stdout() -> None:
    """Redirect standard output to the null device, so that flushing it at exit cannot fail."""
    with suppress(OSError, ValueError):  # a stream without a descriptor is not flushed at exit
        descriptor = os.open(os.devnull, os.O_WRONLY)
        os.dup2(descriptor, sys.stdout.fileno())
        os.close(descriptor)
