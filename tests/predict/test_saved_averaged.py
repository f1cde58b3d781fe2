"""Saved state of a predictor with averaging: restored bit for bit, or refused."""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from averaged_cases import averaged, averaged_model, cycles, friction, physics, run

from hybridsep.base.signals import Array
from hybridsep.predict.predictor import HybridPredictor

WAYS: dict[str, Callable[[HybridPredictor], HybridPredictor]] = {
    "bytes": lambda predictor: HybridPredictor.from_bytes(predictor.to_bytes()),
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda predictor: pickle.loads(pickle.dumps(predictor)),
}


def signals(n: int = 1500) -> tuple[Array, Array]:
    x_d = 0.1 + cycles(n)
    return x_d, physics(x_d) + friction(x_d) + 1e-6 * np.random.default_rng(3).normal(size=n)


def in_mid_run(x: Array | None = None, *, warm: bool = False, **changes: Any) -> HybridPredictor:
    """Return a small predictor after 400 samples, of a second run if it is warm, with a predicted window of 30."""
    x_d, sound = signals()
    x = sound if x is None else x
    predictor = averaged(**{"Np": 20, "p": 6, "q": 2, "forgetting": 2.0} | changes)
    if warm:
        run(predictor, x_d, sound, 20)
        predictor.restart(0.1)
    run(predictor, x_d[:400], x[:400], 20)
    predictor.predict(x_d[400:430])
    return predictor


@pytest.mark.slow
@pytest.mark.parametrize("warm", [True, False])
@pytest.mark.parametrize("pending", [True, False])
def test_a_restored_predictor_continues_bit_for_bit(pending: bool, warm: bool) -> None:
    x_d, x = signals()
    x[[390, 395]], x[435:440] = np.nan, x[435] + 1e-2  # what is missing is part of the state, too
    original = in_mid_run(x=x, warm=warm)
    assert averaged_model(original).doubts == warm
    assert averaged_model(original).n_rejected >= 2
    if not pending:
        original.update(x[400:430])
    twins = {way: restored(original) for way, restored in WAYS.items()}
    for way, twin in twins.items():
        assert twin.to_bytes() == original.to_bytes(), way
    if pending:
        for each in (original, *twins.values()):
            each.update(x[400:417])
    for first in range(430, 700, 20):
        window = slice(first, first + 20)
        predicted = original.predict(x_d[window]).x_h
        original.update(x[window])
        for way, twin in twins.items():
            np.testing.assert_array_equal(twin.predict(x_d[window]).x_h, predicted, err_msg=way)
            twin.update(x[window])
    for way, twin in twins.items():
        assert twin.to_bytes() == original.to_bytes(), way


@pytest.mark.parametrize("samples", [0, 1])
def test_before_anything_is_learned(samples: int) -> None:
    predictor = averaged(q=0)
    if samples:
        run(predictor, np.zeros(1), np.zeros(1))
    predictor.predict(np.linspace(0.0, 1e-3, 100))
    twin = HybridPredictor.from_bytes(predictor.to_bytes())
    assert twin.to_bytes() == predictor.to_bytes()


def test_memory_does_not_grow() -> None:
    x_d, x = signals()
    predictor = in_mid_run()
    predictor.update(x[400:430])
    size = len(predictor.to_bytes())
    run(predictor, x_d, x, 20)
    assert abs(len(predictor.to_bytes()) - size) <= 200  # the digits of some numbers, and the pending window
