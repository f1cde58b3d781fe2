"""Writer of machine files: TOML with the unit of each entry as a comment."""

from collections.abc import Iterable, Mapping
from typing import Any

from ..base.parameters import Parameter, angular_unit
from ..base.settings import PARAMETERS, Limits
from .machine import Machine

_COLUMN = 32  # column of the comments, for alignment


def machine_text(machine: Machine, comments: Iterable[str] = (), *, annotated: bool = False) -> str:
    """Return a machine file; :func:`~hybridsep.machines.machine.load_machine` reads the same machine.

    ``comments`` are lines at its head; if it is ``annotated``, each entry says what it is, besides its unit.
    """
    head = [f"# {line}".rstrip() for comment in comments for line in comment.splitlines()]
    declared = {**PARAMETERS, **Limits.parameters()}
    words = {name: _words(one, machine.unit == "rad", annotated) for name, one in declared.items()}
    lines = _lines("", {**machine.table, "T_s": machine.T_s}, words, "")
    return "\n".join([*head, *lines]).strip("\n") + "\n"


def _lines(place: str, table: Mapping[str, Any], words: Mapping[str, str], heading: str) -> list[str]:
    """Return the lines of a table's own entries below its heading, then of the tables in it."""
    own, tables = [], []
    for name, value in table.items():
        inner = f"{place}.{name}" if place else name
        if isinstance(value, Mapping):
            tables += _lines(inner, value, words, f"[{inner}]")
        elif isinstance(value, list | tuple) and value and isinstance(value[0], Mapping):
            tables += [line for item in value for line in _lines(inner, item, words, f"[[{inner}]]")]
        else:
            line, said = f"{name} = {_value(value)}", words.get(name, "")
            own.append(f"{line:<{_COLUMN}}# {said}" if said and "\n" not in line else line)
    return ["", heading, *own, *tables] if own and heading else [*own, *tables]


def _words(parameter: Parameter, rotary: bool, annotated: bool) -> str:
    """Return the unit of a parameter and, if it is annotated, its description."""
    unit = (angular_unit(parameter.unit) or "") if rotary else parameter.unit
    parts = [unit] if parameter.kind is float and unit != "1" else []
    return ", ".join([*parts, *([parameter.description] if annotated else [])])


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, list | tuple):
        return "[\n" + "".join(f"    {_value(item)},\n" for item in value) + "]" if value else "[]"
    return '"' + str(value).replace("\\", "\\\\").replace('"', '\\"') + '"'
