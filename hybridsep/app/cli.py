"""Command line ``hybridsep``: one function a command."""

from __future__ import annotations

import sys
from importlib.metadata import EntryPoint, entry_points
from typing import Annotated, Any

import typer

from ..base.errors import ParameterError
from ..base.version import version_text
from .command_backtest import backtest
from .command_build import build
from .command_cosim import cosim
from .command_fit import fit
from .command_hal import hal
from .command_header import header
from .command_identify import identify
from .command_report import report
from .command_system import system
from .command_tune import tune
from .failures import DEBUG_VARIABLE, Commands, run
from .panels import EXAMPLES, PanelledCommand
from .start import demo, example_log, init

__all__ = ["app", "main"]

PLUG_INS = ("fleet", "live", "modal")
"""Commands that this repository has as plug-ins, in ``plugins``."""


class _WithPlugIns(Commands):
    """Commands, and those of plug-ins: functions that are installed as entry points ``hybridsep.commands``."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands."""
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
        alone.command(cmd_name, cls=PanelledCommand)(found.load())
        return typer.main.get_command(alone)


def _plug_ins() -> dict[str, EntryPoint]:
    return {one.name: one for one in entry_points(group="hybridsep.commands")}


app = typer.Typer(
    cls=_WithPlugIns,
    help="Predict a CNC feed drive's servo error one look-ahead window early, with a linear hybrid model.",
    epilog=f"An error is one line and exit status 2, Ctrl-C 130. {DEBUG_VARIABLE}=1 in the environment shows "
    "the traceback of an unexpected error.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    add_completion=False,
)
for _command in (
    fit,
    identify,
    tune,
    init,
    demo,
    build,
    cosim,
    system,
    hal,
    header,
    backtest,
    report,
    example_log,
):
    _name = _command.__name__.replace("_", "-")
    app.command(cls=PanelledCommand, epilog="\b\nExamples:\n" + "\n".join(f"  {line}" for line in EXAMPLES[_name]))(
        _command
    )


@app.callback(invoke_without_command=True)
def _version(version: Annotated[bool, typer.Option("--version", help="Print version and commit.")] = False) -> None:
    if version:
        typer.echo(f"hybridsep {version_text()}")
        raise typer.Exit


def main() -> None:
    """Run the command line; an error is one line on stderr and exit status 2, Ctrl-C another and 130."""
    sys.exit(run(app))


if __name__ == "__main__":
    main()
