"""Interface table of an FMU for the README and the FMU's documentation page."""

from __future__ import annotations

import re
from collections.abc import Iterable

from .variables import Variable

__all__ = ["interface_table"]


def interface_table(table: Iterable[Variable]) -> list[tuple[str, str, str, str, str]]:
    """Return ``(name, causality, type and unit, start, meaning)`` of each variable, arrays in one row.

    Parameters
    ----------
    table : iterable of Variable
        As :func:`hybridsep.fmi.variables.variables_of` returns it.
    """
    rows: dict[str, tuple[str, str, str, str, str]] = {}
    for variable in table:
        name = re.sub(r"^(\w+_window)\[\d+\]", r"\1[i]", variable.name)
        causality = "parameter, fixed" if variable.causality == "parameter" else variable.causality
        unit = "" if variable.unit in (None, "1") else f", {variable.unit}"
        start = "" if variable.start is None else _start(variable)
        items = ", ".join(f"{number} {item}" for number, item in enumerate(variable.items))
        meaning = f"{variable.description}: {items}" if items else variable.description
        rows.setdefault(name, (name, causality, f"{variable.kind}{unit}", start, meaning))
    return list(rows.values())


def _start(variable: Variable) -> str:
    return str(variable.start).lower() if variable.kind == "Boolean" else f"{variable.start:.10g}"
