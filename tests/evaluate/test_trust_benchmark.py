"""Benchmark of trust: the model fitted to a recording, and the table of errors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks import trust
from benchmarks.trust import circle, fitted_model, recorded, replayed, short_staircase, simulated
from hybridsep.base.errors import SignalError
from hybridsep.base.signals import Array
from hybridsep.evaluate.backtest import Backtest, backtest
from hybridsep.machines.paper import paper_machine
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.predict.predictor import HybridPredictor

OMEGA, DEAD_TIME, TS = 25.0, 3, 2e-3
LAG = ModalModel([Mode(OMEGA / (2 * np.pi), 1.0, OMEGA**2, OMEGA)], DEAD_TIME)


def moves(n: int) -> Array:
    """Return a command to and fro that starts away from zero, (n,), m."""
    return np.asarray(0.1 + 2e-3 * np.sin(2 * np.pi * np.arange(n) / 300) ** 3)


def lagging(x_d: Array) -> Array:
    discrete = LAG.discretise(TS)
    return np.asarray(x_d[0] + discrete.forced_response(discrete.rest(), x_d - x_d[0])[0])


def test_the_fit_finds_lag_and_dead_time() -> None:
    x_d = moves(900)
    model = fitted_model(x_d, lagging(x_d), TS)
    assert model.dead_time == DEAD_TIME
    assert model.modes[0].omega == pytest.approx(OMEGA, rel=1e-4)
    assert model.dc_gain == pytest.approx(1.0)


@pytest.mark.parametrize("jitter", [0.0, 3e-4])
def test_a_recording_is_resampled_where_its_intervals_vary(tmp_path: Path, jitter: float) -> None:
    x_d = moves(900)
    t = TS * np.arange(900) + jitter * np.sin(np.arange(900))
    columns = [t, *(np.interp(t, TS * np.arange(900), signal) for signal in (x_d, lagging(x_d)))]
    np.savetxt(tmp_path / "axis.csv", np.transpose(columns), "%.17g", delimiter=",", header="t,x_d,x", comments="")
    case = recorded(tmp_path / "axis.csv", 20)
    assert (case.settings.Np, case.settings.p) == (20, 20)
    assert case.settings.T_s == pytest.approx(TS, rel=0.1)
    assert case.model.dead_time == pytest.approx(DEAD_TIME, abs=1)
    if not jitter:
        assert np.array_equal(case.x_d, columns[1])


def test_paths_begin_and_end_at_rest() -> None:
    for x_d in (short_staircase(), *circle()):
        assert x_d[[0, -1]] == pytest.approx([0.0, 0.0], abs=1e-9)
        assert np.abs(np.diff(x_d)[[0, -1]]).max() < 1e-6


@pytest.mark.slow
def test_errors_of_a_drive(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    case = simulated("short", paper_machine("spring_mass_damper"), short_staircase()[:2500])
    row = replayed(case)
    assert row.trust[0] < 0.6 * row.physics
    assert row.trust[1] < row.trust[0] < row.paper[0]
    monkeypatch.setattr(trust, "cases", lambda *_: iter([case]))
    trust.main([])
    assert str(row) in capsys.readouterr().out


def test_a_refused_replay_has_diverged(monkeypatch: pytest.MonkeyPatch) -> None:
    def refusing(predictor: HybridPredictor, x_d: Array, x: Array) -> Backtest:
        if predictor.settings.trust:
            return backtest(predictor, x_d, x)
        raise SignalError("the prediction diverges")

    monkeypatch.setattr(trust, "backtest", refusing)
    row = replayed(simulated("short", paper_machine("spring_mass_damper"), short_staircase()[:600]))
    assert str(row).count("diverged") == 2
    assert row.paper == (np.inf, np.inf)
    assert row.trust[0] < row.physics
