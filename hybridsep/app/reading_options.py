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
    MeasuredColumnOption,
    TimeColumnOption,
    TsOption,
    UnitOption,
)

__all__ = ["ReadingOptions", "takes_reading"]


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
    """

    unit: UnitOption = None
    T_s: TsOption = None
    axis: AxisOption = None
    t: TimeColumnOption = None
    x_d: CommandColumnOption = None
    x: MeasuredColumnOption = None

    @property
    def columns(self) -> dict[str, str]:
        """Columns that are given, by what they hold."""
        return {role: column for role in ("t", "x_d", "x") if (column := getattr(self, role))}


def takes_reading(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command these options in the place of its argument ``reading``, which becomes :class:`ReadingOptions`."""
    names = [field.name for field in fields(ReadingOptions)]

    @wraps(command)
    def run(**arguments: Any) -> None:
        reading = ReadingOptions(**{name: arguments.pop(name) for name in names})
        command(**arguments, reading=reading)

    signature, options = (inspect.signature(one, eval_str=True) for one in (command, ReadingOptions))
    taken: list[inspect.Parameter] = []
    for name, argument in signature.parameters.items():
        taken += list(options.parameters.values()) if name == "reading" else [argument]
    taken = [argument.replace(kind=inspect.Parameter.KEYWORD_ONLY) for argument in taken]
    run.__signature__ = signature.replace(parameters=taken)  # type: ignore[attr-defined]
    run.__annotations__ = {argument.name: argument.annotation for argument in taken}
    return run
