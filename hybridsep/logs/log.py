"""Recorded logs: :class:`Log`, and :func:`read_log`, which reads one from a file of any format, or from arrays.

What changes a log keeps the file's meaning, or is asked for by an option. Each change returns another log and a line
that says what was done, empty where nothing was.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from numbers import Integral
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.errors import LogError, ParameterError, brief, check_kind
from ..base.settings import check
from ..base.signals import Array, Indices
from .arrays import TableSource
from .columns import Column, choose_columns, side_by_side, signal_columns
from .formats import open_source
from .names import SIGNALS
from .source import Block, Source
from .times import NOT_LATER, Times, recorded_times
from .units import POSITION_UNITS, DisplayUnits, position_unit, shown_of, stated_unit


class _Frame(Protocol):
    @property
    def columns(self) -> Any: ...


class _Dataset(Protocol):
    @property
    def data_vars(self) -> Any: ...


Table = _Frame | _Dataset | NDArray[np.void]  # of pandas, polars or Arrow; xarray; a structured array


@dataclass(frozen=True, eq=False)
class Log:
    """A recorded log.

    Positions are in metres, of a rotary axis in radians; ``unit`` says which. Where the library says metres, it means
    radians then: λ is in rad², a limit in rad/s.

    Attributes
    ----------
    t : (n,) array, s
        Times as recorded, from 0 where they are clock timestamps, or ``k·T_s`` if the file has no time column.
    x_d, x_meas : (n,) array, m or rad
        Commanded and measured positions; ``x_meas`` is NaN where it is missing, if it may be.
    T_s : float
        Sampling interval, s.
    path : Path
        The file.
    unit : {"m", "rad"}
        Unit of the positions.
    unit_stated, time_stated : bool
        Whether the file or the caller stated the positions' unit; and the times', or the interval.
    starts : tuple of int
        First samples of the segments, which gaps and clocks that were set back separate; the first is 0.
    remarks : tuple of str
        What was chosen and what was done to keep the file's meaning, each in a line.
    file_unit : str
        Unit of the positions in the file, in which they are shown; SI if left out.
    n_recorded : int
        Samples that were read from the file; as many as there are, if left out.
    T_recorded : float
        Interval between them, s; ``T_s`` if left out.
    columns : mapping of str to str
        Names of the columns by role, ``"x_d"`` and ``"x"``, or one of them and ``"error"``.
    signals : mapping of str to (n,) array, m or rad
        What the controller itself says beside the pair, as far as its recorder has it, by the names of
        :data:`hybridsep.logs.names.SIGNALS`: ``"planned_position"``, ``"following_error"``.
    """

    t: Array
    x_d: Array
    x_meas: Array
    T_s: float
    path: Path
    unit: str = "m"
    unit_stated: bool = False
    starts: tuple[int, ...] = (0,)
    remarks: tuple[str, ...] = ()
    file_unit: str = ""
    n_recorded: int = 0
    T_recorded: float = 0.0
    columns: Mapping[str, str] = field(default_factory=lambda: {"x_d": "x_d", "x": "x"})
    signals: Mapping[str, Array] = field(default_factory=dict)
    time_stated: bool = True

    @property
    def shown(self) -> DisplayUnits:
        """Units in which its positions are shown."""
        return shown_of(self.file_unit, self.unit)

    def segments(self) -> "list[Log]":
        """Return each stretch without a gap as a log of its own."""
        return [_at(replace(self, starts=(0,)), slice(*piece)) for piece in pairwise((*self.starts, len(self.t)))]


def read_log(
    recording: str | Path | Mapping[str, ArrayLike] | Table,
    *,
    columns: Mapping[str, str] | None = None,
    unit: str | None = None,
    T_s: float | None = None,
    axis: str | None = None,
    delay: int = 0,
    resample: bool = False,
) -> Log:
    """Read a log as it was recorded: in the order of the file, every sample. Its units are said here, and nowhere else.

    Measured positions that are missing are NaN; longer gaps, and times that go back, begin another segment. What keeps
    the file's meaning is done, and said in :attr:`Log.remarks`: the page on formats of logs tells what.

    Parameters
    ----------
    recording : str, Path, mapping or table
        A file in a format of :mod:`hybridsep.logs.formats`; what it is, its content tells. Or columns in memory:
        ``{"x_d": x_d, "x": x}``, a structured array, or a table of pandas, polars, Arrow or xarray, with its index of
        times or numbers. What is masked, None or NA is missing; a quantity has its unit.
    columns : mapping, optional
        The file's names of ``"t"``, ``"x_d"`` and ``"x"``, the measured position, where they are others, such as
        ``{"x_d": "qg", "x": "qm"}``; units in them may be left out. Without a name for ``"x"``, ``x_meas`` is read
        where the file has it. An ``"error"``, commanded − measured, tells the position of the two that the file does
        not have; ``"-name"`` is one that is measured − commanded.
    unit : str, optional
        Unit of the positions: m, mm, um, nm, in, or rad, mrad, urad, deg, rev for a rotary axis, or a multiple of
        one, ``0.1um``, such as an encoder's count. If left out, that in the columns' names (``x [mm]``), or m.
    T_s : float, optional
        Sampling interval, s; needed if no column of times tells it, otherwise it is checked against the times.
    axis : str, optional
        Axis of a file that holds several, such as ``"X1"``; of a matrix the column, ``"0"``.
    delay : int
        Samples by which the measured position is recorded too late, negative: too early; it is shifted back.
    resample : bool
        Whether columns of rates of their own are taken at the times of the slower one, and uneven times at even ones,
        linearly between samples.

    Raises
    ------
    LogError
        If the file, its columns or its times cannot be used.
    """
    given = check_reading(unit, T_s)
    check_kind(Mapping | None, columns=columns)
    check_kind(Integral, delay=delay)
    if isinstance(recording, str | Path):
        source: Source = open_source(Path(recording))
    elif is_table(recording):
        source = TableSource(recording)
    else:
        got = type(recording).__name__
        raise LogError(f"a log is a file, a mapping of columns or a table, got {got}; x beside x_d?")
    path = source.path
    chosen = choose_columns(source, columns, unit, axis=axis, time_needed=given is None)
    pair = {role: chosen[role] for role in ("x_d", "x")}
    if not pair["x_d"].error:  # else a command's sample is missing with either of them
        source.commanded, source.measured = chosen["x_d"].name, chosen["x"].name
    _check_twins(source, chosen)
    chosen = {**chosen, **signal_columns(source, chosen)}
    block, resampling = side_by_side(source, chosen, resample=resample)
    read, repeats = _without_repeats(_checked(path, block, chosen))
    _check_alternation(path, read.get("t", np.arange(2.0)), read["x_d"], read["x"])
    own = {what: chosen[what].unit.factor * read[what] for what in SIGNALS if what in chosen}
    signals = {what: values for what, values in own.items() if not np.isnan(values).all()}
    x_d, x_meas = (chosen[role].unit.factor * read[role] for role in ("x_d", "x"))
    x_meas = x_d - e * x_meas if (e := pair["x"].error) else x_meas
    x_d = x_meas + e * x_d if (e := pair["x_d"].error) else x_d
    time = chosen.get("t")
    if time is None:
        T_s = given or 0.0  # given, as there is no time
        times = Times(np.arange(len(x_d), dtype=np.float64) * T_s, T_s)
    else:
        times = recorded_times(path, time.name, read["t"], time.unit.factor, stated=time.stated, given=given)
    log = Log(
        *(times.t, x_d, x_meas, times.T_s, path, chosen["x_d"].unit.si),
        unit_stated=chosen["x_d"].stated and chosen["x"].stated,
        time_stated=given is not None or (time is not None and time.stated),
        starts=times.starts,
        file_unit=chosen["x_d"].unit.name,
        n_recorded=len(x_d),
        T_recorded=times.T_s,
        columns={"error" if one.error else role: "-" * (one.error < 0) + one.name for role, one in pair.items()},
        signals=signals,
    )
    remarks = [*source.remarks, resampling, repeats, *_guessed(source, chosen, columns or {}), *source.notes()]
    remarks += times.remarks
    for change, wanted in (
        (whole_turns, log.unit == "rad"),
        (partial(_even, lost=times.lost), times.lost is not None),
        (_at_sensor_phase, chosen["x"].name != chosen["x_d"].name),  # only commands may be held
        (partial(_shifted, delay=int(delay)), delay != 0),
        (_even, resample),
    ):
        if wanted:
            log, said = change(log)
            remarks.append(said)
    return replace(log, remarks=tuple(filter(None, remarks)))


def is_table(given: Any) -> bool:
    """Return whether it is a mapping of columns, or a table of pandas, polars, Arrow, xarray or NumPy's fields."""
    marks = ("collect", "columns", "column_names", "data_vars")  # in order: polars warns of a LazyFrame's columns
    fields = getattr(getattr(given, "dtype", None), "names", None)
    return not isinstance(given, Log) and (
        isinstance(given, Mapping) or isinstance(fields, tuple) or any(hasattr(given, mark) for mark in marks)
    )


def _checked(path: Path, block: Block, columns: Mapping[str, Column]) -> dict[str, Array]:
    """Return the columns by role as they are in the file, checked to be finite; LogError for fewer than 2 samples."""
    read = dict(zip(columns, block.columns, strict=True))
    n = len(read["x_d"])
    if n < 2:
        raise LogError(f"{path}: a log needs at least 2 samples, got {n or 'none'}")
    for role, column in columns.items():
        may_miss = role not in ("t", "x_d") and not columns["x_d"].error
        wrong = np.isinf(read[role]) if may_miss else ~np.isfinite(read[role])
        if wrong.any():
            i = int(np.argmax(wrong))
            raise LogError(f"{path}, {block.where(i)}: column {brief(column.name)} must be finite, got {read[role][i]}")
    if np.isnan(read["x"]).all():
        raise LogError(f"{path}: the measured position is missing (NaN) in all {n} samples; name its column (--x)")
    return read


def _without_repeats(read: dict[str, Array]) -> tuple[dict[str, Array], str]:
    """Return the columns without rows that repeat the one before, time included, and how many these are, in words.

    Where others repeat only a time, or many rows do, times are rounded, and all rows stay.
    """
    n = len(read["x_d"])
    same = {role: (one[1:] == one[:-1]) | (np.isnan(one[1:]) & np.isnan(one[:-1])) for role, one in read.items()}
    again = np.all(list(same.values()), axis=0)
    repeats = np.flatnonzero(again) + 1
    if "t" not in read or not 0 < len(repeats) < NOT_LATER * n or (same["t"] & ~again).any():
        return read, ""
    said = f"{len(repeats)} of {n} rows repeat the one before, time included, first row {repeats[0] + 1}: left out"
    return {role: np.delete(one, repeats) for role, one in read.items()}, said


def _check_alternation(path: Path, t: Array, x_d: Array, x: Array) -> None:
    """Raise LogError if rows of k axes follow each other: times repeat, and positions move far less over k rows."""
    k = round(len(t) / (np.count_nonzero(np.diff(t)) + 1))
    both = np.stack((x_d, x))
    over_k, over_1, over_2 = (np.nansum(np.abs(both[:, n:] - both[:, :-n]), axis=1) for n in (k, 1, 2))
    if 1 < k < len(t) and (over_k < 0.2 * over_1).all() and (k == 2 or (over_1 > 0.6 * over_2).all()):  # not smooth
        raise LogError(f"{path}: rows of {k} axes follow each other; write those of one into a file of their own")


def _guessed(source: Source, columns: Mapping[str, Column], given: Mapping[str, str]) -> Iterator[str]:
    """Yield a remark if a column of positions was recognised by a name other than the library's own."""
    known = {"x_d", "x", "x_meas", *(name for pair in source.axes.values() for name in pair)}
    roles = [role for role in ("x_d", "x") if role not in given and "error" not in given]
    if any(stated_unit(columns[role].name)[0] not in known for role in roles):
        x_d, x = brief(columns["x_d"].name), brief(columns["x"].name)
        yield f"columns {x_d} and {x} are read as the commanded and the measured position (--x_d, --x)"


def _check_twins(source: Source, columns: Mapping[str, Column]) -> None:
    """Raise LogError if a column occurs several times with values that differ, as times beside channels may."""
    for role, column in columns.items():
        twins: Sequence[str] = source.twins.get(column.name, ())
        if not twins:
            continue
        whole = source.read([column.name, *twins])
        values = np.stack(whole.columns)
        differ = ~((values == values[0]) | np.isnan(values) & np.isnan(values[0])).all(axis=0)
        if differ.any():
            i = int(np.argmax(differ))
            other = next(value for value in values[1:, i] if value != values[0, i])
            ways = "export all channels with one common time, or remove" if role == "t" else "rename or remove"
            raise LogError(
                f"{source.path}, {whole.where(i)}: column {brief(column.name)} occurs {1 + len(twins)} times, "
                f"with different values, {values[0, i]:.9g} and {other:.9g}; {ways} those that are not meant"
            )


def check_reading(unit: str | None, T_s: float | None) -> float | None:
    """Return the given sampling interval, validated; LogError for an unknown unit."""
    if unit is not None and (not isinstance(unit, str) or position_unit(unit) is None):
        raise LogError(f"unit must be one of {', '.join(POSITION_UNITS)}, got {brief(unit)}; a multiple is 0.1um")
    return None if T_s is None else float(check("T_s", T_s))


# Changes --------------------------------------------------------------------------------------------------------------

_TURN = 2 * math.pi

_ONE_PHASE, _CHANGES = 0.95, 50
"""Share of a slow sensor's changes that come in one sample of every n, which no other log of a hundred reached for any
n, and fewest changes that show it."""

_UNEVEN = 0.05
"""Relative difference of an interval from the log's from which it counts as uneven: at a feed rate of 80 mm/s and
1 kHz, 5 % of an interval are 4 µm of travel, comparable to the noise of an encoder."""


def _at(log: Log, which: slice | Indices) -> Log:
    """Return a log of some samples of another; the segments remain where they are."""
    signals = {what: values[which] for what, values in log.signals.items()}
    return replace(log, t=log.t[which], x_d=log.x_d[which], x_meas=log.x_meas[which], signals=signals)


def whole_turns(given: Log) -> tuple[Log, str]:
    """Return a rotary axis's log without the jumps of positions modulo one turn."""
    jumps = [_turn_jumps(x) for x in (given.x_d, given.x_meas)]
    n = sum(map(len, jumps))
    if not n:
        return given, ""
    x_d, x_meas = np.unwrap(given.x_d, period=_TURN), given.x_meas.copy()
    known = np.isfinite(x_meas)
    x_meas[known] = np.unwrap(x_meas[known], period=_TURN)
    x_meas -= _TURN * np.round(np.median(x_meas[known] - x_d[known]) / _TURN)
    # A command may well jump by one turn: the axis then follows it through, and loses it if the jump is taken out.
    if _error(x_d, x_meas) > 1.001 * _error(given.x_d, given.x_meas):  # one may be made of the other and their error
        return given, ""
    first = min(int(where[0]) for where in jumps if len(where))
    said = f"{n} jumps of a whole turn, the first at sample {first + 1}: both positions are unwrapped"
    return replace(given, x_d=x_d, x_meas=x_meas), said


def _turn_jumps(x: Array) -> Indices:
    """Return the samples at which a position, NaN where it is missing, is all its turns away from where it was."""
    known = np.flatnonzero(np.isfinite(x))
    steps = np.diff(x[known])
    turns = _TURN * max(round(float(np.ptp(x[known])) / _TURN), 1) if len(known) > 1 else 0.0
    if not turns or np.ptp(x[known]) > turns + 0.05 * _TURN:  # whole turns with their noise
        return np.empty(0, dtype=np.intp)
    far = np.abs(steps) > _TURN / 2
    usual = float(np.abs(steps[~far]).max(initial=0.0))
    off = np.abs(np.abs(steps) - turns)
    return np.asarray(known[1:][far & (off < 3.0 * usual) & (off < _TURN / 2)])  # a jump is a turn and a step


def _error(x_d: Array, x_meas: Array) -> float:
    """Return the RMS of the servo error around its median."""
    error = x_d - x_meas
    error = error[np.isfinite(error)]
    return float(np.sqrt(np.mean((error - np.median(error)) ** 2)))


def _at_sensor_phase(given: Log) -> tuple[Log, str]:
    """Return the log of the samples in which a slow sensor is new, where the measurement is renewed every n samples.

    In a log of its controller's cycle such a sensor's position is held between; no model follows its steps.
    """
    changes = np.diff(given.x_meas)
    at = np.flatnonzero(np.isfinite(changes) & (changes != 0.0)) + 1
    sizes = np.abs(changes[at - 1])
    if len(at) < _CHANGES or np.isclose(np.median(sizes), sizes.min()):  # steps of an encoder that moves evenly
        return given, ""
    usual = int(np.bincount(np.diff(at)).argmax())  # a multiple of the period
    for n in (usual // k for k in range(1, usual) if usual % k == 0):
        share = float(np.bincount(at % n).max()) / len(at)
        if share < _ONE_PHASE:
            continue
        parts = []
        for start, end in pairwise((*given.starts, len(given.t))):
            own = at[(at > start) & (at < end)]
            phase = int(np.bincount(own % n).argmax()) if len(own) else start % n
            parts.append(_at(given, np.arange(start + (phase - start) % n, end, n)))
        said = (
            f"the measured position is renewed every {n} samples ({100 * share:.4g} % of its changes come in one of "
            f"{n}): the samples in which it is new are taken, {n * given.T_s:g} s apart"
        )
        return replace(_joined([part for part in parts if len(part.t)]), T_s=n * given.T_s), said
    return given, ""


def _shifted(given: Log, delay: int) -> tuple[Log, str]:
    """Return the log with its measured position ``delay`` samples earlier, or later if that is negative.

    Of each segment the samples are left out at whose instants nothing was measured then.

    ParameterError if no segment is as long.
    """
    parts = [part for part in given.segments() if len(part.t) > abs(delay)]
    if not parts:
        raise ParameterError(f"--delay must be less than the samples of a segment, got {delay}")
    here, there = (slice(max(n, 0), min(n, 0) or None) for n in (-delay, delay))
    parts = [replace(_at(part, here), x_meas=part.x_meas[there]) for part in parts]
    way = f"{abs(delay)} samples {'earlier' if delay > 0 else 'later'}"
    return _joined(parts), f"the measured position is taken {way} than recorded (--delay {delay})"


def uneven(t: Array, T_s: float, starts: tuple[int, ...]) -> Indices:
    """Return the samples, first ones of segments aside, whose intervals are not the log's."""
    deviations = np.abs(np.diff(t) / T_s - 1.0)
    deviations[np.array(starts[1:], dtype=np.intp) - 1] = 0.0
    return np.asarray(np.flatnonzero(deviations > _UNEVEN) + 1)


def _even(given: Log, lost: Indices | None = None) -> tuple[Log, str]:
    """Return the log with a row for each of those ``lost`` before each sample, (n,); without them at even times.

    The command is the cubic through its neighbours, or at times of a clock, which may repeat, linear between them.
    """
    if lost is None and not len(uneven(given.t, given.T_s, given.starts)):
        return given, ""
    places = given.t / given.T_s if lost is None else np.arange(float(len(lost))) + np.cumsum(lost)
    parts = []
    for part, own in zip(given.segments(), np.split(places, given.starts[1:]), strict=True):
        rows = own - own[0]
        at = np.arange(int(rows[-1] + 1e-6) + 1)
        x_d = np.interp(at, rows, part.x_d) if lost is None else _cubic(rows, part.x_d, at)
        x_meas, *signals = (_between(rows, x, at) for x in (part.x_meas, *part.signals.values()))
        taken = dict(zip(part.signals, signals, strict=True))
        parts.append(replace(part, t=np.interp(at, rows, part.t), x_d=x_d, x_meas=x_meas, signals=taken))
    said = f"taken at even times, {given.T_s:g} s apart, linearly between samples (--resample)"
    return _joined(parts), said if lost is None else ""


def _cubic(rows: Array, x: Array, at: Indices) -> Array:
    """Return a signal between its samples: Newton's polynomial through the two on either side, at an end the next."""
    n = min(4, len(rows))
    near = np.clip(np.searchsorted(rows, at) - 2, 0, len(rows) - n)[:, None] + np.arange(n)
    order = np.argsort(np.abs(rows[near] - at[:, None]), axis=1)  # exact at a sample, which is the first then
    near = np.take_along_axis(near, order, axis=1)
    places, differences, found = rows[near], x[near], np.zeros(len(at))
    for k in range(1, n):
        differences[:, k:] = np.diff(differences[:, k - 1 :]) / (places[:, k:] - places[:, :-k])
    for k in reversed(range(n)):
        found = differences[:, k] + (at - places[:, k]) * found
    return found


def _between(rows: Array, x: Array, at: Indices) -> Array:
    """Return a signal linearly between its known samples, NaN over half a row from the nearest one."""
    rows, x = rows[np.isfinite(x)], x[np.isfinite(x)]
    if not len(rows):
        return np.full(len(at), np.nan)
    nearest = rows[np.searchsorted((rows[1:] + rows[:-1]) / 2, at)]
    return np.where(np.abs(nearest - at) > 0.5, np.nan, np.interp(at, rows, x))


def _joined(parts: list[Log]) -> Log:
    """Return one log of several, each of which begins a segment."""
    starts = np.cumsum([0, *(len(part.t) for part in parts[:-1])])
    t, x_d, x_meas = (np.concatenate([getattr(part, what) for part in parts]) for what in ("t", "x_d", "x_meas"))
    signals = {what: np.concatenate([part.signals[what] for part in parts]) for what in parts[0].signals}
    return replace(parts[0], t=t, x_d=x_d, x_meas=x_meas, starts=tuple(starts.tolist()), signals=signals)
