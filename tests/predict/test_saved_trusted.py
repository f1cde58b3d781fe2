"""Saved state of a predictor with trust: restored bit for bit, or refused."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from trusted_cases import cycles, friction, physics, run, trusted, trusted_model

from hybridsep.base.errors import StateError
from hybridsep.base.signals import Array
from hybridsep.base.state import pack, unpack
from hybridsep.model.physics import ModalModel, Mode
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
    predictor = trusted(**{"Np": 20, "p": 6, "q": 2, "forgetting": 2.0} | changes)
    if warm:
        run(predictor, x_d, sound, 20)
        predictor.restart(0.1)
    run(predictor, x_d[:400], x[:400], 20)
    predictor.predict(x_d[400:430])
    return predictor


@pytest.mark.parametrize("warm", [True, False])
@pytest.mark.parametrize("pending", [True, False])
@pytest.mark.parametrize("way", WAYS)
def test_a_restored_predictor_continues_bit_for_bit(way: str, pending: bool, warm: bool) -> None:
    x_d, x = signals()
    x[[390, 395]], x[435:440] = np.nan, x[435] + 1e-2  # what is missing is part of the state, too
    original = in_mid_run(x=x, warm=warm)
    assert trusted_model(original).doubts == warm
    assert trusted_model(original).n_rejected >= 2
    if not pending:
        original.update(x[400:430])
    twin = WAYS[way](original)
    assert twin.to_bytes() == original.to_bytes()
    if pending:
        original.update(x[400:417])
        twin.update(x[400:417])
    for first in range(430, 700, 20):
        window = slice(first, first + 20)
        np.testing.assert_array_equal(twin.predict(x_d[window]).x_h, original.predict(x_d[window]).x_h)
        original.update(x[window])
        twin.update(x[window])
    assert twin.to_bytes() == original.to_bytes()


@pytest.mark.parametrize("samples", [0, 1])
def test_before_anything_is_learned(samples: int) -> None:
    predictor = trusted(q=0)
    if samples:
        run(predictor, np.zeros(1), np.zeros(1))
    predictor.predict(np.linspace(0.0, 1e-3, 100))
    twin = HybridPredictor.from_bytes(predictor.to_bytes())
    assert twin.to_bytes() == predictor.to_bytes()


@pytest.mark.slow
def test_with_dead_time_first_order_hold_and_a_restart() -> None:
    x_d, x = signals()
    model = ModalModel([Mode(25.0, 0.05, 24674.0, 15.7), Mode(90.0, 1.5, -40.0, 0.1)], 4)
    predictor = HybridPredictor(model, trusted(input_hold="foh", Np=20, p=20).settings)
    run(predictor, x_d[:300], x[:300], 20)
    predictor.restart(0.1)
    twin = HybridPredictor.from_bytes(predictor.to_bytes())
    np.testing.assert_array_equal(run(twin, x_d, x, 20), run(predictor, x_d, x, 20))


def test_memory_does_not_grow() -> None:
    x_d, x = signals()
    predictor = in_mid_run()
    predictor.update(x[400:430])
    size = len(predictor.to_bytes())
    run(predictor, x_d, x, 20)
    assert abs(len(predictor.to_bytes()) - size) <= 200  # the digits of some numbers, and the pending window


def change_entry(tables: tuple[dict[str, Any], dict[str, Any]], name: str, value: Any) -> None:
    """Change an entry of the one of two tables that has it; None: delete it."""
    table = tables[0] if name in tables[0] else tables[1]
    assert name in table
    if value is None:
        del table[name]
    else:
        table[name] = value


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("n_rows", np.array([-1.0, 1.0])),
        ("n_rows", np.array([1e6, 1.0])),
        ("n_rows", np.array([1.0, np.nan])),
        ("n_samples", 1.5),
        ("motion", np.array([-1.0, 1.0, 1.0])),
        ("motion", np.array([1e-300, 1.0, 1.0])),
        ("motion", np.array([1e150, 1.0, 1.0])),
        ("motion", np.array([1.0, 1.0, -1.0])),
        ("n_missing", -1),
        ("n_beyond", 1.5),
        ("factor", np.eye(9)),
        ("factor", np.eye(200)),
        ("factor", np.zeros((27, 27))),
        ("factor_of_command", np.eye(14)),
        ("factor_of_command", np.full((15, 15), np.nan)),
        ("largest", -np.ones(20)),
        ("largest", np.ones(19)),
        ("scale", np.array([2.0, -1.0])),
        ("scale", np.array([0.0, np.inf])),
        ("scale_of_command", np.ones(3)),
        ("noise_variances", np.array([-1e-12, 1.0, 1.0, 1.0])),
        ("correlations", np.array([0.5, 1.0, 1.0, 1.0])),
        ("correlations", np.ones(3)),
        ("gram", np.full((5, 5), np.nan)),
        ("gram", np.ones((4, 4))),
        ("cross", np.ones(3)),
        ("weights", np.array([0.5, 0.5, 0.5, 0.0, 0.0])),
        ("weights", np.array([-0.5, 0.5, 0.5, 0.5, 0.0])),
        ("evidence", np.array([-1.0, 1.0])),
        ("filters", np.zeros((3, 8))),
        ("filtered", np.full(8, np.inf)),
        ("x_d", np.array([np.nan])),
        ("last_x_pb", np.zeros(3)),
        ("commands", np.zeros(6)),
        ("past_of_command", np.zeros(5)),
        ("bridged", np.zeros(5)),
        ("past", np.zeros(5)),
        ("past", None),
        ("n_rows", None),
    ],
    ids=str,
)
def test_an_inconsistent_model(name: str, value: Any) -> None:
    meta, arrays, parts = unpack("predictor", in_mid_run().to_bytes())
    own, inside, _ = unpack("trusted model", parts["trusted"])
    change_entry((own, inside), name, value)
    with pytest.raises(StateError, match=r"^the saved (trusted model|predictor) is inconsistent: "):
        HybridPredictor.from_bytes(pack("predictor", meta, arrays, {"trusted": pack("trusted model", own, inside)}))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("earlier", np.eye(26)),
        ("earlier", np.zeros((27, 27))),
        ("earlier_of_command", np.eye(3)),
        ("n_earlier", -1.0),
        ("n_earlier_of_command", 1e300),
    ],
    ids=str,
)
def test_an_inconsistent_doubt_of_earlier_runs(name: str, value: Any) -> None:
    meta, arrays, parts = unpack("predictor", in_mid_run(warm=True).to_bytes())
    own, inside, _ = unpack("trusted model", parts["trusted"])
    change_entry((own, inside), name, value)
    with pytest.raises(StateError, match=r"^the saved trusted model is inconsistent: "):
        HybridPredictor.from_bytes(pack("predictor", meta, arrays, {"trusted": pack("trusted model", own, inside)}))


def test_a_prediction_that_overflows_is_refused() -> None:
    meta, arrays, parts = unpack("predictor", in_mid_run().to_bytes())
    own, inside, _ = unpack("trusted model", parts["trusted"])
    # The leverage of the lags overflows: they are huge, and nothing is known of their weights.
    inside["past"], inside["scale"] = np.full(6, 1e100), np.array([1e-200, 1e-100])
    inside["factor"], inside["noise_variances"] = 1e-100 * np.eye(27), np.zeros(4)
    forged = pack("predictor", meta, arrays, {"trusted": pack("trusted model", own, inside)})
    with pytest.raises(StateError, match="the prediction of the pending window must be finite"):
        HybridPredictor.from_bytes(forged)


@pytest.mark.parametrize("change", [{"trust": False}, {"q": 3}, {"p": 7}, {"p": 5}])
def test_other_settings(change: dict[str, Any]) -> None:
    meta, arrays, parts = unpack("predictor", in_mid_run().to_bytes())
    meta["settings"] |= change
    with pytest.raises(StateError, match=r"^the saved (trusted model|predictor) is inconsistent: "):
        HybridPredictor.from_bytes(pack("predictor", meta, arrays, parts))
    with pytest.raises(StateError, match="trusted is missing"):
        HybridPredictor.from_bytes(pack("predictor", meta | {"settings": in_mid_run().settings.as_table()}, arrays))
