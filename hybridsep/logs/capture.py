"""Siemens Capture JSON: signals of all axes of a SINUMERIK, one row an interpolation cycle."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import LogError, brief, first_line
from ..base.signals import Array
from .source import ArraysSource

__all__ = ["CaptureSource"]

_SIGNALS = b'"SignalListHFData"'
_COUNTER, _COMMANDED, _MEASURED = "CYCLE", "DES_POS", "ENC_POS"
_TIME = "t"
"""Name of the time column, which is made from the counter of cycles."""

_ROTARY = ("A", "B", "C", "SP", "S")
"""Beginnings of the names of rotary axes and spindles, whose positions are in degrees; others are in millimetres."""


class CaptureSource(ArraysSource):
    """Recording of a Siemens controller in Capture's JSON, read whole.

    The columns are the high-frequency signals under their own names, such as ``DES_POS|1``, and ``t`` from ``CYCLE``.
    Without a choice, the first axis whose commanded position moves is read.
    """

    format = "Siemens Capture JSON"
    endings = (".json",)

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        try:
            content = json.loads(path.read_bytes())
        except (ValueError, RecursionError) as error:
            raise LogError(f"{path}: is truncated, damaged or not JSON: {first_line(error)}") from error
        header = _entry(path, content, "Header", dict)
        signals = _entry(path, header, "SignalListHFData", list, "Header.")
        for i, signal in enumerate(signals):
            if not (isinstance(signal, dict) and all(isinstance(signal.get(key), str) for key in ("Name", "Axis"))):
                raise LogError(
                    f"{path}: Header.SignalListHFData[{i}] must have a Name and an Axis, got {brief(signal)}"
                )
        names = [signal["Name"] for signal in signals]
        cycle = header.get("CycleTimeMs")
        if isinstance(cycle, bool) or not isinstance(cycle, (int, float)) or not 0 < cycle < math.inf:
            raise LogError(f"{path}: Header.CycleTimeMs must be a number of milliseconds above 0, got {brief(cycle)}")
        values = _rows(path, _entry(path, content, "Payload", list), len(names))
        self._columns = {name: values[:, i] for i, name in enumerate(names)}
        self.names = list(names)
        if _COUNTER in self._columns:
            self._columns[_TIME] = 1e-3 * cycle * (self._columns[_COUNTER] - self._columns[_COUNTER][0])
            self.names.append(_TIME)
        axes = {signal["Name"]: signal["Axis"] for signal in signals}
        pairs = {name: name.replace(_COMMANDED, _MEASURED, 1) for name in names if name.startswith(f"{_COMMANDED}|")}
        self.axes = {axes[x_d]: (x_d, x) for x_d, x in pairs.items() if x in self._columns}
        moving = [axis for axis, (x_d, _) in self.axes.items() if np.ptp(self._columns[x_d]) != 0.0]
        self.axis = moving[0] if moving else ""
        self.assumed_units = {
            name: "deg" if axis.upper().startswith(_ROTARY) else "mm"
            for name, axis in axes.items()
            if name.split("|")[0] in (_COMMANDED, _MEASURED)
        }
        self.roles = {"t": _TIME} if _TIME in self._columns else {}

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it is a JSON object with the list of signals near its beginning."""
        return head.lstrip().startswith(b"{") and _SIGNALS in head

    def column(self, name: str) -> Array:
        """Return a signal."""
        return self._columns[name]


def _entry(path: Path, table: Any, name: str, kind: type, place: str = "") -> Any:
    """Return an entry of a JSON object, of the type; LogError if it is not there."""
    value = table.get(name) if isinstance(table, dict) else None
    if not isinstance(value, kind):
        what = "an object" if kind is dict else "a list"
        raise LogError(f"{path}: {place}{name} must be {what}, got {type(value).__name__}")
    return value


def _rows(path: Path, payload: Sequence[Any], width: int) -> Array:
    """Return the rows of all ``HFData`` of the payload, events and slow signals between them left out."""
    rows: list[Any] = []
    for i, entry in enumerate(payload):
        if not (isinstance(entry, dict) and "HFData" in entry):
            continue
        for j, row in enumerate(_entry(path, entry, "HFData", list, f"Payload[{i}].")):
            if not isinstance(row, list) or len(row) != width:
                came = len(row) if isinstance(row, list) else type(row).__name__
                raise LogError(f"{path}: Payload[{i}].HFData[{j}] must have {width} values, one a signal, got {came}")
            wrong = next((k for k, value in enumerate(row) if type(value) not in (int, float)), None)
            if wrong is not None:
                raise LogError(f"{path}: Payload[{i}].HFData[{j}][{wrong}] must be a number, got {brief(row[wrong])}")
            rows.append(row)
    try:
        return np.array(rows, dtype=np.float64).reshape(len(rows), width)
    except OverflowError as error:
        raise LogError(f"{path}: a value is no floating-point number: {first_line(error)}") from error
