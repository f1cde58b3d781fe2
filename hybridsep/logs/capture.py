"""Siemens Capture JSON: signals of all axes of a SINUMERIK, one row an interpolation cycle."""

import json
from pathlib import Path

import numpy as np

from ..base.errors import LogError, first_line
from ..base.signals import Array
from .names import SIGNALS, axes_of
from .source import ArraysSource

_SIGNALS = b'"SignalListHFData"'
_COUNTER = "CYCLE"
_TIME = "t"  # name of the time column, which is made from the counter of cycles

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
        try:
            header, payload = content["Header"], content["Payload"]
            axes = {signal["Name"]: signal["Axis"] for signal in header["SignalListHFData"]}
            names, cycle = list(axes), float(header["CycleTimeMs"])
            # Events and slow signals lie between
            rows = [row for entry in payload if "HFData" in entry for row in entry["HFData"]]
            values = np.array(rows, dtype=np.float64).reshape(len(rows), len(names))
        except (LookupError, TypeError, ValueError, OverflowError) as error:
            raise LogError(
                f"{path}: must have Header.CycleTimeMs, the Name and Axis of each of Header.SignalListHFData, and rows "
                f"of as many numbers in each HFData of Payload: {type(error).__name__}: {first_line(error)}"
            ) from error
        self._columns = {name: values[:, i] for i, name in enumerate(names)}
        self.names = list(names)
        if _COUNTER in self._columns:
            self._columns[_TIME] = 1e-3 * cycle * (self._columns[_COUNTER] - self._columns[_COUNTER][:1])
            self.names.append(_TIME)
        self.axes = {axes[x_d]: (x_d, x) for x_d, x in axes_of(names).values()}
        moving = [axis for axis, (x_d, _) in self.axes.items() if np.ptp(self._columns[x_d]) != 0.0]
        self.axis = moving[0] if moving else ""
        self.assumed_units = {
            name: "deg" if axis.upper().startswith(_ROTARY) else "mm"
            for name, axis in axes.items()
            if name.split("|")[0] in ("ENC_POS", *SIGNALS.values())
        }
        self.roles = {"t": _TIME} if _TIME in self._columns else {}

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it is a JSON object with the list of signals near its beginning."""
        return head.lstrip().startswith(b"{") and _SIGNALS in head

    def column(self, name: str) -> Array:
        """Return a signal."""
        return self._columns[name]
