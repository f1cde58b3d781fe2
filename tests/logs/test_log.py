"""Recorded logs: every format gives the same one; files that are none; what times tell, and remedies."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from log_files import EVERY_FORMAT, FORMATS, columns, refused, write, write_csv
from places import EMPS
from properties import examples

from hybridsep.base.errors import LogError, ParameterError
from hybridsep.base.signals import Array
from hybridsep.logs.checks import check
from hybridsep.logs.log import Log, read_log


@EVERY_FORMAT
def test_every_format_gives_the_same_log_by_its_content(tmp_path: Path, suffix: str) -> None:
    data, own = columns(), tmp_path / f"log{suffix}"
    other = tmp_path / ("other.mat" if suffix in (".csv", ".csv.gz", ".json") else "other.csv")
    shutil.copy(write(own, data), other)
    rounding = 1e-15 if suffix == ".scope" else 0.0  # which has its times in ms
    for path in (own, other):
        log = read_log(path)
        for found, name in ((log.t, "t"), (log.x_d, "x_d"), (log.x_meas, "x")):
            np.testing.assert_allclose(found, data[name], rtol=rounding)
        assert (log.T_s, log.path) == (1e-3, path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"ARROW1..", r"is Arrow or Feather, .*; import pandas; pandas\.read_feather\('file'\)\.to_csv"),
        (b"\x89HDF\r\n\x1a\n", r"is HDF5, or MATLAB 7\.3, .* these three lines .*\nimport h5py, numpy\n"),
        (b"MATLAB 7.3 MAT-file, Platform", r"is HDF5, or MATLAB 7.*\n.*\nwith h5py\.File\('file'\) as f:\n    numpy"),
        (b"MDF     4.10", "is ASAM MDF, which is not read; docs/howto/recorders.md has three lines of Python"),
        (b"TDSm", "is NI TDMS, which is not read; docs/howto/recorders.md has"),
        (b"PK\x03\x04" + bytes(30), "is an Excel workbook, or another zip .*; save its columns .* in Excel, or"),
        (b'{"a": 1}', r"is JSON, but no Siemens Capture, .*; import pandas; pandas\.read_json"),
        (b"<?xml version='1.0'?>", r"is XML, but no SINUMERIK trace, .*; save its columns t"),
        (b"\x93NUMPY\x01\0", r"is a NumPy \.npy array, which is not read; numpy\.savez\('log\.npz', t=a"),
        (b"BZh91AY", r"is compressed, which is not read; unpack it, or compress it by gzip"),
        (bytes(range(256)), r"is in no format that is read \(NumPy \.npz, .*, text\); save its columns t, x_d and x"),
    ],
)
def test_formats_without_a_reader(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "file").write_bytes(content)
    refused(message, tmp_path / "file")
    (tmp_path / "log.mat").write_bytes(bytes(range(256)))
    refused(r"log\.mat: is truncated, damaged or not a MATLAB", tmp_path / "log.mat")
    (tmp_path / "log.csv").write_bytes(bytes(range(256)) * 20)
    refused(r"log\.csv: is binary, though its name says text", tmp_path / "log.csv")


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    refused(r"none\.csv: there is no such file", tmp_path / "none.csv")
    (tmp_path / "folder.csv").mkdir()
    refused(r"folder\.csv: is not a file", tmp_path / "folder.csv")
    for suffix in (".csv", ".npz", ".mat"):
        path = tmp_path / f"empty{suffix}"
        path.touch()
        refused("the file is empty", path)
    refused(r"\.csv: (cannot be read: File name too long|there is no such file)", tmp_path / ("long" * 100 + ".csv"))
    refused("the file is empty, a line of column names was expected", write_csv(tmp_path / "blank.csv", "\n\n"))


@pytest.mark.parametrize("suffix", [".npz", ".mat", ".json", ".csv.gz"])
@pytest.mark.parametrize("kept", [0.01, 0.3, 0.99])
def test_truncated_files(tmp_path: Path, suffix: str, kept: float) -> None:
    path = write(tmp_path / f"log{suffix}", columns(3000))
    data = path.read_bytes()
    path.write_bytes(data[: max(1, int(kept * len(data)))])
    refused(rf"log\{suffix}: is truncated(, damaged or not| or damaged( after line \d+)?: )", path)


@FORMATS
@pytest.mark.parametrize(("n", "came"), [(0, "none"), (1, "1")])
@pytest.mark.parametrize("T_s", [None, 1e-3])
def test_too_short(tmp_path: Path, suffix: str, n: int, came: str, T_s: float | None) -> None:
    data = columns(n)
    if T_s is not None:
        del data["t"]
    refused(f"a log needs at least 2 samples, got {came}", write(tmp_path / f"log{suffix}", data), T_s=T_s)


# Times


def time_at(i: int, value: float) -> Array:
    t = np.arange(25_000, dtype=np.float64) * 1e-3
    t[i] = value
    return t


@pytest.mark.parametrize(
    ("t", "message"),
    [
        (time_at(7, np.nan), r"sample 8 \(the first is 1\): column 't' must be finite, got nan"),
        (np.zeros(50), r"log.npz: time 't' must increase, it never does"),
        (np.array([0.0, 5e-324, 1e-323, 1.5e-323]), "time 't' must be "),
        (np.array([-1e308, 0.0, 1e308]), "time 't' must be "),
        (np.arange(50) // 4 * 0.01, r"rounded too coarsely, 75\.5 % .*, about 0\.0025 s \(--T_s 0\.0025\)$"),
        (1e6 + np.arange(50, dtype=np.float32) / 16, r"time 't' is rounded too coarsely, 0 % .*, about 0\.062 s"),
        (np.arange(50) * 4.0, r"has an interval of 4, no axis's in s, or a time in ms; give T_s"),
        (1.7e12 + np.arange(50), r"it is an index, or a time in ms since 1970; give T_s \(--T_s 0.001\), or"),
        (1.33e17 + 1e4 * np.arange(50), r"in 100 ns; give T_s \(--T_s 0.001\), or name .*, 't \[100 ns\]'$"),
        (np.arange(50.0) * 7 % 50, "time 't' goes back in 6 rows; sort the rows by it"),
        (46_000 + np.arange(50) / 8_640_000, r"an interval of 1\.15741e-07, .* in d; give T_s \(--T_s 0.01\)$"),
    ],
)
def test_bad_time(tmp_path: Path, t: Array, message: str) -> None:
    refused(message, write(tmp_path / "log.npz", {"t": t, "x_d": t * 0, "x": t * 0}))


def test_given_ts_must_agree_with_the_time(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", columns())
    assert read_log(path, T_s=1.005e-3).T_s == 1.005e-3
    refused(r"T_s = 0.002 s was given, but column 't' has an interval of 0.001 s", path, T_s=2e-3)
    with pytest.raises(ParameterError, match="T_s must be 1e-05 … 1 s, got -1"):
        read_log(path, T_s=-1.0)


@pytest.mark.parametrize("T_s", [1e-3, 1 / 3000, 1 / 8192, 2.5e-4, 1.25e-5, 0.0040012])
def test_interval_is_the_mean_rounded_sensibly(tmp_path: Path, T_s: float) -> None:
    path = write(tmp_path / "log.npz", columns(2000, T_s) | {"t": 17.0 + np.arange(2000) * T_s * (1 + 3e-9)})
    assert read_log(path).T_s == T_s


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1000, 20_000), rows_lost=st.sampled_from([0, 100]))
@examples(30)
def test_the_interval_of_a_clock_that_jitters(
    seed: int, n: int, rows_lost: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    numbers = np.random.default_rng(seed)
    t = np.arange(n) * 1e-3 + np.clip(numbers.normal(0.0, 1e-4, n), -4e-4, 4e-4)
    t = np.delete(t, numbers.integers(1, n - 1, rows_lost))
    t[n // 2 :] += 7.77  # recording stopped, and went on
    T_s = read_log(write(tmp_path_factory.mktemp("jitter") / "log.npz", {"t": t, "x_d": t, "x": t})).T_s
    # Standard error of the mean: by two ends for each piece between gaps, √2 · 0.1 ms
    assert T_s == pytest.approx(1e-3, rel=5 * 0.1414 * np.sqrt(rows_lost + 2) / (n - rows_lost))
    if rows_lost == 0 and n > 15_000:
        assert T_s == 1e-3 or abs(T_s - 1e-3) > 2e-8


def test_an_interval_that_is_not_round_stays(tmp_path: Path) -> None:
    t = np.arange(12_000) * 1.0002e-3
    jitter = np.random.default_rng(0).normal(0.0, 1e-4, len(t))
    path = write(tmp_path / "log.npz", {"t": t + jitter, "x_d": t, "x": t})
    assert read_log(path).T_s == pytest.approx(1.0002e-3, rel=1e-6)
    t[7000:] += 0.3e-3  # one late sample tells nothing of the others
    for uneven in (t, np.delete(t, 5000)):
        path = write(tmp_path / "log.npz", {"t": uneven, "x_d": uneven, "x": uneven})
        assert read_log(path).T_s == pytest.approx(1.0002e-3, rel=3e-5)


def test_a_median_between_two_intervals_that_differ_much(tmp_path: Path) -> None:
    assert read_log(write_csv(tmp_path / "log.csv", "t,x_d,x\n0,0,0\n1,0,0\n11,0,0\n")).T_s == 5.5


def test_recorded_axis() -> None:
    if not EMPS.is_file():
        pytest.skip("the recorded axis is not here: ../shared/data/emps/DATA_EMPS.mat, beside the repository")
    log = read_log(EMPS, columns={"t": "t", "x_d": "qg", "x": "qm"})
    assert check(log) == ()
    assert (len(log.x_meas), log.T_s) == (24_841, 1e-3)
    assert 1e6 * np.sqrt(np.mean((log.x_d - log.x_meas) ** 2)) == pytest.approx(577.8, abs=0.1)


# Times as they were recorded ----------------------------------------------------------------------------------------


N = 600
X_D = np.cumsum(np.sin(np.arange(N) / 50.0)) * 1e-5
X = np.concatenate((np.zeros(6), X_D[:-6])) + 1e-9 * np.arange(N) ** 0.5


def read(folder: Path, t: Any, *, x: Array = X, name: str = "t", **how: float | None) -> Log:
    return read_log(write(folder / "log.npz", {name: t, "x_d": X_D[: len(t)], "x": x[: len(t)]}), **how)  # type: ignore[arg-type]


def test_times_that_begin_again(tmp_path: Path) -> None:
    """Two runs, the second half a sample off: they were sorted into one another, "2000 Hz"."""
    k = np.arange(N // 2)
    log = read(tmp_path, np.concatenate((1e-3 * k, 1e-3 * k + 0.5e-3)))
    assert (log.T_s, log.starts) == (1e-3, (0, N // 2))
    np.testing.assert_array_equal(log.x_d, X_D)
    assert log.remarks[0].startswith("the time goes back 1 time, first at sample 301, by 0.2985 s at most: the file's")


@pytest.mark.parametrize(
    ("unit", "T_s", "period", "words"),
    [
        ("t [us]", 1e-3, 2.0**32, "after 32 bits"),
        ("t [ms]", 4e-3, 2.0**16, "after 16 bits"),
        ("t [s]", 1e-3, 86_400.0, "after a day"),
        ("t [s]", 1e-3, 2.0**32 * 1e-6, "after 32 bits"),
    ],
)
def test_a_wrap_is_unwrapped(tmp_path: Path, unit: str, T_s: float, period: float, words: str) -> None:
    step = T_s / {"t [us]": 1e-6, "t [ms]": 1e-3, "t [s]": 1.0}[unit]
    log = read(tmp_path, (period - 200 * step + step * np.arange(N)) % period, name=unit)
    assert (log.T_s, log.starts) == (T_s, (0,))
    np.testing.assert_allclose(np.diff(log.t), T_s, rtol=1e-3)
    assert log.remarks == (f"the time wraps once, {words}: unwrapped",)


@pytest.mark.parametrize(
    ("t", "by", "T_s"),
    [
        (7200.0 + 1e-3 * np.arange(N), -3600.0, None),  # a clock that is set back an hour
        (np.arange(N) // 10 * 0.01, 5.0, 1e-3),  # a long gap in rounded times
        (1e-3 * np.arange(N), 1.2e-3, None),  # half a row
    ],
)
def test_a_jump_of_the_time_begins_a_segment(tmp_path: Path, t: Array, by: float, T_s: float | None) -> None:
    assert read(tmp_path, t + by * (np.arange(N) >= 350), T_s=T_s).starts == (0, 350)


def test_rows_that_are_written_twice_are_left_out(tmp_path: Path) -> None:
    """They counted as samples: a log of 1 kHz was taken to have 1017 Hz, and so had its FMUs."""
    twice = np.sort(np.concatenate((np.arange(N), [7, 50, 51, 180, 182, 300, 420, 421, 422, 590])))
    log = read_log(write(tmp_path / "twice.npz", {"t": 1e-3 * twice, "x_d": X_D[twice], "x": X[twice]}))
    assert (log.T_s, log.starts, len(log.t)) == (1e-3, (0,), N)
    np.testing.assert_array_equal(log.x_meas, X)
    assert log.remarks == ("10 of 610 rows repeat the one before, time included, first row 9: left out",)


def test_rows_that_jitter_or_repeat_a_little_stay_one_segment(tmp_path: Path) -> None:
    t = 1e-3 * np.arange(N)
    t[[100, 101]] = t[[101, 100]]  # out of order
    t[200] = t[199]
    log = read(tmp_path, t)
    assert log.starts == (0,)
    np.testing.assert_array_equal(log.x_d, X_D)


def test_an_index_with_a_gap_takes_the_given_interval(tmp_path: Path) -> None:
    index = np.delete(np.arange(N + 40), np.arange(300, 340))
    log = read(tmp_path, index.astype(np.float64), T_s=1e-3)
    assert (log.T_s, log.starts, log.t[-1]) == (1e-3, (0, 300), pytest.approx(0.639))


@pytest.mark.parametrize(
    ("t", "T_s"),
    [
        (np.arange(N) // 10 * 0.01, 1e-3),
        (np.arange(N) // 200 * 0.2, 1e-3),
        (86_400.0 + (1e-3 * np.arange(N)).astype(np.float32), 1e-3),
        (1.7e12 + np.arange(N), 1e-3),
        (1.7e9 * 1e3 + 4.0 * np.arange(N), 4e-3),
        (np.arange(N) * 2.0, 2e-3),
    ],
    ids=["two decimals", "three times", "single precision", "ms since 1970", "ms since 1970 at 250 Hz", "ms at 500 Hz"],
)
def test_what_times_do_not_tell_is_asked_for(tmp_path: Path, t: Array, T_s: float) -> None:
    """Times that are rounded, or whose unit is not stated, with the line to paste, and what it gives."""
    t = t.astype(np.float32) if t[0] == 86_400.0 else t
    with pytest.raises(LogError) as caught:
        read(tmp_path, t)
    ((option, _),) = caught.value.options
    assert option == f"--T_s {T_s:g}"
    log = read(tmp_path, t, T_s=T_s)
    assert (log.T_s, log.starts) == (T_s, (0,))
    np.testing.assert_array_equal(log.x_meas, X)


@pytest.mark.parametrize("period", [2, 7])
def test_every_nth_sample_of_a_slow_sensor(tmp_path: Path, period: int) -> None:
    held = X[3:][np.maximum(np.arange(N - 3) - 3, 0) // period * period]
    log = read(tmp_path, 1e-3 * np.arange(N - 3), x=held)
    assert log.T_s == pytest.approx(period * 1e-3)
    np.testing.assert_array_equal(log.x_d, X_D[np.arange(3 % period, N - 3, period)])
    assert log.remarks[0].startswith(f"the measured position is renewed every {period} samples (100 % of its changes")


def test_the_measured_position_is_shifted_by_an_option(tmp_path: Path) -> None:
    t = 1e-3 * np.arange(N)
    for delay in (6, -6):
        log = read(tmp_path, t, delay=np.int8(delay))
        assert len(log.t) == N - 6
        first = max(-delay, 0)
        np.testing.assert_array_equal(log.x_d, X_D[first : N - max(delay, 0)])
        np.testing.assert_array_equal(log.x_meas, X[first + delay : first + delay + N - 6])
        assert f"(--delay {delay})" in log.remarks[0]
    with pytest.raises(ParameterError, match="--delay must be less than the samples of a segment, got 600"):
        read(tmp_path, t, delay=600)


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".mat", ".json", ".parquet"])
def test_a_few_rows_that_are_lost_are_put_back(tmp_path: Path, suffix: str) -> None:
    """They cut a log, and the run began again after each: a log without one row in 9000 was predicted half as well."""
    data, put_back = columns(200), [1, 40, 41, *range(90, 100)]
    keep = np.delete(np.arange(200), [*put_back, *range(150, 161)])
    log = read_log(write(tmp_path / f"log{suffix}", {name: values[keep] for name, values in data.items()}))
    there = np.r_[0:150, 161:200]
    assert (log.starts, log.n_recorded) == ((0, 150), len(keep))
    np.testing.assert_allclose(log.t, data["t"][there], atol=1e-12)
    np.testing.assert_allclose(log.x_d, data["x_d"][there], atol=1e-9)  # a line is 15 µm away
    np.testing.assert_allclose(log.x_meas, np.where(np.isin(there, put_back), np.nan, data["x"][there]))
    short, long = (remark for remark in log.remarks if "missing" in remark)
    assert short == (
        "13 samples are missing in 3 gaps, the longest of 0.011 s; the first is before sample 2: the command is the "
        "cubic through its neighbours there, the measurement missing"
    )
    assert long.startswith("11 samples are missing in 1 gap, ")
    assert long.endswith(": another segment begins after each")


def test_where_a_command_rests_it_rests_in_rows_that_were_lost(tmp_path: Path) -> None:
    keep = np.delete(np.arange(N), [1, 3, 100, 597, 598])
    path = write(tmp_path / "log.npz", {"t": 1e-3 * keep, "x_d": np.full(len(keep), 0.1), "x": X[keep]})
    assert (read_log(path).x_d == 0.1).all()


def test_how_many_rows_are_lost_must_be_told(tmp_path: Path) -> None:
    """By a clock that jitters as well."""
    keep = np.delete(np.arange(N), np.arange(50, 550, 20))
    jitter = np.random.default_rng(0).uniform(-2e-4, 2e-4, len(keep))
    log = read_log(write(tmp_path / "log.npz", {"t": 1e-3 * keep + jitter, "x_d": X_D[keep], "x": X[keep]}))
    assert (log.starts, len(log.t), np.isnan(log.x_meas).sum()) == ((0,), N, 25)
    assert log.remarks[0].startswith("25 samples are missing in 25 gaps")


def test_commands_alone_may_be_held(tmp_path: Path) -> None:
    """As a trajectory is read; a measured position that is held is a slow sensor's, whose samples are kept."""
    held = X_D[np.arange(N) // 2 * 2]
    path = write(tmp_path / "log.npz", {"t": 1e-3 * np.arange(N), "x_d": held})
    log = read_log(path, columns={"x_d": "x_d", "x": "x_d"})
    np.testing.assert_array_equal(log.x_d, held)


def test_resampled_by_an_option(tmp_path: Path) -> None:
    t = 1e-3 * np.arange(N)
    keep = np.delete(np.arange(N), [100, 200, 201])
    uneven = t + 2e-4 * np.sin(np.arange(N))
    log = read_log(write(tmp_path / "log.npz", {"t": uneven[keep], "x_d": X_D[keep], "x": X[keep]}), resample=True)
    missing = np.flatnonzero(np.isnan(log.x_meas))
    assert (log.starts, missing.tolist()) == ((0,), [100, 200, 201])
    log = read(tmp_path, uneven, resample=True)
    np.testing.assert_allclose(np.diff(log.t), log.T_s)
    np.testing.assert_allclose(np.interp(log.t, uneven, X), log.x_meas, atol=1e-12)
    assert read(tmp_path, t, resample=True).remarks == ()


def test_a_motion_that_repeats_while_a_coarse_time_stays() -> None:
    k = np.arange(600)
    for n in (10, 100):
        x_d, x = (np.sin(2 * np.pi * (k - lag) / n) for lag in (0, 1))
        assert read_log({"t": 1e-3 * n * (k // n), "x_d": x_d, "x": x}, T_s=1e-3).T_s == 1e-3


@pytest.mark.parametrize("unit", ["rev", "deg"])
def test_whole_turns_are_unwrapped(tmp_path: Path, unit: str) -> None:
    turn, modulo = {"rev": (1.0, 1.0), "deg": (360.0, 720.0)}[unit]
    turns = np.cumsum(np.linspace(0.0, 0.02, N))
    x_d, x = turn * turns, turn * np.concatenate((np.zeros(3), turns[:-3]))
    data = {"t": 1e-3 * np.arange(N), f"x_d [{unit}]": x_d % modulo, f"x [{unit}]": x % modulo}
    log = read_log(write(tmp_path / "log.npz", data))
    np.testing.assert_allclose([log.x_d, log.x_meas], 2 * np.pi / turn * np.array([x_d, x]), atol=1e-9)
    assert "jumps of a whole turn, the first at sample " in log.remarks[0]
    for name in (f"x_d [{unit}]", f"x [{unit}]"):  # of the other one there is the error
        log = read_log({"t": data["t"], name: data[name], "error": x_d - x}, columns={"error": "error"})
        np.testing.assert_allclose([log.x_d, log.x_meas], 2 * np.pi / turn * np.array([x_d, x]), atol=1e-9)
