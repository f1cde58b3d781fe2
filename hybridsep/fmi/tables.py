"""Table of an FMU's interface for its documentation page."""

from __future__ import annotations

import re
from collections.abc import Iterable

from .variables import Variable

__all__ = ["grouped_table"]


def grouped_table(table: Iterable[Variable]) -> dict[str, list[tuple[str, str, str, str, str]]]:
    """Return ``(name, type and unit, display unit, start, meaning)`` by heading; enumerations with what items mean."""
    groups: dict[str, list[tuple[str, str, str, str, str]]] = {}
    for name, variable in _in_one_row(table).items():
        pairs = enumerate(zip(variable.items, variable.item_meanings, strict=True))
        items = ", ".join(f"{number} {item} ({meaning})" for number, (item, meaning) in pairs)
        meaning = f"{variable.description}: {items}" if items else variable.description
        row = (name, _kind(variable), variable.display_unit or "", _start(variable), meaning)
        groups.setdefault(variable.heading, []).append(row)
    return groups


def _in_one_row(table: Iterable[Variable]) -> dict[str, Variable]:
    """Return the variables by name, of a window the first one as ``name[i]``."""
    rows: dict[str, Variable] = {}
    for variable in table:
        rows.setdefault(re.sub(r"^(\w+_window)\[\d+\]", r"\1[i]", variable.name), variable)
    return rows


def _kind(variable: Variable) -> str:
    return variable.kind if variable.unit in (None, "1") else f"{variable.kind}, {variable.unit}"


def _start(variable: Variable) -> str:
    if variable.start is None:
        return ""
    return str(variable.start).lower() if variable.kind == "Boolean" else f"{variable.start:.10g}"
