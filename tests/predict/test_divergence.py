"""Predictions that diverge, window by window."""

import c_core
import numpy as np
import pytest
from library_models import library_compensator, numbered, runaway_predictor

from hybridsep.base.errors import SignalError
from hybridsep.evaluate.backtest import backtest
from hybridsep.online.look_ahead import LookAhead
from hybridsep.predict.window import Prediction

SAID = "x_h must stay within ±1e+100 m: the learned recursion diverges; raise lambda, lower p or reset"


def test_a_direct_prediction_that_diverges_is_refused() -> None:
    with pytest.raises(SignalError) as caught:
        _ = runaway_predictor().predict(np.full(100, 1e-3)).x_h
    assert str(caught.value) == SAID
    with pytest.raises(SignalError, match="x_pb must stay within"):
        _ = Prediction(np.array([np.nan]), np.zeros(1), np.zeros(1), 1).x_h


def test_a_replay_that_diverges_is_refused() -> None:
    x_d = np.full(250, 1e-3)
    x_d[0] = 0.0
    with pytest.raises(SignalError, match="x_h diverges in the window from sample 0 on; raise lambda or lower p"):
        backtest(runaway_predictor(), x_d, np.zeros(250))


def test_a_plan_that_diverges_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    values = {**c_core.COMPENSATOR, **numbered([c_core.SPRING_MASS_DAMPER]), "t_init": 0.0}
    look_ahead = LookAhead(library_compensator(values), 0.0)
    diverging = Prediction(np.full(100, np.inf), np.zeros(100), np.zeros(100), 0)
    monkeypatch.setattr(look_ahead.predictor, "predict", lambda *_, **__: diverging)
    for _ in range(99):
        look_ahead.sample(0.0, 0.0)
    for _ in range(3):
        with pytest.raises(SignalError, match="x_pb must stay within"):
            look_ahead.sample(0.0, 0.0)
