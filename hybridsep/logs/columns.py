"""Choice of a log's columns: which are time, commanded and measured position, and in which units."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

from ..base.errors import LogError, brief, listed
from .source import Source
from .text_layout import is_number
from .timestamps import stamp_kind
from .units import POSITION_UNITS, TIME_UNITS, Unit, plain_name, position_unit, stated_unit, time_unit

__all__ = ["COUNT", "ROLES", "Column", "choose_columns", "roles_of"]

COUNT = "such as unit='0.1um' (--unit 0.1um)"
"""Example of the unit of a log in encoder counts, for messages."""

_COUNTS = ("count", "counts", "cts", "inc", "incr", "increment", "increments", "pulse", "pulses")
"""Spellings of an encoder's count where a unit is stated, in small letters; its length must be given."""

ROLES = ("t", "x_d", "x")
"""Time, commanded and measured position."""

_NAMES: Mapping[str, tuple[str, ...]] = {
    "t": ("t", "time", "timestamp", "time_stamp", "zeit"),
    "x_d": (
        "x_d", "xd", "x_ref", "xref", "x_cmd", "x_set", "x_des", "reference", "setpoint", "command", "commanded",
        "position_commanded", "commanded_position", "pos_cmd", "cmd_pos", "pos_ref", "pos_set", "des_pos", "q_d",
    ),
    "x": (
        "x_meas", "x", "x_m", "x_act", "measured", "measurement", "actual", "position_measured", "measured_position",
        "actual_position", "position_actual", "pos_meas", "pos_act", "act_pos", "enc_pos", "feedback", "q_meas",
    ),
}  # fmt: skip
"""Names of each role's column, by precedence, in small letters; where the true position is x, x_meas is meant."""


@dataclass(frozen=True)
class Column:
    """Column that is read.

    Attributes
    ----------
    name : str
        Its name in the file.
    unit : Unit
        Unit of its numbers.
    stated : bool
        Whether the file or the caller stated the unit; otherwise it is SI.
    """

    name: str
    unit: Unit
    stated: bool


def choose_columns(
    source: Source, columns: Mapping[str, str] | None, unit: str | None, *, time_needed: bool
) -> dict[str, Column]:
    """Return the columns to read, by role.

    Parameters
    ----------
    source : Source
    columns : mapping, optional
        Names by role; a name may leave out the unit that the file's has.
    unit : str, optional
        Unit of the positions.
    time_needed : bool
        Whether a time column must be there.

    Raises
    ------
    LogError
        If a column is missing, occurs twice, or its unit is unknown or contradicts the given one.
    """
    for role in columns or ():
        if role not in ROLES:
            raise LogError(f"{source.path}: columns may name {', '.join(ROLES)}, got {brief(role)}")
    given = columns or {}
    chosen = {role: _name(source, role, given.get(role)) for role in ("x_d", "x")}
    own = source.times.get(chosen["x_d"] or "")
    chosen = {"t": own if own and "t" not in given else _name(source, "t", given.get("t")), **chosen}
    if chosen["t"] is None and "t" not in given and time_needed:
        chosen["t"] = _only_clock(source)
    if chosen["t"] is None and "t" not in given and not time_needed:
        del chosen["t"]
    found: dict[str, Column] = {}
    names = {role: name for role, name in chosen.items() if name is not None}
    if len(names) < len(chosen):
        raise _missing(source, {role: given.get(role, role) for role in chosen if role not in names})
    for role, name in names.items():
        if source.names.count(name) > 1:
            raise LogError(
                f"{source.path}: column {brief(name)} must occur once, got it {source.names.count(name)} times"
            )
        found[role] = _time(source, name) if role == "t" else _position(source, name, unit)
    x_d, x = found["x_d"], found["x"]
    if x_d.unit.si != x.unit.si:
        raise LogError(
            f"{source.path}: column {brief(x_d.name)} is in {x_d.unit.name} and column {brief(x.name)} in "
            f"{x.unit.name}; both must be lengths or both angles"
        )
    return found


def _name(source: Source, role: str, given: str | None) -> str | None:
    """Return the file's name of a role's column, None if there is none.

    A given name is the file's own, with its unit or without; otherwise the format's own choice counts, then the known
    names as they are, then the known names without units and in any spelling.
    """
    plain = {name: stated_unit(name)[0] for name in source.names}
    if given is not None:
        known = [name for name in source.names if name == given] or [name for name in plain if plain[name] == given]
        return known[0] if known else None
    if role in source.roles:
        return source.roles[role]
    for spelled in ({name: name for name in source.names}, {name: _spelling(plain[name]) for name in source.names}):
        for key in _NAMES[role]:
            known = [name for name in source.names if spelled[name] == key]
            if len(set(known)) > 1:
                there = listed(known)
                raise LogError(f"{source.path}: column {role} may be {there}; name it: --{_option(role)} NAME")
            if known:
                return known[0]
    return None


def roles_of(source: Source) -> dict[str, str]:
    """Return the names of the columns that are read without a word of the user's, by role, as far as there are any."""
    found = {}
    for role in ROLES:
        with suppress(LogError):  # there are several
            name = _name(source, role, None)
            if name is not None:
                found[role] = name
    return found


def _only_clock(source: Source) -> str | None:
    """Return the only column of timestamps, whatever its name; None if there are none or several."""
    twins = {twin for one in source.twins.values() for twin in one}
    clocks = [name for name in source.names if name in source.stamps and name not in twins]
    if len(clocks) != 1:
        return None
    source.remarks = [*source.remarks, f"column {brief(clocks[0])} is read as the time; columns (--t) names another"]
    return clocks[0]


def _spelling(name: str) -> str:
    return name.strip().lower().replace(" ", "_").replace("-", "_").replace(".", "_")


def _option(role: str) -> str:
    return role.replace("_", "-")


def _missing(source: Source, names: Mapping[str, str]) -> LogError:
    """Return the error of columns that are not there, by role."""
    there = listed(source.names)
    plain = [name.partition("#")[0] for name in source.names]
    if plain and all(is_number(name) or stamp_kind(name) for name in plain):
        kinds = "t,x_d,x" if len(source.names) == 3 else "t,x_d,x and what the others are"
        raise LogError(
            f"{source.path}: has no line of names, its first line is numbers ({there}); put one above, such as "
            f"{kinds}: time, commanded and measured position, with units if they are not SI, as in x_d [mm]"
        )
    what = ", ".join(repr(name) if name == role else f"{brief(name)} ({role})" for role, name in names.items())
    which, it = (f"column {what} is", "it") if len(names) == 1 else (f"columns {what} are", "them")
    options = " ".join(f"--{_option(role)} NAME" for role in names)
    other = " (or --T_s SECONDS instead of --t)" if "t" in names else ""
    return LogError(f"{source.path}: {which} missing, the file has {there}; name {it}: {options}{other}")


def _stated(source: Source, name: str) -> str:
    """Return the unit that the file states of a column, empty if it states none."""
    return source.units.get(name, "") or stated_unit(name)[1]


def _time(source: Source, name: str) -> Column:
    if name in source.stamps:
        return Column(name, TIME_UNITS["s"], True)  # whatever is stated, such as hh:mm:ss or UTC
    text = _stated(source, name)
    unit = time_unit(text) if text else TIME_UNITS["s"]
    if unit is None:
        raise LogError(
            f"{source.path}: time {brief(name)} must be in one of {', '.join(TIME_UNITS)}, its unit is {brief(text)}; "
            "correct it, or remove the column and give T_s (--T_s)"
        )
    return Column(name, unit, bool(text))


def _position(source: Source, name: str, given: str | None) -> Column:
    if name in source.stamps:
        raise LogError(
            f"{source.path}: column {brief(name)} must be a position, it holds timestamps; name another: --x-d NAME, "
            "--x NAME"
        )
    text = _stated(source, name)
    unit = position_unit(text) if text else None
    counts = plain_name(text) in _COUNTS
    if counts and given is None:
        raise LogError(f"{source.path}: column {brief(name)} is in encoder counts; give the length of one, {COUNT}")
    if text and unit is None and not counts:
        raise LogError(
            f"{source.path}: column {brief(name)} must be a position in one of {', '.join(POSITION_UNITS)}, its unit "
            f"is {brief(text)}; is it another quantity? Name another column (--x-d NAME, --x NAME), or correct the unit"
        )
    chosen = position_unit(given) if given is not None else None
    if unit is not None and chosen not in (None, unit):
        raise LogError(
            f"{source.path}: unit={brief(given)} (--unit {given}) was given, but column {brief(name)} states "
            f"{brief(text)}; leave the unit out, or correct the file"
        )
    chosen = chosen or unit or position_unit(source.assumed_units.get(name, ""))
    return Column(name, chosen or POSITION_UNITS["m"], chosen is not None)
