"""The replay of a log, and the open benchmark."""

import math
from dataclasses import replace

import numpy as np
import pytest
from oracle import held
from places import EMPS

from benchmarks.fit import errors_of
from hybridsep.base.errors import SignalError
from hybridsep.base.metrics import rms
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.evaluate.backtest import backtest, replayed_run
from hybridsep.logs.log import read_log
from hybridsep.machines.machine import load_machine
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.predict.predictor import HybridPredictor


def predictor(Np: int = 20, p: int = 5, q: int = 2, t_init: float = 0.05) -> HybridPredictor:
    return HybridPredictor(
        ModalModel([Mode(25.0, 0.7, (50 * np.pi) ** 2)]),
        PredictorSettings(averaging=False, Np=Np, p=p, q=q, t_init=t_init),
    )


def log(n: int = 1010) -> tuple[Array, Array]:
    """Return a command and a position that lags behind it, offset and curved as no linear model has it."""
    t = np.arange(n) * 1e-3
    x_d = 0.1 + 0.01 * np.sin(9 * t) ** 3
    return x_d, 0.1 + 0.0098 * np.sin(9 * (t - 0.004)) ** 3 + 1e-5 * np.tanh(50 * np.cos(9 * t))


@pytest.mark.skipif(not EMPS.is_file(), reason="needs ../shared/data/emps beside the repository")
def test_recorded_axis() -> None:
    log, machine = read_log(EMPS, columns={"t": "t", "x_d": "qg", "x": "qm"}), load_machine("emps")
    paper = replace(machine.predictor_settings, averaging=False, t_init=1.242)
    summary = backtest(machine.new_predictor(paper), log.x_d, log.x_meas).summary()
    assert summary["rms_pb_um"] == pytest.approx(15.45, abs=0.05)
    assert summary["rms_hold_um"] == pytest.approx(5.93, abs=0.05)
    assert summary["rms_h_um"] <= 5.55
    assert summary["reduction_percent"] > 60
    assert (summary["n_samples"], summary["n_batches"]) == (24_841, 249)
    assert summary["n_samples_after_warm_up"] == 24_841 - 1242


def test_scores_are_those_of_the_predictions() -> None:
    x_d, x = log()
    result = backtest(predictor(), x_d, x)
    assert (result.n_batches, result.overall.n_samples, result.after_warm_up.n_samples) == (51, 1010, 960)
    np.testing.assert_array_equal(result.active, np.arange(1010) >= 50)
    for name in ("pb", "hold", "h"):
        error = x - getattr(result, f"x_{name}")
        windows = [rms(error[i : i + 20]) for i in range(0, 1010, 20)]
        for score, part in ((result.overall, error), (result.after_warm_up, error[50:])):
            assert getattr(score, name).rms == pytest.approx(rms(part), rel=1e-12)
            assert getattr(score, name).largest == np.abs(part).max()
        np.testing.assert_allclose(getattr(result, f"batch_rms_{name}"), windows, rtol=1e-12)
        assert result.summary()[f"rms_{name}_um"] == pytest.approx(1e6 * rms(error), rel=1e-12)
        assert result.summary()[f"max_{name}_um_after_warm_up"] == 1e6 * np.abs(error[50:]).max()
    expected = 100 * (1 - result.overall.h.rms / result.overall.pb.rms)
    assert result.summary()["reduction_percent"] == pytest.approx(expected)


@pytest.mark.parametrize("delay", [0, 3, 25])
def test_hold_is_the_last_sample_measured_whatever_is_believed(delay: int) -> None:
    """On an axis in motion at the start, which stands, changes its level, and is missing for a while."""
    x_d, x = (signal[180:] for signal in log(1190))
    x = x.copy()
    x[300:420] = x[300]
    x[500:] += 2e-4
    x[599::100] += 0.1  # out of reach
    x[700:745] = np.nan
    settings = PredictorSettings(Np=20, p=5, q=2, t_init=0.0, measurement_delay=delay)
    result = backtest(HybridPredictor(predictor().model, settings), x_d, x)
    assert result.verdict.n_rejected > result.verdict.n_missing
    expected = held(result.x_pb[delay:], x[delay:], 20, delay=delay)
    np.testing.assert_allclose(result.x_hold[delay:], expected, rtol=0, atol=1e-15)
    error = (x - result.x_hold)[delay:]
    assert result.overall.hold.rms == pytest.approx(rms(error[~np.isnan(error)]), abs=1e-15)
    run = replayed_run(result, x_d, x, 1e-3, 20, measurement_delay=delay)
    np.testing.assert_allclose(run.x_hold, expected, rtol=0, atol=1e-15)
    assert run.prediction_figures()["rms_hold_um"] == pytest.approx(1e6 * result.overall.hold.rms, rel=1e-12)


def test_log_shorter_than_the_warm_up() -> None:
    result = backtest(predictor(), *log(30))
    assert result.after_warm_up.n_samples == 0
    assert math.isnan(result.after_warm_up.pb.rms)
    assert math.isnan(result.summary()["reduction_percent_after_warm_up"])
    assert result.summary()["reduction_percent"] == 0.0


def test_perfect_physics_leaves_nothing_to_reduce() -> None:
    x_d = np.zeros(100)
    assert backtest(predictor(), x_d, x_d).summary()["reduction_percent"] == 0.0
    warm = predictor()
    backtest(warm, *log())
    warm.restart()
    figures = backtest(warm, x_d, x_d).summary()
    assert (figures["rms_pb_um"], figures["reduction_percent"]) == (0.0, -math.inf)


@pytest.mark.parametrize(
    ("x_d", "x", "message"),
    [
        ([], [], "x_d must have at least one sample, got none"),
        ([0.0, 1.0], [0.0], "x_meas must have 2 samples, got 1"),
        ([[0.0]], [[0.0]], r"x_d must be one-dimensional, got shape \(1, 1\)"),
        ([0.0, math.nan], [0.0, 0.0], "x_d must be finite, got nan at sample 1"),
        ([0.0, 0.0], [0.0, math.inf], "x_meas must be finite, got inf at sample 1"),
    ],
)
def test_bad_arrays(x_d: list[float], x: list[float], message: str) -> None:
    replaying = predictor()
    before = replaying.to_bytes()
    with pytest.raises(SignalError, match=message):
        backtest(replaying, x_d, x)
    assert replaying.to_bytes() == before


def test_missing_measurements_are_bridged_with_averaging_and_refused_without() -> None:
    x_d, x = log()
    holes = x.copy()
    holes[300:320:2] = np.nan
    holes[500:520] = np.nan  # a whole window
    with pytest.raises(SignalError, match="x_meas must be finite, got nan at sample 300: missing measurements need"):
        backtest(predictor(), x_d, holes)
    settings = PredictorSettings(Np=20, p=5, q=2, t_init=-1.0)
    result = backtest(HybridPredictor(predictor().model, settings), x_d, holes)
    assert result.overall.n_samples == 1010 - 30
    assert result.overall.h.rms == pytest.approx(rms((holes - result.x_h)[~np.isnan(holes)]), rel=1e-12)
    assert np.isfinite(result.x_h).all()
    assert np.isfinite(result.x_h_std).all()
    assert math.isnan(result.batch_rms_h[25])
    assert result.verdict.n_rejected >= 30


class Hold:
    """The last servo error, held over the window."""

    def fit(self, x_d: Array, x: Array, T_s: float, Np: int) -> None:
        self.seen, self.late = [len(x)], float(x[-1] - x_d[-1])

    def predict(self, x_d: Array) -> Array:
        self.x_d = x_d
        return x_d + self.late

    def update(self, x: Array) -> None:
        self.seen.append(len(x))
        self.late = float(x[-1] - self.x_d[-1])


def test_a_method_sees_the_first_half_and_then_each_window_behind_its_prediction() -> None:
    k, method = np.arange(95.0), Hold()
    errors = errors_of(method, k, k + 0.01 * k, 1e-3, 10)
    assert method.seen == [50, *[10] * 4, 5]
    expected = 0.01 * (k[50:] - (k[50:] // 10 * 10 - 1))  # since the last sample before each window
    np.testing.assert_allclose(errors, expected, atol=1e-12)
