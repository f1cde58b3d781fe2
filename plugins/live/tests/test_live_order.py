"""Order of samples: repeated, late and missing ones, by number and by time."""

import math

import numpy as np
import pytest

from hybridsep.base.errors import SignalError
from hybridsep_live import order as order_module
from hybridsep_live.order import HELD_MAX, Order
from hybridsep_live.sample import Sample

T_S = 1e-3


def numbered(k: int | None, t: float | None = None) -> Sample:
    return Sample(1e-3 * (k or 0), 0.0, k, t)


def taken(order: Order, samples: list[Sample]) -> list[int | None]:
    return [ready.k for sample in samples for ready in order.take(sample)]


def test_samples_without_number_and_time_are_counted() -> None:
    assert taken(Order(T_S), [numbered(None)] * 4) == [0, 1, 2, 3]


def test_repeated_samples_are_ignored_and_counted() -> None:
    order = Order(T_S)
    assert taken(order, [numbered(k) for k in (7, 8, 8, 9, 7, 10, 12, 12, 11)]) == [7, 8, 9, 10, 11, 12]
    assert (order.n_repeated, order.n_late) == (3, 1)
    order.finish()


def test_late_samples_are_put_in_their_place() -> None:
    order, numbers = Order(T_S), list(range(200))
    mixed = [k for begin in range(0, 200, 20) for k in (begin, *reversed(numbers[begin + 1 : begin + 20]))]
    assert taken(order, [numbered(k) for k in mixed]) == numbers
    assert (order.n_repeated, order.n_late) == (0, 180)


def test_a_gap_is_refused() -> None:
    order = Order(T_S)
    assert taken(order, [numbered(k) for k in (3, 4, 7)]) == [3, 4]
    with pytest.raises(SignalError, match=r"^samples 5 … 6 are missing, and with them commands, without which"):
        order.finish()
    with pytest.raises(SignalError, match=r"^samples 5 … 6 are missing"):
        taken(order, [numbered(k) for k in range(8, 8 + HELD_MAX)])
    order = Order(T_S)
    taken(order, [numbered(3), numbered(5)])
    with pytest.raises(SignalError, match=r"^sample 4 is missing"):
        order.finish()


def test_a_gap_is_refused_when_nothing_more_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(order_module, "monotonic", lambda: now[0])
    order = Order(T_S)
    taken(order, [numbered(3), numbered(5)])
    order.check_waiting()
    now[0] += 1.1
    with pytest.raises(SignalError, match="sample 4 is missing"):
        order.check_waiting()
    assert taken(order, [numbered(4)]) == [4, 5]
    now[0] += 10.0
    order.check_waiting()


def test_a_sender_that_begins_anew_is_refused() -> None:
    order = Order(T_S)
    taken(order, [numbered(k) for k in range(20_000, 20_010)])
    with pytest.raises(SignalError, match="sample 0 came after sample 20009: the sender began anew; so must this"):
        order.take(numbered(0))


def test_times_count_samples_in_spite_of_jitter_and_drift() -> None:
    rng, n = np.random.default_rng(1), 20_000
    clock = 1.7e9 + np.arange(n) * T_S * (1 + 2e-5) + rng.uniform(-0.35, 0.35, n) * T_S
    order = Order(T_S)
    assert taken(order, [numbered(None, t) for t in clock.tolist()]) == list(range(n))
    assert (order.n_repeated, order.n_late) == (0, 0)
    assert taken(order, [numbered(None, float(clock[-1]))]) == []
    assert order.n_repeated == 1


@pytest.mark.parametrize("factor", [0.5, 2.0, 1000.0])
def test_another_interval_is_refused(factor: float) -> None:
    order = Order(T_S)
    with pytest.raises(
        SignalError, match=f"every {T_S * factor:.4g} s by their times, but the machine has T_s = 0.001"
    ):
        taken(order, [numbered(None, k * T_S * factor) for k in range(60)])
    with pytest.raises(SignalError, match="by their times"):
        taken(Order(T_S), [numbered(k, k * T_S * factor) for k in range(60)])


def test_a_time_that_is_no_number_of_samples_away_is_a_gap() -> None:
    order = Order(T_S)
    taken(order, [numbered(None, k * T_S) for k in range(30)])
    with pytest.raises(SignalError, match="samples 30 … 49 are missing"):
        taken(order, [numbered(None, (50 + k) * T_S) for k in range(HELD_MAX + 1)])
    assert not math.isnan(order.n_late)
