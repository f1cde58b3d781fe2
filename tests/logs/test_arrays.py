"""Arrays: NumPy's ``.npz``, MATLAB's ``.mat``, Parquet."""

import decimal
import sys
import zipfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from log_files import Columns, columns, refused, write, write_parquet
from places import CASES
from scipy import io, sparse

from hybridsep.base.errors import LogError
from hybridsep.logs.formats import open_source
from hybridsep.logs.log import read_log

DATA = columns()
X_D, X = DATA["x_d"], DATA["x"]
HEADER = "{'descr': '<f8', 'fortran_order': False, 'shape': (50,), }"


# NumPy


def with_member(path: Path, header: str) -> Path:
    """Write a log whose array ``x`` is this one."""
    write(path, {name: values for name, values in DATA.items() if name != "x"})
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        length = len(header).to_bytes(2, "little")
        archive.writestr("x.npy", b"\x93NUMPY\x01\x00" + length + header.encode("latin-1") + bytes(400))
    return path


@pytest.mark.parametrize(
    ("header", "message"),
    [
        (HEADER.replace("'shape'", "'shale'"), "is truncated, damaged or not an array: "),
        (HEADER.replace("(50,)", "(" * 3000 + ")" * 3000), "is truncated, damaged or not an array: "),
        (HEADER.replace("'<f8'", "'<f7'"), "is truncated, damaged or not an array: "),
        (HEADER.replace("'<f8'", "'|O'"), "is truncated, damaged or not an array: ValueError: Object arrays"),
        (HEADER.replace("'<f8'", "[('a', '<f8')]"), "must be numbers, got .*'a'"),
        (HEADER.replace("(50,)", "(51,)"), "is truncated, damaged or not an array: "),
    ],
)
def test_damaged_headers_of_npz(tmp_path: Path, header: str, message: str) -> None:
    with pytest.raises(LogError, match=f"log.npz: column 'x' {message}") as caught:
        read_log(with_member(tmp_path / "log.npz", header))
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize("start", [np.datetime64("2026-03-05T10:20:30", "ns"), np.timedelta64(5, "ms")])
def test_times_of_numpy(tmp_path: Path, start: np.datetime64) -> None:
    path = write(tmp_path / "log.npz", columns() | {"t": start + 2 * np.arange(50).astype("m8[ms]")})
    assert read_log(path).T_s == 2e-3
    refused(r"T_s = 0\.001 s was given, but column 't' has an interval of 0\.002 s", path, T_s=1e-3)


@pytest.mark.parametrize("suffix", [".npz", ".mat"])
def test_columns_of_matrices(tmp_path: Path, suffix: str) -> None:
    both = {"q_cmd": np.stack([X_D, 2 * X_D], axis=1), "q_act": np.stack([X, 2 * X])}
    path = write(tmp_path / f"log{suffix}", {"t": DATA["t"], **both})
    np.testing.assert_array_equal(read_log(path, axis="1").x_meas, 2 * X)
    named = read_log(path, columns={"x_d": "q_cmd[1]", "x": "q_act[0]"})
    np.testing.assert_array_equal((named.x_d, named.x_meas), (2 * X_D, X))


def test_damaged_members_of_an_npz(tmp_path: Path) -> None:
    path = write(tmp_path / "log.npz", columns(500))
    data = bytearray(path.read_bytes())
    data[data.rindex(columns(500)["x"][400:].tobytes())] ^= 1
    path.write_bytes(data)
    refused("column 'x' is truncated, damaged or not an array: BadZipFile: Bad CRC-32", path)


@pytest.mark.parametrize("suffix", [".npz", ".mat"])
@pytest.mark.parametrize("dtype", ["<f4", ">f8", "<i4"])
@pytest.mark.parametrize("shape", [(-1, 1), (1, -1)])
def test_types_and_orientations(tmp_path: Path, suffix: str, dtype: str, shape: tuple[int, int]) -> None:
    data = {"t": np.arange(5.0), "x_d": np.arange(5).astype(dtype).reshape(shape), "x": np.ones((5, 1))}
    log = read_log(write(tmp_path / f"log{suffix}", data))
    np.testing.assert_array_equal(log.x_d, np.arange(5.0))
    assert log.x_d.dtype == np.float64


# MATLAB


def test_version_4_of_matlab(tmp_path: Path) -> None:
    io.savemat(tmp_path / "log.mat", columns(), format="4")
    np.testing.assert_array_equal(read_log(tmp_path / "log.mat").x_d, columns()["x_d"])


def test_structs(tmp_path: Path) -> None:
    data, path = columns(), tmp_path / "log.mat"
    signals = np.array([(data["x_d"], "x_d"), (data["x"], "x")], [("values", "O"), ("label", "O")])
    series = {role: {"Time": data["t"], "Data": data[role]} for role in ("x_d", "x")}
    for one in ({"rec": data, "name": "axis"}, {"rec": {"time": data["t"], "signals": signals}}, {"rec": series}):
        io.savemat(path, one)
        log = read_log(path)
        np.testing.assert_array_equal((log.t, log.x_d, log.x_meas), [data[role] for role in ("t", "x_d", "x")])
    for label in ("", "twice"):
        signals["label"] = label
        io.savemat(path, {"rec": {"time": data["t"], "signals": signals}})
        assert read_log(path, columns={"x_d": "rec.signals.0", "x": "rec.signals.1"}).x_meas[7] == data["x"][7]
    io.savemat(path, {"run1": data, "run2": data})
    refused(r"column x_d may be 'run1\.x_d', 'run2\.x_d'; name it: --x_d NAME", path)
    assert len(read_log(path, columns={"x_d": "run2.x_d", "x": "run2.x"}).t) == 50


def test_complex_vectors_are_two_columns(tmp_path: Path) -> None:
    io.savemat(tmp_path / "frf.mat", {"H": np.array([1 + 2j, 3 - 4j])})
    values = open_source(tmp_path / "frf.mat").read(["H.real", "H.imag"]).columns
    np.testing.assert_array_equal(values, [[1, 3], [2, -4]])


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (sparse.eye(5, format="csc"), r"must be a full matrix, got c(s[cr]|oo)_"),
        (np.zeros(9, [("a", "f8"), ("b", "f8")]), "must be a full matrix, got structs"),
    ],
)
def test_mat_that_is_not_a_plain_matrix(tmp_path: Path, value: object, message: str) -> None:
    refused(f"column 'x' {message}", write(tmp_path / "log.mat", columns() | {"x": value}))


@pytest.mark.parametrize("suffix", [".npz", ".mat"])
@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"x_d": np.full(50, np.nan)}, r"sample 1 \(the first is 1\): column 'x_d' must be finite, got nan"),
        ({"x": np.full(50, np.nan)}, r"the measured position is missing \(NaN\) in all 50 samples; name its column"),
        ({"x": np.zeros(49)}, r"same number of samples, got: .*'x_d' has 50, 'x' has 49"),
        ({"x": np.zeros(50) * 1j}, r"column 'x' must be real, got complex numbers \(complex128\)"),
        ({"x": np.zeros((25, 2))}, r"column 'x' is missing, the file has 't', 'x_d', 'x\[0\]', 'x\[1\]'"),
        ({"x": np.zeros((25, 1, 2))}, r"column 'x' must have shape \(n,\), \(n, 1\) or \(1, n\), got \(25, 1, 2\)"),
        ({"x": np.array(["a"] * 50)}, r"column 'x' must be numbers, got <U1"),
    ],
)
def test_bad_arrays(tmp_path: Path, suffix: str, bad: Columns, message: str) -> None:
    refused(message, write(tmp_path / f"log{suffix}", columns() | bad))


# Parquet


def test_a_missing_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path / "log.parquet", columns())
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    refused(r"log.parquet: is a Parquet file, which needs: pip install 'hybridsep\[parquet\]'$", path)


def test_nulls_times_structs_and_decimals(tmp_path: Path) -> None:
    stamps = pa.array(np.datetime64("2026-03-05T10:20:30", "ns") + np.arange(50) * np.timedelta64(10**6, "ns"))
    cents = pa.array([decimal.Decimal(f"{x:.3f}") for x in X_D])
    axis = pa.StructArray.from_arrays([cents, pa.array([None if i == 30 else x for i, x in enumerate(X)])], ["d", "m"])
    path = write_parquet(tmp_path / "log", {"clock": stamps, "axis": axis, "note": pa.array(["ok"] * 50)})
    names = {"x_d": "axis.d", "x": "axis.m"}
    log = read_log(path, columns=names)
    np.testing.assert_allclose(log.x_d, np.round(X_D, 3), atol=1e-15)
    assert np.flatnonzero(np.isnan(log.x_meas)).tolist() == [30]
    assert log.T_s == 1e-3
    refused(r"column 'note' must be numbers: values of type str", path, columns={**names, "x": "note"})


def test_units_in_the_metadata_of_fields(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fields = [pa.field(name, pa.float64(), metadata={"unit": "mm"}) for name in ("x_d", "x", "q", "q")]
    pq.write_table(pa.table([X_D, X, X, X_D], schema=pa.schema(fields)), tmp_path / "log")
    read, asked = pq.ParquetFile.read, dict[str, list[str]]()
    monkeypatch.setattr(pq.ParquetFile, "read", lambda one, columns: read(one, asked.setdefault("read", columns)))
    assert read_log(tmp_path / "log", T_s=1e-3).file_unit == "mm"
    assert asked == {"read": ["x_d", "x"]}


@pytest.mark.skipif(not CASES.is_dir(), reason="needs ../shared/cases/logs beside the repository")
@pytest.mark.parametrize("name", ["dur_us", "time64"])
def test_durations_and_times_of_day(name: str) -> None:
    """The second passes midnight."""
    log = read_log(CASES / f"{name}.parquet")
    assert log.T_s == 1e-3
    np.testing.assert_allclose(log.t, 1e-3 * np.arange(6000), atol=1e-9)
