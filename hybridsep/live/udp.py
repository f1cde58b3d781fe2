"""JSON messages by UDP."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import suppress

from ..base.errors import ParameterError
from .sample import AS_NAMED, MessageReader, Reading, Sample
from .source import IDLE, LiveSource

__all__ = ["LOCAL", "UdpSource"]

LOCAL = "127.0.0.1"

_BUFFER = 4 << 20
"""Bytes that the system is asked to keep while the core is busy; it may grant fewer."""


class UdpSource(LiveSource):
    """Datagrams, each a JSON message, from whoever sends them to the address.

    Parameters
    ----------
    port : int
        0 for a free one.
    host : str
        Address of this machine that is listened at; its own network alone if left out.
    reading : Reading

    Attributes
    ----------
    port : int
    n_messages : int

    Raises
    ------
    ParameterError
        If the address cannot be listened at.
    """

    def __init__(self, port: int, host: str = LOCAL, reading: Reading = AS_NAMED) -> None:
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
        self._socket.settimeout(IDLE)
        self.port = int(self._socket.getsockname()[1])
        self.name = f"udp:{host}:{self.port}"
        self._messages = MessageReader(self.name, reading)

    @property
    def n_messages(self) -> int:
        """Datagrams that came."""
        return self._messages.n

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
            yield from self._messages.samples(message)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
