"""Recorded logs: what is read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from log_files import EVERY_FORMAT, FORMATS, columns, write, write_csv
from places import EMPS
from properties import examples

from hybridsep.logs.log import read_log


@EVERY_FORMAT
def test_every_format_gives_the_same_log(tmp_path: Path, suffix: str) -> None:
    data = columns()
    log = read_log(write(tmp_path / f"log{suffix}", data))
    rounding = 1e-15 if suffix == ".scope" else 0.0  # which has its times in ms
    np.testing.assert_allclose(log.t, data["t"], rtol=rounding)
    np.testing.assert_allclose(log.x_d, data["x_d"], rtol=rounding)
    np.testing.assert_allclose(log.x_meas, data["x"], rtol=rounding)
    assert log.T_s == 1e-3
    assert log.path == tmp_path / f"log{suffix}"


@FORMATS
def test_named_columns_unit_and_ts(tmp_path: Path, suffix: str) -> None:
    data = columns()
    path = write(tmp_path / f"log{suffix}", {"extra": data["t"], "qg": data["x_d"] * 1e3, "qm": data["x"] * 1e3})
    log = read_log(path, columns={"x_d": "qg", "x": "qm"}, unit="mm", T_s=2e-3)
    np.testing.assert_allclose(log.x_d, data["x_d"], rtol=1e-15)
    np.testing.assert_allclose(log.x_meas, data["x"], rtol=1e-15)
    np.testing.assert_array_equal(log.t, np.arange(50) * 2e-3)
    assert log.T_s == 2e-3


def test_micrometres(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "log.csv", "x_d,x\n1,2\n3,4\n")
    np.testing.assert_allclose(read_log(path, unit="um", T_s=1.0).x_meas, [2e-6, 4e-6])


@pytest.mark.parametrize(
    "text",
    [
        "t,x_d,x\n0,1,2\n1,3,4\n",
        "t, x_d, x\r\n0, 1, 2\r\n1, 3, 4\r\n",
        "t;x_d;x\n0;1;2\n1;3;4",
        "t\tx_d\tx\n0\t1\t2\n1\t3\t4\n",
        "t x_d   x\n0 1 2\n 1  3 4\n",
        "# t x_d x\n0 1 2\n1 3 4\n",
        '"t","x_d","x"\n"0","1","2"\n1,3,4\n',
        "'t','x_d','x'\n'0','1','2'\n'1','3','4'\n",
        "\n\nt,x_d,x\n\n0,1,2\n\n1,3,4\n\n",
        "\ufefft,x_d,x\n0,1,2\n1,3,4\n",
        "note,x,t,x_d\n9,2,0,1\nno number,4,1,3\n",
        "t,x_d,x,\n0,1,2,\n1,3,4,\n",
    ],
)
def test_spellings_of_csv(tmp_path: Path, text: str) -> None:
    log = read_log(write_csv(tmp_path / "log.csv", text))
    assert (log.t.tolist(), log.x_d.tolist(), log.x_meas.tolist(), log.T_s) == ([0, 1], [1, 3], [2, 4], 1.0)


@pytest.mark.parametrize("suffix", [".npz", ".mat"])
@pytest.mark.parametrize("dtype", ["<f4", ">f8", "<i4"])
@pytest.mark.parametrize("shape", [(-1, 1), (1, -1)])
def test_types_and_orientations(tmp_path: Path, suffix: str, dtype: str, shape: tuple[int, int]) -> None:
    data = {"t": np.arange(5.0), "x_d": np.arange(5).astype(dtype).reshape(shape), "x": np.ones((5, 1))}
    log = read_log(write(tmp_path / f"log{suffix}", data))
    np.testing.assert_array_equal(log.x_d, np.arange(5.0))
    assert log.x_d.dtype == np.float64


def test_compressed_npz(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "log.npz", **columns())
    assert len(read_log(tmp_path / "log.npz").x_meas) == 50


@FORMATS
@pytest.mark.parametrize(
    ("measured", "names", "read"),
    [
        (("x",), {}, "x"),
        (("x_meas",), {}, "x_meas"),
        (("x", "x_meas"), {}, "x_meas"),
        (("x_meas", "x"), {}, "x_meas"),
        (("x", "x_meas"), {"x": "x"}, "x"),
        (("x_meas", "x_enc"), {"x": "x_enc"}, "x_enc"),
    ],
)
def test_which_column_is_the_measured_position(
    tmp_path: Path, suffix: str, measured: tuple[str, ...], names: dict[str, str], read: str
) -> None:
    """Where the true position is x and the measured one x_meas, the latter is meant unless a name is given."""
    data = {name: columns()[name] for name in ("t", "x_d")} | {name: np.full(50, float(len(name))) for name in measured}
    path = write(tmp_path / f"log{suffix}", data)
    np.testing.assert_array_equal(read_log(path, columns=names).x_meas, np.full(50, float(len(read))))


# The time axis


@pytest.mark.parametrize("T_s", [1e-3, 1 / 3000, 1 / 8192, 2.5e-4, 1.25e-5, 0.0040012])
def test_interval_is_the_mean_rounded_sensibly(tmp_path: Path, T_s: float) -> None:
    path = write(tmp_path / "log.npz", columns(2000, T_s) | {"t": 17.0 + np.arange(2000) * T_s * (1 + 3e-9)})
    assert read_log(path).T_s == T_s


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1000, 30_000))
@examples(20)
def test_jitter_of_a_clock_does_not_move_the_interval(
    seed: int, n: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    t = np.arange(n) * 1e-3 + np.random.default_rng(seed).uniform(-1e-5, 1e-5, n)
    path = write(tmp_path_factory.mktemp("jitter") / "log.npz", {"t": t, "x_d": t, "x": t})
    assert read_log(path).T_s == pytest.approx(1e-3, rel=2e-5)


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
    assert (len(log.x_meas), log.T_s) == (24_841, 1e-3)
    assert 1e6 * np.sqrt(np.mean((log.x_d - log.x_meas) ** 2)) == pytest.approx(577.8, abs=0.1)
