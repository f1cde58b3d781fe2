"""Sources of samples: a log that is replayed, UDP, standard input; and how an address names them."""

import os
import queue
import re
import socket
import sys
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from hybridsep.base.errors import HybridSepError, ParameterError, SignalError
from hybridsep.base.signals import check_interval
from hybridsep.logs.log import Log, check_reading, read_log
from hybridsep.machines.machine import Machine

from .sample import AS_NAMED, MessageReader, Reading, RowReader, Sample

FORMS = "a log, udp:[HOST:]PORT, or - (lines of CSV or JSON on standard input)"

_UDP = re.compile(r"udp:(?:(?P<host>[^:\s]+|\[[^\]\s]+\]):)?(?P<port>\d+)", re.ASCII)
_LOCAL = "127.0.0.1"
_PORT_MAX = 65535

_IDLE = 0.05  # longest time for which a source waits before it says that nothing came, s
_PAUSE = 1e-3  # time for which a replay sleeps at least, s; samples due meanwhile come together
_BUFFER = 4 << 20  # bytes that the system is asked to keep of datagrams while the core is busy; it may grant fewer

_PIECE, _PIECES_MAX = 1 << 16, 64
"""Bytes that are read of standard input at once, and pieces that wait at most; the writer waits then."""

_LINE_MAX = 1_000_000  # bytes of a line at most: what has no end of a line is no CSV, and must not fill the memory

Opened = TypeVar("Opened", bound="LiveSource")


class LiveSource(ABC):
    """Source of samples, open as long as the context."""

    name: str  # what it is, for messages
    file_unit: str = ""  # unit in which positions are shown, empty for the machine's
    n_malformed: int = 0  # messages that were dropped, as they were no samples

    def _of_message(self, reader: MessageReader, message: bytes, say: Callable[[str], object]) -> list[Sample]:
        """Return the samples of a message; none of one that is dropped."""
        try:
            return reader.samples(message)
        except HybridSepError as error:  # whoever reaches the port, or the topic, may send anything
            if self.n_malformed == 0:
                say(f"dropped, as all that are like it: {error}")
            self.n_malformed += 1
            return []

    @abstractmethod
    def samples(self) -> Iterator[Sample | None]:
        """Yield samples as they come; None where none has come for a while; end where the source does."""

    def __enter__(self: Opened) -> Opened:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:  # noqa: B027 - a log holds nothing between its samples
        """Release what it holds."""


class RecordedSource(LiveSource):
    """Samples of a log at ``speed`` times its own, 0: as fast as they are taken; ParameterError if that is negative."""

    def __init__(self, log: Log, speed: float = 1.0) -> None:
        if not 0.0 <= speed <= 1e6:
            raise ParameterError(f"speed must be 0 … 1e6, 0 for as fast as possible, got {speed:g}")
        self.name, self.file_unit = str(log.path), log.file_unit
        self._log, self._speed = log, speed

    def samples(self) -> Iterator[Sample | None]:
        """Yield the samples, each at its time."""
        T_s, begun = self._log.T_s, time.perf_counter()
        for k, (x_d, x_meas) in enumerate(zip(self._log.x_d.tolist(), self._log.x_meas.tolist(), strict=True)):
            if self._speed:
                due = begun + k * T_s / self._speed
                while (wait := due - time.perf_counter()) > 0.0:
                    time.sleep(min(max(wait, _PAUSE), _IDLE))
                    if wait > _IDLE:
                        yield None
            yield Sample(x_d, x_meas, k, k * T_s)


class UdpSource(LiveSource):
    """Datagrams, each a JSON message, from whoever sends them to the address; what is no sample is dropped.

    ``port``: 0 for a free one; ``host``: address of this machine that is listened at; this machine's own network if
    left out; ``say``: called with what is wrong with the first message that is dropped. ParameterError if the address
    cannot be listened at.
    """

    def __init__(
        self,
        port: int,
        host: str = _LOCAL,
        reading: Reading = AS_NAMED,
        say: Callable[[str], object] = lambda _words: None,
    ) -> None:
        try:
            found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(found[0], socket.SOCK_DGRAM)
        except (OSError, UnicodeError) as error:
            raise ParameterError(f"udp:{host}:{port} cannot be listened at: {error}") from error
        with suppress(OSError):
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        try:
            self._socket.bind(found[4])
        except OSError as error:
            self._socket.close()
            raise ParameterError(f"udp:{host}:{port} cannot be listened at: {error.strerror or error}") from error
        self._socket.settimeout(_IDLE)
        self.port = int(self._socket.getsockname()[1])
        self.name, self._say = f"udp:{host}:{self.port}", say
        self._messages = MessageReader(self.name, reading)

    def samples(self) -> Iterator[Sample | None]:
        """Yield samples as they come; without end."""
        while True:
            try:
                message = self._socket.recv(1 << 16)
            except TimeoutError:
                yield None
                continue
            except ConnectionResetError:  # Windows: what was sent before to another
                continue
            yield from self._of_message(self._messages, message, self._say)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class LinesSource(LiveSource):
    """Lines of a descriptor, until its writer closes it: CSV, the first of which are the names, or JSON messages.

    ``descriptor``: it is read from directly: a thread that waits in a buffered reader could not be left at the end;
    ``say``: called with what is wrong with the first JSON message that is dropped.
    """

    name: str = "standard input"

    def __init__(
        self, descriptor: int, reading: Reading = AS_NAMED, say: Callable[[str], object] = lambda _words: None
    ) -> None:
        self._descriptor, self._say = descriptor, say
        self._rows, self._messages = RowReader(self.name, reading), MessageReader(self.name, reading)
        self._is_json: bool | None = None
        self._pieces: queue.Queue[bytes | OSError] = queue.Queue(_PIECES_MAX)

    def samples(self) -> Iterator[Sample | None]:
        """Yield samples as they come; SignalError if a line does not end."""
        threading.Thread(target=self._read, daemon=True).start()
        rest = b""
        while True:
            try:
                piece = self._pieces.get(timeout=_IDLE)
            except queue.Empty:
                yield None
                continue
            if isinstance(piece, OSError):
                raise piece
            if not piece:
                break
            *lines, rest = (rest + piece).split(b"\n")
            for line in lines:
                yield from self._of_line(line)
            if len(rest) > _LINE_MAX:
                raise SignalError(
                    f"{self.name}: a line must have at most {_LINE_MAX} bytes, got {len(rest)} and no end"
                )
        yield from self._of_line(rest)

    def _of_line(self, line: bytes) -> list[Sample]:
        if self._is_json is None and line.strip():
            self._is_json = line.lstrip()[:1] in (b"{", b"[")
        if not self._is_json:
            return self._rows.samples(line)
        return self._of_message(self._messages, line, self._say) if line.strip() else []

    def _read(self) -> None:
        piece: bytes | OSError = b"begun"
        while piece and not isinstance(piece, OSError):
            try:
                piece = os.read(self._descriptor, _PIECE)
            except OSError as error:
                piece = error
            self._pieces.put(piece)


@dataclass(frozen=True)
class Given:
    """What the command line says of a source."""

    # names of ``"t"``, ``"x_d"`` and ``"x"``; the machine file's where they are left out, as its unit and axis
    columns: dict[str, str] = field(default_factory=dict)
    # unit of the positions, sampling interval, s, axis of a file with several, and speed of a log, times the recorded
    # one; 0: as fast as possible
    unit: str | None = None
    T_s: float | None = None
    axis: str | None = None
    speed: float | None = None


def open_source(
    address: str, machine: Machine, given: Given, say: Callable[[str], object] = lambda _words: None
) -> LiveSource:
    """Open a source.

    ``address``: in one of :data:`FORMS`; ``say``: as of :class:`UdpSource`. ParameterError if the address has no such
    form, cannot be listened at, or a speed is given for another source than a log; LogError if the log cannot be
    read.
    """
    own = machine.log
    columns, unit = own.columns_beside(given.columns, given.T_s), given.unit or own.unit
    T_s = check_reading(unit, given.T_s)
    reading = Reading(columns, unit, machine.unit)
    udp = _UDP.fullmatch(address)
    if address == "-" or udp is not None:
        if given.speed is not None:
            raise ParameterError(f"--speed is for a log; {address} comes at its own")
        if T_s is not None:
            check_interval(address, T_s, f"machine {machine.name}", machine.T_s)
    if address == "-":
        return LinesSource(sys.stdin.fileno(), reading, say)
    if udp is not None:
        return UdpSource(check_port(udp["port"], address), (udp["host"] or _LOCAL).strip("[]"), reading, say)
    if address.startswith("udp:") or "://" in address:
        raise ParameterError(f"SOURCE must be {FORMS}; got {address!r}")
    log = read_log(Path(address), columns=columns, unit=unit, T_s=given.T_s, axis=given.axis or own.axis)
    check_interval(Path(address).name, log.T_s, f"machine {machine.name}", machine.T_s)
    if log.file_unit and unit is None and log.unit != machine.unit:
        raise ParameterError(
            f"{address} is in {log.unit}, but machine {machine.name} has unit = {machine.unit!r}; correct the machine "
            "file, or say the log's unit (--unit)"
        )
    return RecordedSource(log, 1.0 if given.speed is None else given.speed)


def check_port(text: str, address: str) -> int:
    """Return a port; ParameterError, which names its address, if it is none."""
    if not (text.isascii() and text.isdecimal() and len(text) < 6 and 0 < int(text) <= _PORT_MAX):
        raise ParameterError(f"a port must be 1 … {_PORT_MAX}, got {text!r} in {address}")
    return int(text)
