"""Recall: the stretch that is found, against a search that looks at all of them; what a repeated motion gains."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hybridsep.base.metrics import rms
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.machines.machine import load_machine
from hybridsep.plants.trajectory import PAPER_LIMITS, rest_to_rest
from hybridsep.predict.averaging.recall import Memory
from hybridsep.predict.predictor import HybridPredictor

SIZE = 300
TS = 1e-3  # s


def rows(residuals: Array) -> Array:
    """Return residuals with commands and leads of none."""
    return np.stack((residuals, 0.0 * residuals, 0.0 * residuals))


def heard(path: Array, residuals: Array, Np: int, ahead: int = 0, known: int | None = None) -> Memory:
    """Return a memory that has heard a path window by window, ``ahead`` samples before it was measured."""
    memory = Memory.init(SIZE, Np)
    for k in range(0, len(path) - ahead, Np):
        memory = memory.append_commands(path[k : k + Np + ahead], known, Np).remember(rows(residuals[k : k + Np]))
    return memory


def lag_by_search(path: Array, Np: int, n: int) -> int:
    """Return the lag with the least distance, each of them summed from its definition."""
    stride, changes = max(1, Np // 25), np.concatenate((np.zeros(SIZE), path))
    changes = changes[stride:] - changes[:-stride]
    ends = [first + j for first in range(0, len(path), Np) for j in range(0, Np // stride * stride, stride)]
    weights = np.exp(-stride / Np * np.arange(len(ends))[::-1])
    at = SIZE - stride + np.array(ends)
    distances = {
        lag: float(weights @ (changes[at] - np.where(at >= lag, changes[np.maximum(at - lag, 0)], 0.0)) ** 2)
        for lag in range(n, SIZE)
    }
    return min(distances, key=lambda lag: (distances[lag], lag))


@given(Np=st.sampled_from([8, 20, 60]), windows=st.integers(2, 12), seed=st.integers(0, 2**32 - 1))
def test_the_stretch_is_that_of_a_search(Np: int, windows: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    path, residuals = np.cumsum(rng.normal(size=Np * windows)), rng.normal(size=Np * windows)
    found = heard(path, residuals, Np).recalled(Np)
    memory = np.concatenate((np.zeros(SIZE), residuals))
    end = len(memory) - lag_by_search(path, Np, Np)
    np.testing.assert_array_equal(found.then[0], memory[end - 1 : end + Np])


def test_of_stretches_that_are_alike_the_last_one_is_recalled_behind_a_compensator() -> None:
    rng = np.random.default_rng(9)
    steps, residuals = rng.normal(size=64), rng.normal(size=256)
    path = np.cumsum(np.concatenate((steps, steps, steps + 2e-3 * rng.normal(size=64), steps)))
    memory = heard(path, residuals, 8)
    np.testing.assert_array_equal(memory.recalled(8, 2).then[0], residuals[190:200])
    np.testing.assert_array_equal(memory.recalled(8).then[0], residuals[127:136])


def test_a_path_that_is_known_further_ahead_is_heard_once() -> None:
    rng = np.random.default_rng(3)
    path, residuals = np.cumsum(rng.normal(size=400)), rng.normal(size=400)
    memory = heard(np.concatenate((np.zeros(60), path)), np.concatenate((np.zeros(60), residuals)), 20, ahead=40)
    plain = heard(np.append(path, np.zeros(40)), residuals, 20, ahead=40, known=20)
    np.testing.assert_allclose(memory.distances, plain.distances, rtol=1e-9)
    np.testing.assert_array_equal(memory.commands, plain.commands)


def test_behind_a_compensator_repeats_from_the_fourth_on_count_by_a_share() -> None:
    rng = np.random.default_rng(2)
    steps, memory = rng.normal(size=80), Memory.init(SIZE, 20)
    path = np.concatenate(([0.0], np.cumsum(np.tile(steps - steps.mean(), 7))[:-1]))
    for k in range(0, 560, 20):
        memory = memory.append_commands(path[k : k + 20], None, 20).remember(rows(np.full(20, k / 80 // 1)), 20, 1)
    np.testing.assert_allclose(memory.measured[0, -80:], 0.7 * 6 + 0.3 * (0.7 * 5 + 0.3 * 4), rtol=1e-4)


def test_a_memory_shorter_than_a_window_recalls_nothing() -> None:
    for memory in (Memory.init(20, 20), Memory.init(0, 20)):
        recalled = memory.append_commands(np.arange(20.0), None, 20).remember(rows(np.ones(20))).recalled(20)
        assert recalled.alike == 0.0
        np.testing.assert_array_equal(recalled.then, 0.0)


def test_a_repeated_part_is_predicted_by_its_first_time() -> None:
    """Errors that no feature has: they follow the time since the part began."""
    machine = load_machine("als25010_x")
    part = rest_to_rest([0.0, 0.01, 0.004, 0.0], PAPER_LIMITS, TS, start_times=[0.05, 0.4, 0.7], duration=1.0)
    of_part = 2e-5 * np.convolve(np.random.default_rng(1).normal(size=len(part)), np.hanning(30), "same")
    errors = {}
    for recall in (0, 4096):
        settings = PredictorSettings(Np=50, p=20, recall=recall)
        predictor, found = HybridPredictor(machine.model, settings, start=0.0), []
        for _ in range(3):
            for k in range(0, len(part), 50):
                window = predictor.predict(part[k : k + 50])
                x = window.x_pb + of_part[k : k + 50]
                found.append(x - window.x_h)
                predictor.update(x)
        errors[recall] = [rms(one) for one in np.split(np.concatenate(found), 3)]
    assert errors[4096][2] < 0.3 * errors[4096][0]
    assert errors[0][2] > 0.5 * errors[0][0]


def test_another_run_begins_at_rest_and_remembers() -> None:
    rng = np.random.default_rng(7)
    path, residuals = np.cumsum(rng.normal(size=200)), rng.normal(size=200)
    again = heard(path, residuals, 20).restart().append_commands(path[:20], None, 20)
    found = again.recalled(20)
    np.testing.assert_array_equal(found.then[0], [0.0, *residuals[:20]])
    assert found.alike == 1.0


def test_another_run_recalls_what_was_measured_after_the_same_commands() -> None:
    """Commands that were known ahead at the end of a run are not part of the next one."""
    rng = np.random.default_rng(5)
    path, residuals = np.cumsum(rng.normal(size=140)), rng.normal(size=100)
    memory = heard(path, residuals, 20, ahead=40).restart()
    path -= path[0]
    for k in range(0, 60, 20):
        memory = memory.append_commands(path[k : k + 20], None, 20).remember(rows(residuals[k : k + 20]))
    recalled = memory.append_commands(path[60:80], None, 20).recalled(20)
    np.testing.assert_array_equal(recalled.then[0], residuals[59:80])


def test_another_run_begins_without_a_residual() -> None:
    memory = Memory.init(SIZE, 20).append_commands(np.arange(20.0), None, 20).remember(rows(np.full(20, 3.0))).restart()
    assert memory.measured[0, -1] == 0.0
    np.testing.assert_array_equal(memory.measured[0, -21:-1], 3.0)
