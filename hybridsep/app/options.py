"""Options of the command line's commands; ranges and units come from the declarations of parameters.

What a command works with is imported when it runs, so that no command's help needs any of it.
"""

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..base.files import COMMANDS
from ..base.settings import DRIVE_LIMIT_ENTRIES, PARAMETERS, PredictorSettings
from ..fmi.compile import TARGET_NAMES

if TYPE_CHECKING:
    from ..machines.machine import Machine

TRAJECTORIES = ("staircase", "spiral_x", "spiral_y")  # what ``--trajectory`` takes besides a file

JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON, and nothing else.")]
ForceOption = Annotated[bool, typer.Option("--force", help="Overwrite existing files.")]
MachineOption = Annotated[
    str, typer.Option("--machine", "-m", help="Machine file (.toml), or the name of one that comes with the library.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="ENTRY=VALUE",
        help="Another value of an entry of the machine file, as predictor.p=20 or plant.seed=3; may be repeated.",
    ),
]
TargetOption = Annotated[
    list[str] | None,
    typer.Option(
        help=f"Platform of native FMUs, may be repeated: {', '.join(TARGET_NAMES)}. If left out this machine's, or all "
        "where their libraries are there."
    ),
]
UnitOption = Annotated[
    str | None,
    typer.Option(
        help="Unit of the positions in the file: m, mm, um, nm, in, or of a rotary axis rad, mrad, urad, deg, rev, or "
        "a multiple of one (0.1um), such as an encoder's count; from the columns' names (x [mm]), or m, if left out."
    ),
]
WeightsOption = Annotated[
    Path | None,
    typer.Option(
        help="A predictor saved with HybridPredictor.save: the one HybridPredictor or SepCompensator that is built "
        "here starts warm; name it where there are more."
    ),
]
TrajectoryOption = Annotated[
    str | None,
    typer.Option(
        help=f"{', '.join(TRAJECTORIES)}, or a CSV, .npz or .mat file with the columns t and x_d; if left out, "
        f"{COMMANDS} beside the machine file, which fit writes, or else the staircase."
    ),
]
CompensateOption = Annotated[
    str | None,
    typer.Option(
        help=f"{PARAMETERS['compensate'].help}. The drive gets the command that a SepCompensator has modified; if left "
        "out, a HybridPredictor only predicts."
    ),
]


@dataclass(frozen=True)
class ReadingOptions:
    """Options of how a log is read, the arguments of :func:`~hybridsep.logs.log.read_log`; None where not given."""

    unit: UnitOption = None
    T_s: Annotated[
        float | None, typer.Option("--T_s", help="Interval between the rows [s], where no column of times tells it.")
    ] = None
    axis: Annotated[str | None, typer.Option(help="Axis of a file that holds several, such as X1.")] = None
    t: Annotated[str | None, typer.Option("--t", help="Name of the time column.")] = None
    x_d: Annotated[str | None, typer.Option("--x_d", help="Name of the commanded position's column.")] = None
    x: Annotated[str | None, typer.Option("--x", help="Name of the measured position's column.")] = None
    error: Annotated[
        str | None, typer.Option("--error", help="Column of the error, commanded − measured; -NAME: the other way.")
    ] = None
    delay: Annotated[
        int, typer.Option(help="Samples by which the log has the measured position too late (negative: too early).")
    ] = 0
    resample: Annotated[
        bool,
        typer.Option(
            "--resample",
            help="Take columns of rates of their own at the times of the slower one, and uneven times at even ones.",
        ),
    ] = False

    def arguments(self, machine: "Machine | None" = None) -> dict[str, Any]:
        """Return the arguments, as a machine's file says where an option does not say otherwise."""
        columns = {role: column for role in ("t", "x_d", "x", "error") if (column := getattr(self, role))}
        given = {"T_s": self.T_s, "delay": self.delay, "resample": self.resample}
        if machine is None:
            return {**given, "columns": columns, "unit": self.unit, "axis": self.axis}
        own, names = machine.log, machine.log.columns_beside(columns, self.T_s)
        return {**given, "columns": names, "unit": self.unit or own.unit, "axis": self.axis or own.axis}


def takes_reading(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command these options in the place of its argument ``reading``, which becomes :class:`ReadingOptions`."""
    options = inspect.signature(ReadingOptions, eval_str=True).parameters.values()
    return _in_the_place_of("reading", list(options), lambda values: ReadingOptions(**values), command)


# In words what `fitting.limits.estimated_limits` computes, whose import every --help would wait for
_LEFT_OUT = {"v_max": "1.25 times the log's", "a_max": "twice the log's", "j_max": "5 times the log's"}
_LEFT_OUT |= {"change_max": "twice the log's largest servo error", "following_error_max": "1.3 times the usual one"}


def takes_known(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command an option for each parameter that may be known of an axis.

    Its argument ``known`` becomes the mapping of those that are given, by their names.
    """
    taken = []
    for one in (*map(PARAMETERS.__getitem__, PredictorSettings.KNOWN), *DRIVE_LIMIT_ENTRIES.values()):
        option = typer.Option(f"--{one.name}", help=f"{one.help}; if left out {_LEFT_OUT.get(one.name, 'none')}")
        annotation = Annotated[one.kind | None, option]  # type: ignore[name-defined]
        taken.append(inspect.Parameter(one.name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation))
    return _in_the_place_of(
        "known", taken, lambda values: {name: value for name, value in values.items() if value is not None}, command
    )


def _in_the_place_of(
    name: str,
    taken: Sequence[inspect.Parameter],
    given: Callable[[dict[str, Any]], object],
    command: Callable[..., None],
) -> Callable[..., None]:
    """Return a command with options in the place of the argument ``name``, which is ``given`` of their values."""

    @wraps(command)
    def run(**arguments: Any) -> None:
        command(**{name: given({one.name: arguments.pop(one.name) for one in taken})}, **arguments)

    signature = inspect.signature(command, eval_str=True)
    mixed = [
        one.replace(kind=inspect.Parameter.KEYWORD_ONLY)
        for argument in signature.parameters.values()
        for one in (taken if argument.name == name else [argument])
    ]
    run.__signature__ = signature.replace(parameters=mixed)  # type: ignore[attr-defined]
    run.__annotations__ = {one.name: one.annotation for one in mixed}
    return run
