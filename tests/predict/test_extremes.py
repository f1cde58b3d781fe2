"""Parameters from 5e-324 to 1e308, alone and together: a refusal that names one, or finite outputs, in bounded time."""

import math
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from library_stream import LookAheadStream, PlantStream
from properties import share
from stream import COMPENSATOR, DRIVE, PLANTS, STAGE, STAGE_PREDICTOR, WINDOWS, RefusedStreamError, Stream, Value
from streams import CoreStream

from hybridsep.base.settings import PARAMETERS
from hybridsep.base.signals import Array

PAPER: dict[str, Value] = {"averaging": False, "Np": 8, "p": 4, "q": 2}
"""Small windows, so that several fit into a short run."""

LEARNING = ("lambda", "T_s", "t_init")
PLANNING = ("jerk_weight", "v_max", "a_max", "j_max", "change_max")
MODE = ("f_n", "zeta", "alpha", "beta")
OF_STAGE = ("f", "kappa", "T_s", "noise_std")

CASES: dict[str, tuple[str, tuple[str, ...], int, dict[str, Value]]] = {
    "predictor": (STAGE_PREDICTOR, LEARNING, 2, PAPER),
    "averaging": (STAGE_PREDICTOR, (*LEARNING, "effect", "noise_std", "forgetting"), 2, PAPER | {"averaging": True}),
    "compensator": (COMPENSATOR, (*LEARNING, *PLANNING), 1, PAPER | {"preview": 24, "spacing": 2}),
    "feed drive": (DRIVE, ("m", "c", "k", "c_nl", "k_nl", "noise_std"), 0, {}),
    "friction of the command": (STAGE, OF_STAGE, 2, {"friction_on": 0}),
    "friction of the motion": (STAGE, OF_STAGE, 2, {"friction_on": 1}),
}
"""Model, parameters that are drawn, number of modes that are, and other values."""

bounded = settings(max_examples=share(100), deadline=timedelta(seconds=20), suppress_health_check=list(HealthCheck))


@pytest.fixture(scope="module", autouse=True)
def _compiled() -> None:
    """Compile the models first: that is no part of an example's time."""
    for model, *_ in CASES.values():
        CoreStream(model, Path())


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


positions = st.builds(
    lambda size, seed: size * np.random.default_rng(seed).uniform(-1, 1, (40, 2)),
    st.sampled_from([0.0, 1e-300, 1e-6, 1.0, 1e3]),
    st.integers(0, 9),
)


def run(stream: Stream, values: dict[str, Value], inputs: tuple[str, ...], samples: Array, h: float) -> None:
    """Step through the samples; all that is shown must be finite."""
    stream.initialise(values)
    for k, row in enumerate(samples.tolist()):
        for name, position in zip(inputs, row, strict=False):
            stream.set(name, position)
        stream.step(k * h, h)
        shown = stream.outputs()
        assert all(map(math.isfinite, shown)), shown
    if stream.model == STAGE_PREDICTOR:
        assert np.isfinite([stream.window(name) for name in WINDOWS]).all()


@pytest.mark.slow
@pytest.mark.parametrize("in_c", [False, True], ids=["library", "C"])
@pytest.mark.parametrize("case", CASES)
@bounded
@given(data=st.data(), samples=positions, h=st.floats(-12, 3).map(lambda e: 10.0**e), hold=st.integers(0, 1))
def test_what_is_not_refused_is_finite(
    in_c: bool, case: str, data: st.DataObject, samples: Any, h: float, hold: int
) -> None:
    """What refuses it names a parameter, an output or the step size."""
    model, names, n_modes, fixed = CASES[case]
    labels = {f"mode[{i}].{key}": key for i in range(1, n_modes + 1) for key in MODE} | {name: name for name in names}
    drawn: dict[str, Value] = {label: data.draw(extreme(name), label) for label, name in labels.items()}
    stream: Stream = CoreStream(model, Path()) if in_c else (PlantStream if model in PLANTS else LookAheadStream)(model)
    inputs: tuple[str, ...] = ("x_d",)
    if model in PLANTS:
        # A step of a drive may take seconds for each second of it, in the library's plants for each millisecond
        given, h = samples[:4], min(h, 0.02 if in_c else 1e-3)
    else:
        given, inputs, h, fixed = samples, ("x_d_ahead", "x_meas"), float(drawn["T_s"]), fixed | {"input_hold": hold}
    try:
        run(stream, drawn | fixed, inputs, given, h)
    except RefusedStreamError as error:
        others = ("T_s", "x_h", "x_pb", "x_dm", "x_d ", "state overflowed", "step size", "k/m", " limit must")
        assert any(name in str(error) for name in (*drawn, *MODE, *others)), error  # noqa: PT017
