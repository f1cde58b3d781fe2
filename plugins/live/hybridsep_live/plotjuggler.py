"""Sender of rows to PlotJuggler, as JSON by UDP with a root ``timestamp``."""

import json
import math
import re
import socket
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

from hybridsep.base.errors import ParameterError

from .core import Row
from .sources import check_port

_ADDRESS = re.compile(r"(?P<host>[^:\s]+|\[[^\]\s]+\]):(?P<port>\d+)", re.ASCII)


class PlotJuggler:
    """Sender of a datagram a row: ``{"timestamp": t, "NAME": {"x_d": …, "x_meas": …, …}}``, in SI units.

    ``address``: ``HOST:PORT`` of PlotJuggler's UDP server; ``name``: of the machine, below which the signals are.
    ParameterError if there is no such address.
    """

    def __init__(self, address: str, name: str) -> None:
        found = _ADDRESS.fullmatch(address)
        if found is None:
            raise ParameterError(f"--plotjuggler must be HOST:PORT, such as 127.0.0.1:9870, got {address!r}")
        port = check_port(found["port"], f"--plotjuggler {address}")
        try:
            to = socket.getaddrinfo(found["host"].strip("[]"), port, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(to[0], socket.SOCK_DGRAM)
        except (OSError, UnicodeError) as error:
            raise ParameterError(f"--plotjuggler {address} is no address: {error}") from error
        self._to, self._name = to[4], name

    def begin(self, T_s: float, delay: int) -> None:
        """Do nothing: a row says its time."""

    def take(self, rows: Sequence[Row], status: Mapping[str, Any]) -> None:
        """Send rows; nobody needs to listen."""
        counts = {name: value for name, value in status.items() if name.startswith(("n_", "rms_"))}
        for row in rows:
            values: dict[str, Any] = row._asdict()
            if math.isnan(row.x_meas):  # JSON has no NaN
                del values["x_meas"]
            message = {"timestamp": values.pop("t"), self._name: values}
            if row is rows[-1]:
                message[self._name] |= counts
            with suppress(OSError):
                self._socket.sendto(json.dumps(message).encode(), self._to)

    def end(self, message: str) -> None:
        """Close the socket."""
        self._socket.close()
