"""Predictions that diverge, window by window, and states that hold what is no number."""

from __future__ import annotations

from collections import Counter

import c_core
import numpy as np
import pytest
from c_core import TS, CModel
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


@pytest.mark.parametrize("offset", [0, 1])
def test_a_restored_state_shows_no_output_that_is_not_finite(offset: int) -> None:
    model = CModel("predictor", {"Np": 20, "p": 4}).initialise()
    model["x_d_ahead"] = 0.125
    for k in range(25):
        model.step(k * TS)
    for value in (np.nan, np.inf, -1e200):
        changed = model.state.copy()
        windows = np.flatnonzero(changed == 0.125)[offset::2]  # commands that came, and their window
        changed[windows[-1]] = value
        if offset == 0:
            model.check_state(model.state.tobytes())
        with pytest.raises(c_core.RefusedError, match="the state is inconsistent: it is damaged"):
            model.check_state(changed.tobytes())


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


@pytest.mark.slow
@pytest.mark.parametrize("name", ["predictor", "compensator", "feed_drive", "stage_drive"])
def test_whatever_a_state_holds_outputs_are_finite(name: str) -> None:
    small = {"Np": 10, "p": 4, "q": 2, "preview": 24, "T_s": TS, "t_init": 0.01}
    model = CModel(name)
    for key, value in small.items():
        if key in model.place:
            model[key] = value
    model.initialise()
    drive_on(model, 0, 47)
    state, chance, ends = model.state.copy(), np.random.default_rng(3), Counter[str]()
    for value in (np.nan, -np.inf, 1e90, 1e200, 1e308):
        for place in chance.permutation(len(state))[:500]:
            model.state = state.copy()
            model.state[place] = value
            try:
                model.check_state(model.state.tobytes())
                drive_on(model, 47, 70)
                ends["finite"] += 1
            except c_core.RefusedError as refused:
                said = str(refused)
                damaged = any(text in said for text in ("is inconsistent", "other parameters", "another", "version"))
                diverges = any(
                    text in said for text in ("must stay within", "overflowed", "as fast as", "communication")
                )
                ends["damaged" if damaged else "diverges" if diverges else said] += 1
    assert ends.keys() <= {"finite", "damaged", "diverges"}
    assert ends["damaged"] > 10
    assert ends["diverges"] > 10 or "drive" in name


def drive_on(model: CModel, first: int, last: int) -> None:
    """Step a model, all of whose outputs must be finite."""
    outputs = ("x_d", "x_dm", "x", "v", "x_meas", "x_pb", "x_h", "e_servo", "rms_pb", "rms_h", "rms_e")
    for k in range(first, last):
        for name in ("x_d_ahead", "x_meas", "x_d"):
            if name in model.place and not (name == "x_d" and "x_d_ahead" in model.place):
                model[name] = 1e-3 * np.sin(0.1 * k)
        model.step(k * TS)
        seen = {name: model[name] for name in outputs if name in model.place}
        assert np.isfinite(list(seen.values())).all(), seen
