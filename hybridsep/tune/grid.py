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

_LAMBDA_FACTORS = (1.0, 1e2, 1e4)
"""Values without trust, relative to the machine's own."""

_FORGETTING = 30
"""Windows after which samples are forgotten in half of the candidates with trust."""


def default_values(settings: PredictorSettings) -> dict[str, tuple[Any, ...]]:
    """Return the values to try, by the fields of settings.

    Some sixteen combinations with trust, and two dozen without.

    Parameters
    ----------
    settings : PredictorSettings
        The machine's own, whose values are among them.
    """
    tried = settings_to_try(settings)
    lags = {name: tuple(sorted({getattr(one, name) for one in tried})) for name in ("p", "q")}
    if settings.trust:
        forgetting = {settings.forgetting, float(f"{_FORGETTING * settings.Np * settings.T_s:.3g}")}
        return {**lags, "forgetting": tuple(sorted(forgetting))}
    lam = {settings.lam, *(float(f"{settings.lam * factor:.6g}") for factor in _LAMBDA_FACTORS)}
    return {**lags, "lam": tuple(sorted(value for value in lam if TUNED["lam"].allows(value)))}


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
