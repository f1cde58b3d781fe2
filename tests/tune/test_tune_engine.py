"""Tuning by the engine of a fleet: the losses are the same as in one process."""

from __future__ import annotations

import numpy as np
import pytest
from predictor_cases import MODEL, small_signals

from hybridsep.base.errors import SignalError
from hybridsep.base.settings import PredictorSettings
from hybridsep.parallel.engine import cluster, joblib_engine
from hybridsep.tune.joint import Logs, over_windows, tune

LOGS: Logs = {"one": [small_signals(300)], "two": [small_signals(130, seed=1), small_signals(90, seed=2)]}


CANDIDATES = [PredictorSettings(Np=20, p=p, q=1, trust=False) for p in (2, 5)]


@pytest.mark.slow
def test_engines_give_the_same_losses() -> None:
    candidates = [*CANDIDATES, PredictorSettings(Np=20, p=2, q=1)]
    here = tune(MODEL, LOGS, candidates)
    windows = over_windows(MODEL, LOGS, candidates[0])
    with cluster(1) as dask:
        for engine in (joblib_engine(1), dask):
            there = tune(MODEL, LOGS, candidates, engine=engine)
            np.testing.assert_array_equal(there.rms_h, here.rms_h)
            np.testing.assert_array_equal(there.rms_hold, here.rms_hold)
        again = over_windows(MODEL, LOGS, candidates[0], engine=dask)
    assert {Np: one.rms_h.tolist() for Np, one in again.items()} == {
        Np: one.rms_h.tolist() for Np, one in windows.items()
    }


def test_a_log_that_cannot_be_replayed_is_named() -> None:
    x_d, x = small_signals(60)
    x[7] = np.nan
    with pytest.raises(SignalError, match=r"^bad: x must be finite, got nan at sample 7$"):
        tune(MODEL, {**LOGS, "bad": [(x_d, x)]}, [CANDIDATES[0]], engine=joblib_engine(1))
