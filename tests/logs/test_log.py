"""Recorded logs: every format gives the same one; files that are none; the interval that times tell."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from log_files import EVERY_FORMAT, FORMATS, columns, write, write_csv
from places import EMPS
from properties import examples

from hybridsep.base.errors import LogError, ParameterError
from hybridsep.base.signals import Array
from hybridsep.logs.checks import check
from hybridsep.logs.log import read_log


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
        (b'{"a": 1}', r"is JSON of another kind than Siemens Capture, .*; import pandas; pandas\.read_json"),
        (b"<?xml version='1.0'?>", r"is XML of another kind than a SINUMERIK trace, .*; save its columns t"),
        (b"\x93NUMPY\x01\0", r"is a NumPy \.npy array, which is not read; numpy\.savez\('log\.npz', t=a"),
        (b"BZh91AY", r"is compressed, which is not read; unpack it, or compress it by gzip"),
        (bytes(range(256)), r"is in no format that is read \(NumPy \.npz, .*, text\); save its columns t, x_d and x"),
    ],
)
def test_formats_without_a_reader(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "file").write_bytes(content)
    with pytest.raises(LogError, match=message):
        read_log(tmp_path / "file")
    (tmp_path / "log.mat").write_bytes(bytes(range(256)))
    with pytest.raises(LogError, match=r"log\.mat: is truncated, damaged or not a MATLAB"):
        read_log(tmp_path / "log.mat")
    (tmp_path / "log.csv").write_bytes(bytes(range(256)) * 20)
    with pytest.raises(LogError, match=r"log\.csv: is binary, though its name says text"):
        read_log(tmp_path / "log.csv")


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(LogError, match=r"none\.csv: there is no such file"):
        read_log(tmp_path / "none.csv")
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(LogError, match=r"folder\.csv: is not a file"):
        read_log(tmp_path / "folder.csv")
    for suffix in (".csv", ".npz", ".mat"):
        path = tmp_path / f"empty{suffix}"
        path.touch()
        with pytest.raises(LogError, match="the file is empty"):
            read_log(path)
    with pytest.raises(LogError, match=r"\.csv: (cannot be read: File name too long|there is no such file)"):
        read_log(tmp_path / ("long" * 100 + ".csv"))
    with pytest.raises(LogError, match="the file is empty, a line of column names was expected"):
        read_log(write_csv(tmp_path / "blank.csv", "\n\n"))


@pytest.mark.parametrize(
    ("suffix", "kept"), [(suffix, kept) for suffix in (".npz", ".mat", ".json") for kept in (0.01, 0.99)]
)
def test_truncated_files(tmp_path: Path, suffix: str, kept: float) -> None:
    path = write(tmp_path / f"log{suffix}", columns(500))
    data = path.read_bytes()
    path.write_bytes(data[: max(1, int(kept * len(data)))])
    with pytest.raises(LogError, match=rf"log\{suffix}: is truncated, damaged or not"):
        read_log(path)


@FORMATS
@pytest.mark.parametrize(("n", "came"), [(0, "none"), (1, "1")])
@pytest.mark.parametrize("T_s", [None, 1e-3])
def test_too_short(tmp_path: Path, suffix: str, n: int, came: str, T_s: float | None) -> None:
    data = columns(n)
    if T_s is not None:
        del data["t"]
    path = write(tmp_path / f"log{suffix}", data)
    with pytest.raises(LogError, match=f"a log needs at least 2 samples, got {came}"):
        read_log(path, T_s=T_s)


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
        (np.arange(50) * 1e-3 % 0.002, r"time 't' is rounded too coarsely, 49 % of the times are not above the one"),
        (1e6 + np.arange(50, dtype=np.float32) / 16, r"time 't' is rounded too coarsely, 0 % .*, about 0\.062 s"),
        (np.arange(50) * 4.0, r"has an interval of 4, no axis's in s, or a time in ms; give T_s"),
        (1.7e12 + np.arange(50), r"it is an index, or a time in ms since 1970; give T_s \(--T_s 0.001\), or"),
        (46_000 + np.arange(50) / 8_640_000, r"an interval of 1\.15741e-07, .* in d since 1970; .*\(--T_s 0.01\)"),
    ],
)
def test_bad_time(tmp_path: Path, t: Array, message: str) -> None:
    path = write(tmp_path / "log.npz", {"t": t, "x_d": t * 0, "x": t * 0})
    with pytest.raises(LogError, match=message):
        read_log(path)


def test_given_ts_must_agree_with_the_time(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", columns())
    assert read_log(path, T_s=1.005e-3).T_s == 1.005e-3
    with pytest.raises(LogError, match=r"T_s = 0.002 s was given, but column 't' has an interval of 0.001 s"):
        read_log(path, T_s=2e-3)
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
    path = write(tmp_path_factory.mktemp("jitter") / "log.npz", {"t": t, "x_d": t, "x": t})
    T_s = read_log(path).T_s
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
    path = write_csv(tmp_path / "log.csv", "t,x_d,x\n0,0,0\n1,0,0\n11,0,0\n")
    assert read_log(path).T_s == 5.5


def test_recorded_axis() -> None:
    if not EMPS.is_file():
        pytest.skip("the recorded axis is not here: ../shared/data/emps/DATA_EMPS.mat, beside the repository")
    log = read_log(EMPS, columns={"t": "t", "x_d": "qg", "x": "qm"})
    assert check(log) == ()
    assert (len(log.x_meas), log.T_s) == (24_841, 1e-3)
    assert 1e6 * np.sqrt(np.mean((log.x_d - log.x_meas) ** 2)) == pytest.approx(577.8, abs=0.1)
