"""Command-line options of the predictor's and the compensator's parameters, made from their declaration."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Iterator
from functools import wraps
from typing import Annotated, Any

import typer

from ..base.parameters import Parameter
from ..base.ranges import GRAMMAR
from ..base.settings import PARAMETERS, CompensatorSettings, Limits, PredictorSettings, Settings

__all__ = [
    "COMPENSATOR_ENTRIES",
    "DRIVE_LIMIT_ENTRIES",
    "KNOWN_ENTRIES",
    "PREDICTOR_ENTRIES",
    "parameter_help",
    "takes_parameters",
]


def _entries(settings: type[Settings]) -> dict[str, Parameter]:
    return {name: entry for name, entry in settings.parameters().items() if name not in settings.ELSEWHERE}


PREDICTOR_ENTRIES = _entries(PredictorSettings)
"""Parameters that the section ``[predictor]`` of a machine file may have, by the names of the settings' fields."""

KNOWN_ENTRIES = {name: PREDICTOR_ENTRIES[name] for name in ("period", "measurement_delay")}
"""Those that are known of an axis, which no log is fitted for."""

COMPENSATOR_ENTRIES = {
    **{name: entry for name, entry in _entries(CompensatorSettings).items() if name != "compensate"},
    **{name: PARAMETERS[name] for name in PredictorSettings.NEEDS_PREVIEW},
}
"""Parameters that the section ``[compensator]`` may have besides, less the model, which commands choose themselves."""

DRIVE_LIMIT_ENTRIES = {**Limits.parameters(), "change_max": PARAMETERS["change_max"]}
"""Parameters of the section ``[drive_limits]``."""


def parameter_help(parameter: Parameter, otherwise: str = "the machine's own") -> str:
    """Return the help of an option that changes a parameter of the machine."""
    return f"{parameter.help}; {otherwise} if left out"


def takes_parameters(
    *groups: dict[str, Parameter], ranges: Collection[str] = (), otherwise: str = "the machine's own"
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a decorator that gives a command an option for each parameter.

    The command's argument ``parameters`` becomes the mapping of those that are given, by their names in FMUs.

    Parameters
    ----------
    *groups : dict
        Of :data:`PREDICTOR_ENTRIES` and :data:`COMPENSATOR_ENTRIES`.
    ranges : collection of str
        Fields of those that take several values; theirs are given as text.
    otherwise : str
        What counts where an option is left out.
    """
    options = {field: parameter for group in groups for field, parameter in group.items()}

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        @wraps(command)
        def run(**arguments: Any) -> None:
            given = {parameter.name: arguments.pop(field) for field, parameter in options.items()}
            command(**arguments, parameters={name: value for name, value in given.items() if value is not None})

        signature = inspect.signature(command, eval_str=True)
        arguments = list(_with_options(signature, options, ranges, otherwise))
        run.__signature__ = signature.replace(parameters=arguments)  # type: ignore[attr-defined]
        run.__annotations__ = {argument.name: argument.annotation for argument in arguments}
        return run

    return decorate


def _with_options(
    signature: inspect.Signature, options: dict[str, Parameter], ranges: Collection[str], otherwise: str
) -> Iterator[inspect.Parameter]:
    """Yield a command's arguments, the options in the place of ``parameters``."""
    for name, argument in signature.parameters.items():
        if name != "parameters":
            yield argument.replace(kind=inspect.Parameter.KEYWORD_ONLY)
            continue
        for field, parameter in options.items():
            kind: Any = str if parameter.kind is bool or field in ranges else parameter.kind
            annotation = Annotated[kind | None, _option(field, parameter, otherwise, several=field in ranges)]
            yield inspect.Parameter(field, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation)


def _option(field: str, parameter: Parameter, otherwise: str, *, several: bool) -> Any:
    """Return the option, under the FMU's name; with hyphens or by the field's name it is accepted, too."""
    names = dict.fromkeys(f"--{name}" for name in (parameter.name, parameter.name.replace("_", "-"), field))
    if several:
        return typer.Option(
            *names, help=f"{parameter.help}; several as {GRAMMAR}; a default range if left out", metavar="RANGE"
        )
    more: dict[str, Any] = {"parser": _truth_value, "metavar": "true|false"} if parameter.kind is bool else {}
    return typer.Option(*names, help=parameter_help(parameter, otherwise), **more)


def _truth_value(text: str | bool) -> bool:
    values = {"true": True, "false": False}
    if str(text).lower() not in values:
        raise typer.BadParameter(f"{text!r} is neither true nor false")
    return values[str(text).lower()]
