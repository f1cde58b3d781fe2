"""What the C models refuse, in the library's words, and that a refusal changes nothing."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import c_core
import numpy as np
import pytest
from c_core import TS, CModel, refusal, write_trajectory, write_weights

from hybridsep.base.clock import SampleClock
from hybridsep.base.errors import FmuError, HybridSepError
from hybridsep.base.settings import PredictorSettings, check
from hybridsep.fmi.variables import modes_from
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.plants.feed_drive import FeedDrive
from hybridsep.plants.stage_drive import StageDrive
from hybridsep.predict.look_ahead import checked_start


@pytest.mark.parametrize(
    "wrong",
    [
        {"Np": 0},
        {"Np": 100_001},
        {"p": 120},
        {"q": 100, "p": 101},
        {"p": 0, "lambda": 0.0},
        {"lambda": -1e-12, "T_s": 0.0, "t_init": -0.25},
        {"lambda": math.nan},
        {"lambda": math.inf},
        {"T_s": -math.inf},
        {"T_s": 1e-300, "t_init": 1e300},
        {"t_init": -1e22},
        {"T_s": -123456.789},
        {"lambda": -1e16},
        {"lambda": -5e-324},
    ],
)
def test_bad_parameters_are_refused_in_the_librarys_words(wrong: dict[str, float]) -> None:
    given: Any = {key: wrong.get(key, c_core.PREDICTOR[key]) for key in ("Np", "p", "q", "lambda", "T_s", "t_init")}
    with pytest.raises(HybridSepError) as caught:
        PredictorSettings.from_fmi(given)
    assert refusal(CModel("predictor", wrong).size) == str(caught.value)
    assert refusal(CModel("predictor", wrong).initialise) == str(caught.value)


@pytest.mark.parametrize(
    ("name", "parameter", "value"),
    [
        ("predictor", "input_hold", 2),
        ("predictor", "dead_time", -1),
        ("feed_drive", "m", 0.0),
        ("feed_drive", "k", -24674.0),
        ("feed_drive", "c_nl", -1.0),
        ("feed_drive", "noise_std", math.nan),
        ("feed_drive", "seed", -1),
        ("stage_drive", "kappa", -0.5),
        ("stage_drive", "T_s", 0.0),
        ("trajectory", "trajectory", 4),
        ("trajectory", "T_s", 1e-6),
        ("predictor", "T_s", 1e-300),
        ("predictor", "lambda", 1e-300),
        ("compensator", "jerk_weight", 1e300),
        ("compensator", "a_max", 1e308),
        ("feed_drive", "k", 1e308),
        ("feed_drive", "noise_std", 1e300),
        ("stage_drive", "kappa", 1e300),
    ],
)
def test_a_parameter_alone_is_refused_in_the_librarys_words(name: str, parameter: str, value: float) -> None:
    with pytest.raises(HybridSepError) as caught:
        check(parameter, value)
    assert refusal(CModel(name, {parameter: value}).size) == str(caught.value)


def test_a_drive_that_is_too_fast_is_refused_in_the_librarys_words() -> None:
    for wrong in ({"k": 1e12}, {"c": 1e6}):
        with pytest.raises(HybridSepError) as caught:
            FeedDrive(**{key: {**c_core.FEED_DRIVE, **wrong}[key] for key in ("m", "c", "k")})
        assert refusal(CModel("feed_drive", wrong).size) == str(caught.value)
    mode = {**c_core.STAGE_MODES[0], "f_n": 2e4}
    with pytest.raises(HybridSepError) as caught:
        StageDrive(ModalModel([Mode(**mode)]))
    assert refusal(CModel("stage_drive", {"mode[1].f_n": 2e4}).size) == str(caught.value)
    model = CModel("feed_drive", {"k": 9e9}).initialise()
    with pytest.raises(HybridSepError) as caught:
        FeedDrive(1.0, 15.7, 9e9).step(0.0, 50.0)
    assert refusal(lambda: model.step(0.0, 50.0)) == str(caught.value)


@pytest.mark.parametrize("name", ["predictor_2", "stage_drive"])
def test_a_modes_parameter_is_refused_with_its_place(name: str) -> None:
    model = CModel(name, {"mode[2].zeta": 0.0})
    with pytest.raises(HybridSepError) as caught:
        modes_from({key: model[key] for key in model.place if key.startswith("mode[")})
    assert refusal(model.size) == str(caught.value)


def test_a_number_that_is_not_whole_is_refused() -> None:
    assert refusal(CModel("predictor", {"p": 2.5}).size) == "p must be a whole number, got 2.5"


def test_many_problems_are_cut_off_within_the_message() -> None:
    wrong = {key: math.nan for key in CModel("predictor_2").place if key.startswith("mode[") or key in c_core.PREDICTOR}
    message = refusal(CModel("predictor_2", wrong).size)
    assert message.startswith("Np must be finite, got nan; p must be finite, got nan; ")
    message = refusal(CModel("predictor_2", dict.fromkeys(wrong, -1.2345678901234567e-5)).size)
    assert 450 < len(message.encode()) < c_core.MESSAGE_SIZE


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_values_that_are_not_finite_are_refused_and_change_nothing(value: float) -> None:
    text = str(value)
    assert refusal(CModel("predictor", {"x_d_ahead": value}).initialise) == (
        f"the start value of x_d_ahead must be finite, got {text}"
    )
    assert refusal(CModel("feed_drive", {"x_d": value}).initialise) == (
        f"the start value of x_d must be finite, got {text}"
    )
    assert refusal(lambda: CModel("predictor").initialise(value)) == f"the start time must be finite, got {text} s"
    for name, variable, message in (
        ("predictor", "x_d_ahead", f"x_d_ahead must be finite, got {text} at sample 1"),
        ("predictor", "x_meas", f"x_meas must be finite, got {text} at sample 1"),
        ("feed_drive", "x_d", f"x_d must be finite, got {text} at t = 0.001 s"),
        ("stage_drive", "x_d", f"x_d must be finite, got {text} at t = 0.001 s"),
    ):
        model = CModel(name).initialise()
        model.step(0.0)
        state = model.state.tobytes()
        model[variable] = value
        values = model.values.copy()
        assert refusal(lambda model=model: model.step(TS)) == message  # type: ignore[misc]
        assert model.state.tobytes() == state
        np.testing.assert_array_equal(model.values, values)


@pytest.mark.parametrize("name", ["predictor", "compensator"])
def test_a_start_further_out_than_any_machine_is_refused(name: str) -> None:
    with pytest.raises(HybridSepError) as caught:
        checked_start(-1e6)
    assert refusal(CModel(name, {"x_d_ahead": -1e6}).initialise) == str(caught.value)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"spacing": 3}, "spacing must be ≥ 1 and divide Np = 100, got 3"),
        ({"preview": 110}, "preview must be ≥ Np + 4·spacing + 3 = 111, got 110"),
        ({"v_friction": 5e-324}, "v_friction must be 0 or 1e-09 … 10000 m/s, got 5e-324"),
        ({"v_friction": -1.0}, "v_friction must be 0 or 1e-09 … 10000 m/s, got -1.0"),
    ],
)
def test_a_plan_that_cannot_be_is_refused_in_the_librarys_words(wrong: dict[str, float], message: str) -> None:
    assert refusal(CModel("compensator", wrong).size) == message
    with pytest.raises(HybridSepError, match=re.escape(message)):
        c_core.library_compensator({**c_core.COMPENSATOR, **wrong}, "compensator")


@pytest.mark.parametrize(("learned", "now"), [(2e-3, 0.0), (0.0, 2e-3), (2e-3, 1e-3)])
def test_weights_of_other_features_are_refused(learned: float, now: float, tmp_path: Path) -> None:
    n = 2 + 3 + 50 + (13 if learned else 0)
    write_weights(tmp_path, "compensator", np.eye(n + 1), 100, v_friction=learned)
    assert refusal(CModel("compensator", {"v_friction": now}, tmp_path).initialise) == (
        f"v_friction must be {learned!r}, with which weights.bin was learned, got {now!r}"
    )
    CModel("compensator", {"v_friction": learned}, tmp_path).initialise()


@pytest.mark.parametrize(
    ("t", "h"),
    [(1.501, h) for h in (0.0, -1e-3, 1e-320 * -1, 100.1, math.nan, math.inf)]
    + [(t, TS) for t in (0.0, 1.5, 1.5004, 1.5016, 1e9, math.nan, -math.inf)],
)
def test_other_steps_are_refused_in_the_librarys_words(t: float, h: float) -> None:
    clock = SampleClock.begin(1.5, TS).stepped(1.5, TS).after
    with pytest.raises(HybridSepError) as caught:
        clock.stepped(t, h)
    model = CModel("predictor").initialise(1.5)
    model.step(1.5)
    state = model.state.tobytes()
    assert refusal(lambda: model.step(t, h)) == str(caught.value)
    assert model.state.tobytes() == state


@pytest.mark.parametrize("start", [math.nan, -math.inf, 1e13, -1e300])
def test_other_start_times_are_refused_in_the_librarys_words(start: float) -> None:
    with pytest.raises(FmuError) as caught:
        SampleClock.begin(start, TS)
    for name in ("predictor", "compensator"):
        assert refusal(lambda name=name: CModel(name).initialise(start)) == str(caught.value)  # type: ignore[misc]


@pytest.mark.parametrize("name", ["feed_drive", "stage_drive"])
def test_steps_that_a_plant_cannot_do_are_refused(name: str) -> None:
    model = CModel(name, {"x_d": 0.0}).initialise()
    state = model.state.tobytes()
    for t, h, message in (
        (0.0, 0.0, "the communication step size must be > 0 and ≤ 100 s, got 0.0"),
        (0.0, -1.0, "the communication step size must be > 0 and ≤ 100 s, got -1.0"),
        (0.0, math.nan, "the communication step size must be > 0 and ≤ 100 s, got nan"),
        (0.0, 101.0, "the communication step size must be > 0 and ≤ 100 s, got 101.0"),
        (math.inf, 1e-3, "the communication point must be finite, got inf s"),
    ):
        assert refusal(lambda t=t, h=h: model.step(t, h)) == message  # type: ignore[misc]
    model["x_d"] = 1e308
    assert refusal(lambda: model.step(0.0, 1e-2)) == "x_d must be within ±1000 m, got 1e+308 at t = 0 s"
    assert model.state.tobytes() == state


def test_resources_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "trajectory_3.bin"
    assert refusal(CModel("trajectory").size) == "trajectory_3.bin must be in the resources (none) and readable"
    assert "must be in the resources" in refusal(CModel("trajectory", resources=tmp_path).size)
    write_trajectory(tmp_path, np.arange(5.0), 2e-3)
    model = CModel("trajectory", resources=tmp_path)
    assert refusal(model.size) == "T_s must be 0.002 s, the interval of trajectory_3.bin, got 0.001"
    model.start_values()
    assert model["r"] == 0.0
    write_trajectory(tmp_path, np.array([1.0, math.nan]))
    assert refusal(model.initialise) == "trajectory_3.bin must be finite, got nan at sample 1"
    write_trajectory(tmp_path, np.arange(5.0))
    good = file.read_bytes()
    for bad in (b"", good[:20], good[:-1], good[:24], b"X" + good[1:], good + b"\0" * 8):
        file.write_bytes(bad)
        assert "it is damaged or truncated" in refusal(model.size)


@pytest.mark.parametrize("name", ["predictor", "compensator", "feed_drive", "stage_drive", "trajectory"])
def test_memory_of_another_size_is_refused(name: str, tmp_path: Path) -> None:
    write_trajectory(tmp_path, np.arange(5.0))
    model = CModel(name, resources=tmp_path)
    size = model.size()
    for other in (size - 8, size + 8):
        assert refusal(lambda other=other: model.initialise(size=other)) == (  # type: ignore[misc]
            f"the state must have {size} bytes, got memory for {other}; its file in the resources has changed "
            "meanwhile: initialise again"
        )


def test_weights_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    factor = np.triu(np.ones((13, 13)))
    model = CModel("predictor", {"p": 7}, tmp_path)
    write_weights(tmp_path, "predictor", factor, 5, p=7)
    model.initialise()
    good = (tmp_path / "weights.bin").read_bytes()
    for bad in (b"", good[:-8], b"X" + good[1:]):
        (tmp_path / "weights.bin").write_bytes(bad)
        assert "it is damaged or truncated" in refusal(model.initialise)
    write_weights(tmp_path, "predictor", np.eye(12), 5, p=7)
    assert "it is damaged or truncated" in refusal(model.initialise)
    factor[3, 3] = 0.0
    write_weights(tmp_path, "predictor", factor, 5, p=7)
    assert "it is damaged or truncated" in refusal(model.initialise)
