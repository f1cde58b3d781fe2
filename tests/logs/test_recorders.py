"""Recorders' formats: what of them is read, and how they name the place of what cannot be."""

from __future__ import annotations

import datetime
import decimal
import sys
from pathlib import Path
from typing import Any

import nptdms
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.feather
import pyarrow.parquet as pq
import pytest
from asammdf import MDF, Signal
from log_files import columns, write

from benchmarks.recorders import (
    halscope_csv,
    halscope_pairs,
    write_arrow,
    write_mdf,
    write_parquet,
    write_tdms,
    write_xlsx,
)
from hybridsep.base.errors import LogError
from hybridsep.logs.formats import channels
from hybridsep.logs.log import read_log

DATA = columns()
X_D, X = DATA["x_d"], DATA["x"]


@pytest.mark.parametrize(
    ("suffix", "module", "extra"),
    [
        (".mf4", "asammdf", "mdf"),
        (".tdms", "nptdms", "tdms"),
        (".parquet", "pyarrow", "parquet"),
        (".arrow", "pyarrow", "parquet"),
        (".xlsx", "openpyxl", "xlsx"),
    ],
)
def test_a_missing_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, module: str, extra: str
) -> None:
    path = write(tmp_path / f"log{suffix}", columns())
    monkeypatch.setitem(sys.modules, module, None)
    message = rf"log{suffix}: is an? .*, which needs the extra {extra}: pip install 'hybridsep\[{extra}\]'$"
    with pytest.raises(LogError, match=message):
        read_log(path)


@pytest.mark.parametrize(
    ("suffix", "message"),
    [
        (".mf4", "it is truncated, damaged or not an ASAM MDF file: "),
        (".tdms", "is truncated: its last segment is incomplete"),
        (".parquet", "is truncated, damaged or not a Parquet file: ArrowInvalid: "),
        (".arrow", "is truncated, damaged or not an Arrow file: ArrowInvalid: "),
        (".xlsx", "is truncated, damaged or not an Excel workbook: "),
        (".xml", r"is truncated, damaged or not XML: .*line \d+|signals .* were found"),
    ],
)
def test_a_truncated_file(tmp_path: Path, suffix: str, message: str) -> None:
    path = write(tmp_path / f"log{suffix}", columns(500))
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(LogError, match=message):
        read_log(path)


# MDF


@pytest.mark.parametrize("version", ["3.30", "4.10", "4.20"])
def test_versions_of_mdf(tmp_path: Path, version: str) -> None:
    log = read_log(write_mdf(tmp_path / "log", [columns()], version, units="mm"))
    np.testing.assert_allclose(log.x_d, 1e-3 * X_D, rtol=1e-15)
    assert (log.file_unit, log.unit_stated) == ("mm", True)


def test_groups_of_mdf(tmp_path: Path) -> None:
    other = {"t": DATA["t"][::2], "x": X[::2], "torque": X[::2]}
    path = write_mdf(tmp_path / "log.mf4", [{"t": DATA["t"], "x_d": X_D, "x": X}, other])
    listed = {one.name: one for one in channels(path)}
    assert (listed["group1.x"].n_samples, listed["group1.x"].unit) == (25, "m")
    assert listed["group1.x"].interval == pytest.approx(2e-3)
    assert list(listed) == ["group0.time", "x_d", "group0.x", "group1.time", "group1.x", "torque"]
    np.testing.assert_array_equal(read_log(path, columns={"x": "group0.x"}).x_meas, X)
    with pytest.raises(LogError, match=r"column 'x' is missing, the file has .*'group0\.x', .*name it: --x NAME"):
        read_log(path)


def test_invalid_samples_of_mdf(tmp_path: Path) -> None:
    invalid = np.zeros(50, dtype=np.bool_)
    invalid[7] = True
    with MDF(version="4.10") as file:
        file.append([Signal(X_D, DATA["t"], name="x_d"), Signal(X, DATA["t"], name="x", invalidation_bits=invalid)])
        file.save(tmp_path / "log.mf4")
    log = read_log(tmp_path / "log.mf4", uniform=False)
    assert list(np.flatnonzero(np.isnan(log.x_meas))) == [7]
    with pytest.raises(LogError, match=r"sample 8 \(the first is 1\): column 'x' must be finite, got nan; missing"):
        read_log(tmp_path / "log.mf4")


def test_texts_of_mdf(tmp_path: Path) -> None:
    with MDF() as file:
        texts = np.array([b"on"] * 50)
        file.append([Signal(X_D, DATA["t"], name="x_d"), Signal(texts, DATA["t"], name="x", encoding="utf-8")])
        file.save(tmp_path / "log.mf4")
    with pytest.raises(LogError, match=r"column 'x' must be numbers, got \|S2"):
        read_log(tmp_path / "log.mf4")


# TDMS


def test_waveforms_of_tdms(tmp_path: Path) -> None:
    path = write_tdms(tmp_path / "log", {"x_d": (1e-3, X_D), "x": (1e-3, X)}, unit="mm", pieces=3)
    log = read_log(path)
    np.testing.assert_array_equal(log.x_d, 1e-3 * X_D)
    assert (log.T_s, log.file_unit) == (1e-3, "mm")
    listed = {one.name: (one.n_samples, one.interval, one.unit) for one in channels(path)}
    assert listed == {"x_d": (50, 1e-3, "mm"), "x": (50, 1e-3, "mm"), "time": (50, 1e-3, "s")}


def tdms(path: Path, *objects: tuple[str, str, Any]) -> Path:
    with nptdms.TdmsWriter(str(path)) as file:
        file.write_segment([nptdms.ChannelObject(*one) for one in objects])
    return path


def test_time_stamps_of_tdms(tmp_path: Path) -> None:
    stamps = np.datetime64("2026-03-05T10:20:30") + np.arange(50) * np.timedelta64(2000, "us")
    log = read_log(tdms(tmp_path / "log.tdms", ("a", "clock", stamps), ("a", "x_d", X_D), ("a", "x", X)))
    assert log.T_s == pytest.approx(2e-3)
    assert log.remarks == ("column 'clock' is read as the time; columns (--t) names another",)


def test_groups_of_tdms(tmp_path: Path) -> None:
    path = tdms(
        tmp_path / "log.tdms", ("a", "x_d", X_D), ("a", "x", X), ("b", "x", X[:9]), ("b", "note", ["left"] * 50)
    )
    assert [one.name for one in channels(path)] == ["x_d", "a.x", "b.x", "note"]
    assert len(read_log(path, columns={"x": "a.x"}, T_s=1e-3).t) == 50
    with pytest.raises(LogError, match=r"same number of samples, got: 'x_d' has 50, 'b\.x' has 9"):
        read_log(path, columns={"x": "b.x"}, T_s=1e-3)
    with pytest.raises(LogError, match="column 'note' must be numbers, got object"):
        read_log(path, columns={"x": "note"}, T_s=1e-3)


def test_waveforms_of_tdms_that_begin_later(tmp_path: Path) -> None:
    begin = np.datetime64("2026-03-05T10:20:30", "us")
    with nptdms.TdmsWriter(str(tmp_path / "log.tdms")) as file:
        for name, late in (("x_d", 0), ("x", 3000)):
            known = {"wf_increment": 1e-3, "wf_start_offset": 0.0, "wf_start_time": begin + np.timedelta64(late, "us")}
            file.write_segment([nptdms.ChannelObject("a", name, DATA["t"] + 1e-6 * late, properties=known)])
    log = read_log(tmp_path / "log.tdms", resample=True)
    assert len(log.t) == 47
    np.testing.assert_allclose(log.x_d, log.x_meas, atol=1e-15)


# Parquet and Arrow


def test_nulls_times_structs_and_decimals(tmp_path: Path) -> None:
    stamps = pa.array(np.datetime64("2026-03-05T10:20:30", "ns") + np.arange(50) * np.timedelta64(10**6, "ns"))
    cents = pa.array([decimal.Decimal(f"{x:.3f}") for x in X_D])
    axis = pa.StructArray.from_arrays([cents, pa.array([None if i == 30 else x for i, x in enumerate(X)])], ["d", "m"])
    data = {"clock": stamps, "axis": axis, "note": pa.array(["ok"] * 50)}
    names = {"x_d": "axis.d", "x": "axis.m"}
    for path in (write_parquet(tmp_path / "log.parquet", data), write_arrow(tmp_path / "log.arrow", data)):
        log = read_log(path, columns=names, uniform=False)
        np.testing.assert_allclose(log.x_d, np.round(X_D, 3), atol=1e-15)
        assert np.flatnonzero(np.isnan(log.x_meas)).tolist() == [30]
        assert log.T_s == 1e-3
        with pytest.raises(LogError, match=r"sample 31 .*: column 'axis\.m' must be finite, got nan; missing"):
            read_log(path, columns=names)
        with pytest.raises(LogError, match=r"column 'note' must be numbers, got string"):
            read_log(path, columns={**names, "x": "note"})


def test_kinds_of_arrow(tmp_path: Path) -> None:
    for compression in ("lz4", "zstd", "uncompressed"):
        pa.feather.write_feather(pa.table(dict(DATA)), str(tmp_path / "log"), compression=compression)
        np.testing.assert_array_equal(read_log(tmp_path / "log").x_meas, X)
    np.testing.assert_array_equal(read_log(write_arrow(tmp_path / "log", DATA, stream=True)).x_meas, X)


def test_units_in_the_metadata_of_fields(tmp_path: Path) -> None:
    fields = [pa.field(name, pa.float64(), metadata={"unit": "mm"}) for name in ("x_d", "x")]
    pq.write_table(pa.table([X_D, X], schema=pa.schema(fields)), tmp_path / "log")
    assert read_log(tmp_path / "log", T_s=1e-3).file_unit == "mm"


# Excel


def test_workbook_with_units_and_other_sheets(tmp_path: Path) -> None:
    data = {name: [unit, *map(float, DATA[name])] for name, unit in (("t", "s"), ("x_d", "mm"), ("x", "mm"))}
    path = write_xlsx(tmp_path / "log.xlsx", data, first="Machine A 12")
    log = read_log(path)
    np.testing.assert_allclose(log.x_d, 1e-3 * X_D, rtol=1e-15)
    assert log.file_unit == "mm"
    book = openpyxl.load_workbook(path)
    sheet = book.create_sheet("Second")
    for row in (["x_d", "torque"], [1, 2], [3, 4]):
        sheet.append(row)
    book.save(path)
    assert [one.name for one in channels(path)] == ["t", "x_d", "x", "Second.x_d", "Second.torque"]
    with pytest.raises(LogError, match=r"'x_d', 'Second\.torque', 't' are on different sheets"):
        read_log(path, columns={"x": "Second.torque"}, T_s=1e-3)


def test_dates_of_a_workbook(tmp_path: Path) -> None:
    begin = datetime.datetime(2026, 3, 5, 23, 59, 59)
    clock = [begin + datetime.timedelta(seconds=0.1 * i) for i in range(50)]
    log = read_log(write_xlsx(tmp_path / "log", {"clock": clock, "x_d": X_D, "x": X}))
    assert log.T_s == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        ("1,5", r"log, row 5 of sheet 'Log': column 'x' must be a number, got '1,5'"),
        (None, r"row 5 of sheet 'Log': column 'x' must be a number, got nothing; missing measurements"),
        ("=1/0", r"row 5 .*must be a number, got"),
    ],
)
def test_cells_that_are_no_numbers(tmp_path: Path, cell: object, message: str) -> None:
    values = [*map(float, X)]
    path = write_xlsx(tmp_path / "log", {**DATA, "x": [*values[:3], cell, *values[4:]]})
    with pytest.raises(LogError, match=message):
        read_log(path)
    if cell is None:
        assert np.isnan(read_log(path, uniform=False).x_meas[3])


def test_a_workbook_without_numbers(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no sheet has a row of names with numbers below it"):
        read_log(write_xlsx(tmp_path / "log", {"a": ["b"], "c": ["d"]}))


# LinuxCNC halscope

JOINTS = {
    "joint.0.pos-cmd": X_D,
    "joint.0.motor-pos-cmd": X_D,
    "joint.0.motor-pos-fb": X,
    "joint.1.pos-cmd": 2 * X_D,
    "joint.1.pos-fb": 2 * X,
}


@pytest.mark.parametrize("old", [False, True])
def test_joints_of_halscope(tmp_path: Path, old: bool) -> None:
    text = halscope_pairs(JOINTS, 500_000, comma=True) if old else halscope_csv(JOINTS, 500_000)
    (tmp_path / "log").write_text(text)
    log = read_log(tmp_path / "log", unit="mm")
    np.testing.assert_allclose(log.x_meas, 1e-3 * X, rtol=1e-15)
    assert (log.T_s, len(log.t)) == (5e-4, 50)
    assert log.remarks[0].startswith("halscope states no unit")
    assert log.remarks[1] == "joint.0 of joint.0, joint.1 is read; axis='…' (--axis) chooses another"
    for name in ("1", "joint.1"):
        np.testing.assert_allclose(read_log(tmp_path / "log", axis=name, unit="mm").x_d, 2e-3 * X_D, rtol=1e-15)
    with pytest.raises(LogError, match=r"axis 'joint\.7' is missing; .* are there for joint\.0, joint\.1"):
        read_log(tmp_path / "log", axis="joint.7")
    names = {"x_d": "joint.0.pos-cmd", "x": "joint.1.pos-fb"}
    np.testing.assert_allclose(read_log(tmp_path / "log", columns=names, unit="mm").x_meas, 2e-3 * X, rtol=1e-15)


def test_channels_of_halscope_that_are_off(tmp_path: Path) -> None:
    data = {"x_d": X_D, "x": X, "(null)": 0 * X}
    (tmp_path / "log").write_text(halscope_pairs(data))
    assert [one.name for one in channels(tmp_path / "log")] == ["x_d", "x", "t"]


@pytest.mark.parametrize(
    ("old", "change", "message"),
    [
        (False, ("period is 1000000", "period is 0"), "line 1: the sampling period must be a positive number of ns"),
        (True, ("period is 1000000", "period is -5"), "line 1: the sampling period .* got -5"),
        (True, ("x_d", "y", 3), r"line 5: values of 'x_d', 'x' in turn were expected, got 'y "),
        (True, ("+0.9", "+0.9.", 1), r"line \d+: column 'x' must be a number, got '\+0\.9\.|names and values in turn"),
        (False, (";0.0\n", ";\n"), r"line 5: column 'x' must be a number, got nothing; missing"),
        (False, ("x_d;x\n", "x_d;x;y\n"), r"line 5: 3 columns were expected as in line 2, got 2"),
    ],
)
def test_damaged_halscope(tmp_path: Path, old: bool, change: tuple[Any, ...], message: str) -> None:
    data = {"x_d": 0 * X_D, "x": 0 * X + (0.9 if old else 0.0)}
    text = halscope_pairs(data) if old else halscope_csv(data)
    before, after, *which = change
    at = -1
    for _ in range(which[0] if which else 1):
        at = text.index(before, at + 1)
    (tmp_path / "log").write_text(text[:at] + after + text[at + len(before) :])
    with pytest.raises(LogError, match=message):
        read_log(tmp_path / "log")
