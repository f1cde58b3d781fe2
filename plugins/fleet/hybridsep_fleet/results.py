"""Results of a fleet: a Parquet dataset that only grows, one row an axis of a log as it was then."""

import hashlib
import json
import uuid
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow
from pyarrow import parquet

from hybridsep.base.errors import StateError, first_line
from hybridsep.base.files import atomic_open

from .sources import LogFile

_FOLDER, _ENDING = "rows", ".parquet"

COLUMNS: Mapping[str, str] = {
    **dict.fromkeys(("key", "url", "stamp", "log", "machine", "axis", "settings", "recorded", "run"), "string"),
    **dict.fromkeys(("version", "status", "message", "unit", "verdict", "best", "advice"), "string"),
    **dict.fromkeys(("modes", "peers", "findings", "axes", "folder"), "string"),
    **dict.fromkeys(("size", "n_samples", "Np", "p", "q", "n_windows"), "int64"),
    **dict.fromkeys(("T_s", "dead_time", "rms_pb", "rms_hold", "rms_h", "ratio", "friction", "seconds"), "float64"),
}
"""Columns and their types. ``modes``, ``peers``, ``findings`` and ``axes`` hold JSON."""

_SCHEMA = pyarrow.schema([(name, getattr(pyarrow, kind)()) for name, kind in COLUMNS.items()])


def key_of(log: str, axis: str, settings: str) -> str:
    """Return the key of a row: a hash of the hashes of the log's content and of the settings, and the axis."""
    return hashlib.sha256(f"{log}\0{axis}\0{settings}".encode()).hexdigest()


class Results:
    """Rows in a folder; each :meth:`add` writes a file of its own, whole or not at all."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._rows = folder / _FOLDER

    def add(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Write rows; a column that a row leaves out is null."""
        if not rows:
            return
        self._rows.mkdir(parents=True, exist_ok=True)
        # Names increase with time, so that the last row of an axis is the latest
        name = f"{max(row['run'] for row in rows)}-{len(list(self._rows.iterdir())):06}-{uuid.uuid4().hex}"
        whole = [{column: row.get(column) for column in COLUMNS} for row in rows]
        with atomic_open(self._rows / f"{name.replace(':', '')}{_ENDING}") as file:
            parquet.write_table(pyarrow.Table.from_pylist(whole, schema=_SCHEMA), file)

    def rows(self) -> list[dict[str, Any]]:
        """Return all rows, the oldest first; StateError if a file is damaged."""
        found: list[dict[str, Any]] = []
        for path in sorted(self._rows.glob(f"*{_ENDING}")):
            try:
                found += parquet.read_table(path, schema=_SCHEMA).to_pylist()
            except (OSError, LookupError, TypeError, ValueError) as error:  # pyarrow's are of these
                raise StateError(
                    f"{path}: is damaged: {first_line(error)}; remove it, its logs are fitted again"
                ) from error
        return found

    def unfinished(self, logs: Iterable[LogFile], settings: str) -> list[LogFile]:
        """Return the logs that are new or changed, or of which an axis has no row with these settings."""
        done: dict[tuple[str, int, str], set[str]] = {}
        wanted: dict[tuple[str, int, str], set[str]] = {}
        for row in self.rows():
            if row["settings"] == settings:
                log = (row["url"], row["size"], row["stamp"])
                done.setdefault(log, set()).add(row["axis"])
                wanted[log] = set(json.loads(row["axes"]))
        return [
            log
            for log in logs
            if (known := (log.url, log.size, log.stamp)) not in done or not wanted[known] <= done[known]
        ]
