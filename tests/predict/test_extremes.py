"""Parameters from 5e-324 to 1e308, alone and together: a refusal that names one, or finite outputs, in bounded time."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Mapping
from datetime import timedelta
from pathlib import Path
from typing import Any

import c_core
import numpy as np
import pytest
from c_core import CModel, RefusedError
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from library_models import library_compensator
from places import ROOT
from properties import share

from hybridsep.app import cli
from hybridsep.base.errors import HybridSepError, MachineError, ParameterError
from hybridsep.base.settings import PARAMETERS, Limits, PredictorSettings
from hybridsep.machines.machine import load_machine
from hybridsep.model.physics import ModalModel, Mode
from hybridsep.online.look_ahead import LookAhead
from hybridsep.plants.feed_drive import FeedDrive
from hybridsep.plants.plant import Drive, Encoder
from hybridsep.plants.stage_drive import StageDrive
from hybridsep.plants.trajectory import rest_to_rest
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


def check_look_ahead(look_ahead: LookAhead | LookAhead, names: tuple[str, ...], samples: Any) -> None:
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
@bounded
@given(values_of(*LEARNING), modes_of(2), positions, st.sampled_from([0, 1]))
def test_the_predictor(learning: dict[str, float], modes: dict[str, float], samples: Any, hold: int) -> None:
    values = {**learning, **modes}

    def run() -> None:
        parameters = {**learning, **{name: SMALL[name] for name in ("Np", "p", "q")}, "input_hold": hold}
        predictor = HybridPredictor(model_from(modes), PredictorSettings.from_fmi({"averaging": False, **parameters}))
        check_look_ahead(
            LookAhead(predictor, 0.0),
            ("x_d", "x_pb", "x_h", "x_h_std", "e_servo", "rms_pb", "rms_h", "rms_hold"),
            samples,
        )

    refused(values, run)


@pytest.mark.slow
@bounded
@given(values_of(*LEARNING), modes_of(2), positions, st.sampled_from([0, 1]))
def test_the_predictor_in_c(learning: dict[str, float], modes: dict[str, float], samples: Any, hold: int) -> None:
    values = {**learning, **modes, **{name: SMALL[name] for name in ("Np", "p", "q")}, "input_hold": hold}
    model = CModel("predictor_2", values)
    refused(values, lambda: check_c_model(model, samples, values["T_s"]))


@pytest.mark.slow
@bounded
@given(values_of(*LEARNING, *AVERAGING), modes_of(2), positions, st.sampled_from([0, 1]))
def test_the_predictor_with_averaging_in_c(
    learning: dict[str, float], modes: dict[str, float], samples: Any, hold: int
) -> None:
    values = {
        "averaging": 1.0,
        **learning,
        **modes,
        **{name: SMALL[name] for name in ("Np", "p", "q")},
        "input_hold": hold,
    }
    model = CModel("predictor_2", values)
    refused(values, lambda: check_c_model(model, samples, values["T_s"]))


@pytest.mark.slow
@bounded
@given(values_of(*LEARNING, *PLANNING), modes_of(1), positions)
def test_the_compensator(values: dict[str, float], modes: dict[str, float], samples: Any) -> None:
    def run() -> None:
        Mode(*modes.values())
        compensator = library_compensator({**c_core.COMPENSATOR, **SMALL, **values, **modes})
        look_ahead = LookAhead(compensator, 0.0)
        names = ("x_d", "x_dm", "x_pb", "x_h", "e_servo", "rms_e", "rms_pb", "rms_h")
        check_look_ahead(look_ahead, names, samples)

    refused({**values, **modes}, run)


@pytest.mark.slow
@bounded
@given(values_of(*LEARNING, *PLANNING), modes_of(1), positions)
def test_the_compensator_in_c(values: dict[str, float], modes: dict[str, float], samples: Any) -> None:
    model = CModel("compensator", {**SMALL, **values, **modes})
    refused({**values, **modes}, lambda: check_c_model(model, samples, values["T_s"]))


def check_plant(plant: Drive, noise_std: float, samples: Any, h: float) -> None:
    encoder = Encoder(noise_std)
    for x_d, _ in samples.tolist():
        plant.step(x_d, h)
        outputs = (plant.x, plant.v, encoder.measure(plant.x))
        assert all(map(math.isfinite, outputs)), outputs


@pytest.mark.slow
@bounded
@given(values_of(*FEED_DRIVE), positions, st.floats(-9, -3).map(lambda e: 10.0**e))
def test_the_feed_drive(values: dict[str, float], samples: Any, h: float) -> None:
    def run() -> None:
        plant = FeedDrive(*(values[name] for name in ("m", "c", "k", "c_nl", "k_nl")))
        check_plant(plant, values["noise_std"], samples[:10], h)

    refused(values, run)


@pytest.mark.slow
@pytest.mark.parametrize("friction_on", ["command", "motion"])
@bounded
@given(values_of(*STAGE), modes_of(2), positions, st.floats(-9, -3).map(lambda e: 10.0**e))
def test_the_stage(friction_on: str, values: dict[str, float], modes: dict[str, float], samples: Any, h: float) -> None:
    def run() -> None:
        plant = StageDrive(model_from(modes), values["f"], values["kappa"], values["T_s"], friction_on)
        check_plant(plant, values["noise_std"], samples[:4], h)

    refused({**values, **modes}, run)


@pytest.mark.slow
@bounded
@given(values_of(*FEED_DRIVE), positions, st.floats(-12, 3).map(lambda e: 10.0**e))
def test_the_feed_drive_in_c(values: dict[str, float], samples: Any, h: float) -> None:
    model = CModel("feed_drive", values)
    refused(values, lambda: check_c_model(model, samples[:10], h))


@pytest.mark.slow
@pytest.mark.parametrize("friction_on", [0, 1])
@bounded
@given(values_of(*STAGE), modes_of(2), positions, st.floats(-12, 3).map(lambda e: 10.0**e))
def test_the_stage_in_c(
    friction_on: int, values: dict[str, float], modes: dict[str, float], samples: Any, h: float
) -> None:
    model = CModel("stage_drive", {**values, **modes, "friction_on": friction_on})
    refused({**values, **modes}, lambda: check_c_model(model, samples[:10], h))


# Machine files and the command line ------------------------------------------------------------------------------

ANY_MODE = "physics.mode[1].{0}: {0} must be "


def with_entry(name: str, entry: str, value: str, folder: Path) -> Path:
    """Write one of the machines that come with the library with another value at the first place of an entry."""
    text = (ROOT / "models" / f"{name}.toml").read_text(encoding="utf-8")
    changed = re.sub(rf"^{entry} = \S+", f"{entry} = {value}", text, count=1, flags=re.MULTILINE)
    assert changed != text
    (folder / "axis.toml").write_text(changed, encoding="utf-8")
    return folder / "axis.toml"


REFUSED = [
    *(("als25010_x", "f_n", value, ANY_MODE.format("f_n")) for value in ("5e-324", "1e-100", "1e308")),
    *(("als25010_x", "zeta", value, ANY_MODE.format("zeta")) for value in ("5e-324", "1e300")),
    *(("als25010_x", name, "1e300", ANY_MODE.format(name)) for name in ("alpha", "beta")),
    (
        "als25010_x",
        "f_n",
        "5e4",
        "2 pi f_n and 4 pi f_n zeta of mode[1] must be at most 100000 1/s in a plant, got 314159",
    ),
    ("als25010_x", "f", "1e300", "plant.f: f must be 0 … 1 m, got 1e+300"),
    ("als25010_x", "kappa", "1e300", "plant.kappa: kappa must be 0 … 1000000 1/m"),
    ("spring_mass_damper", "k", "1e308", "physics.spring_mass_damper.k: k must be 1e-06 … 1e+15 N/m, got 1e+308"),
    ("spring_mass_damper", "m", "5e-324", "physics.spring_mass_damper.m: m must be "),
    ("spring_mass_damper", "c", "1e308", "physics.spring_mass_damper.c: c must be "),
    ("spring_mass_damper", "k", "1e15", "sqrt(k/m) and c/m must be at most 100000 1/s, got 3.16228e+07; lower k or c"),
    ("spring_mass_damper", "k", "1e-6", "give a mode out of range: f_n must be 0.001 … 100000 Hz, got 0.000159"),
    ("spring_mass_damper", "k_nl", "1e300", "plant.k_nl: k_nl must be 0 … 1e+15 N/m2"),
    ("spring_mass_damper", "T_s", "1e-300", "T_s must be 1e-05 … 1 s, got 1e-300"),
    ("spring_mass_damper", "velocity", "1e-300", "limits.velocity: velocity must be 1e-09 … 10000 m/s, got 1e-300"),
    ("spring_mass_damper", "jerk", "1e308", "limits.jerk: jerk must be 1e-06 … 1e+12 m/s3, got 1e+308"),
    ("spring_mass_damper", "change_max", "1e308", "drive_limits.change_max: change_max must be 1e-12 … 10 m"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "entry", "value", "message"), REFUSED)
def test_a_machine_is_refused_by_name(name: str, entry: str, value: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(MachineError) as caught:
        load_machine(with_entry(name, entry, value, tmp_path))
    assert message in str(caught.value)


@pytest.mark.slow
def test_a_build_of_what_cannot_be_ends_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    machine = with_entry("spring_mass_damper", "k", "1e308", tmp_path)
    monkeypatch.setattr("sys.argv", ["hybridsep", "build", "-m", str(machine), "--out", str(tmp_path)])
    begin = time.perf_counter()
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    assert stopped.value.code == 2
    assert time.perf_counter() - begin < 10.0
    assert "k must be 1e-06 … 1e+15 N/m, got 1e+308" in " ".join(capsys.readouterr().err.split())


@pytest.mark.slow
def test_a_trajectory_of_too_many_samples_is_refused() -> None:
    with pytest.raises(
        ParameterError, match=r"fewer than 2000000 samples, got 1e\+07 s at T_s = 0.001 s; raise its limits"
    ):
        rest_to_rest([0.0, 0.01], Limits(1e-9, 1.0, 1.0))


@pytest.mark.slow
@pytest.mark.parametrize("name", c_core.TABLES)
def test_every_parameter_of_an_fmu_has_both_bounds(name: str) -> None:
    for variable in c_core.TABLES[name].variables:
        if variable.causality == "parameter":
            assert variable.minimum is not None
            assert variable.maximum is not None
        if variable.name == "T_s":
            assert (variable.minimum, variable.maximum) == (1e-5, 1.0)
