"""Candidates: values of the parameters that are tuned, and their combinations."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..base.errors import ParameterError
from ..base.settings import PredictorSettings
from .choice import settings_to_try

__all__ = ["TUNED", "candidates", "default_values"]

Values = Mapping[str, Sequence[Any]]

TUNED = {name: PredictorSettings.parameters()[name] for name in PredictorSettings.TUNED}
"""Parameters that can be tuned, by their fields."""

_CANDIDATES_MAX = 100_000
"""Candidates beyond which a range is a slip of the pen."""

_P_VALUES = 20
"""Values of p without trust, evenly spaced up to a window."""

_Q_VALUES = (0, 1, 3, 5, 8)
_LAMBDA_FACTORS = tuple(10.0**i for i in range(-2, 7))
"""Values without trust. A λ of less than 1e-2 of the default is at the limit of what the numbers tell."""

_FORGETTING = 30
"""Windows after which samples are forgotten in half of the candidates with trust."""


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
        if name in PredictorSettings.TRUST and not settings.trust:
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
