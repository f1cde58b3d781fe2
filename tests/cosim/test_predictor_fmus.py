"""Predictor FMU against plant FMU: agreement with the library, wiring, files; the figures are test_demo's."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hybridsep import Encoder, Run, backtest, cosimulate, load_machine, simulate
from hybridsep.base.errors import FmuError, SignalError
from hybridsep.plants.trajectory import staircase

Fmu = Callable[[str], Path]


@pytest.fixture(scope="module")
def pair(python_fmu: Fmu) -> tuple[Path, Path]:
    return python_fmu("HybridPredictorPy"), python_fmu("FeedDrivePy")


@pytest.fixture(scope="module")
def run(pair: tuple[Path, Path]) -> Run:
    return cosimulate(*pair, staircase())


@pytest.mark.slow
def test_fmus_equal_the_library(run: Run) -> None:
    machine = load_machine("spring_mass_damper")
    x = simulate(machine.new_plant(), staircase(), machine.T_s)
    np.testing.assert_allclose(run.x, x, atol=1e-15)
    np.testing.assert_array_equal(run.x_d, staircase())
    # One draw right after the initialization, then one each communication step; the fill took the first 100.
    noise = Encoder(5e-6, 0).measure_all(np.zeros(len(x) + 100))[100:]
    np.testing.assert_allclose(run.x_meas, x + noise, atol=1e-15)
    result = backtest(machine.new_predictor(), staircase(), run.x_meas)
    np.testing.assert_allclose(run.x_pb, result.x_pb, atol=1e-15)
    np.testing.assert_allclose(run.x_h, result.x_h, atol=1e-12)
    np.testing.assert_allclose(run.x_hold, result.x_hold, atol=1e-15)
    np.testing.assert_array_equal(run.active, result.active)
    assert run.summary()["rms_h_um"] == pytest.approx(result.summary()["rms_h_um"], rel=1e-9)
    np.testing.assert_allclose(run.batch_rms()["x_h"], result.batch_rms_h, rtol=1e-9)


@pytest.mark.slow
def test_a_shifted_start_gives_the_same_errors(pair: tuple[Path, Path], run: Run) -> None:
    shifted = cosimulate(*pair, staircase() + 0.1)
    np.testing.assert_allclose(shifted.x_h - 0.1, run.x_h, rtol=0, atol=1e-10)


def test_start_time_and_parameters(pair: tuple[Path, Path]) -> None:
    r = staircase()[:1200]
    at_zero = cosimulate(*pair, r, controller_values={"Np": 50, "p": 20})
    later = cosimulate(*pair, r, controller_values={"Np": 50, "p": 20}, start_time=100.0)
    np.testing.assert_array_equal(at_zero.x_h, later.x_h)
    assert later.t[0] == pytest.approx(100.05)
    assert (later.Np, len(later.t)) == (50, len(r))


def test_results_as_csv_and_npz(run: Run, tmp_path: Path) -> None:
    run.save(tmp_path / "run.csv")
    run.save(tmp_path / "run.npz")
    with (tmp_path / "run.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    with np.load(tmp_path / "run.npz") as arrays:
        assert set(arrays) == set(rows[0]) == {"t", "x_d", "x", "x_meas", "x_pb", "x_hold", "x_h", "x_h_std", "active"}
        for name in ("t", "x_meas", "x_h"):
            np.testing.assert_array_equal(arrays[name], [float(row[name]) for row in rows])
            np.testing.assert_array_equal(arrays[name], getattr(run, name))
    with pytest.raises(ValueError, match=r"written as .csv or .npz, got 'run.xlsx'"):
        run.save(tmp_path / "run.xlsx")


def test_progress_is_reported_to_the_end(pair: tuple[Path, Path]) -> None:
    calls: list[tuple[int, int]] = []
    cosimulate(*pair, staircase()[:300], progress=lambda k, n: calls.append((k, n)))
    assert calls[-1] == (400, 400)
    assert 50 < len(calls) < 150


def test_what_is_refused(pair: tuple[Path, Path]) -> None:
    with pytest.raises(SignalError, match="r must be finite, got nan at sample 1"):
        cosimulate(*pair, [0.0, float("nan")])
    with pytest.raises(SignalError, match="r must have 1 samples, got 0"):
        cosimulate(*pair, [])
    with pytest.raises(FmuError, match="p must be 1 … Np = 100, got 101"):
        cosimulate(*pair, [0.0, 0.0], controller_values={"p": 101})
    with pytest.raises(FmuError, match="has no variable 'stiffness'"):
        cosimulate(*pair, [0.0, 0.0], plant_values={"stiffness": 1.0})
    with pytest.raises(FmuError, match=r"FeedDrivePy.fmu is no predictor: it has no input x_d_ahead"):
        cosimulate(pair[1], pair[0], [0.0, 0.0])
    with pytest.raises(FmuError, match=r"HybridPredictorPy.fmu is no plant: it has no input x_d$"):
        cosimulate(pair[0], pair[0], [0.0, 0.0])
    for value in (99_999_999_999, 1.5, "one"):
        with pytest.raises(FmuError, match=rf"seed must be a whole number within ±2147483647, got {value!r}"):
            cosimulate(*pair, [0.0, 0.0], plant_values={"seed": value})


def test_sampling_intervals_must_agree(python_fmu: Fmu) -> None:
    fmus = python_fmu("HybridPredictorPy"), python_fmu("FeedDrivePy_als25010_x")
    with pytest.raises(
        FmuError, match=r"FeedDrivePy_als25010_x.fmu has T_s = 0.002 s, but HybridPredictorPy.fmu has 0.001 s"
    ):
        cosimulate(*fmus, [0.0, 0.0], plant_values={"T_s": 0.002})
