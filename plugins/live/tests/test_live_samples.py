"""Samples of JSON messages and CSV lines."""

import json
import math

import pytest

from hybridsep.base.errors import LogError, ParameterError, SignalError
from hybridsep_live.sample import AS_NAMED, MessageReader, Reading, RowReader, Sample


def messages(*texts: str, reading: Reading = AS_NAMED) -> list[Sample]:
    reader = MessageReader("udp:127.0.0.1:9870", reading)
    return [sample for text in texts for sample in reader.samples(text.encode())]


def rows(*lines: str, reading: Reading = AS_NAMED) -> list[Sample]:
    reader = RowReader("standard input", reading)
    return [sample for line in lines for sample in reader.samples(line.encode())]


def test_an_object_is_a_sample_and_an_array_several() -> None:
    assert messages('{"x_d": 0.5, "x_meas": 0.25}') == [Sample(0.5, 0.25)]
    found = messages('[{"k": 4, "t": 0.004, "x_d": 1, "x": 2}, {"k": 5.0, "t": 0.005, "x_d": 1, "x": 3}]', "[]")
    assert found == [Sample(1.0, 2.0, 4, 0.004), Sample(1.0, 3.0, 5, 0.005)]
    assert messages('{"x_d_ahead": 0.5, "x_meas": 0.25}') == [Sample(0.5, 0.25, ahead=True)]


def test_units_and_names() -> None:
    text = '{"time [ms]": 2, "set [mm]": 500, "act [um]": 250}'
    found = messages(text, reading=Reading({"x_d": "set", "x": "act"}))
    assert found == [Sample(0.5, pytest.approx(2.5e-4), None, 0.002)]  # type: ignore[arg-type]
    assert messages('{"x_d": 500, "x": 250}', reading=Reading(unit="mm")) == [Sample(0.5, 0.25)]
    assert rows("t;x_d_ahead [mm];x", "0;1;2", reading=Reading({}, None))[0] == Sample(1e-3, 2.0, None, 0.0, True)
    with pytest.raises(ParameterError, match="positions are in mm, but the machine has unit = 'rad'"):
        messages('{"x_d [mm]": 1, "x [mm]": 1}', reading=Reading(si="rad"))


def test_an_error_tells_the_other_position() -> None:
    told = Reading({"error": "err"})
    assert rows("set [mm],err [um]", "1,250", reading=told) == [Sample(1e-3, pytest.approx(7.5e-4))]  # type: ignore[arg-type]
    assert rows("act [mm],err [um]", "1,250", reading=told) == [Sample(pytest.approx(1.25e-3), 1e-3)]  # type: ignore[arg-type]
    assert math.isnan(rows("set [mm],err [um]", "1,", reading=told)[0].x_meas)
    with pytest.raises(SignalError, match=r"act \[mm\] is missing"):
        rows("act [mm],err [um]", ",250", reading=told)


def test_missing_measurements() -> None:
    first, *others = messages('{"x_d": 0, "x_meas": null}', '{"x_d": 0}', '{"x_d": 0, "x_meas": NaN}')
    assert first.x_d == 0.0
    assert all(math.isnan(sample.x_meas) for sample in (first, *others))
    assert math.isnan(rows("x_d,x", "1,")[0].x_meas)


def test_rows() -> None:
    assert rows("\ufeffk,x_d,x_meas\r", "0,1,2\r", "", "1,1e-3,-2\r") == [Sample(1.0, 2.0, 0), Sample(1e-3, -2.0, 1)]
    assert rows("x_d x", "1 2", "3  4") == [Sample(1.0, 2.0), Sample(3.0, 4.0)]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "udp:127.0.0.1:9870, message 1 must be JSON, got b'{'"),
        ("[" * 100_000, "must be JSON, got"),
        ("3", "message 1 must be an object with x_d and x_meas, or an array of them, got 3"),
        ('{"x_d": null, "x": 1}', "x_d is missing; a command must not be"),
        ('{"x_d": "a", "x": 1}', "x_d must be a number, got 'a'"),
        ('{"x_d": true, "x": 1}', "x_d must be a number, got True"),
        ('{"x_d": NaN, "x": 1}', "x_d must be finite, got nan"),
        ('{"x_d": 1, "x": Infinity}', "x must be finite, got inf"),
        ('{"x_d": 1, "x": 1, "k": 1.5}', "k must be a whole number, got 1.5"),
        ('{"x_d": 1, "x": 1, "k": null}', "k is missing"),
        ('{"x_d": 1' + "0" * 400 + ', "x": 1}', "x_d must be finite, got inf"),
        (json.dumps([{"x_d": 1, "x": 1}] * 60_000), "must have at most 1000000 characters, got"),
    ],
)
def test_messages_that_cannot_be_read(text: str, words: str) -> None:
    with pytest.raises(SignalError) as found:
        messages(text)
    assert words in str(found.value)


def test_lines_that_cannot_be_read() -> None:
    with pytest.raises(SignalError, match=r"standard input, line 3 must have 2 fields, as the names, got 3: '1,2,3'"):
        rows("x_d,x", "1,2", "1,2,3")
    with pytest.raises(SignalError, match="line 2: x must be a number, got '1_0'"):
        rows("x_d,x", "1,1_0")
    with pytest.raises(SignalError, match="line 2 must have at most 1000000 characters"):
        rows("x_d,x", "1" * 1_000_001)
    with pytest.raises(LogError, match="standard input: column 'x' is missing, the file has 'x_d', 'y'"):
        rows("x_d,y", "1,2")
