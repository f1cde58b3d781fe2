"""MQTT 3.1.1 broker of one client: it takes a subscription and sends what it is given, as far as the tests need it.

Packets are as in the OASIS standard MQTT 3.1.1, sections 3.1 to 3.9.
"""

from __future__ import annotations

import socket
import ssl
import threading
from collections.abc import Sequence

__all__ = ["Broker"]

CONNECT, SUBSCRIBE = 1, 8


class Broker(threading.Thread):
    """Broker that sends messages, at quality of service 0, to the topic of the first subscription.

    Parameters
    ----------
    messages : sequence of bytes
    refusal : int
        Return code of the connection; 0 accepts it, 5 is "not authorised".
    grant : int
        Return code of the subscription; 128 is a failure.
    tls : ssl.SSLContext, optional
        Of the server, where connections are encrypted.
    """

    def __init__(
        self, messages: Sequence[bytes], *, refusal: int = 0, grant: int = 0, tls: ssl.SSLContext | None = None
    ) -> None:
        super().__init__(daemon=True)
        self._messages, self._refusal, self._grant, self._tls = messages, refusal, grant, tls
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        self.connect = b""
        self.topic = b""
        self.start()

    def run(self) -> None:
        with self._listener, self._listener.accept()[0] as plain:
            try:
                client = self._tls.wrap_socket(plain, server_side=True) if self._tls else plain
            except (ssl.SSLError, OSError):  # the client goes, or has no certificate
                return
            self._serve(client)

    def _serve(self, client: socket.socket) -> None:
        with client, client.makefile("rb") as packets:
            kind, self.connect = self._packet(packets)
            assert kind == CONNECT
            client.sendall(bytes([0x20, 2, 0, self._refusal]))
            if self._refusal:
                return
            kind, subscribe = self._packet(packets)
            assert kind == SUBSCRIBE
            self.topic = subscribe[4 : 4 + int.from_bytes(subscribe[2:4], "big")]
            client.sendall(bytes([0x90, 3]) + subscribe[:2] + bytes([self._grant]))
            for message in self._messages:
                body = len(self.topic).to_bytes(2, "big") + self.topic + message
                client.sendall(bytes([0x30]) + self._length(len(body)) + body)

    @staticmethod
    def _packet(packets: object) -> tuple[int, bytes]:
        """Return type and body of the next packet; its length has seven bits a byte."""
        read = packets.read  # type: ignore[attr-defined]
        kind, length, shift = read(1)[0] >> 4, 0, 0
        while True:
            byte = read(1)[0]
            length |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return kind, read(length)

    @staticmethod
    def _length(n: int) -> bytes:
        found = bytearray()
        while n > 127:
            found.append(n & 127 | 128)
            n >>= 7
        return bytes([*found, n])
