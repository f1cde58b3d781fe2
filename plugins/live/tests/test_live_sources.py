"""Sources of samples: UDP, standard input, and how an address names them."""

import json
import os
import socket
import threading
import time
from contextlib import closing
from itertools import islice
from pathlib import Path

import pytest
from command_line import write_log

from hybridsep import load_machine
from hybridsep.base.errors import HybridSepError, LogError, ParameterError, SignalError
from hybridsep_live.sample import Sample
from hybridsep_live.sources import Given, LinesSource, LiveSource, RecordedSource, UdpSource, open_source


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
        with pytest.raises(ParameterError, match=f"udp:127.0.0.1:{source.port} cannot be listened at: "):
            UdpSource(source.port)
    with pytest.raises(ParameterError, match="udp:no host:9870 cannot be listened at"):
        UdpSource(9870, "no host")


def test_datagrams_that_are_no_samples_are_dropped_and_counted() -> None:
    said: list[str] = []
    sent = (b"no JSON", b'{"other": 1}', b'{"x_d": 1, "x": 2}', b'{"x_d": "a", "x": 2}', b"3", b'{"x_d": 3, "x": 4}')
    with UdpSource(0, say=said.append) as source, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for message in sent:
            sender.sendto(message, ("127.0.0.1", source.port))
        assert come(source, 2) == [Sample(1.0, 2.0), Sample(3.0, 4.0)]
        assert source.n_malformed == 4
    (words,) = said
    assert words.endswith("message 1 must be JSON, got b'no JSON': Expecting value: line 1 column 1 (char 0)")


def test_lines_of_json_as_a_client_of_mqtt_prints_them() -> None:
    reader, writer = os.pipe()
    os.write(writer, b'\n{"k": 0, "x_d": 1, "x": 2}\n{"k": 1, "x_d": \n[{"k": 1, "x_d": 3, "x": 4}]\n\n')
    os.close(writer)
    with LinesSource(reader) as source:
        assert [sample for sample in source.samples() if sample] == [Sample(1.0, 2.0, 0), Sample(3.0, 4.0, 1)]
        assert source.n_malformed == 1
    os.close(reader)


def test_a_line_that_does_not_end_is_refused() -> None:
    reader, writer = os.pipe()
    written: list[int] = []

    def write() -> None:
        while len(written) < 400:
            written.append(os.write(writer, b"x" * 65536))

    with LinesSource(reader) as source:
        thread = threading.Thread(target=write, daemon=True)
        thread.start()
        with pytest.raises(SignalError, match=r"a line must have at most 1000000 bytes, got \d+ and no end"):
            come(source, 1)
        time.sleep(0.2)
        assert sum(written) < 1e7  # what is not read is not kept


def test_udp_listens_at_this_machine_alone_unless_told() -> None:
    with closing(open_source("udp:18431", load_machine("spring_mass_damper"), Given())) as source:
        assert isinstance(source, UdpSource)
        assert source._socket.getsockname() == ("127.0.0.1", 18431)
    with closing(open_source("udp:0.0.0.0:18432", load_machine("spring_mass_damper"), Given())) as source:
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


def test_logs(tmp_path: Path) -> None:
    log, machine = write_log(tmp_path / "log.csv"), load_machine("spring_mass_damper")
    assert isinstance(open_source(str(log), machine, Given()), RecordedSource)
    text = write_log(tmp_path / "bare.csv", header="n,x_d,x")
    with pytest.raises(ParameterError, match=r"bare.csv is sampled every 0.002 s, but machine spring_mass_damper has"):
        open_source(str(text), machine, Given(T_s=0.002))
    degrees = write_log(tmp_path / "degrees.csv", header="t,x_d [deg],x [deg]")
    with pytest.raises(ParameterError, match="is in rad, but machine spring_mass_damper has unit = 'm'"):
        open_source(str(degrees), machine, Given())


@pytest.mark.parametrize(
    ("address", "error", "words"),
    [
        ("udp:", ParameterError, "SOURCE must be a log, udp:"),
        ("udp:70000", ParameterError, "a port must be 1 … 65535, got '70000' in udp:70000"),
        ("udp:0", ParameterError, "a port must be 1 … 65535"),
        ("http://host/topic", ParameterError, r"SOURCE must be a log, udp:.*; got 'http://host/topic'"),
        ("mqtt://host/topic", ParameterError, "SOURCE must be a log, udp:"),
        ("none.csv", LogError, "none.csv"),
    ],
)
def test_addresses_that_are_none(address: str, error: type[HybridSepError], words: str) -> None:
    with pytest.raises(error, match=words):
        open_source(address, load_machine("spring_mass_damper"), Given())


def test_a_stream_has_its_own_speed() -> None:
    with pytest.raises(ParameterError, match="--speed is for a log; udp:9870 comes at its own"):
        open_source("udp:9870", load_machine("spring_mass_damper"), Given(speed=2.0))
    with pytest.raises(ParameterError, match=r"udp:9870 is sampled every 0.002 s, but machine spring_mass_damper has"):
        open_source("udp:9870", load_machine("spring_mass_damper"), Given(T_s=0.002))
