"""Command line ``hybridsep``: its commands and their help, and how failures end it.

An error is one line on standard error and exit status 2, Ctrl-C another and 130; the status is 1 where the reader of
standard output has gone.
"""

import os
import shlex
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from ..base.errors import HybridSepError, LogError, ParameterError, brief
from ..base.version import version_text
from .cosim import cosim, system
from .fit import fit
from .fmus import build, hal, header
from .logs import backtest
from .start import demo, example_log, init

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

PLUG_INS = ("fleet", "live", "modal")  # commands that this repository has as plug-ins, in ``plugins``
_DEBUG_VARIABLE = "HYBRIDSEP_DEBUG"  # environment variable: if it is set, an unexpected error shows its traceback

_WANTED = {"int": "must be a whole number", "float": "must be a number"}
"""What an option takes, by the beginning of a type of typer's errors."""

_ARGUMENTS = {
    "fit": ("my_axis.csv --Np 100", "my_axis.csv --unit mm --v_max 0.25 --a_max 20 --j_max 1e4"),
    "init": ("machine.toml", "--force"),
    "demo": ("--out demo", "--out demo --force"),
    "build": ("{m} --out dist", "HybridPredictor_my_axis {m} --weights my_axis/trained.state --out warm"),
    "cosim": ("{m} --compensate hybrid", "x/machine.toml y/machine.toml --path part.ngc --figure part.png"),
    "system": ("{m} --compensate hybrid", "--ssp 2 --target host"),
    "backtest": (
        "my_axis.csv {m} --set predictor.p=20 --figure errors.png",
        "my_axis.csv {m} --report today.html --save trained.state",
    ),
    "hal": ("my_axis/machine.toml --out hal", "x/machine.toml y/machine.toml --out hal"),
    "header": (
        "my_axis/machine.toml --predictor",
        "my_axis/machine.toml --predictor --weights my_axis/trained.state --force",
    ),
    "example-log": ("--out my_axis.csv", "--out my_axis.csv.gz"),
}
EXAMPLES = {
    name: [f"hybridsep {name} {one}".format(m="-m my_axis/machine.toml") for one in lines]
    for name, lines in _ARGUMENTS.items()
}
"""Two lines for each command."""


class _Commands(TyperGroup):
    """Commands, ours and plug-ins': functions that are installed as entry points ``hybridsep.commands``.

    A refusal of an option's value names the value.
    """

    def invoke(self, ctx: typer.Context) -> Any:  # type: ignore[override]
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
            from .console import errors_console

            errors_console.print("interrupted: nothing is half written, files are either as they were or complete")
            raise typer.Exit(130) from None

    def list_commands(self, ctx: Any) -> list[str]:
        return [*super().list_commands(ctx), *sorted(_plug_ins())]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command; ParameterError if its plug-in is not installed."""
        command = super().get_command(ctx, cmd_name)
        if command is not None:
            return command
        found = _plug_ins().get(cmd_name)
        if found is None and cmd_name in PLUG_INS:
            raise ParameterError(
                f"hybridsep {cmd_name} is a plug-in, which is not installed: pip install ./plugins/{cmd_name} in a "
                f"checkout (hybridsep-{cmd_name} once released)"
            )
        if found is None:
            return None
        alone = typer.Typer(rich_markup_mode=None, add_completion=False)
        alone.command(cmd_name)(found.load())
        return typer.main.get_command(alone)


def _plug_ins() -> "dict[str, EntryPoint]":
    from importlib.metadata import entry_points  # takes a tenth of the time in which a command's help is there

    return {one.name: one for one in entry_points(group="hybridsep.commands")}


app = typer.Typer(
    cls=_Commands,
    help="Predict a CNC feed drive's servo error one look-ahead window early, with a linear hybrid model.",
    epilog=f"An error is one line and exit status 2, Ctrl-C 130. {_DEBUG_VARIABLE}=1 in the environment shows "
    "the traceback of an unexpected error.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    add_completion=False,
)
for _command in (fit, backtest, init, example_log, demo, build, cosim, system, hal, header):
    _name = _command.__name__.replace("_", "-")
    app.command(epilog="\b\nExamples:\n" + "\n".join(f"  {line}" for line in EXAMPLES[_name]))(_command)


@app.callback(invoke_without_command=True)
def _version(version: Annotated[bool, typer.Option("--version", help="Print version and commit.")] = False) -> None:
    if version:
        typer.echo(f"hybridsep {version_text()}")
        raise typer.Exit


def main() -> None:
    """Run the command line."""
    sys.exit(_run())


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


def _run() -> int:
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError):  # a replaced stream, which cannot be reconfigured
            stream.reconfigure(errors="replace")  # type: ignore[union-attr]
    try:
        status = _status()
        sys.stdout.flush()
        return status
    except BrokenPipeError:
        _abandon_stdout()
        return 1
    except HybridSepError as error:
        options = error.options if isinstance(error, LogError) else ()  # that would put it right, to paste
        given, width = shlex.join(sys.argv[1:]), max((len(option) for option, _ in options), default=0)
        more = (f"  hybridsep {given} {option:{width}}  # {meaning}" for option, meaning in options)
        return _fail("\n".join([str(error), *more]))
    except OSError as error:
        if error.filename is None:  # files name theirs
            _abandon_stdout()
        return _fail(f"cannot read or write {error.filename or 'standard output'}: {error.strerror or error}")
    except MemoryError as error:
        return _fail(f"out of memory: {error}; use a smaller Np, p or q, or a shorter log".replace(": ;", ";"))
    except Exception as error:
        if os.environ.get(_DEBUG_VARIABLE):
            raise
        what = " ".join(f"{type(error).__name__}: {error}".split())
        return _fail(
            f"unexpected {what if len(what) <= 300 else what[:300] + '…'}; this is a fault of hybridsep "
            f"{version_text()}: please report it with the command and its files ({_DEBUG_VARIABLE}=1 shows where it is)"
        )


def _status() -> int:
    try:
        app()
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else int(stop.code is not None)
    return 0


def _fail(message: str) -> int:
    from .console import errors_console

    errors_console.print("error: ", style="bold red", end="")
    errors_console.print(message, soft_wrap=True)
    return 2


def _abandon_stdout() -> None:
    """Redirect standard output to the null device, so that flushing it at exit cannot fail."""
    with suppress(OSError, ValueError):  # a stream without a descriptor is not flushed at exit
        descriptor = os.open(os.devnull, os.O_WRONLY)
        os.dup2(descriptor, sys.stdout.fileno())
        os.close(descriptor)
