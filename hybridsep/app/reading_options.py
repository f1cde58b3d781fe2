"""Command-line options of how a log is read, the same for every command that reads one."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import wraps
from typing import Any

from .options import (
    AxisOption,
    CommandColumnOption,
    ListChannelsOption,
    MeasuredColumnOption,
    ResampleOption,
    TimeColumnOption,
    TsOption,
    UnitOption,
)

__all__ = ["ReadingOptions", "takes_reading"]

_LIST = "list_channels"


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
    resample : bool
    """

    unit: UnitOption = None
    T_s: TsOption = None
    axis: AxisOption = None
    t: TimeColumnOption = None
    x_d: CommandColumnOption = None
    x: MeasuredColumnOption = None
    resample: ResampleOption = False

    @property
    def columns(self) -> dict[str, str]:
        """Columns that are given, by what they hold."""
        return {role: column for role in ("t", "x_d", "x") if (column := getattr(self, role))}


def takes_reading(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command these options in the place of its argument ``reading``, which becomes :class:`ReadingOptions`.

    With ``--list-channels`` the channels of its logs are printed in the place of all that it does.
    """
    names = [field.name for field in fields(ReadingOptions)]

    @wraps(command)
    def run(**arguments: Any) -> None:
        reading = ReadingOptions(**{name: arguments.pop(name) for name in names})
        if arguments.pop(_LIST):
            from .channel_table import print_channels

            logs = arguments["logs"] if "logs" in arguments else [arguments["log"]]
            print_channels(logs, as_json=bool(arguments.get("as_json")))
            return
        command(**arguments, reading=reading)

    signature, options = (inspect.signature(one, eval_str=True) for one in (command, ReadingOptions))
    taken: list[inspect.Parameter] = []
    listing = inspect.Parameter(_LIST, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=ListChannelsOption)
    for name, argument in signature.parameters.items():
        taken += [*options.parameters.values(), listing] if name == "reading" else [argument]
    taken = [argument.replace(kind=inspect.Parameter.KEYWORD_ONLY) for argument in taken]
    run.__signature__ = signature.replace(parameters=taken)  # type: ignore[attr-defined]
    run.__annotations__ = {argument.name: argument.annotation for argument in taken}
    return run
