"""Stages of a long command, each kept in a JSON file as it is finished, so that a later run goes on from there."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from ..base.output import written_text
from ..base.version import __version__
from ..tune.recordings import Recording

__all__ = ["Stages", "key_of"]


_FORMAT = 3
"""Number of what the stages hold; it is counted up where that changes."""


def key_of(recordings: Iterable[Recording], options: object) -> str:
    """Return what a result depends on as a hash: the samples as they are used, the options, the version."""
    found = hashlib.sha256(f"{_FORMAT} {__version__} {options!r}".encode())
    for recording in recordings:
        found.update(f"{len(recording.x)} {recording.n_train}".encode())
        found.update(recording.x_d.tobytes() + recording.x.tobytes())
    return found.hexdigest()


class Stages:
    """Results by the name of their stage, kept in a file.

    Parameters
    ----------
    path : Path
        The JSON file.
    key : str
        What the results depend on; results of another key are not used.
    """

    def __init__(self, path: Path, key: str) -> None:
        self.path = path
        self.results: dict[str, Any] = {"hybridsep": __version__, "key": key}
        try:
            before = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return
        if isinstance(before, dict) and before.get("key") == key:
            self.results = before

    def result(self, name: str, make: Callable[[], Any]) -> Any:
        """Return the result of a stage: an earlier run's, or what ``make`` returns, plain values."""
        if name not in self.results:
            self.keep(name, make())
        return self.results[name]

    def keep(self, name: str, result: Any) -> None:
        """Keep a result, in the file as well."""
        self.results[name] = result
        with written_text(self.path) as file:
            file.write(json.dumps(self.results, indent=2) + "\n")
