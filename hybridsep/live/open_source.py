"""Choice of a source by its address."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from ..base.errors import ParameterError
from ..logs.log import check_reading, open_log
from ..machines.agree import check_interval
from ..machines.machine import Machine
from .address import check_port
from .lines import LinesSource
from .mqtt import MqttSource
from .recorded import RecordedSource
from .sample import Reading
from .source import LiveSource
from .udp import LOCAL, UdpSource

__all__ = ["FORMS", "open_source"]

FORMS = "a log, udp:[HOST:]PORT, - (CSV on standard input), or mqtt://HOST[:PORT]/TOPIC (mqtts:// with TLS)"

_UDP = re.compile(r"udp:(?:(?P<host>[^:\s]+|\[[^\]\s]+\]):)?(?P<port>\d+)", re.ASCII)
_MQTT_PORTS = {"mqtt": 1883, "mqtts": 8883}


def open_source(address: str, machine: Machine, how: Mapping[str, Any], speed: float | None = None) -> LiveSource:
    """Open a source.

    Parameters
    ----------
    address : str
        In one of :data:`FORMS`.
    machine : Machine
    how : mapping
        How a log of the machine is read, arguments of :func:`~hybridsep.logs.log.open_log`; names and unit count for
        all sources.
    speed : float, optional
        Of a log, times the recorded one; 0: as fast as possible.

    Raises
    ------
    ParameterError
        If the address has no such form, cannot be reached, or ``speed`` is given for another source than a log.
    LogError
        If the log cannot be read.
    """
    given = check_reading(how["unit"], how["T_s"])
    reading = Reading(how["columns"], how["unit"], machine.unit)
    udp = _UDP.fullmatch(address)
    stream = address == "-" or udp is not None or "://" in address
    if stream and speed is not None:
        raise ParameterError(f"--speed is for a log; {address} comes at its own")
    if stream and given is not None:
        check_interval(address, given, machine)
    if address == "-":
        return LinesSource(sys.stdin.fileno(), reading)
    if udp is not None:
        return UdpSource(check_port(udp["port"], address), (udp["host"] or LOCAL).strip("[]"), reading)
    if "://" in address:
        return _mqtt(address, reading)
    if address.startswith("udp:"):
        raise ParameterError(f"SOURCE must be {FORMS}; got {address!r}")
    log = open_log(Path(address), **how)
    check_interval(Path(address).name, log.T_s, machine)
    if log.file_unit and how["unit"] is None and log.unit != machine.unit:
        raise ParameterError(
            f"{address} is in {log.unit}, but machine {machine.name} has unit = {machine.unit!r}; correct the machine "
            "file, or say the log's unit (--unit)"
        )
    return RecordedSource(log, 1.0 if speed is None else speed)


def _mqtt(address: str, reading: Reading) -> LiveSource:
    parts = urlsplit(address)
    topic = address.partition("://")[2].partition("/")[2]
    if parts.username is not None:
        raise ParameterError("credentials do not belong into an address, where others see them; use the environment")
    if parts.scheme not in _MQTT_PORTS or not parts.hostname or not topic:
        raise ParameterError(f"SOURCE must be {FORMS}; got {address!r}")
    try:
        port = parts.port
    except ValueError:
        port = None
        check_port(parts.netloc.rpartition(":")[2], address)
    return MqttSource(
        parts.hostname, port or _MQTT_PORTS[parts.scheme], topic, tls=parts.scheme == "mqtts", reading=reading
    )
