"""Readers of logs: whole (:func:`read_log`) or chunk by chunk (:func:`open_log`), with the same checks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..base.errors import LogError
from ..base.settings import check
from ..base.signals import Array
from .mat import MatSource
from .npz import NpzSource
from .source import Block, Source
from .text import TextSource
from .time_axis import TimeAxis

__all__ = ["UNITS", "Log", "LogReader", "check_reading", "open_log", "read_log"]

UNITS: Mapping[str, float] = {"m": 1.0, "mm": 1e-3, "um": 1e-6}
"""Units of a log's positions, in metres."""

SPAN_MAX = 100.0
"""Largest plausible travel of an axis, m; a larger one indicates a log in a smaller unit."""

TS_TOLERANCE = 0.01
"""Largest relative difference between a given ``T_s`` and the time column's: more than any clock's drift."""

_SOURCES: Mapping[str, type[Source]] = {
    ".csv": TextSource,
    ".tsv": TextSource,
    ".txt": TextSource,
    ".npz": NpzSource,
    ".mat": MatSource,
}
_ROLES = ("t", "x_d", "x")
_MEASURED = "x_meas"
"""Measured position in a file that calls the true one x; read before x unless a name is given."""

_BLOCK = 10_000


@dataclass(frozen=True)
class Log:
    """A recorded log.

    Attributes
    ----------
    t : (n,) array, s
        Times as recorded, or ``k·T_s`` if the file has no time column.
    x_d, x_meas : (n,) array, m
        Commanded and measured positions.
    T_s : float
        Sampling interval, s.
    path : Path
        The file.
    """

    t: Array
    x_d: Array
    x_meas: Array
    T_s: float
    path: Path


class LogReader:
    """Chunk-wise reader of a log; returned by :func:`open_log`.

    Opening scans the time column (``x_d`` if there is none), so that ``T_s`` is the mean over the whole file and an
    invalid time axis is reported before any prediction. No file stays open between calls.

    Attributes
    ----------
    path : Path
        The file.
    T_s : float
        Sampling interval, s: the given one, or the mean of the time column's, rounded to its significant digits.
    n_samples : int
        Samples in the log.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        columns: Mapping[str, str] | None = None,
        unit: str = "m",
        T_s: float | None = None,
    ) -> None:
        self.path = Path(path)
        given = check_reading(unit, T_s)
        self._unit = unit
        self._source = _open_source(self.path)
        self._names = _column_names(self._source, columns, time_needed=given is None)
        self.n_samples, found = self._scan()
        if given is not None and found is not None and abs(found - given) > TS_TOLERANCE * given:
            raise LogError(
                f"{self.path}: T_s = {given:g} s was given, but column {self._names['t']!r} has an interval of "
                f"{found:g} s; leave T_s out, or correct it or the column"
            )
        self.T_s = float(given or found or 0.0)  # one of them is there, both are > 0

    def chunks(self, n: int = _BLOCK) -> Iterator[tuple[Array, Array]]:
        """Iterate over the log as pairs ``(x_d, x_meas)``, m, of at most ``n`` samples each.

        Raises
        ------
        LogError
            When the next samples are invalid.
        """
        if n < 1:
            raise LogError(f"{self.path}: a chunk must have n ≥ 1 samples, got {n}")
        return ((x_d, x_meas) for x_d, x_meas in self._positions(n, ("x_d", "x")))

    def read(self) -> Log:
        """Return the whole log."""
        roles = ("x_d", "x", "t") if "t" in self._names else ("x_d", "x")
        columns = [np.concatenate(parts) for parts in zip(*self._positions(_BLOCK, roles), strict=True)]
        if len(columns) == 2:
            columns.append(np.arange(self.n_samples, dtype=np.float64) * self.T_s)
        x_d, x_meas, t = columns
        return Log(t, x_d, x_meas, self.T_s, self.path)

    def _positions(self, n: int, roles: tuple[str, ...]) -> Iterator[tuple[Array, ...]]:
        """Iterate over the columns ``roles``, the first two being positions, checked and in SI units."""
        names, metres = [self._names[role] for role in roles], UNITS[self._unit]
        lowest, highest, count = np.inf, -np.inf, 0
        for block in self._source.blocks(names, n):
            for name, column in zip(names, block.columns, strict=True):
                self._check_finite(block, name, column)
            x_d, x_meas = block.columns[0] * metres, block.columns[1] * metres
            lowest, highest = min(lowest, float(x_d.min())), max(highest, float(x_d.max()))
            if highest - lowest > SPAN_MAX:
                smaller = "um" if self._unit != "m" else "mm"
                raise LogError(
                    f"{self.path}: column {names[0]!r} read in {self._unit} spans {highest - lowest:.4g} m, more than "
                    f"{SPAN_MAX:g} m; if the log is in {smaller}, say unit='{smaller}' (--unit {smaller})"
                )
            count += len(x_d)
            yield (x_d, x_meas, *block.columns[2:])
        if count != self.n_samples:
            raise LogError(f"{self.path}: the file had {self.n_samples} samples when opened, now it has {count}")

    def _scan(self) -> tuple[int, float | None]:
        """Scan one column; return the number of samples and, if it is the time, the sampling interval."""
        role = "t" if "t" in self._names else "x_d"
        axis, count = TimeAxis(self.path, self._names[role]), 0
        for block in self._source.blocks([self._names[role]], _BLOCK):
            self._check_finite(block, self._names[role], block.columns[0])
            if role == "t":
                axis.extend(block)
            count += len(block.columns[0])
        if count < 2:
            raise LogError(f"{self.path}: a log needs at least 2 samples, got {count or 'none'}")
        return count, axis.interval() if role == "t" else None

    def _check_finite(self, block: Block, name: str, column: Array) -> None:
        finite = np.isfinite(column)
        if not finite.all():
            i = int(np.argmin(finite))
            raise LogError(f"{self.path}, {block.where(i)}: column {name!r} must be finite, got {column[i]}")


def check_reading(unit: str, T_s: float | None) -> float | None:
    """Return the given sampling interval, validated; LogError for an unknown unit."""
    if unit not in UNITS:
        raise LogError(f"unit must be one of {', '.join(UNITS)}, got {unit!r}")
    return None if T_s is None else float(check("T_s", T_s, label="T_s"))


def open_log(
    path: str | Path, *, columns: Mapping[str, str] | None = None, unit: str = "m", T_s: float | None = None
) -> LogReader:
    """Open a log for reading in bounded memory.

    CSV files are streamed by lines and ``.npz`` files by members; a ``.mat`` file is loaded whole by SciPy, so that its
    size is limited by the memory.

    Parameters
    ----------
    path : str or Path
        ``.csv`` (also ``.tsv``, ``.txt``; comma, semicolon, tab or blanks between columns), ``.npz`` or ``.mat``.
    columns : mapping, optional
        The file's names of ``"t"``, ``"x_d"`` and ``"x"``, the measured position, where they are others, such as
        ``{"x_d": "qg", "x": "qm"}``. Without a name for ``"x"``, ``x_meas`` is read where the file has it.
    unit : {"m", "mm", "um"}
        Unit of the file's positions.
    T_s : float, optional
        Sampling interval, s; needed only if the file has no time column, checked against that if it has.

    Returns
    -------
    LogReader

    Raises
    ------
    LogError
        If the file, its columns or its time axis cannot be used.
    """
    return LogReader(path, columns=columns, unit=unit, T_s=T_s)


def read_log(
    path: str | Path, *, columns: Mapping[str, str] | None = None, unit: str = "m", T_s: float | None = None
) -> Log:
    """Return a whole log; parameters and errors as for :func:`open_log`."""
    return LogReader(path, columns=columns, unit=unit, T_s=T_s).read()


def _open_source(path: Path) -> Source:
    if path.suffix.lower() not in _SOURCES:
        raise LogError(f"{path}: a log must be one of {', '.join(_SOURCES)}, got {path.suffix or 'no extension'!r}")
    try:
        if not path.is_file():
            raise LogError(f"{path}: there is no such file" if not path.exists() else f"{path}: is not a file")
        if path.stat().st_size == 0:
            raise LogError(f"{path}: the file is empty")
        return _SOURCES[path.suffix.lower()](path)
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror or error}") from error


def _column_names(source: Source, columns: Mapping[str, str] | None, *, time_needed: bool) -> dict[str, str]:
    """Return the file's names of the columns to read, by role."""
    for role in columns or ():
        if role not in _ROLES:
            raise LogError(f"{source.path}: columns may name {', '.join(_ROLES)}, got {role!r}")
    names = {role: role for role in _ROLES}
    if _MEASURED in source.names:
        names["x"] = _MEASURED
    names |= dict(columns or {})
    if names["t"] not in source.names and "t" not in (columns or {}) and not time_needed:
        del names["t"]
    for role, name in names.items():
        if name not in source.names:
            there = ", ".join(repr(other) for other in source.names) or "none"
            hint = "; give its name in columns, or T_s" if role == "t" else "; give its name in columns"
            what = repr(name) if name == role else f"{name!r} ({role})"
            raise LogError(f"{source.path}: column {what} is missing, the file has {there}{hint}{source.advice}")
        if source.names.count(name) > 1:
            raise LogError(f"{source.path}: column {name!r} must occur once, got it {source.names.count(name)} times")
    return names
