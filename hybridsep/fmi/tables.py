"""Table of an FMU's interface for its documentation page."""

from __future__ import annotations

import re
from collections.abc import Iterable

from .variables import Variable

__all__ = ["grouped_table"]


def grouped_table(table: Iterable[Variable]) -> dict[str, list[tuple[str, str, str, str, str, str]]]:
    """Return ``(name, type and unit, display unit, start, range, meaning)`` by heading; items with what they mean."""
    groups: dict[str, list[tuple[str, str, str, str, str, str]]] = {}
    for name, variable in _in_one_row(table).items():
        pairs = enumerate(zip(variable.items, variable.item_meanings, strict=True))
        items = ", ".join(f"{number} {item} ({meaning})" for number, (item, meaning) in pairs)
        meaning = f"{variable.description}: {items}" if items else variable.description
        row = (name, _kind(variable), variable.display_unit or "", _start(variable), _range(variable), meaning)
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


def _range(variable: Variable) -> str:
    """Return the allowed values, an automatic choice and the least value that is not 0 included."""
    if variable.minimum is None or variable.maximum is None or variable.kind == "Boolean":
        return ""
    least = f"0 or {variable.nonzero:g}" if variable.nonzero else f"{variable.minimum:.10g}"
    if variable.minimum == variable.maximum:
        return least
    if variable.automatic is not None:
        least = f"{variable.automatic:g} or {least}"
    return f"{least} … {variable.maximum:.10g}"
