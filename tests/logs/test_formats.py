"""Log formats: recognised by content, Siemens Capture, MATLAB v7.3 and structs, and advice for the others."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from log_files import EVERY_FORMAT, columns, write

from hybridsep.base.errors import LogError
from hybridsep.logs.log import read_log


@EVERY_FORMAT
def test_content_and_not_the_name_decides(tmp_path: Path, suffix: str) -> None:
    name = "log.mat" if suffix in (".csv", ".csv.gz", ".json") else "log.csv"
    shutil.move(write(tmp_path / f"file{suffix}", columns()), tmp_path / name)
    assert len(read_log(tmp_path / name).t) == 50


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"ARROW1..", r"is Arrow or Feather, .*; import pandas; pandas\.read_feather\('file'\)\.to_csv"),
        (
            b"\x89HDF\r\n\x1a\n",
            r"is HDF5, or MATLAB 7\.3, .* these three lines .*\nimport h5py, numpy\n",
        ),
        (
            b"MATLAB 7.3 MAT-file, Platform",
            r"is HDF5, or MATLAB 7.*\n.*\nwith h5py\.File\('file'\) as f:\n    numpy",
        ),
        (b"MDF     4.10", "is ASAM MDF, which is not read; docs/howto/recorders.md has three lines of Python"),
        (b"TDSm", "is NI TDMS, which is not read; docs/howto/recorders.md has"),
        (
            b"PK\x03\x04" + bytes(30),
            "is an Excel workbook, or another zip .*; save its columns .* in Excel, or",
        ),
        (
            b'{"a": 1}',
            r"is JSON of another kind than Siemens Capture, .*; import pandas; pandas\.read_json",
        ),
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


def test_binary_rubbish_under_a_known_name(tmp_path: Path) -> None:
    (tmp_path / "log.mat").write_bytes(bytes(range(256)))
    with pytest.raises(LogError, match=r"log\.mat: is truncated, damaged or not a MATLAB"):
        read_log(tmp_path / "log.mat")
