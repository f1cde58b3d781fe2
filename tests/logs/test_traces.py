"""Traces of SINUMERIK and TwinCAT Scope, and columns that are sampled at rates of their own."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from benchmarks.recorders import trace_xml, twincat_csv, write_mdf, write_tdms
from hybridsep.base.errors import LogError
from hybridsep.logs.formats import channels
from hybridsep.logs.log import open_log, read_log

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
    listed = {one.name: (one.n_samples, one.interval, one.role) for one in channels(path)}
    assert listed["measPos1|7"] == (200, 2e-3, "")
    assert listed["nckServoDataActPos2ndEnc64|7"] == (400, 1e-3, "x")
    with pytest.raises(LogError, match=r"axis 'X1' is missing; a commanded and a measured position are there for 7, 3"):
        read_log(path, axis="X1")


def test_values_of_a_trace_are_held(tmp_path: Path) -> None:
    """A record that is not there, as nothing has changed, is a sample all the same."""
    steps = np.repeat([0.0, 1.0, 1.5, 1.5], 100)
    signals = {"nckServoDataCmdPos1 [u1, 1]": (0.0, 1e-3, steps), "nckServoDataActPos1 [u1, 1]": (0.0, 1e-3, steps)}
    text = trace_xml(signals)
    assert text.count("<rec") == 4
    reader = open_log(trace(tmp_path / "log", text))
    assert reader.n_samples == 400
    np.testing.assert_array_equal(np.concatenate([x_d for x_d, _ in reader.chunks(7)]), 1e-3 * steps)


def test_the_bits_of_a_nan_are_no_value(tmp_path: Path) -> None:
    text = trace_xml(SIGNALS).replace(f'f2="{float(X[5])!r}"', 'f2="9218868437227405313"', 1)
    log = read_log(trace(tmp_path / "log", text))
    assert log.x_meas[5] == log.x_meas[4]


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        (
            '<rec time="0.005000"',
            '<rec time="0.0009"',
            r"line \d+: time of rec must increase, got 0.0009 s after 0.004",
        ),
        ('<rec time="0.005000"', '<rec time="x"', r"line \d+: time of rec must be a number, got 'x'"),
        (
            '<rec time="0.005000" f1="',
            '<rec time="0.005000" f1="1,0',
            r"line \d+: f1 of rec must be a number, got .1,0",
        ),
        ('interval="0.001000"', 'interval="0"', r"line 6: dataSignal must have an interval above 0 s and at most"),
        (
            'datapointCount="400"',
            'datapointCount="1e18"',
            r"line 6: .* at most 100000000 points, got 0.001 s and 1e\+18",
        ),
        ('id="f1"', 'id=""', "line 6: dataSignal must have an id and a name"),
        ("<traceSession", "<!DOCTYPE a [<!ENTITY b 'c'>]><traceSession", "line 2: a document type is not read"),
        ("</traceData>", "", r"is truncated, damaged or not XML: mismatched tag: line \d+"),
        ('encoding="utf-8"', 'encoding="nonsense"', "is truncated, damaged or not XML: unknown encoding"),
    ],
)
def test_damaged_traces(tmp_path: Path, before: str, after: str, message: str) -> None:
    text = trace_xml(SIGNALS)
    assert before in text
    with pytest.raises(LogError, match=message):
        read_log(trace(tmp_path / "log", text.replace(before, after, 1)))


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
    listed = {one.name: (one.interval, one.unit) for one in channels(tmp_path / "log")}
    assert listed["x"] == (1e-3, "mm")


def test_channels_of_one_name(tmp_path: Path) -> None:
    text = twincat_csv({"x_d": (1e-3, X_D), "x": (1e-3, X), "other": (1e-3, X)})
    text = text.replace("Name\tother", "Name\tx", 1)
    (tmp_path / "log").write_text(text)
    assert [one.name for one in channels(tmp_path / "log") if one.unit == "m"] == ["x_d", "MAIN.x", "MAIN.other"]


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


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("\n5,0\t", "\n5.5.5\t", r"line 17: column 'time' must be a number, got '5\.5\.5'"),
        ("\n5,0\t", "\nx\t", r"line 17: column 'time' must be a number, got 'x'"),
        (f"\n5,0\t{str(X_D[5]).replace('.', ',')}", "\n5,0\t", "line 17: column 'x_d' must be a number, got nothing"),
        ("\nName\tx_d", "\n" * 500 + "Name\tx_d", "a row of the channels' names was expected below the head, got none"),
        ("Name\tx_d\tName\tx", "Name\tx_d\tx\ty\tz\tv", r"line 12: a column of times before each channel, .* expected"),
    ],
)
def test_damaged_exports(tmp_path: Path, before: str, after: str, message: str) -> None:
    text = twincat_csv(SCOPE)
    assert before in text
    (tmp_path / "log").write_text(text.replace(before, after, 1))
    with pytest.raises(LogError, match=message):
        read_log(tmp_path / "log")


def test_an_export_without_times(tmp_path: Path) -> None:
    head = "Name\tscope\nFile\tscope.csv\nStarttime of export\t1\n\nName\tx_d\tx\n\n"
    (tmp_path / "log").write_text(head + "1\t2\n3\t4\n")
    with pytest.raises(LogError, match=r"line 7: a column of times .* was expected; export with timelines \(All, or"):
        read_log(tmp_path / "log")
    (tmp_path / "log").write_text(head + "no\tnumbers\n")
    with pytest.raises(LogError, match="numbers were expected below the channels' names, got none"):
        read_log(tmp_path / "log")


# Rates


def two_rates(path: Path, kind: str, slow: int = 2) -> Path:
    """Write a command at 1 kHz, and a position sampled more slowly and from the first slow interval on."""
    t = T[slow::slow]
    if kind == "mdf":
        return write_mdf(path, [{"t": T, "x_d": X_D}, {"t": t, "x": X[slow::slow]}])
    if kind == "tdms":
        return write_tdms(path, {"x_d": (1e-3, X_D), "x": (slow * 1e-3, X[::slow])}, pieces=1)
    if kind == "twincat":
        path.write_text(twincat_csv({"x_d": (1e-3, X_D), "x": (slow * 1e-3, X[::slow])}))
        return path
    names = ("CmdPos [u1, 1]", "ActPos [u1, 1]")
    path.write_text(trace_xml({names[0]: (0.0, 1e-3, X_D), names[1]: (slow * 1e-3, slow * 1e-3, X[slow::slow])}))
    return path


@pytest.mark.parametrize("kind", ["mdf", "tdms", "twincat", "sinumerik"])
def test_rates_that_differ(tmp_path: Path, kind: str) -> None:
    path, unit = two_rates(tmp_path / "log", kind), "m" if kind == "sinumerik" else None
    skipped = 0 if kind in ("tdms", "twincat") else 2
    with pytest.raises(
        LogError, match=r"sampled at different times: '.*' has 400 samples every 0\.001 s, '.*' has \d+ "
    ):
        read_log(path, unit=unit)
    log = read_log(path, unit=unit, resample=True)
    assert log.T_s == 2e-3
    assert any(remark.startswith("resampled onto the times of the slower column") for remark in log.remarks)
    np.testing.assert_allclose(log.x_d, X_D[skipped::2], atol=1e-15)
    np.testing.assert_allclose(log.x_meas, X[skipped::2], atol=1e-15)


def test_a_faster_measurement_is_interpolated(tmp_path: Path) -> None:
    late = T + 0.25e-3
    path = write_mdf(tmp_path / "log", [{"t": T[:100:2], "x_d": X_D[:100:2]}, {"t": late, "x": X}])
    log = read_log(path, resample=True)
    np.testing.assert_array_equal(log.t, T[2:100:2])  # nothing was measured before the first
    np.testing.assert_allclose(log.x_meas, np.interp(T[2:100:2], late, X), rtol=1e-12)


def test_gaps_are_not_bridged(tmp_path: Path) -> None:
    fast = np.delete(np.arange(400), range(100, 110))
    path = write_mdf(tmp_path / "log", [{"t": T[fast], "x_d": X_D[fast]}, {"t": T[::2], "x": X[::2]}])
    with pytest.raises(
        LogError, match=r"sample 51 .*: column 'x_d' has a gap of 0\.011 s there and cannot be resampled"
    ):
        read_log(path, resample=True)
    back = T.copy()
    back[200] = 0.0
    path = write_mdf(tmp_path / "log", [{"t": back, "x_d": X_D}, {"t": T[::2], "x": X[::2]}])
    with pytest.raises(LogError, match=r"sample 201 .*: time 'group0\.time' must increase to be resampled"):
        read_log(path, resample=True)


def test_the_same_times_in_several_groups(tmp_path: Path) -> None:
    path = write_mdf(tmp_path / "log", [{"t": T, "x_d": X_D}, {"t": T, "x": X}])
    np.testing.assert_array_equal(read_log(path).x_meas, X)


@pytest.mark.slow
def test_resampling_takes_constant_memory(tmp_path: Path) -> None:
    peaks = []
    for n in (500_000, 1_000_000):
        x = np.sin(1e-3 * np.arange(n))
        path = write_tdms(tmp_path / "log", {"x_d": (1e-3, x), "x": (2e-3, x[::2])}, pieces=n // 25_000)
        tracemalloc.start()
        for _ in open_log(path, resample=True).chunks(1000):
            pass
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.05 * peaks[0]
