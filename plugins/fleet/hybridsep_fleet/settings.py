"""Task of a fleet: a log and an axis, and how they are read and fitted; paths, never data."""

import hashlib
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hybridsep.base.version import __version__
from hybridsep.logs.log import Log, read_log

from .results import key_of
from .sources import LogFile


@dataclass(frozen=True)
class FleetSettings:
    """How every log is read and fitted, or replayed."""

    Np: int | None = None
    # as of :func:`~hybridsep.logs.log.read_log`
    unit: str | None = None
    T_s: float | None = None
    columns: tuple[tuple[str, str], ...] = ()
    axes: tuple[str, ...] = ()  # axes that are read of a log with several; all if empty
    # folder of machine files, ``MACHINE.toml`` or ``MACHINE/machine.toml``, or with ``_AXIS``, with which logs are
    # replayed; empty to fit
    machines: str = ""
    # whether FMUs are built and reports written
    fmus: bool = True
    reports: bool = True

    def key(self) -> str:
        """Return a hash of the settings and of the machine files."""
        found = hashlib.sha256(repr(replace(self, machines="")).encode())
        there = (
            [*Path(self.machines).glob("*.toml"), *Path(self.machines).glob("*/machine.toml")] if self.machines else []
        )
        for path in sorted(there):
            found.update(path.as_posix().encode() + b"\0" + path.read_bytes())
        return found.hexdigest()

    def read(self, path: Path, axis: str) -> Log:
        """Read an axis of a log."""
        return read_log(path, columns=dict(self.columns), unit=self.unit, T_s=self.T_s, axis=axis or None)


@dataclass(frozen=True)
class Looked:
    """Log that has been looked at."""

    log: LogFile
    content: str  # hash of its content
    axes: tuple[str, ...]  # the axes that are wanted; one without a name where the format names none


@dataclass(frozen=True)
class AxisTask:
    """Axis of a log."""

    looked: Looked
    axis: str
    settings: FleetSettings
    settings_key: str
    out: str  # folder of the results
    run: str  # when the run began, ISO

    @property
    def key(self) -> str:
        """Key of its row."""
        return key_of(self.looked.content, self.axis, self.settings_key)

    def row(self) -> dict[str, Any]:
        """Return what is known of its row before the work."""
        log = self.looked.log
        return {
            "key": self.key,
            "url": log.url,
            "size": log.size,
            "stamp": log.stamp,
            "log": self.looked.content,
            "machine": log.machine,
            "axis": self.axis,
            "axes": json.dumps(self.looked.axes),
            "settings": self.settings_key,
            "recorded": log.recorded,
            "run": self.run,
            "version": __version__,
        }

    def failed(self, message: str) -> dict[str, Any]:
        """Return its row where there are no figures."""
        return {**self.row(), "status": "failed", "message": message}
