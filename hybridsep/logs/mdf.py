"""ASAM MDF files, versions 3 and 4, read by asammdf."""

from __future__ import annotations

import gc
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import numpy as np

from ..base.errors import brief
from ..base.signals import Array
from .extras import library, quiet, reading, refusal
from .records import RecordsSource
from .source import Channel, check_column

__all__ = ["MdfSource"]

_FORMAT = "an ASAM MDF file"


class MdfSource(RecordsSource):
    """The channels of an MDF file; each group has times of its own.

    A name that occurs once in the file is the channel's own; otherwise the group is put before it, ``group2.x``.
    """

    format = "ASAM MDF"
    endings = (".mf4", ".mdf", ".mf3", ".dat")

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._module = library(path, "asammdf", "mdf", _FORMAT)
        self._places: dict[str, tuple[int, int]] = {}
        self._intervals: dict[int, float] = {}
        units: dict[str, str] = {}
        with self._opened() as file, self._reading("it"):
            found = [(g, i, channel) for g, group in enumerate(file.groups) for i, channel in enumerate(group.channels)]
            counts = Counter(channel.name for _, _, channel in found)
            for g, i, channel in found:
                name = channel.name if counts[channel.name] == 1 else f"group{g}.{channel.name}"
                self._places[name] = (g, i)
                self.lengths[name] = int(file.groups[g].channel_group.cycles_nr)
                if unit := channel.unit or getattr(channel.conversion, "unit", ""):
                    units[name] = str(unit)
            names = {place: name for name, place in self._places.items()}
            masters = {g: names[g, i] for g, i in file.masters_db.items() if (g, i) in names}
            for g, name in masters.items():
                if (n := self.lengths[name]) > 1:
                    ends = [float(file.get_master(g, record_offset=i, record_count=1)[0]) for i in (0, n - 1)]
                    self._intervals[g] = (ends[1] - ends[0]) / (n - 1)
        self.names, self.units = list(self._places), units
        self.times = {name: masters[g] for name, (g, _) in self._places.items() if g in masters and masters[g] != name}

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it begins as a finished or an unfinished MDF file."""
        return head.startswith((b"MDF     ", b"UnFinMF "))

    def channels(self) -> list[Channel]:
        """Return the columns with what the file says of them."""
        return [
            replace(one, n_samples=self.lengths[one.name], interval=self._intervals.get(self._places[one.name][0]))
            for one in super().channels()
        ]

    def _values(self, file: Any, name: str, start: int, n: int) -> Array:
        """Return values in the channel's unit; NaN where the file has them invalid."""
        group, index = self._places[name]
        with self._reading(f"column {brief(name)}"):
            values, invalid = file.get(
                group=group,
                index=index,
                samples_only=True,
                record_offset=start,
                record_count=n,
                ignore_invalidation_bits=True,
            )
        check_column(self.path, name, values.shape, values.dtype)
        found: Array = values.astype(np.float64).ravel()
        if invalid is not None:
            found[np.asarray(invalid, dtype=np.bool_)] = np.nan
        return found

    @contextmanager
    def _opened(self) -> Iterator[Any]:
        # Of an open file asammdf reads the records that it is asked for; of a path, it may read a column whole
        with self.path.open("rb") as content:
            file = self._open(content)
            try:
                yield file
            finally:
                file.close()

    def _open(self, content: IO[bytes]) -> Any:
        with quiet("asammdf"):
            try:
                return self._module.MDF(content, process_bus_logging=False)
            except MemoryError:
                raise
            except Exception as error:  # a damaged file makes it fail in nearly every way there is
                refused = refusal(self.path, _FORMAT, error, "it")
            hook, sys.unraisablehook = sys.unraisablehook, lambda _: None
            gc.collect()  # a file that is half open fails again, and says so, as its object ends
            sys.unraisablehook = hook
        raise refused

    @contextmanager
    def _reading(self, what: str) -> Iterator[None]:
        """Turn what asammdf raises into LogError."""
        with reading(self.path, _FORMAT, what), quiet("asammdf"), redirect_stdout(None):  # it prints how fast it is
            yield
