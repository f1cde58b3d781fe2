"""Results of a fleet: a dataset that only grows, one row an axis of a log as it was then.

Its files are Parquet where pyarrow (extra ``fleet``) is installed, else JSON; both are read.
"""

from __future__ import annotations

import hashlib
import json
import uuid
from collections.abc import Iterable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ..base.errors import LogError, StateError, first_line
from ..base.output import written_whole
from ..logs.extras import library
from .sources import LogFile

__all__ = ["COLUMNS", "Results", "key_of"]

_FOLDER, _PARQUET, _JSON = "rows", ".parquet", ".json"

COLUMNS: Mapping[str, str] = {
    **dict.fromkeys(("key", "url", "stamp", "log", "machine", "axis", "settings", "recorded", "run"), "string"),
    **dict.fromkeys(("version", "status", "message", "unit", "verdict", "best", "advice"), "string"),
    **dict.fromkeys(("modes", "peers", "findings", "axes", "folder"), "string"),
    **dict.fromkeys(("size", "n_samples", "Np", "p", "q", "n_windows"), "int64"),
    **dict.fromkeys(("T_s", "dead_time", "rms_pb", "rms_hold", "rms_h", "ratio", "friction", "seconds"), "float64"),
}
"""Columns and their types. ``modes``, ``peers``, ``findings`` and ``axes`` hold JSON."""


def key_of(log: str, axis: str, settings: str) -> str:
    """Return the key of a row: a hash of the hashes of the log's content and of the settings, and the axis."""
    return hashlib.sha256(f"{log}\0{axis}\0{settings}".encode()).hexdigest()


class Results:
    """Rows in a folder; each :meth:`add` writes a file of its own, whole or not at all.

    Parameters
    ----------
    folder : Path
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._rows = folder / _FOLDER
        self._parquet = find_spec("pyarrow") is not None

    def add(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Write rows; a column that a row leaves out is null."""
        if not rows:
            return
        self._rows.mkdir(parents=True, exist_ok=True)
        # Names increase with time, so that the last row of an axis is the latest
        name = f"{max(row['run'] for row in rows)}-{len(list(self._rows.iterdir())):06}-{uuid.uuid4().hex}"
        path = self._rows / f"{name.replace(':', '')}{_PARQUET if self._parquet else _JSON}"
        whole = [{column: row.get(column) for column in COLUMNS} for row in rows]
        with written_whole(path) as file:
            if self._parquet:
                arrow, parquet = _arrow(path)
                parquet.write_table(arrow.Table.from_pylist(whole, schema=_schema(arrow)), file)
            else:
                file.write(json.dumps(whole).encode())

    def rows(self) -> list[dict[str, Any]]:
        """Return all rows, the oldest first.

        Raises
        ------
        StateError
            If a file is damaged.
        LogError
            If one is Parquet and pyarrow is not installed.
        """
        found: list[dict[str, Any]] = []
        paths = self._rows.iterdir() if self._rows.is_dir() else ()
        for path in sorted(path for path in paths if path.suffix in (_PARQUET, _JSON)):
            try:
                found += _read(path)
            except LogError:  # pyarrow is not installed
                raise
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


def _arrow(path: Path) -> tuple[Any, Any]:
    """Return pyarrow and its Parquet; LogError if they are not installed."""
    return tuple(library(path, name, "fleet", "Parquet") for name in ("pyarrow", "pyarrow.parquet"))


def _schema(arrow: Any) -> Any:
    return arrow.schema([(name, getattr(arrow, kind)()) for name, kind in COLUMNS.items()])


def _read(path: Path) -> list[dict[str, Any]]:
    """Return the rows of a file."""
    if path.suffix == _PARQUET:
        arrow, parquet = _arrow(path)
        rows: list[dict[str, Any]] = parquet.read_table(path, schema=_schema(arrow)).to_pylist()
        return rows
    return [{column: row[column] for column in COLUMNS} for row in json.loads(path.read_text(encoding="utf-8"))]
