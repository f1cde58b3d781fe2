"""Log formats: recognised by content, Siemens Capture, MATLAB v7.3 and structs, and advice for the others."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from log_files import EVERY_FORMAT, capture, columns, write
from places import RECORDINGS
from scipy import io

from hybridsep.base.errors import LogError
from hybridsep.logs.log import open_log, read_log


@EVERY_FORMAT
def test_content_and_not_the_name_decides(tmp_path: Path, suffix: str) -> None:
    name = "log.mat" if suffix in (".csv", ".csv.gz", ".json") else "log.csv"
    shutil.move(write(tmp_path / f"file{suffix}", columns()), tmp_path / name)
    assert len(read_log(tmp_path / name).t) == 50


def test_version_4_of_matlab(tmp_path: Path) -> None:
    io.savemat(tmp_path / "log.mat", columns(), format="4")
    np.testing.assert_array_equal(read_log(tmp_path / "log.mat").x_d, columns()["x_d"])


@pytest.mark.slow
def test_structs(tmp_path: Path) -> None:
    io.savemat(tmp_path / "log.mat", {"rec": columns(), "name": "axis"})
    with pytest.raises(
        LogError, match=r"columns 't', 'x_d', 'x' are missing, the file has 'rec\.t', 'rec\.x_d', 'rec\.x', 'name'"
    ):
        open_log(tmp_path / "log.mat")
    names = {role: f"rec.{role}" for role in ("t", "x_d", "x")}
    assert len(read_log(tmp_path / "log.mat", columns=names).t) == 50
    with h5py.File(tmp_path / "v73.mat", "w") as file:
        for name, values in columns().items():
            file[f"rec/{name}"] = values[:, None]
        file["note"] = np.array([72, 105], dtype=np.uint16)
        file["note"].attrs["MATLAB_class"] = b"char"
    assert len(read_log(tmp_path / "v73.mat", columns=names).t) == 50
    with pytest.raises(LogError, match="column 'note' must be a full matrix, got str"):
        read_log(tmp_path / "v73.mat", columns={**names, "x": "note"})


def test_hdf5_without_its_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "log.mat"
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + bytes(500))
    with pytest.raises(LogError, match=r"is truncated, damaged or not a MATLAB v7\.3 \(HDF5\) file: OSError"):
        read_log(path)
    (tmp_path / "h5py.py").write_text("raise ModuleNotFoundError('no h5py', name='h5py')\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    message = (
        r"needs the extra hdf5: pip install 'hybridsep\[hdf5\]'; or save it with '-v7' .*save\('log_v7\.mat', '-v7'\)"
    )
    with pytest.raises(LogError, match=message):
        read_log(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"FEA1....", r"is Feather of version 1, which is not read; pandas\.read_feather\('file'\)\.to_csv"),
        (b"PK\x03\x04" + bytes(30), r"is a zip archive of another kind than \.npz and \.xlsx, .*; unpack it"),
        (b'{"a": 1}', r"is JSON of another kind than Siemens Capture, which is not read; pandas\.read_json"),
        (b"<?xml version='1.0'?>", r"is XML of another kind than a SINUMERIK trace, .*; save its columns t"),
        (b"\x93NUMPY\x01\0", r"is a NumPy \.npy array, which is not read; numpy\.savez\('log\.npz', t=a"),
        (b"\x80\x04\x95\0", r"is a Python pickle, .* a pickle runs code"),
        (b"BZh91AY", r"is compressed, which is not read; unpack it, or compress it by gzip"),
        (bytes(range(256)), r"is in no format that is read \(NumPy \.npz, .*, text\); save its columns t, x_d and x"),
    ],
)
def test_formats_without_a_reader(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "file").write_bytes(content)
    with pytest.raises(LogError, match=message):
        open_log(tmp_path / "file")


def test_binary_rubbish_under_a_known_name(tmp_path: Path) -> None:
    (tmp_path / "log.mat").write_bytes(bytes(range(256)))
    with pytest.raises(LogError, match=r"log\.mat: is truncated, damaged or not a MATLAB"):
        open_log(tmp_path / "log.mat")


def test_another_librarys_error_is_named(tmp_path: Path) -> None:
    """It was "error: Error -3", as zlib calls its exception error."""
    log = tmp_path / "log.mat"
    io.savemat(log, {"x": np.random.default_rng(0).normal(size=500)}, do_compression=True)
    content = log.read_bytes()
    log.write_bytes(content[:300] + bytes(200) + content[500:])
    with pytest.raises(LogError, match=r"log\.mat: is truncated, damaged or not a MATLAB file: zlib\.error: Error -3"):
        open_log(log)


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
    with pytest.raises(LogError, match=r"axis 'Y1' is missing; DES_POS and ENC_POS are there for X1 \(1\), C1 \(4\)"):
        read_log(path, axis="Y1")
    np.testing.assert_array_equal(read_log(path, columns={"x": "DES_POS|4"}).x_meas, log.x_d)


def spoiled(what: str) -> str:
    content = recording()
    header, payload = content["Header"], content["Payload"]
    match what:
        case "cycle":
            header["CycleTimeMs"] = 0
        case "signals":
            header["SignalListHFData"] = {}
        case "signal":
            del header["SignalListHFData"][2]["Axis"]
        case "row":
            payload[0]["HFData"][3] = [1.0]
        case "value":
            payload[3]["HFData"][4][1] = "1"
        case "rows":
            payload[3]["HFData"] = None
        case "payload":
            del content["Payload"]
        case "lost":
            del payload[0]["HFData"][7]
        case "huge":
            payload[0]["HFData"][0][0] = 10**400
        case "nan":
            payload[0]["HFData"][1][3] = float("nan")
        case "deep":
            return '{"SignalListHFData"' + ":[" * 100_000
    return json.dumps(content)


@pytest.mark.parametrize(
    ("what", "message"),
    [
        ("cycle", "Header.CycleTimeMs must be a number of milliseconds above 0, got 0"),
        ("signals", "Header.SignalListHFData must be a list, got dict"),
        ("signal", r"Header\.SignalListHFData\[2\] must have a Name and an Axis, got {'Name'"),
        ("row", r"Payload\[0\]\.HFData\[3\] must have 5 values, one a signal, got 1"),
        ("value", r"Payload\[3\]\.HFData\[4\]\[1\] must be a number, got '1'"),
        ("rows", r"Payload\[3\]\.HFData must be a list, got NoneType"),
        ("payload", "Payload must be a list, got NoneType"),
        ("lost", r"sample 8 .*uniform: .* got 0\.004 s; 1 sample may be lost"),
        ("huge", "a value is no floating-point number"),
        ("nan", r"sample 2 \(the first is 1\): column 'DES_POS\|4' must be finite, got nan"),
        ("deep", "is truncated, damaged or not JSON"),
    ],
)
def test_refused_captures(tmp_path: Path, what: str, message: str) -> None:
    path = tmp_path / "recording.json"
    path.write_text(spoiled(what))
    with pytest.raises(LogError, match=rf"recording\.json.*{message}"):
        read_log(path)


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason="needs ../shared/data/recordings beside the repository")
@pytest.mark.parametrize(("axis", "file"), [(None, 1), ("X1", 1), ("2", 2)])
def test_recorded_capture(axis: str | None, file: int) -> None:
    log, same = read_log(RECORDINGS / "cnc_a_capture.json", axis=axis), read_log(RECORDINGS / f"cnc_a_axis{file}.csv")
    np.testing.assert_allclose(log.x_d, same.x_d, atol=1e-12)
    np.testing.assert_allclose(log.x_meas, same.x_meas, atol=1e-12)
    np.testing.assert_allclose(log.t, same.t, atol=1e-12)
