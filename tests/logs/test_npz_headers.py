"""Headers of arrays in ``.npz`` files: what NumPy and others write is read, damage is one line."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from log_files import columns, write

from hybridsep.base.errors import LogError
from hybridsep.logs.log import read_log
from hybridsep.logs.npy_header import read_npy_header

HEADER = "{'descr': '<f8', 'fortran_order': False, 'shape': (50,), }"


def member(header: str, values: bytes = b"", version: int = 1) -> bytes:
    length = len(header).to_bytes(2 if version == 1 else 4, "little")
    return b"\x93NUMPY" + bytes([version, 0]) + length + header.encode("latin-1") + values


def with_member(path: Path, content: bytes) -> Path:
    """Write a log whose array ``x`` is this one."""
    write(path, {name: values for name, values in columns().items() if name != "x"})
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("x.npy", content)
    return path


@pytest.mark.parametrize(
    "array",
    [
        *(np.arange(50, dtype=kind) for kind in ("f8", "<f4", ">f8", ">i2", "u1", "f2", "longdouble")),
        np.asfortranarray(np.arange(50.0).reshape(1, 50)),
        *(np.zeros(50, kind) for kind in ("c16", "U3", "S2", "M8[ns]", "m8[25us]", "?", [("a", "f8"), ("b", "i4", 3)])),
        np.zeros((0, 3)),
        np.array(1.5),
    ],
    ids=lambda array: f"{array.dtype.str}{array.shape}",
)
@pytest.mark.parametrize("version", [(1, 0), (2, 0), (3, 0)])
def test_headers_are_read_as_numpy_reads_them(array: np.ndarray, version: tuple[int, int]) -> None:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, array, version)
    stream.seek(0)
    header = read_npy_header(stream)
    assert header.shape == array.shape
    assert header.dtype.kind == array.dtype.kind
    assert header.dtype == array.dtype or array.dtype.names
    assert stream.read() == array.tobytes(order="A")


@pytest.mark.parametrize(
    "header",
    [
        '{"descr": "<f8", "fortran_order": False, "shape": (50,)}',
        "{'shape':(50L,),'fortran_order':True,'descr':'<f8'}  \n",
        "  {  'descr' : '<f8' , 'fortran_order' : False , 'shape' : ( 50 , 1 ) , }",
    ],
)
def test_other_writers_headers(tmp_path: Path, header: str) -> None:
    values = np.arange(50.0)
    path = with_member(tmp_path / "log.npz", member(header, values.tobytes(), 2))
    np.testing.assert_array_equal(read_log(path).x_meas, values)


@pytest.mark.parametrize(
    ("damaged", "message"),
    [
        (HEADER.replace("{", "("), "its header must hold descr, fortran_order and shape"),
        (HEADER.replace("'<f8'", "'<f8"), "its header must hold"),
        (HEADER.replace("'shape'", "'shale'"), "its header must hold"),
        (HEADER.replace("}", ", " * 900), "its header must hold"),
        (HEADER.replace("}", "}]"), "its header must hold"),
        (HEADER.replace("(50,)", "(" * 3000 + ")" * 3000), "its header must hold"),
        (HEADER.replace("(50,)", "-" * 5000 + "1"), "its header must hold"),
        (HEADER.replace("(50,)", "(5 0,)"), "its shape is damaged"),
        (HEADER.replace("(50,)", f"({'9' * 5000},)"), "its shape is damaged"),
        (HEADER.replace("(50,)", "True"), "its shape is damaged"),
        (HEADER.replace("'<f8'", "'<f7'"), "its type is damaged"),
        (HEADER.replace("'<f8'", "'os.system'"), "its type is damaged"),
        (HEADER.replace("'<f8'", "False"), "its type is damaged"),
        (HEADER.replace("'<f8'", "'|O'"), "must be numbers, got object"),
        (HEADER.replace("'<f8'", "[('a', '<f8')]"), "must be numbers, got .V"),
        (" " * 20_000 + HEADER, "its header must have at most 10000 bytes, got 20058"),
    ],
)
def test_damaged_headers_are_one_line(tmp_path: Path, damaged: str, message: str) -> None:
    """Python's own parser raised SyntaxError, TokenError, MemoryError or RecursionError on such."""
    path = with_member(tmp_path / "log.npz", member(damaged, bytes(400)))
    with pytest.raises(LogError, match=f"log.npz: column 'x' .*{message}") as caught:
        read_log(path)
    assert len(str(caught.value)) < 300
    assert "\n" not in str(caught.value)


def test_an_array_of_another_version(tmp_path: Path) -> None:
    path = with_member(tmp_path / "log.npz", member(HEADER, bytes(400), 9))
    with pytest.raises(LogError, match=r"it does not begin as an \.npy array of version 1 to 3"):
        read_log(path)
