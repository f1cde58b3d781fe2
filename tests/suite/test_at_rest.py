"""An axis at rest whose command rounds in its last places learns no scale from them, in every implementation."""

import numpy as np
from driving import run
from stream import COMPENSATOR, OUTPUTS, PREDICTOR, Array, Stream, Value
from streams import StreamMaker, on_all

START, NP = 0.17453292519943295, 20


def shown(stream: Stream, name: str, command: Array) -> Array:
    """Return an output over a run, m, of an axis that stands 1.2 mm off its first command."""
    start = float(command[0])
    values: dict[str, Value] = {"averaging": True, "Np": NP, "p": NP, "t_init": 0.0, "x_meas": start}
    if stream.model == COMPENSATOR:
        values |= {"preview": 80, "spacing": 2, "compensate": 2}
    outputs = run(stream, command, np.full(len(command), start + 1.2e-3), values)
    return np.asarray(outputs[:-1, OUTPUTS[stream.model].index(name)])


def motion() -> Array:
    """Return commands that rest, move by 10 mm, and rest, (400,), m."""
    velocity = np.convolve(np.repeat([0.0, 1e-4, 0.0], [160, 100, 140]), np.full(20, 1 / 20))[:400]
    return np.asarray(START + np.cumsum(velocity))


@on_all((PREDICTOR,))
def test_what_is_rounded_at_rest_is_no_motion(new_stream: StreamMaker) -> None:
    command = motion()
    rounded = command + np.spacing(START) * np.random.default_rng(0).integers(-9, 10, 400) * (np.arange(400) < 140)
    exact, found = (shown(new_stream(), "x_h", one) for one in (command, rounded))
    np.testing.assert_allclose(found, exact, rtol=0.0, atol=1e-9)


@on_all((COMPENSATOR,))
def test_an_axis_at_rest_off_zero_is_compensated_as_one_at_zero(new_stream: StreamMaker) -> None:
    found, at_zero = (shown(new_stream(), "x_dm", np.full(200, start)) for start in (START, 0.0))
    assert np.abs(at_zero).max() > 1e-4
    np.testing.assert_allclose(found - START, at_zero, rtol=0.0, atol=1e-9)
