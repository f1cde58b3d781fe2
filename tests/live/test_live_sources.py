"""Sources of samples: UDP, standard input, MQTT, and how an address names them."""

from __future__ import annotations

import gc
import json
import os
import socket
import ssl
import sys
from collections.abc import Mapping
from contextlib import closing
from itertools import islice
from pathlib import Path
from typing import Any

import pytest
from certificates import Authority
from command_line import write_log
from mqtt_broker import Broker

from hybridsep import load_machine
from hybridsep.base.errors import HybridSepError, LogError, ParameterError, SignalError
from hybridsep.live.lines import LinesSource
from hybridsep.live.mqtt import CA, CERTIFICATE, KEY, KEY_PASSWORD, PASSWORD, USER, MqttSource
from hybridsep.live.open_source import open_source
from hybridsep.live.recorded import RecordedSource
from hybridsep.live.sample import Sample
from hybridsep.live.source import LiveSource
from hybridsep.live.udp import UdpSource

HOW: Mapping[str, Any] = {"columns": {}, "unit": None, "T_s": None}


def come(source: LiveSource, n: int) -> list[Sample]:
    return list(islice((sample for sample in source.samples() if sample is not None), n))


def test_udp() -> None:
    with UdpSource(0) as source, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        assert next(source.samples()) is None
        to = ("127.0.0.1", source.port)
        for k in range(2000):  # more than come at once are kept
            sender.sendto(json.dumps({"k": k, "x_d": 1e-5 * k, "x_meas": 0.0}).encode(), to)
            if k % 500 == 499:
                assert [sample.k for sample in come(source, 500)] == list(range(k - 499, k + 1))
        assert source.n_messages == 2000
        with pytest.raises(ParameterError, match=f"udp:127.0.0.1:{source.port} cannot be listened at: "):
            UdpSource(source.port)
        sender.sendto(b"no JSON", to)
        with pytest.raises(
            SignalError, match=f"udp:127.0.0.1:{source.port}, message 2001 must be JSON, got b'no JSON'"
        ):
            come(source, 1)
    with pytest.raises(ParameterError, match="udp:no host:9870 cannot be listened at"):
        UdpSource(9870, "no host")


def test_udp_listens_at_this_machine_alone_unless_told() -> None:
    with closing(open_source("udp:18431", load_machine("spring_mass_damper"), HOW)) as source:
        assert isinstance(source, UdpSource)
        assert source._socket.getsockname() == ("127.0.0.1", 18431)
    with closing(open_source("udp:0.0.0.0:18432", load_machine("spring_mass_damper"), HOW)) as source:
        assert isinstance(source, UdpSource)
        assert source._socket.getsockname() == ("0.0.0.0", 18432)


def test_lines() -> None:
    reader, writer = os.pipe()
    with LinesSource(reader) as source:
        os.write(writer, b"k,x_d,x\n0,1,2\n1,3")
        samples = source.samples()
        assert next(samples) == Sample(1.0, 2.0, 0)
        assert next(samples) is None
        os.write(writer, b",4\n2,5,6")
        assert next(sample for sample in samples if sample) == Sample(3.0, 4.0, 1)
        os.close(writer)
        assert [sample for sample in samples if sample] == [Sample(5.0, 6.0, 2)]
    os.close(reader)


@pytest.mark.slow
def test_mqtt(monkeypatch: pytest.MonkeyPatch) -> None:
    broker = Broker([json.dumps({"k": k, "x_d": 0.0, "x_meas": 1.0}).encode() for k in range(300)])
    monkeypatch.setenv(USER, "ann")
    monkeypatch.setenv(PASSWORD, "a secret")
    address = f"mqtt://127.0.0.1:{broker.port}/machines/1/x"
    with open_source(address, load_machine("spring_mass_damper"), HOW) as source:
        assert [sample.k for sample in come(source, 300)] == list(range(300))
        assert broker.topic == b"machines/1/x"
        assert b"ann" in broker.connect
        assert b"a secret" in broker.connect
        assert source.name == address
        with pytest.raises(ParameterError, match=r"the connection is lost: .*; commands may be missing"):
            come(source, 1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("broker", "words"),
    [
        ({"refusal": 5}, f"the broker refuses the connection: Not authorized; user and password are read from {USER}"),
        ({"grant": 128}, "the broker refuses the topic"),
    ],
)
def test_brokers_that_refuse(broker: dict[str, Any], words: str) -> None:
    with (
        MqttSource("127.0.0.1", Broker([], **broker).port, "x") as source,
        pytest.raises(ParameterError, match=words),
    ):
        come(source, 1)


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Authority:
    return Authority(tmp_path_factory.mktemp("certificates"))


def server(authority: Authority, name: str = "broker", asks: bool = False) -> ssl.SSLContext:
    """Return what a broker encrypts with; ``asks`` for a certificate of its client, too."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(*authority.issue(name))
    if asks:
        context.load_verify_locations(authority.path)
        context.verify_mode = ssl.CERT_REQUIRED
    return context


def encrypted(broker: Broker) -> LiveSource:
    return open_source(f"mqtts://127.0.0.1:{broker.port}/x", load_machine("spring_mass_damper"), HOW)


MESSAGES = [json.dumps({"k": k, "x_d": 0.0, "x_meas": 1.0}).encode() for k in range(50)]


@pytest.mark.slow
def test_mqtt_by_tls(monkeypatch: pytest.MonkeyPatch, authority: Authority) -> None:
    monkeypatch.setenv(CA, str(authority.path))
    monkeypatch.setenv(USER, "ann")
    broker = Broker(MESSAGES, tls=server(authority))
    with encrypted(broker) as source:
        assert [sample.k for sample in come(source, 50)] == list(range(50))
        assert b"ann" in broker.connect


@pytest.mark.slow
def test_mqtt_by_tls_with_a_certificate_of_the_client(monkeypatch: pytest.MonkeyPatch, authority: Authority) -> None:
    certificate, key = authority.issue("client", "a secret")
    for name, value in ((CA, authority.path), (CERTIFICATE, certificate), (KEY, key), (KEY_PASSWORD, "a secret")):
        monkeypatch.setenv(name, str(value))
    with encrypted(Broker(MESSAGES, tls=server(authority, asks=True))) as source:
        assert len(come(source, 50)) == 50
    monkeypatch.setenv(KEY_PASSWORD, "another")
    with pytest.raises(
        ParameterError, match=f"the certificate and its key cannot be used: .*; {CERTIFICATE}, {KEY} and"
    ):
        encrypted(Broker(MESSAGES))
    for name in (CERTIFICATE, KEY, KEY_PASSWORD):
        monkeypatch.delenv(name)
    with (
        pytest.raises(ParameterError, match=r"the broker cannot be reached|the connection is lost"),
        encrypted(Broker(MESSAGES, tls=server(authority, asks=True))) as source,
    ):
        come(source, 1)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:unclosed:ResourceWarning")  # paho's, of the connection that it did not make
def test_a_broker_that_is_not_trusted(monkeypatch: pytest.MonkeyPatch, authority: Authority, tmp_path: Path) -> None:
    """Signed by nobody whom the system knows, or by another than the one that is named."""
    monkeypatch.delenv(CA, raising=False)
    words = f"the broker's certificate is not trusted: .*; {CA} names the file of who signed it"
    with pytest.raises(ParameterError, match=words):
        encrypted(Broker([], tls=server(authority)))
    monkeypatch.setenv(CA, str(Authority(tmp_path).path))
    with pytest.raises(ParameterError, match=words):
        encrypted(Broker([], tls=server(authority)))
    with pytest.raises(ParameterError, match="the broker cannot be reached"):  # which speaks no TLS
        encrypted(Broker([], refusal=5))
    gc.collect()


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ({CA: "none.pem"}, f"{CA} must name a PEM file, there is none at none.pem"),
        ({KEY: __file__}, f"{KEY} is the key of a certificate, which {CERTIFICATE} must name"),
        ({CA: __file__}, f"{CA} names no file of certificates: "),
    ],
)
def test_files_of_tls_that_are_none(monkeypatch: pytest.MonkeyPatch, files: dict[str, str], words: str) -> None:
    for name, path in files.items():
        monkeypatch.setenv(name, path)
    with pytest.raises(ParameterError, match=words):
        MqttSource("127.0.0.1", 9, "x", tls=True)


def test_logs(tmp_path: Path) -> None:
    log, machine = write_log(tmp_path / "log.csv"), load_machine("spring_mass_damper")
    assert isinstance(open_source(str(log), machine, HOW), RecordedSource)
    text = write_log(tmp_path / "bare.csv", header="n,x_d,x")
    with pytest.raises(ParameterError, match=r"bare.csv is sampled every 0.002 s, but machine spring_mass_damper has"):
        open_source(str(text), machine, {**HOW, "T_s": 0.002})
    degrees = write_log(tmp_path / "degrees.csv", header="t,x_d [deg],x [deg]")
    with pytest.raises(ParameterError, match="is in rad, but machine spring_mass_damper has unit = 'm'"):
        open_source(str(degrees), machine, HOW)


@pytest.mark.parametrize(
    ("address", "error", "words"),
    [
        ("udp:", ParameterError, "SOURCE must be a log, udp:"),
        ("udp:70000", ParameterError, "a port must be 1 … 65535, got '70000' in udp:70000"),
        ("udp:0", ParameterError, "a port must be 1 … 65535"),
        ("http://host/topic", ParameterError, r"SOURCE must be a log, udp:.*; got 'http://host/topic'"),
        ("mqtt://host", ParameterError, "SOURCE must be"),
        ("mqtt://host:x/topic", ParameterError, "a port must be 1 … 65535, got 'x'"),
        ("mqtt://me:secret@host/topic", ParameterError, "^credentials do not belong into an address"),
        ("mqtt://127.0.0.1:9/topic", ParameterError, "the broker cannot be reached: "),
        ("none.csv", LogError, "none.csv"),
    ],
)
def test_addresses_that_are_none(address: str, error: type[HybridSepError], words: str) -> None:
    with pytest.raises(error, match=words):
        open_source(address, load_machine("spring_mass_damper"), HOW)


def test_a_stream_has_its_own_speed_and_paho_is_an_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ParameterError, match="--speed is for a log; udp:9870 comes at its own"):
        open_source("udp:9870", load_machine("spring_mass_damper"), HOW, speed=2.0)
    with pytest.raises(ParameterError, match=r"udp:9870 is sampled every 0.002 s, but machine spring_mass_damper has"):
        open_source("udp:9870", load_machine("spring_mass_damper"), {**HOW, "T_s": 0.002})
    monkeypatch.setitem(sys.modules, "paho.mqtt.client", None)
    with pytest.raises(LogError, match=r"is MQTT, which needs the extra live: pip install 'hybridsep\[live\]'"):
        MqttSource("127.0.0.1", 1883, "x")
