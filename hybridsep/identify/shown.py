"""Estimates of a model as they are shown: in the units of their log, with what was not estimated."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from ..logs.units import Shown

__all__ = ["deviation_words", "shown_estimates"]


def deviation_words(std: float, sign: str = "") -> str:
    """Return a standard deviation as text; "fixed" for a parameter that was not estimated."""
    return f"{sign}{std:.2g}" if std > 0 else "fixed"


def shown_estimates(parameters: Iterable[Mapping[str, Any]], shown: Shown) -> Iterator[tuple[str, float, float, str]]:
    """Yield name, value, standard deviation and unit of parameters; positions in the units of their log."""
    for one in parameters:
        factor, unit = shown.error(abs(one["value"])) if one["unit"] in ("m", "rad") else (1.0, str(one["unit"]))
        yield str(one["name"]), factor * one["value"], factor * one["std"], unit
