"""Readers of logs: whole (:func:`read_log`) or chunk by chunk (:func:`open_log`), with the same checks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np

from ..base.errors import LogError, brief
from ..base.settings import check
from ..base.signals import Array
from .columns import COUNT, Column, choose_columns, on_one_clock
from .formats import open_source
from .gaps import row_interval
from .source import NEEDS_TRUST, Block
from .time_axis import TimeAxis
from .units import POSITION_UNITS, UNIT_OPTIONS, Shown, position_unit, shown_of, stated_unit

__all__ = ["Log", "LogReader", "check_reading", "open_log", "read_log"]

SPAN_MAX: Mapping[str, float] = {"m": 100.0, "rad": 1e3}
"""Largest plausible travel of an axis, m or rad; a larger one indicates a log in a smaller unit."""

TS_TOLERANCE = 0.01
"""Largest relative difference between a given ``T_s`` and the time column's: more than any clock's drift."""

_SMALLER = {"m": "mm", "mm": "um", "um": "nm", "in": "mm", "rad": "deg"}
"""Unit that a log may be in if its travel is implausible in the key's."""

_OWN_NAMES = ("x_d", "x", "x_meas")
"""Names of columns of positions that leave no doubt."""

_BLOCK = 10_000


@dataclass(frozen=True)
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
    unit_stated : bool
        Whether the file or the caller stated the positions' unit.
    starts : tuple of int
        First samples of the segments, which gaps separate; the first is 0.
    remarks : tuple of str
        What the reader chose that the user may want to change.
    file_unit : str
        Unit of the positions in the file, in which they are shown; SI if left out.
    n_recorded : int
        Samples that were read from the file; as many as there are, if left out.
    T_recorded : float
        Mean interval between them, s, gaps aside; ``T_s`` if left out.
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

    @property
    def shown(self) -> Shown:
        """Units in which its positions are shown."""
        return shown_of(self.file_unit, self.unit)

    def segments(self) -> list[Log]:
        """Return each stretch without a gap as a log of its own."""
        ends = (*self.starts[1:], len(self.t))
        pieces = [slice(start, end) for start, end in zip(self.starts, ends, strict=True)]
        return [replace(self, t=self.t[s], x_d=self.x_d[s], x_meas=self.x_meas[s], starts=(0,)) for s in pieces]


class LogReader:
    """Chunk-wise reader of a log; returned by :func:`open_log`.

    Opening scans the time column (``x_d`` if there is none), so that ``T_s`` is the mean over the whole file and an
    invalid time axis is reported before any prediction. No file stays open between calls.

    Attributes
    ----------
    path : Path
        The file.
    T_s : float
        Sampling interval, s: the given one, or the mean of the time column's, gaps aside, rounded to the fewest digits
        within three of its standard errors.
    n_samples : int
        Samples in the log.
    is_even : bool
        Whether its times increase and none is missing; jitter counts only where ``uniform`` is true, and is refused.
    unit : {"m", "rad"}
        Unit of the positions that are returned.
    file_unit : str
        Their unit in the file.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        columns: Mapping[str, str] | None = None,
        unit: str | None = None,
        T_s: float | None = None,
        axis: str | None = None,
        uniform: bool = True,
        may_miss: bool | None = None,
        resample: bool = False,
    ) -> None:
        self.path = Path(path)
        given = check_reading(unit, T_s)
        self._source = open_source(self.path)
        chosen = choose_columns(self._source, columns, unit, axis=axis, time_needed=given is None)
        self._may_miss = not uniform if may_miss is None else may_miss
        self._source.commanded, self._source.measured = chosen["x_d"].name, chosen["x"].name
        self._source.may_miss = self._may_miss
        self._source, self._columns = on_one_clock(self._source, chosen, resample=resample)
        self.unit, self.file_unit = self._columns["x_d"].unit.si, self._columns["x_d"].unit.name
        self._guesses = list(self._guessed(columns or {}))
        self._uniform = uniform
        self._check_twins()
        self.is_even = True
        self.n_samples, self.T_s = self._scan(given)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What was chosen, left out or filled that the user may want to change."""
        return (*self._source.remarks, *self._guesses, *self._source.notes())

    def chunks(self, n: int = _BLOCK) -> Iterator[tuple[Array, Array]]:
        """Iterate over the log as pairs ``(x_d, x_meas)``, in :attr:`unit`, of at most ``n`` samples each.

        Raises
        ------
        LogError
            When the next samples are invalid.
        """
        if n < 1:
            raise LogError(f"{self.path}: a chunk must have n ≥ 1 samples, got {n}")
        return ((x_d, x_meas) for x_d, x_meas in self._signals(n, ("x_d", "x")))

    def read(self, most: int | None = None) -> Log:
        """Return the whole log, or at least its first ``most`` samples."""
        roles = ("x_d", "x", "t") if "t" in self._columns else ("x_d", "x")
        blocks = self._signals(_BLOCK, roles)
        if most is not None and most < self.n_samples:
            blocks = islice(blocks, -(-most // _BLOCK))
        columns = [np.concatenate(parts) for parts in zip(*blocks, strict=True)]
        if len(columns) == 2:
            columns.append(np.arange(len(columns[0]), dtype=np.float64) * self.T_s)
        x_d, x_meas, t = columns
        stated = self._columns["x_d"].stated and self._columns["x"].stated
        return Log(
            *(t, x_d, x_meas, self.T_s, self.path, self.unit, stated),
            remarks=self.remarks,
            file_unit=self.file_unit,
            n_recorded=len(t),
            T_recorded=row_interval(t, self.T_s),
        )

    def _signals(self, n: int, roles: tuple[str, ...]) -> Iterator[tuple[Array, ...]]:
        """Iterate over the columns ``roles``, the first being the commanded position, checked and in SI units."""
        columns = [self._columns[role] for role in roles]
        lowest, highest, count = np.inf, -np.inf, 0
        for block in self._source.blocks([column.name for column in columns], n):
            for column, values in zip(columns, block.columns, strict=True):
                self._check_finite(block, column.name, values, measured=column is self._columns["x"])
            with np.errstate(invalid="ignore"):  # a NaN may be a signalling one
                signals = [values * column.unit.factor for column, values in zip(columns, block.columns, strict=True)]
            x_d = signals[0]
            lowest, highest = min(lowest, float(x_d.min())), max(highest, float(x_d.max()))
            self._check_span(columns[0], highest - lowest)
            count += len(x_d)
            yield tuple(signals)
        if count != self.n_samples:
            raise LogError(f"{self.path}: the file had {self.n_samples} samples when opened, now it has {count}")

    def _guessed(self, given: Mapping[str, str]) -> Iterator[str]:
        """Yield a remark if a column of positions was recognised by a name other than the library's own."""
        known = {*_OWN_NAMES, *(name for pair in self._source.axes.values() for name in pair)}
        roles = [role for role in ("x_d", "x") if role not in given]
        if any(stated_unit(self._columns[role].name)[0] not in known for role in roles):
            x_d, x = brief(self._columns["x_d"].name), brief(self._columns["x"].name)
            yield (
                f"columns {x_d} and {x} are read as the commanded and the measured position; columns (--x_d, --x) name "
                "others"
            )

    def _check_span(self, column: Column, span: float) -> None:
        """Raise LogError if the commanded position spans more than any axis does."""
        si, largest = column.unit.si, SPAN_MAX[column.unit.si]
        if span > largest:
            smaller = _SMALLER.get(column.unit.name)
            hint = f"; if the log is in {smaller}, say unit='{smaller}' (--unit {smaller})" if smaller else ""
            hint += f", if it is in encoder counts, the length of one, {COUNT}" if smaller and si == "m" else ""
            error = LogError(
                f"{self.path}: column {brief(column.name)} read in {column.unit.name} spans {span:.4g} {si}, more than "
                f"{largest:g} {si}{hint}"
            )
            error.options = () if column.stated else UNIT_OPTIONS
            raise error

    def _check_twins(self) -> None:
        """Raise LogError if a column that is read occurs several times, with values that differ.

        Scopes write the time again beside each channel.
        """
        for role, column in self._columns.items():
            twins = self._source.twins.get(column.name, ())
            for block in self._source.blocks([column.name, *twins], _BLOCK) if twins else ():
                values = np.stack(block.columns)
                differ = ~((values == values[0]) | np.isnan(values) & np.isnan(values[0])).all(axis=0)
                if differ.any():
                    i = int(np.argmax(differ))
                    other = next(value for value in values[1:, i] if value != values[0, i])
                    ways = "export all channels with one common time, or remove" if role == "t" else "rename or remove"
                    raise LogError(
                        f"{self.path}, {block.where(i)}: column {brief(column.name)} occurs {1 + len(twins)} times, "
                        f"with different values, {values[0, i]:.9g} and {other:.9g}; {ways} those that are not meant"
                    )

    def _scan(self, given: float | None) -> tuple[int, float]:
        """Scan one column; return the number of samples and the sampling interval.

        A column of time that counts samples is an index: its place is taken by the given interval.
        """
        role = "t" if "t" in self._columns else "x_d"
        column = self._columns[role]
        axis, count = TimeAxis(self.path, column.name, uniform=self._uniform), 0
        for block in self._source.blocks([column.name], _BLOCK):
            self._check_finite(block, column.name, block.columns[0])
            if role == "t":
                axis.extend(Block([block.columns[0] * column.unit.factor], block.where))
            count += len(block.columns[0])
        if count < 2:
            raise LogError(f"{self.path}: a log needs at least 2 samples, got {count or 'none'}")
        if role != "t":
            return count, float(given or 0.0)  # given, as there is no time
        if axis.counts_samples and not column.stated:
            if given is None:
                raise LogError(
                    f"{self.path}: column {brief(column.name)} counts samples: it is an index, or a time in ms; "
                    f"give T_s (--T_s), or name its unit in the file, '{column.name:.60} [ms]'"
                )
            del self._columns["t"]
            return count, given
        found = axis.interval()
        self.is_even = self._uniform or axis.is_even
        if given is not None and abs(found - given) > TS_TOLERANCE * given:
            raise LogError(
                f"{self.path}: T_s = {given:g} s was given, but column {brief(column.name)} has an interval of "
                f"{found:g} s; leave T_s out, or correct it or the column"
            )
        return count, found if given is None else given

    def _check_finite(self, block: Block, name: str, column: Array, *, measured: bool = False) -> None:
        """Raise LogError if a value is infinite, or NaN and not a measurement that may miss."""
        finite = np.isfinite(column)
        if not finite.all():
            if measured and self._may_miss and not np.isinf(column).any():
                return
            i = int(np.argmax(np.isinf(column) if measured and self._may_miss else ~finite))
            hint = NEEDS_TRUST if measured and np.isnan(column[i]) else ""
            raise LogError(f"{self.path}, {block.where(i)}: column {brief(name)} must be finite, got {column[i]}{hint}")


def check_reading(unit: str | None, T_s: float | None) -> float | None:
    """Return the given sampling interval, validated; LogError for an unknown unit."""
    if unit is not None and position_unit(unit) is None:
        raise LogError(
            f"unit must be one of {', '.join(POSITION_UNITS)}, got {brief(unit)}; a multiple of one is said as 0.1um"
        )
    return None if T_s is None else float(check("T_s", T_s, label="T_s"))


def open_log(
    path: str | Path,
    *,
    columns: Mapping[str, str] | None = None,
    unit: str | None = None,
    T_s: float | None = None,
    axis: str | None = None,
    uniform: bool = True,
    may_miss: bool | None = None,
    resample: bool = False,
) -> LogReader:
    """Open a log for reading chunk by chunk.

    Columns are read whole, so that their size is limited by the memory. What a file is, its content tells.

    Parameters
    ----------
    path : str or Path
        Text (CSV, TSV; comma, semicolon, tab or blanks between columns; plain or in gzip), ``.npz``, ``.mat`` up to
        version 7, Parquet (with the extra ``parquet``), Siemens Capture JSON, SINUMERIK trace XML, TwinCAT Scope's CSV,
        LinuxCNC halscope.
    columns : mapping, optional
        The file's names of ``"t"``, ``"x_d"`` and ``"x"``, the measured position, where they are others, such as
        ``{"x_d": "qg", "x": "qm"}``; units in them may be left out. Without a name for ``"x"``, ``x_meas`` is read
        where the file has it. In text a time may be a clock timestamp, ``2026-03-05 10:20:30.001`` or a time of day,
        with its date in a column beside it or without; the only such column is ``"t"`` whatever its name.
    unit : str, optional
        Unit of the positions: m, mm, um, nm, in, or rad, mrad, urad, deg, rev for a rotary axis, or a multiple of
        one, ``0.1um``, such as an encoder's count. If left out, the unit in the columns' names (``x [mm]``), otherwise
        m.
    T_s : float, optional
        Sampling interval, s; needed only if the file has no time column or an index in its place; otherwise it is
        checked against the times.
    axis : str, optional
        Axis of a file that holds several, such as ``"X1"``.
    uniform : bool
        Whether an uneven time axis is refused; otherwise gaps, jitter and times out of order are left to
        :func:`hybridsep.intake.check.check`.
    may_miss : bool, optional
        Whether measured positions may be missing: NaN, in text ``nan`` or nothing. With trust a predictor replays them,
        and they are left out of an identification. If left out, where ``uniform`` is false, as the checks find them.
    resample : bool
        Whether columns that are sampled at rates of their own are taken at the times of the slower one; otherwise that
        is refused.

    Returns
    -------
    LogReader

    Raises
    ------
    LogError
        If the file, its columns or its time axis cannot be used.
    """
    return LogReader(
        path, columns=columns, unit=unit, T_s=T_s, axis=axis, uniform=uniform, may_miss=may_miss, resample=resample
    )


def read_log(
    path: str | Path,
    *,
    columns: Mapping[str, str] | None = None,
    unit: str | None = None,
    T_s: float | None = None,
    axis: str | None = None,
    uniform: bool = True,
    may_miss: bool | None = None,
    resample: bool = False,
) -> Log:
    """Return a whole log; parameters and errors as for :func:`open_log`."""
    return LogReader(
        path, columns=columns, unit=unit, T_s=T_s, axis=axis, uniform=uniform, may_miss=may_miss, resample=resample
    ).read()
