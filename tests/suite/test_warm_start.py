"""Weights of an earlier run, on every implementation: they predict at once, and fit one set of settings alone."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from driving import closed_loop, initialise, replay, steps
from library_models import trained
from stream import COMPENSATOR, LIBRARY, LOOK_AHEADS, OUTPUTS, PREDICTOR, PYTHON, RefusedStreamError, Value
from streams import StreamMaker, on_all

Trained = Callable[[str], Path]


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Trained:
    """Return a function that gives a predictor as it was saved after one staircase, of a predictor or a compensator."""
    folder = tmp_path_factory.mktemp("trained")

    def saved(model: str) -> Path:
        path = folder / f"{model}.state"
        if not path.exists():
            trained(model).save(path)
        return path

    return saved


@on_all(LOOK_AHEADS)
def test_a_warm_run_is_the_librarys_second_run(new_stream: StreamMaker, weights: Trained) -> None:
    # 1e-11 m at every sample; a pythonfmu FMU is the library.
    tolerance = 0.0 if new_stream.implementation in (LIBRARY, PYTHON) else 1e-11
    path, model = weights(new_stream.model), new_stream.model
    loop, cold = closed_loop(model, 1500, weights=path), closed_loop(model, 1500)
    stream = new_stream(weights=path)
    stream.initialise(loop.values)
    np.testing.assert_allclose(replay(stream, loop), loop.outputs, rtol=0, atol=tolerance)
    # From the first window on, and better than cold.
    if model == PREDICTOR:
        assert (loop.column(model, "hybrid_active") == 1.0).all()
        assert loop.column(model, "rms_h")[-1] < 0.8 * cold.column(model, "rms_h")[-1]
    else:
        assert (loop.column(model, "sep_state") == 2.0).all()
        assert loop.outputs[0, OUTPUTS[model].index("x_h")] != 0.0
        assert loop.column(model, "rms_e")[-1] < 0.8 * cold.column(model, "rms_e")[-1]


@on_all(LOOK_AHEADS, needs="outputs before")
def test_outputs_before_the_initialization_has_ended(new_stream: StreamMaker, weights: Trained) -> None:
    expected = closed_loop(new_stream.model, 1500, weights=weights(new_stream.model)).outputs[0]
    found = new_stream(weights=weights(new_stream.model)).outputs_before({})
    if new_stream.model == PREDICTOR:  # whether it is active follows from the weights, which are read when it ends
        found[OUTPUTS[PREDICTOR].index("hybrid_active")] = 1.0
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11)


@on_all(LOOK_AHEADS)
@pytest.mark.parametrize("values", [{"t_init": 0.05}, {"compensate": 1}], ids=str)
def test_a_warm_up_and_the_physics_model_can_be_asked_for(
    new_stream: StreamMaker, weights: Trained, values: dict[str, Value]
) -> None:
    if new_stream.model == PREDICTOR:
        values = {"t_init": 0.05}
    stream = new_stream(weights=weights(new_stream.model))
    stream.initialise(values)
    state = OUTPUTS[new_stream.model].index("sep_state" if new_stream.model == COMPENSATOR else "hybrid_active")
    steps(stream, 0, 1)
    assert stream.outputs()[state] == (1.0 if new_stream.model == COMPENSATOR else 0.0)


@on_all(LOOK_AHEADS)
def test_a_warm_state_is_saved_and_an_instance_reset(new_stream: StreamMaker, weights: Trained) -> None:
    stream, other = (new_stream(weights=weights(new_stream.model)) for _ in range(2))
    runs = []
    for _ in range(2):
        stream.initialise({})
        runs.append(steps(stream, 0, 250))
        blob = stream.save()
        expected = steps(stream, 250, 420)
        for each in (stream, other):
            each.restore(blob)
            assert steps(each, 250, 420) == expected
        stream.reset()
    assert runs[0] == runs[1]
    names = OUTPUTS[new_stream.model]
    assert any(row[names.index("x_h")] != row[names.index("x_pb")] for row in runs[0])


LEARNED: dict[str, dict[str, Value]] = {
    PREDICTOR: {"p": 50, "q": 3, "lambda": 1e-12, "T_s": 0.001, "input_hold": 0, "dead_time": 0},
    COMPENSATOR: {"p": 50, "q": 40, "lambda": 1e-8, "T_s": 0.001, "input_hold": 0, "dead_time": 0, "v_s": 0.002},
}
OTHERS: list[dict[str, Value]] = [
    {"p": 40},
    {"p": 49, "q": 4},
    {"lambda": 1e-9},
    {"T_s": 0.002},
    {"input_hold": 1},
    {"dead_time": 3},
    {"mode[1].alpha": 24000.0},
    {"v_s": 0.0},
    {"v_s": 1e-3},
]


@on_all(LOOK_AHEADS)
def test_other_settings_than_learned_are_refused(new_stream: StreamMaker, weights: Trained) -> None:
    stream, learned = new_stream(weights=weights(new_stream.model)), LEARNED[new_stream.model]
    for values in OTHERS:
        if "v_s" in values and new_stream.model == PREDICTOR:
            continue
        message = "; ".join(
            f"{name} must be {learned.get(name, 24674.0)!r}, with which weights.bin was learned, got {now!r}"
            for name, now in values.items()
        )
        with pytest.raises(RefusedStreamError, match=re.escape(message)):
            stream.initialise(values)
        stream.reset()
    stream.initialise({})


@on_all(LOOK_AHEADS)
def test_what_does_not_shape_the_features_may_be_another(new_stream: StreamMaker, weights: Trained) -> None:
    stream = new_stream(weights=weights(new_stream.model))
    stream.initialise({"Np": 60, "t_init": 0.1})
    steps(stream, 0, 130)


@on_all((PREDICTOR,))
def test_a_window_that_diverges_is_refused_until_another_state_is_set(
    new_stream: StreamMaker, runaway_weights: Path
) -> None:
    stream = new_stream(weights=runaway_weights)
    stream.initialise({})
    stream.set("x_d_ahead", 1e-3)
    for k in range(99):
        stream.step(k * 1e-3, 1e-3)
    before, outputs, window = stream.save(), stream.outputs(), stream.window("x_h_window")
    said = "x_h must stay within ±1e+100 m: what was learned makes it diverge; raise lambda, lower p or restart"
    for _ in range(3):
        with pytest.raises(RefusedStreamError, match=re.escape(said)):
            stream.step(0.099, 1e-3)
        assert stream.outputs() == outputs
        np.testing.assert_array_equal(stream.window("x_h_window"), window)
    diverged = stream.save()
    other = new_stream(weights=runaway_weights)
    for state in (diverged, before):
        other.restore(state)
        with pytest.raises(RefusedStreamError, match=re.escape(said)):
            other.step(0.099, 1e-3)
    stream.reset()
    initialise(stream, t_init=1.0, Np=100, p=50, q=3)
    steps(stream, 0, 150)  # the warm-up hides what diverges
