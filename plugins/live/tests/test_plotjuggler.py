"""Rows as PlotJuggler takes them."""

import json
import math
import socket

import pytest

from hybridsep.base.errors import ParameterError
from hybridsep_live.core import Row
from hybridsep_live.plotjuggler import PlotJuggler


def test_rows_are_json_with_a_root_timestamp() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(5.0)
        sender = PlotJuggler(f"127.0.0.1:{receiver.getsockname()[1]}", "axis")
        sender.begin(1e-3, 0)
        rows = [
            Row(7, 0.007, 0.1 + 0.2, 1e-17, 0.3, 0.4, 1e-6, 1, 2e-5),
            Row(8, 0.008, 0.1, math.nan, 0.3, 0.4, 0.0, 0, 2e-5),
        ]
        sender.take(rows, {"n_rejected": 3, "rms_h": 1e-6, "step_p50": 1e-5})
        first, second = (json.loads(receiver.recv(65536)) for _ in rows)
        sender.end("")
    assert first == {
        "timestamp": 0.007,
        "axis": {
            "k": 7, "x_d": 0.1 + 0.2, "x_meas": 1e-17, "x_pb": 0.3, "x_h": 0.4, "x_h_std": 1e-6, "active": 1,
            "step": 2e-5,
        },
    }  # fmt: skip
    assert "x_meas" not in second["axis"]
    assert (second["axis"]["n_rejected"], second["axis"]["rms_h"]) == (3, 1e-6)


@pytest.mark.parametrize(
    ("address", "words"),
    [
        *((one, r"--plotjuggler must be HOST:PORT, such as") for one in ("", "127.0.0.1", "host:", "a host:1")),
        ("127.0.0.1:70000", r"a port must be 1 … 65535, got '70000' in --plotjuggler 127\.0"),
        ("no.such.host.invalid:9870", r"--plotjuggler no.such.host.invalid:9870 is no address: "),
    ],
)
def test_addresses_that_are_none(address: str, words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        PlotJuggler(address, "axis")
