"""Times of recorded logs: the order of the file, wraps of counters, gaps, rounded times, slow sensors, options."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_files import write
from numpy.typing import NDArray

from hybridsep.base.errors import LogError, ParameterError
from hybridsep.logs.log import Log, read_log

Array = NDArray[np.floating[Any]]

N = 600
X_D = np.cumsum(np.sin(np.arange(N) / 50.0)) * 1e-5
X = np.concatenate((np.zeros(6), X_D[:-6])) + 1e-9 * np.arange(N) ** 0.5


def read(folder: Path, t: Array, *, x: Array = X, name: str = "t", **how: float) -> Log:
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


def test_a_clock_that_is_set_back_an_hour(tmp_path: Path) -> None:
    t = 7200.0 + 1e-3 * np.arange(N)
    t[400:] -= 3600.0
    assert read(tmp_path, t).starts == (0, 400)


def test_rows_that_are_written_twice_are_left_out(tmp_path: Path) -> None:
    """They counted as samples: a log of 1 kHz was taken to have 1017 Hz, and so had its FMUs."""
    twice = np.sort(np.concatenate((np.arange(N), [7, 50, 51, 180, 182, 300, 420, 421, 422, 590])))
    columns = {"t": 1e-3 * twice, "x_d": X_D[twice], "x": X[twice]}
    log = read_log(write(tmp_path / "twice.npz", columns))
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
        (86_400.0 + (1e-3 * np.arange(N)).astype(np.float32), 1e-3),
        (1.7e12 + np.arange(N), 1e-3),
        (1.7e9 * 1e3 + 4.0 * np.arange(N), 4e-3),
        (np.arange(N) * 2.0, 2e-3),
    ],
    ids=["two decimals", "single precision", "ms since 1970", "ms since 1970 at 250 Hz", "ms at 500 Hz"],
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


def test_a_long_gap_is_seen_in_rounded_times(tmp_path: Path) -> None:
    t = np.arange(N) // 10 * 0.01
    t[350:] += 5.0
    assert read(tmp_path, t, T_s=1e-3).starts == (0, 350)


@pytest.mark.parametrize("period", [2, 7])
def test_every_nth_sample_of_a_slow_sensor(tmp_path: Path, period: int) -> None:
    held = X[3:][np.maximum(np.arange(N - 3) - 3, 0) // period * period]
    log = read(tmp_path, 1e-3 * np.arange(N - 3), x=held)
    assert log.T_s == pytest.approx(period * 1e-3)
    kept = np.arange(3 % period, N - 3, period)
    np.testing.assert_array_equal(log.x_d, X_D[kept])
    assert log.remarks[0].startswith(f"the measured position is renewed every {period} samples (100 % of its changes")


def test_the_measured_position_is_shifted_by_an_option(tmp_path: Path) -> None:
    t = 1e-3 * np.arange(N)
    for delay in (6, -6):
        log = read(tmp_path, t, delay=delay)
        assert len(log.t) == N - 6
        first = max(-delay, 0)
        np.testing.assert_array_equal(log.x_d, X_D[first : N - max(delay, 0)])
        np.testing.assert_array_equal(log.x_meas, X[first + delay : first + delay + N - 6])
        assert f"(--delay {delay})" in log.remarks[0]
    with pytest.raises(ParameterError, match="--delay must be less than the samples of a segment, got 600"):
        read(tmp_path, t, delay=600)


def test_resampled_by_an_option(tmp_path: Path) -> None:
    t = 1e-3 * np.arange(N)
    keep = np.delete(np.arange(N), [100, 200, 201, *range(300, 350)])
    path = write(tmp_path / "log.npz", {"t": t[keep], "x_d": X_D[keep], "x": X[keep]})
    assert read_log(path).starts == (0, 100, 199, 297)
    log = read_log(path, resample=True)
    assert log.starts == (0, 300)
    assert np.flatnonzero(np.isnan(log.x_meas)).tolist() == [100, 200, 201]
    known = np.isfinite(log.x_meas)
    np.testing.assert_allclose(log.x_d[known], X_D[keep], atol=1e-12)
    uneven = read(tmp_path, t + 2e-4 * np.sin(np.arange(N)), resample=True)
    np.testing.assert_allclose(np.diff(uneven.t), uneven.T_s)
    np.testing.assert_allclose(np.interp(uneven.t, t + 2e-4 * np.sin(np.arange(N)), X), uneven.x_meas, atol=1e-12)
    assert read(tmp_path, t, resample=True).remarks == ()


@pytest.mark.parametrize("unit", ["rev", "deg"])
def test_whole_turns_are_unwrapped(tmp_path: Path, unit: str) -> None:
    turn = {"rev": 1.0, "deg": 360.0}[unit]
    turns = np.cumsum(np.linspace(0.0, 0.02, N))
    x_d, x = turn * turns, turn * np.concatenate((np.zeros(3), turns[:-3]))
    data = {"t": 1e-3 * np.arange(N), f"x_d [{unit}]": x_d % turn, f"x [{unit}]": x % turn}
    log = read_log(write(tmp_path / "log.npz", data))
    np.testing.assert_allclose([log.x_d, log.x_meas], 2 * np.pi / turn * np.array([x_d, x]), atol=1e-9)
    assert "jumps of a whole turn, the first at sample " in log.remarks[0]
