"""JSON messages by MQTT (extra ``live``)."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

from ..base.errors import ParameterError, first_line
from ..logs.extras import library
from .sample import AS_NAMED, MessageReader, Reading, Sample
from .source import LiveSource
from .waiting import Waiting

__all__ = ["PASSWORD", "USER", "MqttSource"]

USER, PASSWORD = "HYBRIDSEP_MQTT_USER", "HYBRIDSEP_MQTT_PASSWORD"
"""Environment variables of the broker's credentials."""


class MqttSource(LiveSource):
    """Messages of a topic, each JSON as by UDP.

    Parameters
    ----------
    host : str
        Of the broker.
    port : int
    topic : str
    tls : bool
        Whether the connection is encrypted, and the broker's certificate checked.
    reading : Reading

    Raises
    ------
    LogError
        If paho is not installed.
    ParameterError
        If the broker cannot be reached.
    """

    def __init__(self, host: str, port: int, topic: str, *, tls: bool = False, reading: Reading = AS_NAMED) -> None:
        self.name = f"mqtt{'s' if tls else ''}://{host}:{port}/{topic}"
        client = library(self.name, "paho.mqtt.client", "live", "MQTT")
        self._messages, self._waiting, self._topic = MessageReader(self.name, reading), Waiting(), topic
        self._client = client.Client(client.CallbackAPIVersion.VERSION2)
        if os.environ.get(USER):
            self._client.username_pw_set(os.environ[USER], os.environ.get(PASSWORD))
        if tls:
            self._client.tls_set()
        self._client.on_connect = self._connected
        self._client.on_disconnect = self._disconnected
        self._client.on_subscribe = self._subscribed
        self._client.on_message = lambda client, data, message: self._waiting.put(message.payload)
        try:
            self._client.connect(host, port)
        except (OSError, ValueError) as error:
            raise ParameterError(f"{self.name}: the broker cannot be reached: {first_line(str(error))}") from error

    def samples(self) -> Iterator[Sample | None]:
        """Yield samples as they come; without end."""
        self._client.loop_start()
        for piece in self._waiting.pieces():
            if piece is None:
                yield None
            else:
                yield from self._messages.samples(piece)

    def close(self) -> None:
        """Leave the broker."""
        self._client.on_disconnect = None
        self._client.disconnect()
        self._client.loop_stop()

    def _connected(self, client: Any, data: Any, flags: Any, reason: Any, properties: Any) -> None:
        if reason.is_failure:
            self._end(
                f"the broker refuses the connection: {reason}; user and password are read from {USER}, {PASSWORD}"
            )
        else:
            client.subscribe(self._topic)

    def _subscribed(self, client: Any, data: Any, number: Any, reasons: Any, properties: Any) -> None:
        if any(reason.is_failure for reason in reasons):
            self._end(f"the broker refuses the topic: {reasons[0]}")

    def _disconnected(self, client: Any, data: Any, flags: Any, reason: Any, properties: Any) -> None:
        if reason.is_failure:
            self._end(f"the connection is lost: {reason}; commands may be missing")

    def _end(self, why: str) -> None:
        self._waiting.end(ParameterError(f"{self.name}: {why}"))
