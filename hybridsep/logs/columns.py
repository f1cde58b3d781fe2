"""Choice of a log's columns: which are time, commanded and measured position, in which units, at which rates."""

import re
import shlex
from collections.abc import Mapping
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace

import numpy as np

from ..base.errors import LogError, brief, listed
from ..base.signals import Array
from .names import ROLES, axes_of, beside_error, has_word, known_names, signals_of
from .source import Block, Source
from .text import is_number, stamp_kind
from .times import COUNTED
from .units import COUNTS, POSITION_UNITS, TIME_UNITS, Unit, plain_name, position_unit, stated_unit, time_unit

_OTHERS = re.compile(r"/|rpm|min-1|hz|%", re.IGNORECASE)  # in units of what is no position; another one may be given

_DATA = re.compile(r"(\.(data|values?|signals))+$", re.IGNORECASE)  # names of what MATLAB has beside a signal's time
_GAP = 1.5  # intervals of the slower column between two samples of the faster one from which on the latter has a gap
_SAME = 1e-6  # largest difference of two channels' times, in intervals, at which they are the same: rounding


@dataclass(frozen=True)
class Column:
    """Column that is read."""

    name: str  # its name in the file
    unit: Unit  # unit of its numbers
    stated: bool  # whether the file or the caller stated the unit; otherwise it is SI
    error: int = 0  # in the place of a position: 1 of commanded − measured, −1 of measured − commanded


def choose_columns(
    source: Source, columns: Mapping[str, str] | None, unit: str | None, *, axis: str | None = None, time_needed: bool
) -> dict[str, Column]:
    """Return the columns to read, by role.

    ``columns`` has given names by role, which may leave out the unit that the file's have, and of an ``"error"``, which
    is then in the place of a position; ``unit`` is the positions'; ``axis`` one of several, by the format's name or the
    columns' names (``X1`` of ``X1_CommandPosition``); ``time_needed`` whether a time column must be there.
    LogError if a column is missing, occurs twice, or its unit is unknown or contradicts the given one.
    """
    for role in columns or ():
        if role not in (*ROLES, "error"):
            raise LogError(f"{source.path}: columns may name {', '.join(ROLES)}, error, got {brief(role)}")
    given = dict(columns or {})
    error = given.pop("error", None)
    beside = beside_error(source.names, error) if error and axis is None and not {"x_d", "x"} & given.keys() else {}
    chosen, remarks = ({"x_d": None, "x": None, **beside}, []) if beside else _positions(source, given, axis)
    time = None
    with nullcontext() if time_needed else suppress(LogError):  # there may be several, none of which is needed
        time = _name(source, "t", given["t"]) if "t" in given else _time_of(source, chosen["x_d"] or "")
    if time is None and "t" not in given:
        time = _only_time(source)
        if time is not None and not time_needed and not (_steps(source, time) > 0.0).any():
            time = None  # that of an export
        if time is not None:
            remarks = [*remarks, f"column {brief(time)} is read as the time; columns (--t) names another"]
        elif not time_needed:
            time = _row_labels(source)
    if time and "t" not in given and not time_needed and plain_name(_stated(source, time)).rstrip("s") in COUNTS:
        time = None  # it counts samples, and the interval is given
    told, sign = _told_by_error(source, chosen, given, error) if error is not None else ("", 0)
    if time is not None or "t" in given or time_needed:
        chosen = {"t": time, **chosen}
    speeds = [name for role, name in chosen.items() if role != "t" and name and has_word("velocity", name)]
    speeds = [f"column {brief(name)} is called a velocity, and read as a position" for name in speeds]
    source.remarks = [*source.remarks, *remarks, *speeds]
    found: dict[str, Column] = {}
    names = {role: name for role, name in chosen.items() if name is not None}
    if len(names) < len(chosen):
        raise _missing(source, {"error" if r == told else r: given.get(r, r) for r in chosen if r not in names})
    for role, name in names.items():
        if source.names.count(name) > 1:
            raise LogError(f"{source.path}: column {brief(name)} must occur once, got {source.names.count(name)}")
        found[role] = _time(source, name) if role == "t" else _position(source, name, unit, sign * (role == told))
    if told and not found[told].stated:  # an error is in the unit of the position beside it
        other = found["x" if told == "x_d" else "x_d"]
        found[told] = replace(found[told], unit=other.unit, stated=other.stated)
    x_d, x = found["x_d"], found["x"]
    if x_d.unit.si != x.unit.si:
        units = f"{brief(x_d.name)} is in {x_d.unit.name} and column {brief(x.name)} in {x.unit.name}"
        raise LogError(f"{source.path}: column {units}; both must be lengths or both angles")
    return found


def _told_by_error(source: Source, chosen: dict[str, str | None], given: dict[str, str], error: str) -> tuple[str, int]:
    """Put an error's column in the place of the position that is not there; return its role and the error's sign."""
    if {"x_d", "x"} <= given.keys():
        raise LogError(f"{source.path}: columns may name two of x_d, x and error, got all three")
    if not any(chosen.values()):
        chosen |= beside_error(source.names)
    told = "x" if chosen["x_d"] and "x" not in given else "x_d"
    name = _name(source, "error", error)
    sign, name = (1, name) if name else (-1, _name(source, "error", error.removeprefix("-")))
    chosen[told], given[told] = name, error
    of, way = brief(chosen["x_d" if told == "x" else "x"]), "+" if (told == "x_d") == (sign > 0) else "−"
    is_what = "commanded − measured" if sign > 0 else "measured − commanded"
    said = f"{told} = {of} {way} {brief(name)}, an error that is {is_what}; the other way: {error_option(error, -1)}"
    source.remarks = [*source.remarks, said]
    return told, sign


def error_option(name: str, sign: int = 1) -> str:
    """Return the option that names an error's column, with its sign, or with the other one."""
    return f"--error={shlex.quote(name if sign > 0 else f'-{name}'.removeprefix('--'))}"


def signal_columns(source: Source, columns: Mapping[str, Column]) -> dict[str, Column]:
    """Return a controller's own signals beside a pair, by what they are, in its unit if they state none."""
    found = {} if source.times else signals_of(source.names, columns["x"].name)
    units = {what: position_unit(_stated(source, name)) or columns["x_d"].unit for what, name in found.items()}
    return {what: Column(name, units[what], True) for what, name in found.items()}


def _positions(source: Source, given: Mapping[str, str], axis: str | None) -> tuple[dict[str, str | None], list[str]]:
    """Return the names of commanded and measured position, None of what is not there, and remarks.

    Those that are given count, then the named axis, the library's own names, the first axis that the format or the
    names tell, and the other one of an axis of which one is given.
    """
    axes = source.axes or axes_of(source.names)
    chosen = {role: _name(source, role, given[role]) for role in ("x_d", "x") if role in given}
    if not any(chosen.values()) and set(given.values()) == {"x_d"}:  # a trajectory's column of another name
        return dict.fromkeys(("x_d", "x"), _positions(source, {}, axis)[0]["x_d"]), []
    if axis is not None:
        x_d, x = _of_axis(source, axes, axis)
        return {"x_d": x_d, "x": x, **chosen}, []
    own = {} if source.axes else {role: _name(source, role, None) for role in ("x_d", "x") if role not in chosen}
    left = [role for role in ("x_d", "x") if role not in chosen and own.get(role) is None]
    partner = next((pair for pair in axes.values() if set(pair) & set(chosen.values())), None)
    first = source.axis or next(iter(axes), None)
    pair, remarks = (own.get("x_d"), own.get("x")), []
    if partner is not None:
        pair = partner
    elif first is not None and left and (not chosen or len(axes) == 1):
        pair = axes[first]
    read = next((name for name, one in axes.items() if one == pair), None)
    if len(axes) > 1 and read is not None and not chosen:
        remarks = [f"axis {read} of {listed(list(axes), str)} is read; axis='…' (--axis) chooses another"]
    return {"x_d": pair[0], "x": pair[1], **chosen}, remarks


def _of_axis(source: Source, axes: Mapping[str, tuple[str, str]], axis: str) -> tuple[str, str]:
    """Return the positions of an axis by its name in any case, the end of it, or its number in the columns' names."""
    axis = str(axis)
    for name, pair in axes.items():
        ends = (re.split(r"[._ /]", name)[-1], pair[0].partition("|")[2])
        if axis.lower() in (name.lower(), *(end.lower() for end in ends if end)):
            return pair
    there = f"there are {listed(list(axes), str)}" if axes else "no names tell axes: name the columns, --x_d and --x"
    raise LogError(f"{source.path}: axis {brief(axis)} is missing; {there}")


def _time_of(source: Source, x_d: str) -> str | None:
    """Return the column of a command's times: its own, that of its struct or one around, or of the file; or None."""
    if x_d in source.times:
        return source.times[x_d]
    for end in sorted((i for i, sign in enumerate(x_d, 1) if sign == "."), reverse=True):
        beside = {name.removeprefix(x_d[:end]): name for name in source.names if name.startswith(x_d[:end])}
        if known := known_names("t", list(beside)):
            return beside[known[0]]
    return _name(source, "t", None)


def _name(source: Source, role: str, given: str | None) -> str | None:
    """Return the file's name of a role's column, None if there is none.

    A given name is the file's own, with its unit or without; otherwise the format's own choice counts, then the known
    names.
    """
    if given is not None:
        plain = [name for name in source.names if stated_unit(name)[0] == given]
        return next((name for name in source.names if name == given), plain[0] if plain else None)
    if role in source.roles:
        return source.roles[role]
    known = known_names(role, source.names)
    if not known and not (source.axes or axes_of(source.names)):  # in structs and models, timeseries too, log.x_d.Data
        ends = {name: re.split("[./]", _DATA.sub("", stated_unit(name)[0]))[-1] for name in source.names}
        known = [name for best in [known_names(role, [*ends.values()])] for name in source.names if ends[name] in best]
    if len(set(known)) > 1:
        raise LogError(f"{source.path}: column {role} may be {listed(known)}; name it: --{role} NAME")
    return known[0] if known else None


def _only_time(source: Source) -> str | None:
    """Return the only column of timestamps, whatever its name, or the only one called a time; None without one."""
    twins = {twin for one in source.twins.values() for twin in one}
    clocks = [name for name in source.names if name in source.stamps and name not in twins]
    called = [name for name in source.names if has_word("t", name) and np.sign(_steps(source, name)).sum() > 0]
    return next((some[0] for some in (clocks, called) if len(some) == 1), None)


def _steps(source: Source, name: str) -> Array:
    """Return the differences of a column, ``(n - 1,)``, none where it does not hold numbers."""
    with suppress(LogError):
        return np.diff(source.read([name]).columns[0])
    return np.zeros(1)


def _row_labels(source: Source) -> str | None:
    """Return the column that counts rows, as pandas and Arrow write an index; None without one."""
    for name in filter(source.names.__contains__, ("", "index", "__index_level_0__", "Unnamed: 0")):
        steps = _steps(source, name)
        if len(steps) >= COUNTED and (steps >= 1.0).all() and np.median(steps) == 1.0:
            return name
    return None


def _check_names(source: Source) -> None:
    plain = [name.partition("#")[0] for name in source.names]
    if plain and all(is_number(name) or stamp_kind(name) for name in plain):
        raise LogError(
            f"{source.path}: has no line of names, its first line is numbers ({listed(plain)}); put one above, such as "
            "t,x_d,x: time, commanded and measured position, with units if they are not SI, as in x_d [mm]"
        )


def _missing(source: Source, names: Mapping[str, str]) -> LogError:
    _check_names(source)
    if "x_d" in names and names["x_d"] == names.get("x"):  # of a trajectory, which has no other position
        it = f"column {brief(names['x_d'])} is missing, the file has {listed(source.names)}"
        return LogError(f"{source.path}: {it}; call the commanded position so in the file")
    what = ", ".join(repr(name) if name == role else f"{brief(name)} ({role})" for role, name in names.items())
    which, it = (f"column {what} is", "it") if len(names) == 1 else (f"columns {what} are", "them")
    of_times = (" (or --T_s SECONDS instead of --t)", ", or T_s=SECONDS") if "t" in names else ("", "")
    options = " ".join(f"--{role} NAME" for role in names) + of_times[0]
    of_python = f"; in Python by columns={{{', '.join(f'{role!r}: NAME' for role in names)}}}{of_times[1]}"
    there = f"{which} missing, the file has {listed(source.names)}"
    errors, speeds = ([name for name in source.names if has_word(kind, name)] for kind in ("error", "velocity"))
    instead = "; velocities are none: record positions" if speeds and not errors and set(names) != {"t"} else ""
    if errors and {"x_d", "x"} & names.keys():
        if {"x_d", "x"} <= names.keys() and not beside_error(source.names):
            instead = "; an error alone tells neither position: record one beside it"
        else:
            instead = f"; or the error beside one position, commanded − measured: {error_option(errors[0])} (where it "
            instead += f"is measured − commanded {error_option(errors[0], -1)}), in Python columns={{'error': NAME}}"
    return LogError(f"{source.path}: {there}; name {it}: {options}{of_python}{instead}")


def _stated(source: Source, name: str) -> str:
    """Return the unit that the file states of a column, empty if it states none."""
    return source.units.get(name, "") or stated_unit(name)[1]


def _time(source: Source, name: str) -> Column:
    if name in source.stamps:
        return Column(name, TIME_UNITS["s"], True)  # whatever is stated, such as hh:mm:ss or UTC
    text = _stated(source, name) or (name if len(name) > 3 and time_unit(name) else "")  # millis
    unit = time_unit(text) if text else TIME_UNITS["s"]
    if unit is None:
        raise LogError(
            f"{source.path}: time {brief(name)} must be in one of {', '.join(TIME_UNITS)}, its unit is {brief(text)}; "
            "correct it, or remove the column and give T_s (--T_s)"
        )
    return Column(name, unit, bool(text))


def _position(source: Source, name: str, given: str | None, error: int) -> Column:
    it = f"{source.path}: column {brief(name)}"
    if name in source.stamps:
        raise LogError(f"{it} must be a position, it holds timestamps; name another (--x_d, --x)")
    text = _stated(source, name)
    unit = position_unit(text) if text else None
    given = None if error and unit is not None else given  # an error may have a unit of its own
    counts = plain_name(text).rstrip("s") in COUNTS or (given is not None and unit is None and not _OTHERS.search(text))
    if counts and given is None:
        raise LogError(f"{it} is in encoder counts; give the length of one, such as unit='0.1um' (--unit 0.1um)")
    if text and unit is None and not counts:
        raise LogError(
            f"{it} must be a position in one of {', '.join(POSITION_UNITS)}, its unit is {brief(text)}; is it another "
            "quantity? Name another column (--x_d NAME, --x NAME), or give it (--unit)"
        )
    chosen = position_unit(given) if given is not None else None
    if unit is not None and chosen not in (None, unit):
        raise LogError(
            f"{source.path}: unit={brief(given)} (--unit {given}) was given, but column {brief(name)} states "
            f"{brief(text)}; leave the unit out, or correct the file"
        )
    chosen = chosen or unit or position_unit(source.assumed_units.get(name, ""))
    return Column(name, chosen or POSITION_UNITS["m"], chosen is not None, error)


@dataclass(frozen=True)
class _Channel:
    name: str
    unit: str  # as the file states it, or the format's convention; empty if there is none
    role: str  # what it is read as without a word of the user's, ``"t"``, ``"x_d"``, ``"x"`` or a signal


def channels(source: Source) -> list[_Channel]:
    """Return a file's columns with their units and roles, as far as they can be told; LogError if it has no names."""
    if source.names != [str(i) for i in range(len(source.names))]:  # as tables call them
        _check_names(source)
    roles: dict[str | None, str] = {}
    with suppress(LogError):  # there are several
        pair = _positions(source, {}, None)[0]
        roles.update((name, what) for what, name in signals_of(source.names, pair["x"] or "").items())
        roles.update((name, role) for role, name in pair.items())
    with suppress(LogError):
        known = _time_of(source, next((name for name, role in roles.items() if name and role == "x_d"), ""))
        roles[_only_time(source) if known is None else known] = "t"
    units = {**source.assumed_units, **source.units}
    return [_Channel(name, units.get(name) or stated_unit(name)[1], roles.get(name, "")) for name in source.names]


# Rates of their own


def side_by_side(source: Source, columns: Mapping[str, Column], *, resample: bool) -> tuple[Block, str]:
    """Return columns side by side, and what was done to them; empty if nothing was.

    Where commanded and measured position have times of their own that differ, both are taken at the times of the one
    that is sampled more slowly, between its first and last time in which there are both; the other is interpolated
    linearly, and refused where it has a gap: nothing is invented between samples.
    LogError if the times differ and ``resample`` is not set, or they cannot be.
    """
    names = {role: column.name for role, column in columns.items()}
    x_d, x = names["x_d"], names["x"]
    clocks = {name: source.times[name] for name in (x_d, x) if name in source.times}
    if len({*clocks.values()}) < 2 or names.get("t") != clocks[x_d]:
        return source.read(list(names.values())), ""
    read = {name: source.read((clock, name)).columns for name, clock in clocks.items()}
    if not all(len(t) for t, _ in read.values()):
        raise LogError(f"{source.path}: columns {brief(x_d)} and {brief(x)} need samples, got none")
    intervals = {name: (t[-1] - t[0]) / max(len(t) - 1, 1) for name, (t, _) in read.items()}
    (a, _), (b, _) = read.values()
    if len(a) == len(b) and (np.abs(a - b) <= _SAME * min(np.abs(list(intervals.values())))).all():
        return source.read(list(names.values())), ""
    unit = columns["t"].unit.factor
    rates = ", ".join(
        f"{brief(name)} has {len(t)} samples every {unit * intervals[name]:.6g} s" for name, (t, _) in read.items()
    )
    if not resample:
        raise LogError(
            f"{source.path}: columns are sampled at different times: {rates}; record them at one rate, or "
            "resample=True (--resample) takes both at the times of the slower one"
        )
    slow, fast = sorted((x, x_d), key=lambda name: -intervals[name])
    (at, values), (t, followed) = read[slow], read[fast]
    inside = (at >= max(a[0], b[0])) & (at <= min(a[-1], b[-1]))
    at, values = at[inside], values[inside]
    if not (np.diff(t) > 0.0).all():
        i = int(np.argmin(np.diff(t) > 0.0)) + 2
        raise LogError(f"{source.path}, sample {i}: time {brief(clocks[fast])} must increase to be resampled")
    after = np.searchsorted(t, at)
    apart = np.where(t[after] == at, 0.0, t[after] - t[np.maximum(after - 1, 0)])
    if (far := apart > _GAP * intervals[slow]).any():
        i = int(np.argmax(far))
        raise LogError(
            f"{source.path}: column {brief(fast)} has a gap of {apart[i]:.6g} at time {at[i]:.9g} and cannot be "
            "resampled; record it without, or both columns at one rate"
        )
    found = {slow: values, fast: np.interp(at, t, followed)}
    block = Block([found.get(name, at) for name in names.values()])
    return block, f"resampled onto the times of the slower column: {rates}"
