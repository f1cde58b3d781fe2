"""Writer of machine files: TOML with the unit of each entry as a comment."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ..base.settings import PARAMETERS
from .machine import Machine

__all__ = ["machine_text"]

_COLUMN = 32
"""Column of the comments, for alignment."""


def machine_text(machine: Machine, comments: Iterable[str] = (), *, annotated: bool = False) -> str:
    """Return a machine file; :func:`~hybridsep.machines.machine.load_machine` reads the same machine.

    Parameters
    ----------
    machine : Machine
    comments : iterable of str
        Lines at the head of the file.
    annotated : bool
        Whether each entry says what it is, besides its unit.
    """
    table = {**machine.table, "T_s": machine.T_s}
    head = [f"# {line}".rstrip() for comment in comments for line in comment.splitlines()]
    lines = [*head, *_entries(table, annotated)]
    for name, value in table.items():
        if isinstance(value, Mapping):
            lines += _section(name, value, annotated)
    return "\n".join(lines).strip("\n") + "\n"


def _section(name: str, table: Mapping[str, Any], annotated: bool) -> list[str]:
    """Return the lines of a table with its tables, a blank one first; an empty table has none."""
    own = _entries(table, annotated)
    lines = ["", f"[{name}]", *own] if own else []
    for key, value in table.items():
        if isinstance(value, Mapping):
            lines += _section(f"{name}.{key}", value, annotated)
        elif _is_tables(value):
            for item in value:
                lines += ["", f"[[{name}.{key}]]", *_entries(item, annotated)]
    return lines


def _entries(table: Mapping[str, Any], annotated: bool) -> list[str]:
    return [
        _with_comment(f"{name} = {_value(value)}", name, annotated)
        for name, value in table.items()
        if not isinstance(value, Mapping) and not _is_tables(value)
    ]


def _is_tables(value: Any) -> bool:
    return isinstance(value, list | tuple) and bool(value) and isinstance(value[0], Mapping)


def _with_comment(line: str, name: str, annotated: bool) -> str:
    """Return an entry with its unit and, if it is annotated, its description."""
    parameter = PARAMETERS.get(name)
    if parameter is None or "\n" in line:
        return line
    parts = [parameter.unit] if parameter.kind is float and parameter.unit != "1" else []
    parts += [parameter.description] if annotated else []
    return f"{line:<{_COLUMN}}# {', '.join(parts)}" if parts else line


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, list | tuple):
        return "[\n" + "".join(f"    {_value(item)},\n" for item in value) + "]" if value else "[]"
    return '"' + str(value).replace("\\", "\\\\").replace('"', '\\"') + '"'
