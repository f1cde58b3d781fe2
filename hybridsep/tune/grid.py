"""Candidates: values of the parameters that are tuned, from text or by default, and their combinations."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..base.errors import ParameterError, brief
from ..base.parameters import Parameter
from ..base.settings import PredictorSettings
from .choice import settings_to_try

__all__ = ["GRAMMAR", "TUNED", "candidates", "default_values", "own_settings", "parse_values"]

Values = Mapping[str, Sequence[Any]]

_WITH_TRUST_ONLY = ("effect", "noise_std", "forgetting")

TUNED = {
    name: parameter
    for name, parameter in PredictorSettings.parameters().items()
    if name in ("p", "q", "lam", *_WITH_TRUST_ONLY)
}
"""Parameters that can be tuned, by their fields; not ``Np``, which is the controller's, nor the warm-up, as holding or
the physics model alone would look better."""

GRAMMAR = "values as 5,10,50, steps as 5:100:5, factors as 1e-14:1e-6:x10, or several of them with commas"
"""How ranges are written."""

_VALUES_MAX, _CANDIDATES_MAX = 10_000, 100_000
"""Values of a parameter, and candidates: beyond them a range is a slip of the pen."""

_P_VALUES = 20
"""Values of p without trust, evenly spaced up to a window."""

_Q_VALUES = (0, 1, 3, 5, 8)
_LAMBDA_FACTORS = tuple(10.0**i for i in range(-2, 7))
"""Values without trust. A λ of less than 1e-2 of the default is at the limit of what the numbers tell."""

_FORGETTING = 30
"""Windows after which samples are forgotten in half of the candidates with trust."""


def parse_values(text: str, parameter: Parameter) -> tuple[Any, ...]:
    """Return the values that a range written as in :data:`GRAMMAR` has, ascending.

    Raises
    ------
    ParameterError
        If it is not written so, or a value is out of the parameter's range; the message names the option.
    """
    option = f"--{parameter.name}"
    found: set[float] = set()
    for part in text.split(","):
        for value in _values(part.strip(), option, whole=parameter.kind is int):
            found.add(parameter.checked(value, option))
    return tuple(sorted(found))


def _values(part: str, option: str, *, whole: bool) -> list[float]:
    """Return the values of a part between commas: one, or those of a range."""
    fields = part.split(":")
    if len(fields) == 1:
        return [_number(part, part, option)]
    if len(fields) == 2 and whole:
        fields.append("1")
    if len(fields) != 3:
        raise ParameterError(f"{option} must be {GRAMMAR}; got {brief(part)}")
    begin, end = (_number(field, part, option) for field in fields[:2])
    geometric = fields[2].startswith("x")
    step = _number(fields[2].removeprefix("x"), part, option)
    if end < begin:
        raise ParameterError(f"{option} must have ranges that ascend, got {part}")
    if geometric and not (begin > 0.0 and step > 1.0):
        raise ParameterError(f"{option} must have factors above 1 and begin above 0, got {part}")
    if not geometric and step <= 0.0:
        raise ParameterError(f"{option} must have steps above 0, got {part}")
    steps = math.log(end / begin) / math.log(step) if geometric else (end - begin) / step
    if not steps < _VALUES_MAX:
        raise ParameterError(f"{option} must have at most {_VALUES_MAX} values, got {part}")
    n = math.floor(steps + 1e-9) + 1
    values = (begin * step**i if geometric else begin + i * step for i in range(n))
    return [float(f"{value:.12g}") for value in values]


def _number(text: str, part: str, option: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ParameterError(f"{option} must be {GRAMMAR}; got {brief(part)}")
    return number


def own_settings(settings: PredictorSettings, Np: int) -> PredictorSettings:
    """Return settings for another look-ahead, with as many of their lags as fit into it."""
    return replace(settings, Np=Np, p=min(settings.p, Np), q=min(settings.q, Np - 1))


def default_values(settings: PredictorSettings) -> dict[str, tuple[Any, ...]]:
    """Return the values to try, by the fields of settings.

    Hundreds of combinations for the paper's model, which share a pass; some sixteen with trust, each of which takes a
    replay.

    Parameters
    ----------
    settings : PredictorSettings
        The machine's own, whose values are among them.
    """
    Np = settings.Np
    if settings.trust:
        tried = settings_to_try(settings)
        forgetting = {settings.forgetting, float(f"{_FORGETTING * Np * settings.T_s:.3g}")}
        lags = {name: tuple(sorted({getattr(one, name) for one in tried})) for name in ("p", "q")}
        return {**lags, "forgetting": tuple(sorted(forgetting))}
    p = {max(1, round((i + 1) * Np / _P_VALUES)) for i in range(_P_VALUES)}
    allowed = TUNED["lam"].allows
    lam = {float(f"{settings.lam * factor:.6g}") for factor in _LAMBDA_FACTORS}
    return {
        "p": tuple(sorted(p | {settings.p})),
        "q": tuple(sorted({q for q in _Q_VALUES if q < Np} | {settings.q})),
        "lam": tuple(sorted(value for value in lam | {settings.lam} if allowed(value))),
    }


def candidates(settings: PredictorSettings, values: Values) -> list[PredictorSettings]:
    """Return all combinations of values, after the settings themselves.

    Parameters
    ----------
    settings : PredictorSettings
        The machine's own, which have the other parameters.
    values : mapping
        Values by the fields of settings, of :data:`TUNED`.

    Raises
    ------
    ParameterError
        If a value does not fit the window or has no effect, or there are too many candidates; options are named.
    """
    for name, given in values.items():
        if name in _WITH_TRUST_ONLY and not settings.trust:
            raise ParameterError(f"--{TUNED[name].name} has an effect with trust only: give --trust true, too")
        for value in given:
            try:
                replace(settings, **{name: value})
            except ParameterError as error:
                raise ParameterError(f"--{TUNED[name].name}: {error}") from error
    n = math.prod(len(given) for given in values.values())
    if n > _CANDIDATES_MAX:
        options = " and ".join(f"--{TUNED[name].name}" for name in values)
        raise ParameterError(f"{options} have {n} combinations, at most {_CANDIDATES_MAX} are allowed; take fewer")
    combined = [
        replace(settings, **dict(zip(values, combination, strict=True)))
        for combination in itertools.product(*values.values())
    ]
    return list(dict.fromkeys([settings, *combined]))
