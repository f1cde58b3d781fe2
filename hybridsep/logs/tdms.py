"""NI TDMS files, read by npTDMS."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import LogError, brief
from ..base.signals import Array
from .extras import library, quiet, reading
from .records import RecordsSource
from .source import Channel, check_column

__all__ = ["TdmsSource"]

_FORMAT = "an NI TDMS file"

_UNITS = ("unit_string", "NI_UnitDescription", "Unit", "unit")
"""Properties of a channel that may hold its unit, by precedence."""


class TdmsSource(RecordsSource):
    """The channels of a TDMS file; a waveform's channels get a column of times from its ``wf_`` properties.

    A name that occurs once in the file is the channel's own; otherwise the group is put before it, ``group.x``. See
    "NI-TDM waveform properties" in NI's description of the format.
    """

    format = "NI TDMS"
    endings = (".tdms",)

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._module = library(path, "nptdms", "tdms", _FORMAT)
        self._keys: dict[str, tuple[str, str]] = {}
        self._grids: dict[str, tuple[float, float]] = {}
        self._kinds: dict[str, np.dtype[Any]] = {}
        self._firsts: dict[str, Any] = {}
        units, times = {}, {}
        with self._opened() as file, self._reading("it"):
            if file.file_status.incomplete_final_segment:
                raise LogError(f"{path}: is truncated: its last segment is incomplete")
            found = [channel for group in file.groups() for channel in group.channels()]
            counts = Counter(channel.name for channel in found)
            starts = [start for one in found if (start := _start(one)) is not None]
            for channel in found:
                name = channel.name if counts[channel.name] == 1 else f"{channel.group_name}.{channel.name}"
                self._keys[name], self.lengths[name] = (channel.group_name, channel.name), len(channel)
                self._kinds[name] = np.dtype(channel.dtype or "O")
                if unit := next((str(channel.properties[key]) for key in _UNITS if channel.properties.get(key)), ""):
                    units[name] = unit
                if grid := _grid(channel, starts):
                    times[name] = self._column_of(grid, len(channel))
        self.stamps = frozenset(name for name, kind in self._kinds.items() if kind.kind == "M")
        self.names = [*self._keys, *self._grids]
        self.units = {**units, **dict.fromkeys(self._grids, "s")}
        self.times = times

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it begins with the tag of a segment."""
        return head.startswith(b"TDSm")

    def channels(self) -> list[Channel]:
        """Return the columns with what the file says of them."""
        grids = {**{name: self._grids[t] for name, t in self.times.items()}, **self._grids}
        return [
            replace(one, n_samples=self.lengths[one.name], interval=grids[one.name][1] if one.name in grids else None)
            for one in super().channels()
        ]

    def _column_of(self, grid: tuple[float, float], n: int) -> str:
        """Return the column of times of a waveform, a new one if there is none."""
        for name, other in self._grids.items():
            if other == grid and self.lengths[name] == n:
                return name
        name = "time" if not self._grids else f"time#{len(self._grids) + 1}"
        while name in self._keys:
            name += "'"
        self._grids[name], self.lengths[name] = grid, n
        return name

    def _values(self, file: Any, name: str, start: int, n: int) -> Array:
        if name in self._grids:
            offset, interval = self._grids[name]
            return offset + interval * np.arange(start, start + n, dtype=np.float64)
        group, own = self._keys[name]
        if name not in self.stamps:
            check_column(self.path, name, (self.lengths[name],), self._kinds[name])
        with self._reading(f"column {brief(name)}"):
            values = file[group][own].read_data(offset=start, length=n)
            if name in self.stamps and len(values):
                first = self._firsts.setdefault(name, values[0])  # blocks begin with the first sample
                values = (values - first) / np.timedelta64(1, "us") * 1e-6
            return np.asarray(values, dtype=np.float64)

    @contextmanager
    def _opened(self) -> Iterator[Any]:
        with self._reading("it"):
            file = self._module.TdmsFile.open(self.path)
        try:
            yield file
        finally:
            file.close()

    @contextmanager
    def _reading(self, what: str) -> Iterator[None]:
        """Turn what npTDMS raises into LogError."""
        with reading(self.path, _FORMAT, what), quiet("nptdms"):
            yield


def _start(channel: Any) -> Any:
    """Return when a waveform begins, None if the file does not say."""
    start = channel.properties.get("wf_start_time")
    return start if isinstance(start, np.datetime64) else None


def _grid(channel: Any, starts: list[Any]) -> tuple[float, float] | None:
    """Return first time and interval of a waveform, s; None if it is none."""
    interval = channel.properties.get("wf_increment")
    if not isinstance(interval, (int, float, np.number)) or not 0.0 < float(interval) < np.inf:
        return None
    offset = channel.properties.get("wf_start_offset", 0.0)
    start = _start(channel)
    late = 0.0 if start is None else float((start - min(starts)) / np.timedelta64(1, "us")) * 1e-6
    return (float(offset) if isinstance(offset, (int, float, np.number)) else 0.0) + late, float(interval)
