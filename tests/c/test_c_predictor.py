"""The C core's predictor, sample by sample, against the library's look-ahead. Each test states its tolerance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import staircase_data as staircase
from c_core import CModel, look_ahead, write_weights
from numpy.typing import NDArray

from hybridsep.predict.look_ahead import LookAhead

Array = NDArray[np.float64]

OUTPUTS = ("x_d", "x_pb", "x_h", "e_servo", "rms_pb", "rms_h")


def compare_runs(ahead: LookAhead, model: CModel, x_d: Array, x: Array, tolerance: float) -> None:
    """Step both through a run, wired as section 4 has it, and compare every output at every sample."""
    period = float(model["T_s"])
    for k in range(len(x_d)):
        measured = float(x[k - ahead.Np]) if k >= ahead.Np else float(x_d[0])
        ahead.sample(float(x_d[k]), measured)
        model["x_d_ahead"], model["x_meas"] = float(x_d[k]), measured
        model.step(k * period, period)
        for name in OUTPUTS:
            assert abs(model[name] - getattr(ahead, name)) <= tolerance, (name, k)
        assert model["batch"] == ahead.batch
        assert bool(model["hybrid_active"]) == ahead.hybrid_active
        if k % 50 == 49:
            for name in ("x_d_window", "x_pb_window", "x_h_window"):
                shown = np.zeros(100)
                shown[: ahead.Np] = getattr(ahead, name)[:100]
                np.testing.assert_allclose(model.window(name), shown, rtol=0, atol=tolerance)


@pytest.mark.parametrize("start", [0.0, 0.1])
@pytest.mark.parametrize(("p", "q"), [(50, 3), (100, 99)])
def test_the_staircase_is_predicted_as_by_the_library(p: int, q: int, start: float) -> None:
    # 1e-11 m at every sample.
    ahead, model = look_ahead("predictor", p=p, q=q, start=start)
    compare_runs(ahead, model, staircase.commanded() + start, staircase.measured(0) + start, 1e-11)
    assert 5e-6 < model["rms_h"] < 1.5e-5


@pytest.mark.parametrize(
    "parameters",
    [
        {"Np": 7, "p": 7, "q": 6},
        {"Np": 1, "p": 1, "q": 0},
        {"Np": 30, "p": 2, "q": 1, "t_init": 0.0},
        {"p": 10, "q": 2, "t_init": 0.2505, "lambda": 1e-9},
        {"p": 10, "input_hold": 1, "dead_time": 3},
        {"p": 10, "dead_time": 150, "t_init": 1e6},
        {"T_s": 2e-3, "p": 20},
    ],
)
def test_other_parameters_are_predicted_as_by_the_library(parameters: dict[str, float]) -> None:
    # 1e-11 m at every sample, of the stage's X axis.
    n = 1500
    ahead, model = look_ahead("predictor_2", **parameters)
    compare_runs(ahead, model, staircase.commanded()[:n], staircase.measured(1)[:n], 1e-11)


def test_the_outputs_before_and_right_after_initialization_are_those_of_t_0() -> None:
    model = CModel("predictor", {"x_d_ahead": 0.25, "Np": 60})
    model.start_values()
    before = model.values.copy()
    assert model["x_d"] == model["x_pb"] == model["x_h"] == 0.25
    np.testing.assert_array_equal(model.window("x_h_window"), [0.25] * 60 + [0.0] * 40)
    np.testing.assert_array_equal(model.initialise().values, before)


def test_learned_weights_from_the_resources_predict_at_once(tmp_path: Path) -> None:
    # 1e-11 m against the library's second run with the weights kept.
    x_d, x = staircase.commanded()[:1500], staircase.measured(0)[:1500]
    ahead, _ = look_ahead("predictor", p=20, t_init=0.0)
    for k in range(len(x_d)):
        ahead.sample(float(x_d[k]), float(x[max(k - 100, 0)]))
    regression = ahead.predictor.regression
    write_weights(tmp_path, "predictor", regression.factor, regression.n_samples, p=20)
    second = LookAhead(ahead.predictor, 0.0)
    model = CModel("predictor", {"p": 20, "t_init": 0.0}, tmp_path).initialise()
    assert np.max(np.abs(second.predictor.weights)) > 0.01
    compare_runs(second, model, x_d, x, 1e-11)
