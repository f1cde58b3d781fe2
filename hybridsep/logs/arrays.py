"""Formats of named arrays that a C library reads whole, in a child process.

A damaged file can crash SciPy's reader (99 of 6300 random mutations of a ``.mat`` file did); in a child process that is
an error message.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

import numpy as np

from ..base.errors import LogError, brief, first_line
from .source import Block, Source, check_column, check_lengths, sample_number

__all__ = ["ArraysSource"]

_CHILD = Path(__file__).with_name("_arrays_child.py")


class ArraysSource(Source):
    """Vectors of a file that is read whole, so that its size is limited by the memory.

    Attributes
    ----------
    kind : str
        The child's name of the format.
    library : str
        The library that reads it, for messages.
    """

    kind: ClassVar[str]
    library: ClassVar[str]

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with TemporaryDirectory() as folder:
            self._variables = self._read(folder)
        self.names = list(self._variables)

    def without_library(self) -> str:
        """Return what to do where the library is not installed."""
        return f"is a {self.format} file; install {self.library} to read it"

    def _read(self, folder: str) -> dict[str, Any]:
        """Return the child's description of each variable, with the array as ``value`` where it is numeric."""
        paths, file = json.dumps(sys.path), str(self.path.absolute())
        command = [sys.executable, "-I", str(_CHILD), self.kind, paths, file, folder]
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
        damaged = f"{self.path}: is truncated, damaged or not a {self.format} file"
        if done.returncode < 0:
            end = signal.Signals(-done.returncode).name
            raise LogError(f"{damaged}: {self.library} crashed on it with {end}")
        if done.returncode:
            reason = "".join(done.stderr.strip().splitlines()[-1:])
            raise LogError(
                f"{self.path}: the process that reads it ended with status {done.returncode}: {first_line(reason)}"
            )
        answer = json.loads(done.stdout)
        if "missing" in answer:
            raise LogError(f"{self.path}: {self.without_library()}")
        if "damage" in answer:
            raise LogError(f"{damaged}: {first_line(answer['damage'])}")
        variables: dict[str, Any] = answer["variables"]
        for variable in variables.values():
            if "i" in variable:
                variable["value"] = np.load(Path(folder) / f"{variable['i']}.npy", allow_pickle=False)
        return variables

    def blocks(self, names: Sequence[str], n: int) -> Iterator[Block]:
        """Iterate over the columns ``names`` in blocks of at most ``n`` samples."""
        lengths, columns = {}, []
        for name in names:
            variable = self._variables[name]
            if "shape" not in variable:
                raise LogError(f"{self.path}: column {brief(name)} must be a full matrix, got {variable['type']}")
            lengths[name] = check_column(self.path, name, tuple(variable["shape"]), np.dtype(variable["dtype"]))
            columns.append(variable["value"].astype(np.float64).ravel())
        check_lengths(self.path, lengths)
        for i in range(0, lengths[names[0]], n):
            yield Block([column[i : i + n] for column in columns], sample_number(i))
