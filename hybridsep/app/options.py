"""Options of the command line's commands; ranges and units come from the declarations of parameters.

What a command works with is imported when it runs, so that no command's help needs any of it.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Annotated, Any

import typer

from ..base.files import COMMANDS
from ..base.parameters import Parameter
from ..base.settings import CompensatorSettings, PredictorSettings, Settings
from ..fmi.compile import TARGET_NAMES
from ..fmi.flavours import FLAVOURS, FMI_CHOICES

__all__ = [
    "COMPENSATOR_ENTRIES",
    "KNOWN_ENTRIES",
    "PREDICTOR_ENTRIES",
    "TRAJECTORIES",
    "AxisOption",
    "CommandColumnOption",
    "DelayOption",
    "FlavourOption",
    "FmiOption",
    "ForceOption",
    "JsonOption",
    "ListChannelsOption",
    "LogArgument",
    "MachineOption",
    "MeasuredColumnOption",
    "ReadingOptions",
    "ResampleOption",
    "SavedOption",
    "TimeColumnOption",
    "TrajectoryOption",
    "TsOption",
    "UnitOption",
    "WeightsOption",
    "parameter_help",
    "takes_parameters",
    "takes_reading",
]

TRAJECTORIES = ("staircase", "spiral_x", "spiral_y")
"""What ``--trajectory`` takes besides a file."""


JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON, and nothing else.")]
ForceOption = Annotated[bool, typer.Option("--force", help="Overwrite existing files.")]
MachineOption = Annotated[
    str, typer.Option("--machine", "-m", help="Machine file (.toml), or the name of one that comes with the library.")
]
FlavourOption = Annotated[str, typer.Option(help=f"Flavour of the FMUs: {', '.join(FLAVOURS)}.")]
FmiOption = Annotated[
    str,
    typer.Option(help=f"Version of FMI: {', '.join(FMI_CHOICES)}; FMUs of FMI 3.0 are native, their names have Fmi3."),
]
TargetOption = Annotated[
    list[str] | None,
    typer.Option(
        help=f"Platform of native FMUs, may be repeated: {', '.join(TARGET_NAMES)}. If left out this machine's, or all "
        "where their libraries are there."
    ),
]
TsOption = Annotated[
    float | None, typer.Option("--T_s", help="Interval between the rows [s], where no column of times tells it.")
]
UnitOption = Annotated[
    str | None,
    typer.Option(
        help="Unit of the positions in the file: m, mm, um, nm, in, or of a rotary axis rad, mrad, urad, deg, rev, or "
        "a multiple of one (0.1um), such as an encoder's count; from the columns' names (x [mm]), or m, if left out."
    ),
]
TimeColumnOption = Annotated[str | None, typer.Option("--t", help="Name of the time column.")]
CommandColumnOption = Annotated[str | None, typer.Option("--x_d", help="Name of the commanded position's column.")]
MeasuredColumnOption = Annotated[str | None, typer.Option("--x", help="Name of the measured position's column.")]
AxisOption = Annotated[str | None, typer.Option(help="Axis of a file that holds several, such as X1.")]
ResampleOption = Annotated[
    bool,
    typer.Option(
        "--resample",
        help="Take columns of rates of their own at the times of the slower one, and uneven times at even ones.",
    ),
]
DelayOption = Annotated[
    int,
    typer.Option(help="Samples by which the log has the measured position too late (negative: too early)."),
]
ListChannelsOption = Annotated[
    bool,
    typer.Option("--list-channels", help="Print what the log holds, with units and rates, and do nothing else."),
]
WeightsOption = Annotated[
    Path | None,
    typer.Option(
        help="A predictor saved with HybridPredictor.save: the one HybridPredictor or SepCompensator that is built "
        "here starts warm; name it where there are more."
    ),
]
LogArgument = Annotated[
    Path,
    typer.Argument(
        help="Recorded log with the columns t, x_d, x_meas or x, in a format of docs/reference/logs.md: CSV, .mat, …"
    ),
]
SavedOption = Annotated[
    Path | None,
    typer.Option(help="A predictor saved with hybridsep backtest --save, to begin with what it learned."),
]

TrajectoryOption = Annotated[
    str | None,
    typer.Option(
        help=f"{', '.join(TRAJECTORIES)}, or a CSV, .npz or .mat file with the columns t and x_d; if left out, "
        f"{COMMANDS} beside the machine file, which fit writes, or else the staircase."
    ),
]

_LIST = "list_channels"


def _entries(settings: type[Settings]) -> dict[str, Parameter]:
    return {name: entry for name, entry in settings.parameters().items() if name not in settings.ELSEWHERE}


PREDICTOR_ENTRIES = _entries(PredictorSettings)
"""Parameters that the section ``[predictor]`` of a machine file may have, by the names of the settings' fields."""

KNOWN_ENTRIES = {name: PREDICTOR_ENTRIES[name] for name in ("period", "measurement_delay")}
"""Entries that are known of an axis and not fitted to a log."""

COMPENSATOR_ENTRIES = {name: entry for name, entry in _entries(CompensatorSettings).items() if name != "compensate"}
"""Parameters that the section ``[compensator]`` may have besides, less the model, which commands choose themselves."""


def parameter_help(parameter: Parameter, otherwise: str = "the machine's own") -> str:
    """Return the help of an option that changes a parameter of the machine."""
    return f"{parameter.help}; {otherwise} if left out"


def takes_parameters(
    *groups: dict[str, Parameter], ranges: Collection[str] = (), otherwise: str = "the machine's own"
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a decorator that gives a command an option for each parameter.

    The command's argument ``parameters`` becomes the mapping of the parameters that are given, by their names in FMUs.

    Parameters
    ----------
    *groups : dict
        Of :data:`PREDICTOR_ENTRIES` and :data:`COMPENSATOR_ENTRIES`.
    ranges : collection of str
        Fields of the parameters that take several values, given as text.
    otherwise : str
        What counts where an option is left out.
    """
    options = {field: parameter for group in groups for field, parameter in group.items()}
    taken = []
    for field, parameter in options.items():
        kind: Any = str if parameter.kind is bool or field in ranges else parameter.kind
        annotation = Annotated[kind | None, _option(parameter, otherwise, several=field in ranges)]
        taken.append(inspect.Parameter(field, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation))

    def given(values: dict[str, Any], _others: dict[str, Any]) -> dict[str, Any]:
        return {options[field].name: value for field, value in values.items() if value is not None}

    return _in_the_place_of("parameters", taken, given)


def _option(parameter: Parameter, otherwise: str, *, several: bool) -> Any:
    """Return the option, under the parameter's name in machine files and FMUs."""
    name = f"--{parameter.name}"
    if several:
        return typer.Option(
            name, help=f"{parameter.help}; several as 5,10,50; some of its own if left out", metavar="VALUES"
        )
    more: dict[str, Any] = {"parser": _truth_value, "metavar": "true|false"} if parameter.kind is bool else {}
    return typer.Option(name, help=parameter_help(parameter, otherwise), **more)


def _truth_value(text: str | bool) -> bool:
    values = {"true": True, "false": False}
    if str(text).lower() not in values:
        raise typer.BadParameter(f"{text!r} is neither true nor false")
    return values[str(text).lower()]


@dataclass(frozen=True)
class ReadingOptions:
    """Options of how a log is read; None where they are not given.

    Attributes
    ----------
    unit : str, optional
    T_s : float, optional
    axis : str, optional
    t, x_d, x : str, optional
        Columns of time, commanded and measured position.
    delay : int
    resample : bool
    """

    unit: UnitOption = None
    T_s: TsOption = None
    axis: AxisOption = None
    t: TimeColumnOption = None
    x_d: CommandColumnOption = None
    x: MeasuredColumnOption = None
    delay: DelayOption = 0
    resample: ResampleOption = False

    @property
    def columns(self) -> dict[str, str]:
        """Columns that are given, by what they hold."""
        return {role: column for role in ("t", "x_d", "x") if (column := getattr(self, role))}

    @property
    def arguments(self) -> dict[str, Any]:
        """Arguments of :func:`~hybridsep.logs.log.read_log`."""
        given = {name: getattr(self, name) for name in ("unit", "T_s", "axis", "delay", "resample")}
        return {"columns": self.columns, **given}


def takes_reading(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command these options in the place of its argument ``reading``, which becomes :class:`ReadingOptions`.

    With ``--list-channels`` the channels of its logs are printed and nothing else is done.
    """
    listing = inspect.Parameter(_LIST, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=ListChannelsOption)

    def given(values: dict[str, Any], others: dict[str, Any]) -> ReadingOptions:
        if values.pop(_LIST):
            from .console import print_channels

            logs = others.get("logs") or [Path(others.get("log") or others["source"])]
            print_channels(logs, as_json=bool(others.get("as_json")))
            raise typer.Exit
        return ReadingOptions(**values)

    options = inspect.signature(ReadingOptions, eval_str=True).parameters.values()
    return _in_the_place_of("reading", [*options, listing], given)(command)


def _in_the_place_of(
    name: str, taken: Sequence[inspect.Parameter], given: Callable[[dict[str, Any], dict[str, Any]], object]
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a decorator that gives a command options in the place of one argument.

    Parameters
    ----------
    name : str
        The argument.
    taken : sequence of inspect.Parameter
        The options.
    given : callable
        Values of the options, the command's other arguments → value of the argument.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        @wraps(command)
        def run(**arguments: Any) -> None:
            values = {one.name: arguments.pop(one.name) for one in taken}
            command(**arguments, **{name: given(values, arguments)})

        signature = inspect.signature(command, eval_str=True)
        mixed = [
            one.replace(kind=inspect.Parameter.KEYWORD_ONLY)
            for argument in signature.parameters.values()
            for one in (taken if argument.name == name else [argument])
        ]
        run.__signature__ = signature.replace(parameters=mixed)  # type: ignore[attr-defined]
        run.__annotations__ = {one.name: one.annotation for one in mixed}
        return run

    return decorate
