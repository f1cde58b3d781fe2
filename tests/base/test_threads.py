"""BLAS threads: the same bits for any number, one inside replays and loops, the user's setting afterwards."""

import hashlib
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from hybridsep import (
    Encoder,
    HybridPredictor,
    SepCompensator,
    backtest,
    cosimulate,
    load_machine,
    paper_machine,
    simulate,
    staircase,
)
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.base.threads import one_blas_thread

N = 1100


def blas_threads() -> set[int]:
    """Return how many threads the BLAS libraries of this process use."""
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


@pytest.fixture
def two_threads() -> Iterator[None]:
    """Two BLAS threads, as a user might have set them."""
    with threadpool_limits(2, user_api="blas"):
        if blas_threads() != {2}:
            pytest.skip("the number of BLAS threads cannot be set here")
        yield


def results() -> dict[str, str]:
    """Return checksums of a replay and a closed loop that are large enough for OpenBLAS to use threads."""
    machine = paper_machine("spring_mass_damper")
    x_d = staircase()[:N]
    noise = Encoder(5e-6, 0)
    x = simulate(machine.new_plant(), x_d, machine.T_s) + noise.measure_all(np.zeros(N))
    replay = backtest(HybridPredictor(machine.model, PredictorSettings(averaging=False, Np=500, p=400, q=3)), x_d, x)
    loop = cosimulate(machine.new_compensator(), machine.new_plant(), x_d, encoder=noise)
    signals = {"replay": replay.x_h, "closed loop": loop.x_dm}
    return {name: hashlib.sha256(signal.tobytes()).hexdigest() for name, signal in signals.items()}


@pytest.mark.slow
def test_results_do_not_depend_on_the_number_of_threads() -> None:
    with threadpool_limits(1, user_api="blas"):
        one = results()
    with threadpool_limits(2, user_api="blas"):
        assert results() == one


def test_windows_of_a_users_own_loop_use_one_thread(two_threads: None) -> None:
    """Seen from a disturbance of the user's own, which is called where a window is predicted, planned and learned."""
    seen: list[set[int]] = []

    def disturbance(x: Array, v: Array) -> Array:
        seen.append(blas_threads())
        return v

    machine = load_machine("spring_mass_damper")
    x_d = staircase()[:400]
    predictor = HybridPredictor(machine.model, replace(machine.predictor_settings, Np=50), disturbances=[disturbance])
    predictor.predict(x_d[:50])
    predictor.update(x_d[:50])
    compensator = SepCompensator(predictor, machine.compensator_settings)
    compensator.plan(x_d[: compensator.preview])
    compensator.update(x_d[:50])
    assert len(seen) > 4
    assert set.union(*seen) == {1}
    assert blas_threads() == {2}


def test_the_users_setting_returns_after_an_error(two_threads: None) -> None:
    machine = paper_machine("spring_mass_damper")

    def fail(*_: object) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        backtest(machine.new_predictor(), staircase()[:300], staircase()[:300], progress=fail)
    assert blas_threads() == {2}


def test_runs_that_overlap_restore_once(two_threads: None) -> None:
    """As in two threads: the first one to begin ends before the second."""
    with ExitStack() as second:
        with one_blas_thread:
            second.enter_context(one_blas_thread)
        assert blas_threads() == {1}
    assert blas_threads() == {2}
