"""Recordings of a SINUMERIK: traces of Operate as XML ("SINUMERIK Solution Line Trace"), and Siemens Capture's JSON.

The XML: how signals and their sample rates are chosen is said in Siemens' "SINUMERIK Operate Commissioning Manual",
section "Trace". A file declares each signal with an ``interval`` and a ``datapointCount``, and has a ``rec`` for each
time. A value that is as before is left out there, and a ``rec`` with none as well, so that a signal's samples are one
in each interval from its first value on, each the last one written.
Capture: the header has the signals and the cycle time, a row of HFData a number of each; events lie between the rows.
"""

import json
import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ..base.errors import LogError, brief, first_line
from .arrays import GivenSource
from .names import SIGNALS, axes_of

_ADDRESS = re.compile(r"(?:.*/)?(?P<name>[^/\[\]]+?)\s*(?:\[\s*(?:[a-z]\d*\s*,\s*)?(?P<axis>\w+)\s*\])?\s*")
"""``/Nck/!SD/nckServoDataCmdPos2ndEnc64 [u1, 7]``: a variable of axis 7."""

_COMMANDED = re.compile(r"cmdpos|despos", re.IGNORECASE)
_MEASURED = (re.compile(r"actpos", re.IGNORECASE), re.compile(r"measpos", re.IGNORECASE))
"""Names of the signals of positions, the measured ones by precedence."""


@dataclass
class _Signal:
    """Signal as it is declared, and its values."""

    name: str  # of its address, as the axis
    axis: str
    interval: float  # s
    n: int  # samples
    kind: str  # type of its unit
    t: list[float] = field(default_factory=list)  # s
    values: list[float] = field(default_factory=list)


def _signals_of(path: Path) -> tuple[list[_Signal], float]:
    """Return the signals of a file's first frame with their values, and its last time."""
    try:
        frame = ElementTree.parse(path).find(".//dataFrame")
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise LogError(f"{path}: is truncated, damaged or not XML: {first_line(error)}") from error
    signals: dict[str, _Signal] = {}
    last = -math.inf
    try:
        for given in () if frame is None else frame.iter("dataSignal"):
            name, interval = _ADDRESS.fullmatch(given.attrib["name"]), float(given.attrib["interval"])
            if name is None or not 0.0 < interval < 1e6:
                raise ValueError(f"{name} at intervals of {interval} s")
            n, kind = int(float(given.attrib["datapointCount"])), given.get("unitsType", "")
            signals[given.attrib["id"]] = _Signal(name["name"], name["axis"] or "", interval, n, kind)
        for record in () if frame is None else frame.iter("rec"):
            t = float(record.attrib["time"])
            if not last <= t < 1e12:
                raise ValueError(f"time {t:.9g} s after {last:.9g} s")
            last = t
            for key in record.keys() & signals.keys():
                # Values above are the bits of a NaN, written as a whole number: there is none
                if (value := float(record.attrib[key])) <= 9.2188684e18:
                    signals[key].t.append(t)
                    signals[key].values.append(value)
    except (LookupError, ValueError, OverflowError) as error:
        raise LogError(
            f"{path}: each dataSignal must have id, name, datapointCount and an interval above 0 s, and each rec a "
            f"time, which increases, and numbers: {type(error).__name__}: {first_line(error)}"
        ) from error
    if not signals:
        raise LogError(f"{path}: no signals (traceData, dataFrame, dataSignal) were found")
    return list(signals.values()), last


class SinumerikSource(GivenSource):
    """The signals of a trace, by the last part of their address and the axis: ``nckServoDataCmdPos2ndEnc64|7``.

    Without a choice, the first axis with a commanded and a measured position is read. Positions are in millimetres
    unless a unit is given: the file does not tell linear axes from rotary ones.
    """

    format = "SINUMERIK trace XML"
    endings = (".xml",)

    def __init__(self, path: Path) -> None:
        signals, last = _signals_of(path)
        self._signals: dict[str, _Signal] = {}
        for signal in signals:
            name = f"{signal.name}|{signal.axis}" if signal.axis else signal.name
            while name in self._signals:
                name += "'"
            self._signals[name] = signal
        clocks: dict[tuple[float, float], str] = {}  # of columns of times by first time and interval
        times = {
            name: clocks.setdefault((signal.t[0], signal.interval), "time" if not clocks else f"time#{len(clocks) + 1}")
            for name, signal in self._signals.items()
            if signal.t
        }
        columns: dict[str, Any] = {one: LogError(f"{path}: column {brief(one)} has no values") for one in self._signals}
        for (start, interval), clock in clocks.items():  # each value is held until the next one
            own = {name: signal for name, signal in self._signals.items() if times.get(name) == clock}
            n = min(*(signal.n for signal in own.values()), math.floor((last - start) / interval + 1.5))
            k = np.arange(n, dtype=np.float64)
            columns[clock] = start + interval * k
            for name, signal in own.items():
                written = np.rint((np.array(signal.t) - start) / interval)
                columns[name] = np.array(signal.values)[np.searchsorted(written, k, side="right") - 1]
        super().__init__(path, columns)
        self.times, self.units = times, dict.fromkeys(clocks.values(), "s")
        self.assumed_units = {name: "mm" for name, signal in self._signals.items() if signal.kind == "posn"}
        self.axes = {}
        for x_d, signal in self._signals.items():
            beside = {name: one.name for name, one in self._signals.items() if one.axis == signal.axis}
            there = [name for pattern in _MEASURED for name, own in beside.items() if pattern.search(own)]
            if there and signal.axis not in self.axes and _COMMANDED.search(signal.name):
                self.axes[signal.axis] = x_d, there[0]

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it is XML with a trace session near its beginning."""
        return head.lstrip(b"\xef\xbb\xbf \r\n\t").startswith(b"<") and b"<traceSession" in head


_COUNTER = "CYCLE"
_TIME = "t"  # name of the time column, which is made from the counter of cycles


class CaptureSource(GivenSource):
    """Recording of a Siemens controller in Capture's JSON, read whole.

    The columns are the high-frequency signals under their own names, such as ``DES_POS|1``, and ``t`` from ``CYCLE``.
    Without a choice, the first axis whose commanded position moves is read.
    """

    format = "Siemens Capture JSON"
    endings = (".json",)

    def __init__(self, path: Path) -> None:
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
        columns = {name: values[:, i] for i, name in enumerate(names)}
        if _COUNTER in columns:
            columns[_TIME] = 1e-3 * cycle * (columns[_COUNTER] - columns[_COUNTER][:1])
        super().__init__(path, columns)
        self.axes = {axes[x_d]: (x_d, x) for x_d, x in axes_of(names).values()}
        self.axis = next((axis for axis, (x_d, _) in self.axes.items() if np.ptp(columns[x_d]) != 0.0), "")
        self.assumed_units = {
            name: "deg" if axis.upper().startswith(("A", "B", "C", "S")) else "mm"  # of rotary axes and spindles
            for name, axis in axes.items()
            if name.split("|")[0] in ("ENC_POS", *SIGNALS.values())
        }
        self.roles = {"t": _TIME} if _TIME in columns else {}

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return whether it is a JSON object with the list of signals near its beginning."""
        return head.lstrip().startswith(b"{") and b'"SignalListHFData"' in head
