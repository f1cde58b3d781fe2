"""Recorded logs that cannot be used, and what every problem is called."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest
from log_files import FORMATS, columns, write, write_csv

from hybridsep.base.errors import HybridSepError, LogError, ParameterError
from hybridsep.base.signals import Array
from hybridsep.logs.log import read_log


def time_at(i: int, value: float, n: int = 25_000) -> Array:
    t = np.arange(n, dtype=np.float64) * 1e-3
    t[i] = value
    return t


@pytest.mark.parametrize(
    ("t", "message"),
    [
        (time_at(7, np.nan), r"sample 8 \(the first is 1\): column 't' must be finite, got nan"),
        (time_at(7, 1e20), r"sample 8 .*: time 't' must be within ±1e\+19, got 1e\+20"),
        (np.zeros(50), r"log.npz: time 't' must increase, it never does"),
        (
            np.arange(50) // 4 * 0.01,
            r"rounded too coarsely, 75\.5 % .*, about 0\.0025 s \(--T_s 0\.0025\)$",
        ),
        (np.arange(50) * 1e-3 % 0.002, r"time 't' is rounded too coarsely, 49 % of the times are not above the one"),
        (1e6 + np.arange(50, dtype=np.float32) / 16, r"time 't' is rounded too coarsely, 0 % .*, about 0\.062 s"),
        (np.arange(50) * 4.0, r"has an interval of 4, no axis's in s, or a time in ms; give T_s"),
        (
            1.7e12 + np.arange(50),
            r"it is an index, or a time in ms since 1970; give T_s \(--T_s 0.001\), or",
        ),
        (
            46_000 + np.arange(50) / 86_400 / 1e2,
            r"an interval of 1\.15741e-07, .* in d since 1970; give T_s \(--T_s 0.01\)",
        ),
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


# Columns and values


@pytest.mark.slow
@FORMATS
def test_missing_columns(tmp_path: Path, suffix: str) -> None:
    data = columns()
    path = write(tmp_path / f"log{suffix}", {"x_d": data["x_d"], "qm": data["x"]})
    with pytest.raises(
        LogError,
        match=r"columns 't', 'x' are missing, the file has 'x_d', 'qm'; name them: --t NAME --x NAME \(or --T_s",
    ):
        read_log(path)
    with pytest.raises(LogError, match=r"column 'x' is missing, the file has 'x_d', 'qm'; name it: --x NAME"):
        read_log(path, T_s=1e-3)
    with pytest.raises(LogError, match=r"column 'time' \(t\) is missing"):
        read_log(path, columns={"t": "time", "x": "qm"}, T_s=1e-3)
    with pytest.raises(LogError, match=r"columns may name t, x_d, x, got 'y'"):
        read_log(path, columns={"y": "qm"})


def test_csv_without_names(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "log.csv", "0,1,2\n1,2,3\n")
    with pytest.raises(LogError, match=r"has no line of names, its first line is numbers \('0', '1', '2'\)"):
        read_log(path)


def test_column_named_twice(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "log.csv", "t,x,x_d,x\n0,1,2,1\n1,3,4,\n2,5,6,7\n")
    with pytest.raises(LogError, match=r"line 3: column 'x' occurs 2 times, with different values, 3 and nan; rename"):
        read_log(path)
    path = write_csv(tmp_path / "log.csv", "t;x_d;t;x\n0;1;0;3\n1;1;1;3\n2;1;2,5;3\n")
    with pytest.raises(
        LogError, match=r"line 4: column 't' occurs 2 times, .* 2 and 2.5; export all channels with one common time, or"
    ):
        read_log(path)
    assert read_log(path, columns={"t": "t#2"}).t.tolist() == [0.0, 1.0, 2.5]
    twice = {"t": np.arange(3.0), "x_d": np.arange(3.0), "x": np.arange(3.0)}
    with zipfile.ZipFile(write(tmp_path / "log.npz", twice), "a") as archive, pytest.warns(UserWarning, match="Dup"):
        archive.writestr("x.npy", archive.read("x.npy"))
    with pytest.raises(LogError, match="column 'x' must occur once, got it 2 times"):
        read_log(tmp_path / "log.npz")


def test_a_time_beside_each_channel(tmp_path: Path) -> None:
    """As TwinCAT Scope exports it."""
    head = "Name;Scope\nFile;C:\\x.tcscopex\nStarttime of export;133500000000\n\n"
    rows = "".join(f"{k};{k / 8:g};{k};{k / 4:g}\n".replace(".", ",") for k in range(30))
    names = {"x_d": "SetPos", "x": "ActPos"}
    for header in ("Time [ms];SetPos;Time [ms];ActPos\n", "Time;SetPos;Time;ActPos\nms;m;ms;m\n"):
        log = read_log(write_csv(tmp_path / "log.csv", head + header + rows), columns=names)
        assert log.T_s == 1e-3
        np.testing.assert_array_equal(log.x_meas, np.arange(30) / 4)
    path = write_csv(tmp_path / "log.csv", f"{head}Time;SetPos;Time;ActPos\n{rows}")
    with pytest.raises(LogError, match=r"counts samples: it is an index, or a time in ms; give T_s"):
        read_log(path, columns=names)
    assert read_log(path, columns=names, T_s=1e-3).T_s == 1e-3
    stamps = "".join(f"12:00:0{k}.5;{k};12:00:0{k}.5;{k}\n" for k in range(9))
    path = write_csv(tmp_path / "log.csv", f"Uhr;x_d;Uhr;x\n{stamps}")
    assert read_log(path).T_s == 1.0


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("0,0,0\n1,nan,0\n", r"log\.csv, line 3: column 'x_d' must be finite, got nan"),
        ("0,0,0\n1,-inf,0\n", r"line 3: column 'x_d' must be finite, got -inf"),
        ("0,0,0\n1,abc,0\n", r"line 3: column 'x_d' must be a number, got 'abc'"),
        ("0,,0\n1,0,0\n", r"line 2: column 'x_d' must be a number, got nothing"),
        ("0,0,0\n1,1_0,0\n", r"line 3: column 'x_d' must be a number, got '1_0'"),
        ("0,0,0\n\n1,0\n", r"line 4: 3 columns were expected as in line 1, got 2"),
        ("0,0,0\n1,0,0,0\n", r"line 3: 3 columns were expected as in line 1, got 4"),
        ("0;0;0\n", r"line 2: column 't' must be a number, got '0;0;0'"),
    ],
)
def test_bad_csv_rows(tmp_path: Path, rows: str, message: str) -> None:
    path = write_csv(tmp_path / "log.csv", "t,x_d,x\n" + rows)
    with pytest.raises(LogError, match=message):
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


@pytest.mark.slow
@FORMATS
def test_millimetres_taken_for_metres(tmp_path: Path, suffix: str) -> None:
    data = columns()
    data["x_d"], data["x"] = np.linspace(-60, 60, 50), np.linspace(-60, 60, 50)
    path = write(tmp_path / f"log{suffix}", data)
    with pytest.raises(LogError, match=r"'x_d' read in m spans 120 m, .*unit='mm' \(--unit mm\)"):
        read_log(path)
    with pytest.raises(LogError, match=r"'x_d' read in m spans 120 m, .*--unit mm"):
        read_log(path)
    assert read_log(path, unit="mm").x_d[-1] == pytest.approx(0.06)
    with pytest.raises(LogError, match=r"unit must be one of m, mm, um, nm, in, rad, mrad, urad, deg, rev, got 'cm'"):
        read_log(path, unit="cm")
    data["x_d"] = data["x_d"] * 1e3
    with pytest.raises(LogError, match=r"read in mm spans 120 m, .*--unit um"):
        read_log(write(path, data), unit="mm")


@pytest.mark.slow
@FORMATS
def test_encoder_counts(tmp_path: Path, suffix: str) -> None:
    data = columns()
    data["x_d"], data["x"] = np.linspace(-6e5, 6e5, 50), np.linspace(-6e5, 6e5, 50)
    path = write(tmp_path / f"log{suffix}", data)
    with pytest.raises(LogError, match=r"spans 1.2e\+06 m, .* in encoder counts, the length of one, .*--unit 0\.1um"):
        read_log(path)
    assert read_log(path, unit="0.1um").x_d[-1] == pytest.approx(0.06)
    assert read_log(path, unit="1e-4 deg").unit == "rad"
    with pytest.raises(LogError, match=r"unit must be one of m, .*, got '0um'; a multiple of one is said as 0\.1um"):
        read_log(path, unit="0um")
    with pytest.raises(LogError, match=r"'x_d' read in 0\.5 mm spans 600 m"):
        read_log(path, unit="0.5mm")


# Files


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    assert issubclass(LogError, HybridSepError)
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
    ("suffix", "kept"),
    [(suffix, kept) for suffix in (".npz", ".mat", ".json") for kept in (0.01, 0.3, 0.7, 0.99)],
)
def test_truncated_files(tmp_path: Path, suffix: str, kept: float) -> None:
    path = write(tmp_path / f"log{suffix}", columns(500))
    data = path.read_bytes()
    path.write_bytes(data[: max(1, int(kept * len(data)))])
    with pytest.raises(LogError, match=rf"log\{suffix}: is truncated, damaged or not"):
        read_log(path)
