"""Saved state of a predictor with averaging: restored bit for bit, or refused."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from averaged_cases import averaged, averaged_model, cycles, friction, physics, run
from numpy.typing import ArrayLike

from hybridsep.base.errors import StateError
from hybridsep.base.signals import Array
from hybridsep.base.state import pack, unpack
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


@cache
def saved(*, warm: bool = False) -> bytes:
    return in_mid_run(warm=warm).to_bytes()


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


SPOILED: dict[str, list[ArrayLike | None]] = {
    "k": [-1.0, 1.5],
    "start": [1e7],
    "physics": [np.zeros(3)],
    "late": [np.zeros(1)],
    "uncertainty.theta": [[-1.0, 1.0, 1.0], [1e-12, np.inf, 1.0], [1e-12, 1.0, 0.0]],
    "uncertainty.evidence": [[-1e-3, 0.0, 0.0]],
    "uncertainty.factor": [100.0],
    "uncertainty.ratio": [100.0, 0.01],
    "uncertainty.recent": [np.nan, -1e-9],
    "residual.leader": [0.0],
    "residual.evidence.0.this.n_rows": [-1.0],
    "residual.evidence.1.this.n_rows": [np.nan],
    "residual.evidence.0.this.factor": [np.eye(9), np.eye(200), np.zeros((27, 27)), np.ones((27, 27))],
    "residual.evidence.0.earlier.factor": [np.eye(26), np.zeros((27, 27))],
    "residual.evidence.0.earlier.n_rows": [-1.0],
    "residual.evidence.1.earlier.n_rows": [1e300],
    "residual.evidence.1.this.factor": [np.eye(14), np.full((75, 75), np.nan)],
    "residual.learned.velocity_scale": [-1.0, 1e-300, 1e150],
    "residual.learned.fastest": [-1.0],
    "residual.learned.largest": [-np.ones(20), np.ones(19)],
    "residual.learned.scales.0.largest": [-1.0],
    "residual.learned.scales.1.largest_square": [np.inf],
    "residual.learned.errors.0.noise_variance": [-1e-12],
    "residual.learned.errors.3.correlation": [0.5],
    "residual.learned.stack.gram": [np.full((5, 5), np.nan), np.ones((4, 4))],
    "residual.learned.stack.cross": [np.ones(3)],
    "residual.learned.stack.weights": [[0.5, 0.5, 0.5, 0.0, 0.0], [-0.5, 0.5, 0.5, 0.5, 0.0]],
    "residual.learned.stack.evidence": [[-1.0, 1.0]],
    "residual.run.static.filters": [np.zeros((3, 8))],
    "residual.run.static.filtered": [np.full(8, np.inf)],
    "residual.run.static.x_d": [np.nan],
    "residual.run.static.x_pb": [np.zeros(3)],
    "residual.run.commands": [np.zeros(6)],
    "residual.run.past.0": [np.zeros(5)],
    "residual.run.past.1": [np.zeros(5), None],
    "residual.run.bridged": [np.zeros(5)],
    "residual.run.gate.n_missing": [-1.0],
    "residual.run.gate.n_beyond": [1.5],
    "residual.run.n_rejected": [None],
    "pending_x_d": [np.zeros(0)],
    "pending_x_pb": [np.zeros(29)],
    "pending_scales": [[-1.0, 1.0]],
    "pending_largest": [np.ones(19)],
}


@pytest.mark.parametrize("name", SPOILED)
def test_an_inconsistent_state(name: str) -> None:
    meta, arrays, _ = unpack("predictor", saved(warm=True))
    right = arrays.pop(name)
    for value in SPOILED[name]:
        changed = {} if value is None else {name: np.asarray(value, dtype=right.dtype)}
        with pytest.raises(StateError, match=r"^the saved predictor is inconsistent: "):
            HybridPredictor.from_bytes(pack("predictor", meta, {**arrays, **changed}))


def test_a_prediction_that_overflows_is_refused() -> None:
    meta, arrays, _ = unpack("predictor", saved())
    # The leverage of the lags overflows: they are huge, and nothing is known of their weights.
    arrays["residual.run.past.0"] = np.full(6, 1e100)
    arrays["residual.learned.scales.0.largest_square"] = np.array(1e-200)
    arrays["residual.learned.scales.0.largest"] = np.array(1e-100)
    arrays["residual.evidence.0.this.factor"] = 1e-100 * np.eye(33)
    for i in range(4):
        arrays[f"residual.noise.{i}"] = np.array(1e-202)
    with pytest.raises(StateError, match="the prediction of the pending window must be finite"):
        HybridPredictor.from_bytes(pack("predictor", meta, arrays))


@pytest.mark.parametrize("change", [{"averaging": False}, {"q": 3}, {"p": 7}, {"p": 5}, {"p": 20, "q": 0}])
def test_other_settings(change: dict[str, Any]) -> None:
    meta, arrays, _ = unpack("predictor", saved())
    meta["settings"] |= change
    with pytest.raises(StateError, match=r"^the saved predictor is inconsistent: "):
        HybridPredictor.from_bytes(pack("predictor", meta, arrays))


def test_sizes_that_a_state_has_not_are_refused_before_memory_is_taken_for_them() -> None:
    meta, arrays, _ = unpack("predictor", saved())
    meta["settings"] |= {"Np": 5000, "p": 5000}
    with pytest.raises(StateError, match=r"p = 5000 and q = 2 must be those of its factors"):
        HybridPredictor.from_bytes(pack("predictor", meta, arrays))
