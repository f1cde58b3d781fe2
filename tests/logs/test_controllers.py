"""Logs of controllers: Siemens Capture, SINUMERIK's trace, TwinCAT Scope, LinuxCNC's halscope; rates that differ."""

import json
import math
from collections.abc import Callable
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_files import capture, columns, halscope_csv, refused, trace_xml, twincat_csv
from places import CAPTURE, RECORDINGS

from hybridsep.base.errors import LogError
from hybridsep.logs.columns import channels
from hybridsep.logs.formats import open_source
from hybridsep.logs.log import read_log

T = np.arange(400) * 1e-3
X_D = np.round(np.sin(7 * T), 6)
X = np.round(0.9 * np.sin(7 * T - 0.02), 6)

# SINUMERIK

SIGNALS = {
    "nckServoDataCmdPos2ndEnc64 [u1, 7]": (0.0, 1e-3, X_D),
    "nckServoDataActPos2ndEnc64 [u1, 7]": (0.0, 1e-3, X),
    "measPos1 [u1, 7]": (1e-3, 2e-3, X[1::2]),
    "nckServoDataCmdPos2ndEnc64 [u1, 3]": (0.0, 1e-3, 2 * X_D),
    "nckServoDataActPos2ndEnc64 [u1, 3]": (0.0, 1e-3, 2 * X),
    "aaStat [u1, 3]": (1e-3, 4e-3, np.full(99, 4.0)),
}


def trace(path: Path, text: str = "") -> Path:
    path.write_text(text or trace_xml(SIGNALS))
    return path


def test_a_trace(tmp_path: Path) -> None:
    path = trace(tmp_path / "log")
    log = read_log(path)
    np.testing.assert_allclose(log.x_d, 1e-3 * X_D, rtol=1e-15)
    np.testing.assert_allclose(log.x_meas, 1e-3 * X, rtol=1e-15)
    np.testing.assert_allclose(log.t, T, rtol=1e-15)
    assert log.remarks == ("axis 7 of 7, 3 is read; axis='…' (--axis) chooses another",)
    np.testing.assert_allclose(read_log(path, axis="3").x_d, 2e-3 * X_D, rtol=1e-15)
    assert read_log(path, unit="deg").unit == "rad"
    listed = {one.name: one.role for one in channels(open_source(path))}
    assert (listed["measPos1|7"], listed["nckServoDataActPos2ndEnc64|7"]) == ("", "x")
    assert len(open_source(path).read(["measPos1|7"]).columns[0]) == 200  # every 2 ms
    refused(r"axis 'X1' is missing; there are 7, 3", path, axis="X1")


def test_values_of_a_trace_are_held(tmp_path: Path) -> None:
    """A record that is not there, as nothing has changed, is a sample all the same."""
    steps = np.repeat([0.0, 1.0, 1.5, 1.5], 100)
    signals = {"nckServoDataCmdPos1 [u1, 1]": (0.0, 1e-3, steps), "nckServoDataActPos1 [u1, 1]": (0.0, 1e-3, steps)}
    text = trace_xml(signals)
    assert text.count("<rec") == 4
    np.testing.assert_array_equal(read_log(trace(tmp_path / "log", text)).x_d, 1e-3 * steps)


def test_the_bits_of_a_nan_are_no_value(tmp_path: Path) -> None:
    text = trace_xml(SIGNALS).replace(f'f2="{float(X[5])!r}"', 'f2="9218868437227405313"', 1)
    log = read_log(trace(tmp_path / "log", text))
    assert log.x_meas[5] == log.x_meas[4]


def test_a_trace_without_signals(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"no signals \(traceData, dataFrame, dataSignal\) were found"):
        read_log(trace(tmp_path / "log", trace_xml(SIGNALS).replace("<dataSignal", "<other")))


# TwinCAT Scope

SCOPE = {"x_d": (1e-3, X_D), "x": (1e-3, X)}


@pytest.mark.parametrize("mark", ["\t", ";", ","])
@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize("shared", [False, True])
def test_kinds_of_exports(tmp_path: Path, mark: str, full: bool, shared: bool) -> None:
    text = twincat_csv(SCOPE, mark=mark, full=full, shared=shared, unit="mm (Length)")
    (tmp_path / "log").write_text(text, encoding="utf-8-sig")
    log = read_log(tmp_path / "log")
    np.testing.assert_allclose(log.x_d, 1e-3 * X_D, rtol=1e-15)
    np.testing.assert_allclose(log.x_meas, 1e-3 * X, rtol=1e-15)
    np.testing.assert_allclose(log.t, T, rtol=1e-15, atol=1e-15)
    assert log.file_unit == "mm"


def test_channels_of_one_name(tmp_path: Path) -> None:
    text = twincat_csv({"x_d": (1e-3, X_D), "x": (1e-3, X), "other": (1e-3, X)})
    text = text.replace("Name\tother", "Name\tx", 1)
    (tmp_path / "log").write_text(text)
    found = [one.name for one in channels(open_source(tmp_path / "log")) if one.unit == "m"]
    assert found == ["x_d", "MAIN.x", "MAIN.other"]


def test_slow_channels_that_are_filled(tmp_path: Path) -> None:
    """The export repeats time and value of a slower channel in each line: "Fill with previous value"."""
    lines = twincat_csv({"x_d": (1e-3, X_D), "x": (2e-3, X[::2]), "y": (2e-3, X[::2])}).splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("0,0\t"))
    for k in reversed(range(400)):
        fast, slow = lines[at + k].split("\t")[:2], lines[at + k // 2].split("\t")[2:6]
        lines[at + k] = "\t".join([*fast, *slow])
    (tmp_path / "log").write_text("\n".join(lines))
    log = read_log(tmp_path / "log", columns={"x_d": "y"})
    assert (len(log.t), log.T_s) == (200, 2e-3)
    np.testing.assert_array_equal(log.x_meas, X[::2])


def test_an_export_without_times(tmp_path: Path) -> None:
    head = "Name\tscope\nFile\tscope.csv\nStarttime of export\t1\n\nName\tx_d\tx\n\n"
    (tmp_path / "log").write_text(head + "1\t2\n3\t4\n")
    refused(r"line 7: a column of times .* was expected; export with timelines \(All, or", tmp_path / "log")
    (tmp_path / "log").write_text(head + "no\tnumbers\n")
    refused("numbers were expected below the channels' names, got none", tmp_path / "log")


# Rates that differ


@pytest.mark.parametrize(("kind", "skipped"), [("twincat", 0), ("sinumerik", 2)])
def test_rates_that_differ(tmp_path: Path, kind: str, skipped: int) -> None:
    """A command at 1 kHz, and a position at 500 Hz, of a trace from its second sample on."""
    path, unit = tmp_path / "log", "m" if kind == "sinumerik" else None
    if kind == "twincat":
        path.write_text(twincat_csv({"x_d": (1e-3, X_D), "x": (2e-3, X[::2])}))
    else:
        path.write_text(trace_xml({"CmdPos [u1, 1]": (0.0, 1e-3, X_D), "ActPos [u1, 1]": (2e-3, 2e-3, X[2::2])}))
    message = r"sampled at different times: '.*' has 400 samples every 0\.001 s, '.*' has \d+ .* every 0\.002 s"
    refused(message, path, unit=unit)
    log = read_log(path, unit=unit, resample=True)
    assert log.T_s == 2e-3
    assert any(remark.startswith("resampled onto the times of the slower column") for remark in log.remarks)
    np.testing.assert_allclose(log.x_d, X_D[skipped::2], atol=1e-15)
    np.testing.assert_allclose(log.x_meas, X[skipped::2], atol=1e-15)


def with_times(path: Path, t_d: Any, x_d: Any, t: Any, x: Any) -> Path:
    """Write an export with these times of the command and of the position."""
    head, _, _ = twincat_csv({"x_d": (1e-3, x_d[:1]), "x": (1e-3, x[:1])}, mark=";").partition("\n0,0;")
    rows = zip_longest(1e3 * t_d, x_d, 1e3 * t, x, fillvalue="")
    path.write_text(head + "\n" + "".join(";".join(map(str, row)).replace(".", ",") + "\n" for row in rows) + "EOF\n")
    return path


def test_a_faster_measurement_is_interpolated(tmp_path: Path) -> None:
    late = T + 0.25e-3
    log = read_log(with_times(tmp_path / "log", T[:100:2], X_D[:100:2], late, X), resample=True)
    np.testing.assert_allclose(log.t, T[2:100:2], rtol=1e-12)  # nothing was measured before the first
    np.testing.assert_allclose(log.x_meas, np.interp(T[2:100:2], late, X), rtol=1e-12)


def test_rows_that_twincat_lost_are_put_back(tmp_path: Path) -> None:
    keep = np.delete(np.arange(400), range(100, 110))
    log = read_log(with_times(tmp_path / "log", T[keep], X_D[keep], T[keep], X[keep]))
    assert (log.starts, np.flatnonzero(np.isnan(log.x_meas)).tolist()) == ((0,), list(range(100, 110)))
    np.testing.assert_allclose(log.t, T, atol=1e-12)


def test_gaps_of_one_channel_are_not_bridged(tmp_path: Path) -> None:
    fast = np.delete(np.arange(400), range(100, 110))
    path = with_times(tmp_path / "log", T[fast], X_D[fast], T[::2], X[::2])
    refused(r"column 'x_d' has a gap of 0\.011 at time 0\.1 and cannot be resampled", path, resample=True)
    back = T.copy()
    back[200] = 0.0
    refused(r"time 'time' must increase to be resampled", with_times(path, back, X_D, T[::2], X[::2]), resample=True)


# LinuxCNC halscope

HAL = columns()
JOINTS = {f"joint.0.{pin}": HAL["x_d"] for pin in ("pos-cmd", "motor-pos-cmd")} | {"joint.0.motor-pos-fb": HAL["x"]}
JOINTS |= {"joint.1.pos-cmd": 2 * HAL["x_d"], "joint.1.pos-fb": 2 * HAL["x"]}


def test_joints_of_halscope(tmp_path: Path) -> None:
    (tmp_path / "log").write_text(halscope_csv(JOINTS, 500_000))
    log = read_log(tmp_path / "log", unit="mm")
    np.testing.assert_allclose(log.x_meas, 1e-3 * HAL["x"], rtol=1e-15)
    assert (log.T_s, len(log.t)) == (5e-4, 50)
    assert log.remarks[0].startswith("halscope states no unit")
    assert log.remarks[1] == "axis joint.0 of joint.0, joint.1 is read; axis='…' (--axis) chooses another"
    for name in ("1", "joint.1"):
        np.testing.assert_allclose(read_log(tmp_path / "log", axis=name, unit="mm").x_d, 2e-3 * HAL["x_d"], rtol=1e-15)
    refused(r"axis 'joint\.7' is missing; there are joint\.0, joint\.1", tmp_path / "log", axis="joint.7")
    names = {"x_d": "joint.0.pos-cmd", "x": "joint.1.pos-fb"}
    np.testing.assert_allclose(read_log(tmp_path / "log", columns=names, unit="mm").x_meas, 2e-3 * HAL["x"], rtol=1e-15)


# Damaged texts

TEXTS = {
    "trace": trace_xml(SIGNALS),
    "export": twincat_csv(SCOPE),
    "halscope": halscope_csv({"x_d": 0 * HAL["x_d"], "x": 0 * HAL["x"]}),
}
DAMAGED = {
    "trace": [
        ('<rec time="0.005000"', '<rec time="0.0009"', r"time, which increases, .*: time 0.0009 s after 0.004"),
        ('<rec time="0.005000"', '<rec time="x"', "could not convert string to float: 'x'"),
        ('"0.005000" f1="', '"0.005000" f1="1,0', "could not convert string to float: '1,0"),
        ('interval="0.001000"', 'interval="0"', "dataSignal must have .* an interval above 0 s"),
        ('Count="400"', 'Count="inf"', "dataSignal must have id, name, datapointCount and"),
        ('id="f1"', "", "dataSignal must have id, name, .*: KeyError: 'id'"),
        ("</traceData>", "", r"is truncated, damaged or not XML: mismatched tag: line \d+"),
    ],
    "export": [
        ("\n5,0\t", "\n5.5.5\t", r"below line 11: column 'time' must be numbers: could not convert .*'5\.5\.5'"),
        (f"\n5,0\t{str(X_D[5]).replace('.', ',')}", "\n5,0\t", "column 'x_d' must be numbers: could not convert .*''"),
        ("\nName\tx_d", "\n" * 500 + "Name\tx_d", "a row of the channels' names was expected below the head, got none"),
        ("Name\tx_d\tName\tx", "Name\tx_d\tx\ty\tz\tv", r"line 12: a column of times before each channel, .* expected"),
    ],
    "halscope": [
        ("period is 1000000", "period is 0", "line 1: the sampling period must be a positive number of ns"),
        ("x_d;x\n", "x_d;x;y\n", r"line 5: 3 columns were expected as in line 2, got 2"),
    ],
}


@pytest.mark.parametrize(
    ("kind", "before", "after", "message"), [(kind, *row) for kind, rows in DAMAGED.items() for row in rows]
)
def test_damaged_texts(tmp_path: Path, kind: str, before: str, after: str, message: str) -> None:
    assert before in TEXTS[kind]
    (tmp_path / "log").write_text(TEXTS[kind].replace(before, after, 1))
    refused(message, tmp_path / "log")


# Siemens Capture


def recording() -> dict[str, Any]:
    cycles = 7.0 + np.arange(50)
    x, zero = np.sin(cycles / 5), np.zeros(50)
    signals = {"CYCLE": cycles, "DES_POS|1": zero, "ENC_POS|1": zero, "DES_POS|4": x, "ENC_POS|4": 0.9 * x}
    return capture(signals, ["Cycle", "X1", "X1", "C1", "C1"])


def test_capture(tmp_path: Path) -> None:
    path = tmp_path / "recording"
    path.write_text(json.dumps(recording()))
    log = read_log(path)
    assert (log.T_s, log.unit, log.unit_stated, len(log.t)) == (0.002, "rad", True, 50)
    np.testing.assert_allclose(log.x_d, np.radians(np.sin((7 + np.arange(50)) / 5)))
    assert log.remarks == ("axis C1 of X1, C1 is read; axis='…' (--axis) chooses another",)
    assert read_log(path, axis="x1").remarks == ()
    assert (read_log(path, axis="1").unit, read_log(path, axis="1", unit="rad").unit) == ("m", "rad")
    refused(r"axis 'Y1' is missing; there are X1, C1", path, axis="Y1")
    np.testing.assert_array_equal(read_log(path, columns={"x": "DES_POS|4"}).x_meas, log.x_d)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda c: c["Header"].update(CycleTimeMs=0), "time 't' must increase, it never does"),
        (lambda c: c["Header"].update(SignalListHFData=7), "must have Header.CycleTimeMs, the Name and Axis of each"),
        (lambda c: c["Header"]["SignalListHFData"][2].pop("Axis"), "the Name and Axis of each .*: KeyError: 'Axis'"),
        (lambda c: c["Payload"][0]["HFData"].insert(3, [1.0]), "rows of as many numbers .* of Payload: ValueError"),
        (lambda c: c["Payload"][3]["HFData"][4].__setitem__(1, "a"), "ValueError: could not .* to float: 'a'"),
        (lambda c: c["Payload"][3].update(HFData=None), "each HFData of Payload: TypeError"),
        (lambda c: c["Payload"][0]["HFData"][0].__setitem__(0, 10**400), "each HFData of Payload: OverflowError"),
        (
            lambda c: c["Payload"][0]["HFData"][1].__setitem__(3, math.nan),
            r"sample 2 .*_POS\|4' must be finite, got nan",
        ),
    ],
)
def test_refused_captures(tmp_path: Path, spoil: Callable[[dict[str, Any]], object], message: str) -> None:
    content = recording()
    spoil(content)
    path = tmp_path / "recording.json"
    path.write_text(json.dumps(content))
    refused(rf"recording\.json.*{message}", path)
    path.write_text('{"SignalListHFData"' + ":[" * 100_000)
    refused("is truncated, damaged or not JSON", path)


@pytest.mark.skipif(not CAPTURE.is_file(), reason="needs ../shared/data/recordings beside the repository")
@pytest.mark.parametrize(("axis", "file"), [(None, 1), ("X1", 1), ("2", 2)])
def test_recorded_capture(axis: str | None, file: int) -> None:
    log, same = read_log(CAPTURE, axis=axis), read_log(RECORDINGS / f"cnc_a_axis{file}.npz")
    np.testing.assert_allclose(log.x_d, same.x_d, atol=1e-12)
    np.testing.assert_allclose(log.x_meas, same.x_meas, atol=1e-12)
    np.testing.assert_allclose(log.t, same.t, atol=1e-12)
