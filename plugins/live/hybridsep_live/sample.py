"""Samples of a stream: rows of CSV and JSON objects, with the names and units that logs have."""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from hybridsep.base.errors import ParameterError, SignalError, brief, first_line
from hybridsep.logs.columns import Column, choose_columns
from hybridsep.logs.source import Block, Source
from hybridsep.logs.text import is_number, split
from hybridsep.logs.units import stated_unit

NUMBER, AHEAD = "k", "x_d_ahead"  # names of the sample number, and of a command that the drive gets a look-ahead later
_MESSAGE_MAX = 1_000_000  # most characters of a message; a thousand samples have a tenth


class Sample(NamedTuple):
    """Sample as it came."""

    # commanded and measured position, m; ``x_meas`` is NaN where it is missing
    x_d: float
    x_meas: float
    k: int | None = None  # number of the sample
    t: float | None = None  # time of the sample by the sender's clock, s
    ahead: bool = False  # whether the drive gets ``x_d`` a look-ahead later, and not now


class Reading(NamedTuple):
    """How the names of a stream are read."""

    columns: Mapping[str, str] = {}  # the stream's names of ``"t"``, ``"x_d"``, ``"x"``, ``"error"``, as of read_log
    unit: str | None = None  # unit of the positions; from the names, or SI, if left out
    si: str = "m"  # {"m", "rad"}: unit of the machine


AS_NAMED = Reading()  # by the known names, in the units that they state


class _Names(Source):
    """Names of a stream, as the choice of columns takes them."""

    format, endings = "stream", ()

    def __init__(self, where: str, names: Sequence[str]) -> None:
        super().__init__(Path(where))
        self.names = list(names)

    @staticmethod
    def recognises(head: bytes) -> bool:
        """Return False: a stream is no file."""
        return False

    def read(self, names: Sequence[str]) -> Block:
        """Return nothing: there are only names."""
        return Block([], str)


class _Chosen:
    """Names that are read of a stream, chosen once by the first sample."""

    def __init__(self, where: str, names: Sequence[str], reading: Reading) -> None:
        ahead = next((name for name in names if stated_unit(name)[0] == AHEAD), None)
        columns = dict(reading.columns)
        if ahead is not None and "x_d" not in columns:
            columns["x_d"] = ahead
        found: dict[str, Column] = choose_columns(_Names(where, names), columns, reading.unit, time_needed=False)
        self.x_d, self.x, self.t = found["x_d"], found["x"], found.get("t")
        self.k = NUMBER if NUMBER in names else None
        self.ahead = stated_unit(self.x_d.name)[0] == AHEAD
        if self.x_d.stated and self.x_d.unit.si != reading.si:
            raise ParameterError(
                f"{where}: positions are in {self.x_d.unit.name}, but the machine has unit = {reading.si!r}; correct "
                "the machine file, or say the stream's unit (--unit)"
            )

    def sample(self, values: Mapping[str, Any], where: str) -> Sample:
        """Return a sample of values by name."""
        k = None if self.k is None else _number(values, self.k, where)
        if k is not None and k != int(k):
            raise SignalError(f"{where}: {NUMBER} must be a whole number, got {brief(k)}")
        t = None if self.t is None else self.t.unit.factor * _number(values, self.t.name, where)
        x_d = self.x_d.unit.factor * _number(values, self.x_d.name, where)
        x_meas = self.x.unit.factor * _number(values, self.x.name, where, may_miss=not self.x_d.error)
        x_meas = x_d - self.x.error * x_meas if self.x.error else x_meas  # an error tells one of them
        x_d = x_meas + self.x_d.error * x_d if self.x_d.error else x_d
        return Sample(x_d, x_meas, None if k is None else int(k), t, self.ahead)


def _number(values: Mapping[str, Any], name: str, where: str, *, may_miss: bool = False) -> float:
    """Return a number by its name; NaN where a measured one is missing."""
    value = values.get(name)
    if value is None or value == "":
        if may_miss:
            return math.nan
        raise SignalError(f"{where}: {name} is missing; a command must not be")
    if isinstance(value, str) and is_number(value):
        value = float(value)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise SignalError(f"{where}: {name} must be a number, got {brief(value)}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number) and not (may_miss and math.isnan(number)):
        raise SignalError(f"{where}: {name} must be finite, got {brief(number)}")
    return number


class MessageReader:
    """Reader of JSON messages: an object is a sample, an array of objects are several.

    ``where``: the source, for messages. ``n``: messages read.
    """

    def __init__(self, where: str, reading: Reading) -> None:
        self._where, self._reading = where, reading
        self._chosen: _Chosen | None = None
        self.n = 0

    def samples(self, message: bytes) -> list[Sample]:
        """Return the samples of a message.

        SignalError if it is no JSON, or a value is no number or missing; LogError, ParameterError if the first one
        lacks a name, or states a unit that does not fit.
        """
        self.n += 1
        where = f"{self._where}, message {self.n}"
        if len(message) > _MESSAGE_MAX:
            raise SignalError(f"{where} must have at most {_MESSAGE_MAX} characters, got {len(message)}")
        try:
            found = json.loads(message)
        except (ValueError, RecursionError) as error:
            raise SignalError(f"{where} must be JSON, got {brief(message)}: {first_line(str(error))}") from error
        objects = found if isinstance(found, list) else [found]
        for one in objects:
            if not isinstance(one, dict):
                raise SignalError(
                    f"{where} must be an object with x_d and x_meas, or an array of them, got {brief(one)}"
                )
        if self._chosen is None and objects:
            self._chosen = _Chosen(self._where, list(objects[0]), self._reading)
        return [self._chosen.sample(one, where) for one in objects] if self._chosen else []


class RowReader:
    """Reader of CSV lines, the first of which are the names; ``where``: the source, for messages."""

    def __init__(self, where: str, reading: Reading) -> None:
        self._where, self._reading = where, reading
        self._chosen: _Chosen | None = None
        self._names: list[str] = []
        self._delimiter: str | None = None
        self._n = 0

    def samples(self, line: bytes) -> list[Sample]:
        """Return the sample of a line; none of the names or of an empty line.

        SignalError if a line has another number of fields, or one that is no number or missing; LogError,
        ParameterError if the first one lacks a name, or states a unit that does not fit.
        """
        self._n += 1
        where = f"{self._where}, line {self._n}"
        text = line.decode("utf-8-sig" if self._chosen is None else "utf-8", "replace").strip()
        if len(text) > _MESSAGE_MAX:
            raise SignalError(f"{where} must have at most {_MESSAGE_MAX} characters, got {len(text)}")
        if not text:
            return []
        if self._chosen is None:
            self._delimiter = next((one for one in (";", "\t", ",") if one in text), None)
            self._names = split(text, self._delimiter)
            self._chosen = _Chosen(self._where, self._names, self._reading)
            return []
        fields = split(text, self._delimiter)
        if len(fields) != len(self._names):
            raise SignalError(
                f"{where} must have {len(self._names)} fields, as the names, got {len(fields)}: {brief(text)}"
            )
        return [self._chosen.sample(dict(zip(self._names, fields, strict=True)), where)]
