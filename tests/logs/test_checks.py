"""Checks of logs: good ones are neither altered nor refused, columns that mean something else are."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from generated_logs import ACCUSED_BEFORE, generated_log, log_of
from hypothesis import example, given
from hypothesis import strategies as st
from log_files import write
from places import CASES, RECORDINGS
from properties import examples
from scipy.signal import chirp

from hybridsep import load_machine, simulate, spiral
from hybridsep.base.errors import LogError
from hybridsep.base.signals import Array
from hybridsep.logs.checks import check, checked
from hybridsep.logs.log import Log, read_log

GOOD_CASES = CASES.parent / "good"

RECORDED = [*sorted(RECORDINGS.glob("*.npz")), *sorted(GOOD_CASES.glob("*.npz"))]


def names(log: Log) -> list[str]:
    """Return what a log is refused for."""
    return [one.name for one in check(log) if one.refused]


# Good logs


@pytest.mark.parametrize("path", RECORDED, ids=lambda path: path.stem)
def test_a_recorded_log_is_taken_as_it_is(path: Path) -> None:
    log = read_log(path)
    assert names(log) == []
    if "hej90" in path.stem:  # whose sensor is renewed every 15 ms
        assert (len(log.t), log.T_s) == (745, 0.015)
        return
    columns = np.load(path)
    np.testing.assert_array_equal([log.x_d, log.x_meas], [columns["x_d"], columns["x"]])
    assert (log.starts, log.remarks) == ((0,), ())


@pytest.mark.parametrize("first", [0, 42, pytest.param(84, marks=pytest.mark.nightly)])
def test_simulated_axes_are_not_refused(first: int) -> None:
    for seed in range(first, first + 42):
        assert names(generated_log(seed)) == [], seed


@pytest.mark.parametrize("name", ACCUSED_BEFORE)
def test_a_good_log_that_was_refused(name: str) -> None:
    assert names(ACCUSED_BEFORE[name]()) == []


@pytest.mark.parametrize("axis", ["x", "y"])
def test_an_axis_without_lag_is_not_refused(axis: str) -> None:
    machine = load_machine(f"als25010_{axis}")
    x_d = spiral()[axis == "y"][:2000]
    x = simulate(machine.new_plant(), x_d, machine.T_s) + np.random.default_rng(7).normal(0.0, 1e-6, len(x_d))
    assert names(log_of(x_d, x)) == []


# What is refused


def swept() -> Log:
    t = 1e-3 * np.arange(12_000)
    x_d = 5e-4 * chirp(t, 0.5, t[-1], 80.0, phi=-90)
    lag = np.exp(-np.arange(100) / 8.0)
    x = np.convolve(x_d - x_d[0], lag / lag.sum())[: len(t)] + x_d[0]
    return log_of(x_d, x + 2e-7 * np.random.default_rng(1).normal(size=len(t)))


def early(log: Log) -> Log:
    return replace(log, t=log.t[:-15], x_d=log.x_d[:-15], x_meas=log.x_meas[15:])


def moves() -> Log:
    return generated_log(91)


FAULTS: dict[str, tuple[str, Callable[[Log], Log]]] = {
    "flipped": ("sign", lambda log: replace(log, x_meas=-log.x_meas)),
    "mm for m": ("scale", lambda log: replace(log, x_meas=1e3 * log.x_meas)),
    "deg for rad": ("scale", lambda log: replace(log, x_meas=np.degrees(log.x_meas))),
    "gain of 4e-5": ("scale", lambda log: replace(log, x_meas=4e-5 * log.x_meas)),
    "swapped": ("columns swapped", lambda log: replace(log, x_d=log.x_meas, x_meas=log.x_d)),
    "8 samples early": ("columns swapped", early),
    "following error": ("following error", lambda log: replace(log, x_meas=log.x_d - log.x_meas)),
    "minus the following error": ("following error", lambda log: replace(log, x_meas=log.x_meas - log.x_d)),
    "velocity measured": ("velocity", lambda log: replace(log, x_meas=np.gradient(log.x_meas) / log.T_s)),
    "velocity commanded": ("velocity", lambda log: replace(log, x_d=np.gradient(log.x_d) / log.T_s)),
    "another axis": ("hardly follows", lambda log: replace(log, x_meas=generated_log(7).x_d)),
    "one column": ("same column", lambda log: replace(log, x_meas=log.x_d)),
    "no command": ("no motion", lambda log: replace(log, x_d=np.zeros_like(log.x_d))),
    "no motion": ("no motion", lambda log: replace(log, x_meas=np.zeros_like(log.x_d))),
    "short": ("too short", lambda log: log_of(log.x_d[150:240], log.x_meas[150:240], log.T_s)),
    "mm read as m": (
        "unit",
        lambda log: replace(log, x_d=1e3 * log.x_d, x_meas=1e3 * log.x_meas, unit="m", unit_stated=False),
    ),
}


OF_A_SWEPT_SINE = ("flipped", "mm for m", "deg for rad", "swapped", "following error", "one column")


@pytest.mark.parametrize(
    ("fault", "good"), [*((fault, moves) for fault in FAULTS), *((fault, swept) for fault in OF_A_SWEPT_SINE)]
)
def test_columns_that_mean_something_else_are_refused(fault: str, good: Callable[[], Log]) -> None:
    name, spoil = FAULTS[fault]
    log = spoil(good())
    assert names(log) == [name]
    with pytest.raises(LogError, match=f"log.csv: {name}: "):
        checked(log)


def test_a_quiet_sensors_swap_is_found_and_no_shift_is_offered() -> None:
    if not CASES.is_dir():
        pytest.skip("needs ../shared/cases beside the repository")
    log = read_log(CASES / "swap.csv.gz")
    with pytest.raises(LogError, match=r"columns swapped: x_d follows x, 7\.2 samples later") as caught:
        checked(log)
    assert [option for option, _ in caught.value.options] == ["--x_d 'x [mm]' --x 'x_d [mm]'"]
    right = read_log(CASES / "swap.csv.gz", columns={"x_d": "x", "x": "x_d"})
    assert names(right) == []


def test_a_shift_is_offered_where_the_measured_column_is_the_noisier_one() -> None:
    log = early(moves())
    noise = 1e-5 * np.ptp(log.x_d) * np.random.default_rng(0).normal(size=len(log.t))
    (finding,) = check(replace(log, x_meas=log.x_meas + noise))
    assert [option for option, _ in finding.options] == ["--x_d x --x x_d", "--delay -8"]


# What is noted


def held(x: Array) -> Array:
    return np.where((np.arange(len(x)) >= 950) & (np.arange(len(x)) < 1010), x[950], x)


NOTES: dict[str, Callable[[Log], Log]] = {
    "missing samples": lambda log: replace(log, x_meas=np.where(np.arange(len(log.t)) == 700, np.nan, log.x_meas)),
    "rate": lambda log: replace(log, t=log.t + 0.1 * log.T_s * np.sin(np.arange(len(log.t)))),
    "offset": lambda log: replace(log, x_meas=log.x_meas + 0.3 * np.ptp(log.x_d)),
    "late": lambda log: replace(log, x_meas=np.concatenate((np.zeros(400), log.x_meas[:-400]))),
    "start in motion": lambda log: log_of(log.x_d[1200:] - log.x_d[1200], log.x_meas[1200:] - log.x_d[1200], log.T_s),
    "stuck samples": lambda log: replace(log, x_meas=held(log.x_meas)),
    "outliers": lambda log: replace(log, x_meas=log.x_meas + 0.1 * (np.arange(len(log.t)) == 500)),
    "clipped": lambda log: replace(log, x_meas=np.minimum(log.x_meas, 0.8 * float(log.x_meas.max()))),
}


def sines() -> Log:
    t = 1e-3 * np.arange(3000)
    x_d = 0.05 * (1.0 - np.cos(2 * np.pi * 1.3 * t)) + 0.01 * (1.0 - np.cos(2 * np.pi * 3.1 * t))
    lag = np.exp(-np.arange(60) / 6.0)
    return log_of(x_d, np.convolve(x_d, lag / lag.sum())[: len(t)])


@pytest.mark.parametrize("name", NOTES)
def test_what_is_noted_has_a_statistic_and_changes_nothing(name: str) -> None:
    log = NOTES[name](sines())
    found = {one.name: one for one in checked(log)}
    assert name in found
    assert found[name].evidence
    assert str(found[name]).startswith(f"note: {name}: ")


def test_a_coarse_encoder_does_not_stand_behind_a_lag() -> None:
    """Moves of a few steps of the encoder after rests: a step comes late, and nothing sticks."""
    moves_of = np.repeat(np.random.default_rng(3).uniform(0.0, 20e-6, 30), 200)
    x_d = np.convolve(moves_of - moves_of[0], np.ones(12) / 12)[: len(moves_of)]
    lag = np.exp(-np.arange(60) / 8.0)
    x = np.convolve(x_d, lag / lag.sum())[: len(x_d)]
    assert not check(log_of(x_d, 1e-6 * np.round(1e6 * x)))


def test_large_outliers_are_noted_and_do_not_hide_the_axis() -> None:
    log, numbers = moves(), np.random.default_rng(7)
    x = log.x_meas.copy()
    x[20 + 100 * np.arange(28) + numbers.integers(0, 90, 28)] += 10.0 * np.ptp(log.x_d)
    x[[0, -1]] = -10.0 * np.ptp(log.x_d)  # a sensor that is not ready yet, a number that is cut off
    (finding,) = check(replace(log, x_meas=x))
    assert (finding.name, finding.refused, finding.evidence["n"]) == ("outliers", False, 30.0)


def test_numbers_without_bounds_are_checked() -> None:
    log = moves()
    assert check(replace(log, x_meas=1e300 * log.x_meas))[0].refused


# Any log


@given(
    seed=st.integers(0, 10_000),
    n=st.integers(120, 1500),
    gaps=st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(-3.0, 3.0)), max_size=4),
    jitter=st.sampled_from([0.0, 0.1, 0.4]),
    decimals=st.sampled_from([9, 4, 3, 2]),
    hold=st.sampled_from([1, 1, 1, 2, 7]),
    missing=st.sampled_from([0.0, 0.02, 0.3]),
)
@example(seed=3, n=120, gaps=[(0.5, 0.5), (0.46875, -1.0)], jitter=0.0, decimals=9, hold=2, missing=0.0)  # 4 between
@examples(60)
def test_any_log_that_is_read_keeps_its_samples_in_order(
    tmp_path_factory: pytest.TempPathFactory,
    seed: int,
    n: int,
    gaps: list[tuple[float, float]],
    jitter: float,
    decimals: int,
    hold: int,
    missing: float,
) -> None:
    """95 % of its samples, in the order of the file, or it is refused; of a slow sensor every n-th."""
    numbers = np.random.default_rng(seed)
    x_d = np.cumsum(np.cumsum(numbers.normal(0.0, 1e-6, n)))
    x = np.concatenate((np.full(5, x_d[0]), x_d))[:n][np.arange(n) // hold * hold]
    x[numbers.random(n) < missing] = np.nan
    t = 1e-3 * (np.arange(n) + jitter * numbers.uniform(-1.0, 1.0, n))
    for place, by in gaps:
        t[int(place * n) :] += by
    path = write(tmp_path_factory.mktemp("any") / "log.npz", {"t": np.round(t, decimals), "x_d": x_d, "x": x})
    try:
        log = read_log(path)
    except LogError as error:
        assert "log.npz" in str(error)  # noqa: PT017
        return
    if len(log.t) == n:
        np.testing.assert_array_equal(log.x_d, x_d)
        np.testing.assert_array_equal(log.x_meas, x)
    else:
        period = round(log.T_s / 1e-3)
        assert hold > 1
        assert period % hold == 0
        assert abs(len(log.t) - n / period) <= len(log.starts)
    assert all(np.diff(log.starts) > 0)


def test_noise_is_no_delay() -> None:
    """The best mixture spreads over all lags, 15 samples in the mean, where the best single one is 8."""
    t = 1e-2 * np.arange(3000)
    x_d = 0.05 * (1.0 - np.cos(1.8 * np.pi * t / 2.0)) + 0.01 * (1.0 - np.cos(4.2 * np.pi * t / 2.0))
    x = np.r_[np.zeros(8), x_d[:-8]] + np.random.default_rng(0).normal(0.0, 0.03, len(t))
    assert "late" not in {one.name for one in check(log_of(x_d, x, 1e-2))}
