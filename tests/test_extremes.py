"""Parameters from 5e-324 to 1e308, alone and together: a refusal that names one, or finite outputs, in bounded time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from datetime import timedelta
from typing import Any

import c_core
import numpy as np
import pytest
from c_core import CModel, RefusedError
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hybridsep.errors import HybridSepError
from hybridsep.lookahead import LookAhead
from hybridsep.parameters import PARAMETERS
from hybridsep.physics import ModalModel, Mode
from hybridsep.plant import Encoder, FeedDrive, Plant, StageDrive
from hybridsep.predictor import HybridPredictor
from hybridsep.sep_lookahead import SepLookAhead

SAMPLES = 40
SMALL = {"Np": 8, "p": 4, "q": 2, "dead_time": 0, "preview": 24, "spacing": 2}
"""Small windows, so that several fit into a short run."""

LEARNING = ("lambda", "T_s", "t_init")
PLANNING = ("jerk_weight", "v_max", "a_max", "j_max", "change_max", "v_s")
MODE = ("f_n", "zeta", "alpha", "beta")
FEED_DRIVE = ("m", "c", "k", "c_nl", "k_nl", "noise_std")
STAGE = ("f", "kappa", "T_s", "noise_std")

bounded = settings(max_examples=150, deadline=timedelta(seconds=20), suppress_health_check=list(HealthCheck))


@st.composite
def extreme(draw: st.DrawFn, name: str) -> float:
    """A parameter's value: now and then anything there is, else log-uniform over its range, with its bounds."""
    parameter = PARAMETERS[name]
    if draw(st.integers(0, 15)) == 0:
        magnitude = draw(st.sampled_from([5e-324, 1e-300, 1e300, 1e308]) | st.floats(-323, 308).map(lambda e: 10.0**e))
        return draw(st.sampled_from([1.0, 1.0, 1.0, -1.0])) * magnitude
    least = parameter.minimum if parameter.minimum > 0 else parameter.nonzero or 1e-20 * parameter.maximum
    magnitude = 10.0 ** draw(st.floats(math.log10(least), math.log10(parameter.maximum)))
    choices = [magnitude, parameter.maximum, parameter.minimum]
    if parameter.minimum < 0:
        choices.append(-magnitude)
    return min(max(draw(st.sampled_from(choices)), parameter.minimum), parameter.maximum)


def values_of(*names: str) -> st.SearchStrategy[dict[str, float]]:
    return st.fixed_dictionaries({name: extreme(name) for name in names})


def modes_of(n: int) -> st.SearchStrategy[dict[str, float]]:
    names = [(f"mode[{i}].{key}", key) for i in range(1, n + 1) for key in MODE]
    return st.fixed_dictionaries({label: extreme(key) for label, key in names})


positions = st.builds(
    lambda size, seed: size * np.random.default_rng(seed).uniform(-1, 1, (SAMPLES, 2)),
    st.sampled_from([0.0, 1e-300, 1e-6, 1.0, 1e3]),
    st.integers(0, 9),
)


def refused(values: Mapping[str, float], action: Callable[[], Any]) -> bool:
    """Return whether an action is refused; what refuses it names a parameter, an output or the step size."""
    try:
        action()
    except (HybridSepError, RefusedError) as error:
        text = str(error)
        known = {
            *values,
            *MODE,
            "T_s",
            "x_h",
            "x_pb",
            "x_dm",
            "x_d ",
            "state left the range",
            "step size",
            "k/m",
            " limit must",
        }
        assert any(name in text for name in known), text
        return True
    return False


def model_from(values: Mapping[str, float]) -> ModalModel:
    n = sum(name.endswith(".f_n") for name in values)
    return ModalModel([Mode(*(values[f"mode[{i}].{key}"] for key in MODE)) for i in range(1, n + 1)])


def check_look_ahead(look_ahead: LookAhead | SepLookAhead, names: tuple[str, ...], samples: Any) -> None:
    for x_d_ahead, x_meas in samples.tolist():
        look_ahead.sample(x_d_ahead, x_meas)
        outputs = [getattr(look_ahead, name) for name in names]
        assert all(map(math.isfinite, outputs)), dict(zip(names, outputs, strict=True))


def check_c_model(model: CModel, samples: Any, step: float) -> None:
    model.initialise()
    for k, (first, second) in enumerate(samples.tolist()):
        for name, value in (("x_d_ahead", first), ("x_meas", second), ("x_d", first)):
            if name in model.place and not (name == "x_d" and "x_d_ahead" in model.place):
                model[name] = value
        model.step(k * step, step)
        assert np.isfinite(model.values).all()


@bounded
@given(values_of(*LEARNING), modes_of(2), positions, st.sampled_from([0, 1]))
def test_the_predictor(learning: dict[str, float], modes: dict[str, float], samples: Any, hold: int) -> None:
    values = {**learning, **modes}

    def run() -> None:
        parameters = {**learning, **{name: SMALL[name] for name in ("Np", "p", "q")}, "input_hold": hold}
        predictor = HybridPredictor.with_parameters(model_from(modes), parameters)
        check_look_ahead(LookAhead(predictor, 0.0), ("x_d", "x_pb", "x_h", "e_servo", "rms_pb", "rms_h"), samples)

    refused(values, run)


@bounded
@given(values_of(*LEARNING), modes_of(2), positions, st.sampled_from([0, 1]))
def test_the_predictor_in_c(learning: dict[str, float], modes: dict[str, float], samples: Any, hold: int) -> None:
    values = {**learning, **modes, **{name: SMALL[name] for name in ("Np", "p", "q")}, "input_hold": hold}
    model = CModel("predictor_2", values)
    refused(values, lambda: check_c_model(model, samples, values["T_s"]))


@bounded
@given(values_of(*LEARNING, *PLANNING), modes_of(1), positions)
def test_the_compensator(values: dict[str, float], modes: dict[str, float], samples: Any) -> None:
    def run() -> None:
        Mode(*modes.values())
        all_values = {**c_core.COMPENSATOR, **SMALL, **values}
        with pytest.MonkeyPatch.context() as patch:
            mode = dict(zip(MODE, modes.values(), strict=True))
            patch.setitem(c_core.DESCRIPTIONS, "extreme", {"modes": [mode]})
            compensator = c_core.library_compensator(all_values, "extreme")
        look_ahead = SepLookAhead(compensator, 0.0)
        names = ("x_d", "x_dm", "x_pb", "x_h", "e_servo", "rms_e", "rms_pb", "rms_h")
        check_look_ahead(look_ahead, names, samples)

    refused({**values, **modes}, run)


@bounded
@given(values_of(*LEARNING, *PLANNING), modes_of(1), positions)
def test_the_compensator_in_c(values: dict[str, float], modes: dict[str, float], samples: Any) -> None:
    model = CModel("compensator", {**SMALL, **values, **modes})
    refused({**values, **modes}, lambda: check_c_model(model, samples, values["T_s"]))


def check_plant(plant: Plant, noise_std: float, samples: Any, h: float) -> None:
    encoder = Encoder(noise_std)
    for x_d, _ in samples.tolist():
        plant.step(x_d, h)
        outputs = (plant.x, plant.v, encoder.measure(plant.x))
        assert all(map(math.isfinite, outputs)), outputs


@bounded
@given(values_of(*FEED_DRIVE), positions, st.floats(-9, -3).map(lambda e: 10.0**e))
def test_the_feed_drive(values: dict[str, float], samples: Any, h: float) -> None:
    def run() -> None:
        plant = FeedDrive(*(values[name] for name in ("m", "c", "k", "c_nl", "k_nl")))
        check_plant(plant, values["noise_std"], samples[:10], h)

    refused(values, run)


@bounded
@given(values_of(*STAGE), modes_of(2), positions, st.floats(-9, -3).map(lambda e: 10.0**e))
def test_the_stage(values: dict[str, float], modes: dict[str, float], samples: Any, h: float) -> None:
    def run() -> None:
        plant = StageDrive(model_from(modes), values["f"], values["kappa"], values["T_s"])
        check_plant(plant, values["noise_std"], samples[:4], h)

    refused({**values, **modes}, run)


@bounded
@given(values_of(*FEED_DRIVE), positions, st.floats(-12, 3).map(lambda e: 10.0**e))
def test_the_feed_drive_in_c(values: dict[str, float], samples: Any, h: float) -> None:
    model = CModel("feed_drive", values)
    refused(values, lambda: check_c_model(model, samples[:10], h))


@bounded
@given(values_of(*STAGE), modes_of(2), positions, st.floats(-12, 3).map(lambda e: 10.0**e))
def test_the_stage_in_c(values: dict[str, float], modes: dict[str, float], samples: Any, h: float) -> None:
    model = CModel("stage_drive", {**values, **modes})
    refused({**values, **modes}, lambda: check_c_model(model, samples[:10], h))
