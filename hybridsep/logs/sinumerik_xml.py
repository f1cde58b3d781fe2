"""Signals and records of a SINUMERIK trace, parsed from its XML piece by piece."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, NoReturn
from xml.parsers import expat

from ..base.errors import LogError, brief, first_line
from .text_layout import is_number

__all__ = ["POINTS_MAX", "Record", "Signal", "TraceXml"]

POINTS_MAX = 100_000_000
"""Most samples of a signal: a day at 1 kHz. A damaged number must not be filled up with held values."""

_CHUNK = 1 << 16
_NOT_A_NUMBER = 9.2188684e18
"""Values above are the bits of a NaN, written as a whole number: there is none."""

_ADDRESS = re.compile(r"(?:.*/)?(?P<name>[^/\[\]]+?)\s*(?:\[\s*(?:[a-z]\d*\s*,\s*)?(?P<axis>\w+)\s*\])?\s*")
"""``/Nck/!SD/nckServoDataCmdPos2ndEnc64 [u1, 7]``: a variable of axis 7."""


@dataclass(frozen=True)
class Signal:
    """Signal as it is declared.

    Attributes
    ----------
    id : str
        Its attribute in the records.
    name, axis : str
        Last part of its address, and the axis there, empty if there is none.
    interval : float, s
    n : int
        Samples.
    kind : str
        Type of its unit; ``posn`` of a position.
    """

    id: str
    name: str
    axis: str
    interval: float
    n: int
    kind: str


class Record(NamedTuple):
    """Values that changed at a time.

    Attributes
    ----------
    t : float, s
    values : dict
        By the signals' ids.
    """

    t: float
    values: dict[str, float]


class TraceXml:
    """Parser of one pass over a file.

    Attributes
    ----------
    signals : list of Signal
        As far as they have been declared.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.signals: list[Signal] = []
        self._records: list[Record] = []
        self._frames, self._within = 0, False
        self._last = float("-inf")
        self._parser: Any = expat.ParserCreate()
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.StartDoctypeDeclHandler = lambda *_: self._refuse("a document type is not read")

    def records(self) -> Iterator[list[Record]]:
        """Iterate over the records, as many at once as a piece of the file has.

        Raises
        ------
        LogError
            If the file is no XML, or a signal or record in it is damaged.
        """
        try:
            with self._path.open("rb") as file:
                while chunk := file.read(_CHUNK):
                    self._parser.Parse(chunk)
                    found, self._records = self._records, []
                    yield found
                self._parser.Parse(b"", True)
        except (expat.ExpatError, LookupError) as error:
            raise LogError(f"{self._path}: is truncated, damaged or not XML: {first_line(error)}") from error

    def _refuse(self, what: str) -> NoReturn:
        raise LogError(f"{self._path}, line {self._parser.CurrentLineNumber}: {what}")

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        if tag == "dataFrame":
            self._frames += 1
            self._within = self._frames == 1
        elif self._within and tag == "dataSignal":
            self.signals.append(self._signal(attributes))
        elif self._within and tag == "rec":
            self._records.append(self._record(attributes))

    def _end(self, tag: str) -> None:
        if tag == "dataFrame":
            self._within = False

    def _signal(self, given: dict[str, str]) -> Signal:
        name = _ADDRESS.fullmatch(given.get("name", ""))
        if not given.get("id") or name is None:
            self._refuse(f"dataSignal must have an id and a name, got {brief(given)}")
        interval, n = (self._number(given, key, "dataSignal") for key in ("interval", "datapointCount"))
        if not 0.0 < interval < 1e6 or not 0 <= n <= POINTS_MAX:
            self._refuse(
                f"dataSignal must have an interval above 0 s and at most {POINTS_MAX} points, got {interval:g} s and "
                f"{n:g}"
            )
        return Signal(given["id"], name["name"], name["axis"] or "", interval, int(n), given.get("unitsType", ""))

    def _record(self, given: dict[str, str]) -> Record:
        try:
            values = {key: float(text) for key, text in given.items()}
            t = values.pop("time")
        except (ValueError, KeyError):
            for key in ("time", *given):
                self._number(given, key, "rec")
            raise
        if not self._last <= t < 1e12:
            self._refuse(f"time of rec must increase, got {t:.9g} s after {self._last:.9g} s")
        self._last = t
        if values and max(values.values()) > _NOT_A_NUMBER:
            values = {key: value for key, value in values.items() if value <= _NOT_A_NUMBER}
        return Record(t, values)

    def _number(self, given: dict[str, str], key: str, tag: str) -> float:
        text = given.get(key, "")
        if not is_number(text):
            self._refuse(f"{key} of {tag} must be a number, got {brief(text) if text else 'nothing'}")
        return float(text)
