"""JSON messages by MQTT (extra ``live``)."""

from __future__ import annotations

import os
import ssl
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..base.errors import ParameterError, first_line
from ..logs.extras import library
from .sample import AS_NAMED, MessageReader, Reading, Sample
from .source import LiveSource
from .waiting import Waiting

__all__ = ["CA", "CERTIFICATE", "KEY", "KEY_PASSWORD", "PASSWORD", "USER", "MqttSource"]

USER, PASSWORD = "HYBRIDSEP_MQTT_USER", "HYBRIDSEP_MQTT_PASSWORD"
"""Environment variables of the broker's credentials."""

CA, CERTIFICATE, KEY, KEY_PASSWORD = (f"HYBRIDSEP_MQTT_{name}" for name in ("CA", "CERTIFICATE", "KEY", "KEY_PASSWORD"))
"""Environment variables of TLS: PEM files of who signed the broker's certificate (unset: whom the system trusts), of
one's own certificate and its key where the broker asks for them, and the key's password."""


class MqttSource(LiveSource):
    """Messages of a topic, each JSON as by UDP.

    Parameters
    ----------
    host : str
        Of the broker.
    port : int
    topic : str
    tls : bool
        Whether the connection is encrypted, and the broker's certificate and name checked; by the files that
        :data:`CA`, :data:`CERTIFICATE` and :data:`KEY` name.
    reading : Reading

    Raises
    ------
    LogError
        If paho is not installed.
    ParameterError
        If the broker cannot be reached, its certificate is not trusted, or a file of TLS cannot be used.
    """

    def __init__(self, host: str, port: int, topic: str, *, tls: bool = False, reading: Reading = AS_NAMED) -> None:
        self.name = f"mqtt{'s' if tls else ''}://{host}:{port}/{topic}"
        client = library(self.name, "paho.mqtt.client", "live", "MQTT")
        self._messages, self._waiting, self._topic = MessageReader(self.name, reading), Waiting(), topic
        self._client = client.Client(client.CallbackAPIVersion.VERSION2)
        if os.environ.get(USER):
            self._client.username_pw_set(os.environ[USER], os.environ.get(PASSWORD))
        if tls:
            self._encrypt()
        self._client.on_connect = self._connected
        self._client.on_disconnect = self._disconnected
        self._client.on_subscribe = self._subscribed
        self._client.on_message = lambda client, data, message: self._waiting.put(message.payload)
        try:
            self._client.connect(host, port)
        except ssl.SSLCertVerificationError as error:
            raise ParameterError(
                f"{self.name}: the broker's certificate is not trusted: {error.verify_message}; {CA} names the file of "
                "who signed it"
            ) from error
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

    def _encrypt(self) -> None:
        """Have the connection encrypted."""
        files = {name: os.environ.get(name) for name in (CA, CERTIFICATE, KEY)}
        for name, path in files.items():
            if path and not Path(path).is_file():
                raise ParameterError(f"{name} must name a PEM file, there is none at {path}")
        if files[KEY] and not files[CERTIFICATE]:
            raise ParameterError(f"{KEY} is the key of a certificate, which {CERTIFICATE} must name")
        context = ssl.create_default_context()
        try:
            if files[CA]:
                context = ssl.create_default_context(cafile=files[CA])
        except OSError as error:
            raise ParameterError(f"{CA} names no file of certificates: {first_line(str(error))}") from error
        try:
            if certificate := files[CERTIFICATE]:  # without a password OpenSSL would ask for one at the terminal
                context.load_cert_chain(certificate, files[KEY], os.environ.get(KEY_PASSWORD, ""))
        except OSError as error:
            raise ParameterError(
                f"the certificate and its key cannot be used: {first_line(str(error))}; {CERTIFICATE}, {KEY} and "
                f"{KEY_PASSWORD} name them"
            ) from error
        self._client.tls_set_context(context)

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
