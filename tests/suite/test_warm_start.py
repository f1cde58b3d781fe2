"""Weights of an earlier run, on every implementation: they predict at once, and fit only one set of settings."""

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from driving import closed_loop, replay, steps
from library_stream import LookAheadStream, trained_state
from predictor_cases import averaged_model, change_learned
from stream import COMPENSATOR, LIBRARY, LOOK_AHEADS, OUTPUTS, PREDICTOR, RefusedStreamError, Value
from streams import StreamMaker, on_adapters

from hybridsep.evaluate.backtest import backtest
from hybridsep.fmi.weights import weights_file
from hybridsep.machines.machine import load_machine
from hybridsep.plants.plant import simulate
from hybridsep.plants.trajectory import staircase
from hybridsep.predict.averaging.experts import ARX_COMMAND, EXPERTS
from hybridsep.predict.averaging.stacking import Stack
from hybridsep.predict.predictor import HybridPredictor


@pytest.fixture(scope="module")
def led(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a compensator's predictor, saved, in which the command's expert led."""
    path = tmp_path_factory.mktemp("led") / "command.state"
    predictor = HybridPredictor.load(trained_state(COMPENSATOR))
    stack = averaged_model(predictor).learned.stack
    weights, less = np.eye(len(EXPERTS))[ARX_COMMAND.place], 1e-3
    change_learned(
        predictor, stacks=(Stack(weights, less * stack.gram, less * stack.cross, less * stack.evidence),) * 2
    )
    predictor.save(path)
    return path


@pytest.mark.slow
@on_adapters(LOOK_AHEADS, needs="agreement")
def test_a_warm_run_is_the_librarys_second_run(new_stream: StreamMaker) -> None:
    path, model = trained_state(new_stream.model), new_stream.model
    loop = closed_loop(model, 2001 if model == PREDICTOR else 701, weights=path)
    stream = new_stream(weights=path)
    stream.initialise(loop.values)
    np.testing.assert_allclose(replay(stream, loop), loop.outputs, rtol=0, atol=1e-11)
    # The learned weights are used from the first predicted window on.
    if model == PREDICTOR:
        assert (loop.column(model, "hybrid_active")[100:] == 1.0).all()
        assert loop.column(model, "rms_h")[-1] == pytest.approx(8.9e-6, abs=2e-7)
    else:
        # The first plan, at rest, has nothing to gain, and the first samples of the second one follow it.
        assert (loop.column(model, "sep_state")[70:] == 2.0).all()
        assert loop.column(model, "rms_e")[-1] < 5.5e-6  # the encoder's noise is 5 µm


@pytest.mark.slow
@on_adapters((COMPENSATOR,), needs="agreement")
def test_a_warm_run_in_which_the_commands_expert_led(new_stream: StreamMaker, led: Path) -> None:
    """Its counterpart doubts it, and has a part in the plans."""
    loop = closed_loop(COMPENSATOR, 700, weights=led)
    stream = new_stream(weights=led)
    stream.initialise(loop.values)
    np.testing.assert_allclose(replay(stream, loop), loop.outputs, rtol=0, atol=1e-10)


@on_adapters(LOOK_AHEADS)
def test_a_warm_up_and_the_physics_model_can_be_asked_for(new_stream: StreamMaker) -> None:
    model = new_stream.model
    choices: dict[str, list[tuple[dict[str, Value], str, int, list[float]]]] = {
        PREDICTOR: [({"t_init": 0.05}, "hybrid_active", 100, [0.0] * 50 + [1.0] * 50)],
        COMPENSATOR: [({"t_init": 0.1}, "sep_state", 0, [1.0] * 200), ({"compensate": 1}, "sep_state", 0, [1.0] * 200)],
    }
    for values, name, first, expected in choices[model]:
        stream = new_stream(weights=trained_state(model))
        stream.initialise(values)
        shown = [stream.outputs(), *steps(stream, 0, 250)]
        assert [row[OUTPUTS[model].index(name)] for row in shown[first : first + len(expected)]] == expected


@pytest.mark.slow
@on_adapters(LOOK_AHEADS)
def test_a_warm_state_is_saved_and_an_instance_reset(new_stream: StreamMaker) -> None:
    stream, other = (new_stream(weights=trained_state(new_stream.model)) for _ in range(2))
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


LEARNED: dict[str, Value] = {"p": 50, "q": 3, "lambda": 1e-12, "T_s": 0.001, "input_hold": 0, "dead_time": 0}
OTHERS: list[dict[str, Value]] = [
    {"p": 40},
    {"p": 49, "q": 4},
    {"lambda": 1e-9},
    {"T_s": 0.002},
    {"input_hold": 1},
    {"dead_time": 3},
    {"mode[1].alpha": 24000.0},
]


@on_adapters(LOOK_AHEADS)
def test_other_settings_than_learned_are_refused(new_stream: StreamMaker) -> None:
    stream = new_stream(weights=trained_state(new_stream.model))
    for values in OTHERS:
        message = "; ".join(
            f"{name} must be {LEARNED.get(name, 24674.0)!r}, with which this FMU was trained (weights.bin), got {now!r}"
            for name, now in values.items()
        )
        with pytest.raises(RefusedStreamError, match=re.escape(message)):
            stream.initialise(values)
        stream.reset()
    stream.initialise({})


@on_adapters(LOOK_AHEADS)
def test_what_does_not_shape_the_features_may_be_another(new_stream: StreamMaker) -> None:
    stream = new_stream(weights=trained_state(new_stream.model))
    stream.initialise({"Np": 60, "t_init": 0.1})
    steps(stream, 0, 130)


@cache
def learned_with_averaging() -> bytes:
    """Return the ``weights.bin`` of the default machine's predictor with averaging after one staircase."""
    machine = load_machine("spring_mass_damper")
    predictor = machine.new_predictor(replace(machine.predictor_settings, p=20, averaging=True))
    backtest(predictor, staircase(), simulate(machine.new_plant(), staircase(), machine.T_s))
    return weights_file(predictor)


@on_adapters((COMPENSATOR,))
def test_a_predictor_may_train_a_compensator(new_stream: StreamMaker) -> None:
    new_stream.planted(learned_with_averaging()).initialise({"p": 20})
    with pytest.raises(RefusedStreamError, match=re.escape("averaging must be 1, with which this FMU was trained")):
        new_stream.planted(learned_with_averaging()).initialise({"p": 20, "averaging": False})


@on_adapters((PREDICTOR,))
def test_what_was_learned_with_averaging_is_all_there_again(new_stream: StreamMaker) -> None:
    learned, values = learned_with_averaging(), {"averaging": True, "p": 20, "t_init": -1.0}
    cold, warm = LookAheadStream(PREDICTOR), LookAheadStream(PREDICTOR, learned)
    stream = new_stream.planted(learned)
    runs = []
    for each in (cold, warm, stream):
        each.initialise(values)
        runs.append(np.array(steps(each, 0, 650)))
    # The smooth motion is none of the drive's, so a single window is left of what was learned: 2e-12 m seen.
    tolerance = 0.0 if new_stream.implementation == LIBRARY else 1e-11
    np.testing.assert_allclose(runs[2], runs[1], rtol=0, atol=tolerance)
    rms_h = OUTPUTS[PREDICTOR].index("rms_h")
    assert runs[1][-1, rms_h] != runs[0][-1, rms_h]
