"""Parameters from 5e-324 to 1e308, alone and together: a refusal that names one, or finite outputs, in bounded time."""

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
from library_models import library_compensator
from properties import share

from hybridsep.base.errors import HybridSepError
from hybridsep.base.settings import PARAMETERS, PredictorSettings
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.online.look_ahead import LookAhead
from hybridsep.plants.feed_drive import FeedDrive
from hybridsep.plants.plant import Drive, Encoder
from hybridsep.plants.stage_drive import StageDrive
from hybridsep.predict.predictor import HybridPredictor

SAMPLES = 40
SMALL = {"Np": 8, "p": 4, "q": 2, "dead_time": 0, "preview": 24, "spacing": 2}
"""Small windows, so that several fit into a short run."""

LEARNING = ("lambda", "T_s", "t_init")
AVERAGING = ("effect", "noise_std", "forgetting")
PLANNING = ("jerk_weight", "v_max", "a_max", "j_max", "change_max")
MODE = ("f_n", "zeta", "alpha", "beta")
FEED_DRIVE = ("m", "c", "k", "c_nl", "k_nl", "noise_std")
STAGE = ("f", "kappa", "T_s", "noise_std")

OF_BOTH = pytest.mark.parametrize("in_c", [False, True], ids=["library", "C"])
bounded = settings(max_examples=share(100), deadline=timedelta(seconds=20), suppress_health_check=list(HealthCheck))


@pytest.fixture(scope="module", autouse=True)
def _compiled() -> None:
    """Compile the models first: that is no part of an example's time."""
    for name in ("predictor_2", "compensator", "feed_drive", "stage_drive"):
        c_core.library(name)


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
    return float(np.clip(draw(st.sampled_from(choices)), parameter.minimum, parameter.maximum))


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
        others = ("T_s", "x_h", "x_pb", "x_dm", "x_d ", "state left the range", "step size", "k/m", " limit must")
        assert any(name in text for name in (*values, *MODE, *others)), text
        return True
    return False


def model_from(values: Mapping[str, float]) -> ModalModel:
    n = sum(name.endswith(".f_n") for name in values)
    return ModalModel([Mode(*(values[f"mode[{i}].{key}"] for key in MODE)) for i in range(1, n + 1)])


def check_look_ahead(look_ahead: LookAhead, names: tuple[str, ...], samples: Any) -> None:
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


@pytest.mark.slow
@pytest.mark.parametrize(("in_c", "averaging"), [(False, False), (True, False), (True, True)])
@bounded
@given(values_of(*LEARNING, *AVERAGING), modes_of(2), positions, st.sampled_from([0, 1]))
def test_the_predictor(
    in_c: bool, averaging: bool, learning: dict[str, float], modes: dict[str, float], samples: Any, hold: int
) -> None:
    chosen = {name: learning[name] for name in (*LEARNING, *AVERAGING * averaging)}
    parameters = {**chosen, **{name: SMALL[name] for name in ("Np", "p", "q")}, "input_hold": hold}

    def run() -> None:
        if in_c:
            check_c_model(
                CModel("predictor_2", {"averaging": averaging, **parameters, **modes}), samples, chosen["T_s"]
            )
            return
        predictor = HybridPredictor(model_from(modes), PredictorSettings.from_fmi({**parameters, "averaging": False}))
        names = ("x_d", "x_pb", "x_h", "x_h_std", "e_servo", "rms_pb", "rms_h", "rms_hold")
        check_look_ahead(LookAhead(predictor, 0.0), names, samples)

    refused({**chosen, **modes}, run)


@pytest.mark.slow
@OF_BOTH
@bounded
@given(values_of(*LEARNING, *PLANNING), modes_of(1), positions)
def test_the_compensator(in_c: bool, values: dict[str, float], modes: dict[str, float], samples: Any) -> None:
    def run() -> None:
        if in_c:
            check_c_model(CModel("compensator", {**SMALL, **values, **modes}), samples, values["T_s"])
            return
        Mode(*modes.values())
        compensator = library_compensator({**c_core.COMPENSATOR, **SMALL, **values, **modes})
        names = ("x_d", "x_dm", "x_pb", "x_h", "e_servo", "rms_e", "rms_pb", "rms_h")
        check_look_ahead(LookAhead(compensator, 0.0), names, samples)

    refused({**values, **modes}, run)


def check_plant(plant: Drive, noise_std: float, samples: Any, h: float) -> None:
    encoder = Encoder(noise_std)
    for x_d, _ in samples.tolist():
        plant.step(x_d, h)
        outputs = (plant.x, plant.v, encoder.measure(plant.x))
        assert all(map(math.isfinite, outputs)), outputs


# Machine files and the command line ------------------------------------------------------------------------------


@pytest.mark.slow
@OF_BOTH
@pytest.mark.parametrize("kind", ["feed drive", "command", "motion"])
@bounded
@given(st.data(), positions, st.floats(-12, 3).map(lambda e: 10.0**e))
def test_the_plants(in_c: bool, kind: str, data: st.DataObject, samples: Any, h: float) -> None:
    """The drive, and the stage with friction on the commanded and on the actual velocity."""
    feed = kind == "feed drive"
    values, modes = data.draw(values_of(*(FEED_DRIVE if feed else STAGE))), {} if feed else data.draw(modes_of(2))

    def run() -> None:
        if in_c:
            friction_on = {} if feed else {"friction_on": int(kind == "motion")}
            model = CModel("feed_drive" if feed else "stage_drive", {**values, **modes, **friction_on})
            check_c_model(model, samples[: 10 if h < 1.0 else 2], h)  # a step of 100 s takes seconds
            return
        plant: Drive = (
            FeedDrive(*(values[name] for name in ("m", "c", "k", "c_nl", "k_nl")))
            if feed
            else StageDrive(model_from(modes), values["f"], values["kappa"], values["T_s"], kind)
        )
        check_plant(plant, values["noise_std"], samples[:4], min(h, 1e-3))

    refused({**values, **modes}, run)
