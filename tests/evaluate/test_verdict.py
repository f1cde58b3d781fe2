"""Verdicts in words, on made-up errors and on replays."""

import numpy as np
import pytest

from hybridsep.base.signals import Array
from hybridsep.cosim.loop import cosimulate
from hybridsep.evaluate.verdict import Verdict, judge, verdict_of
from hybridsep.machines.machine import load_machine, paper_machine
from hybridsep.plants.trajectory import staircase
from hybridsep.predict.predictor import HybridPredictor

NP = 30
UM = 1e-6
NOISE = np.random.default_rng(0).normal(size=NP)
HALF = np.arange(NP) < NP // 2


def errors(*sizes: Array | float) -> Array:
    """Return errors of physics model, hold and hybrid of these sizes, ``(3, NP)``, m."""
    return np.array([UM * NOISE * np.broadcast_to(size, NP) for size in sizes], dtype=np.float64)


def verdict(
    pb: Array | float,
    hold: Array | float,
    h: Array | float,
    *,
    n: int = 40,
    motion: Array | float = 1e-3,
    n_missing: int = 0,
    n_rejected: int = 0,
) -> Verdict:
    """Return the verdict on ``n`` windows with these errors, µm; the axis moves by ``motion``, m a sample."""
    x = np.zeros(n * NP)
    x[:n_missing] = np.nan
    x_d = np.cumsum(np.tile(np.broadcast_to(motion, NP), n))
    return judged(x_d, x, np.tile(errors(pb, hold, h), n), n_rejected)


def judged(x_d: Array, x: Array, predictions: Array, n_rejected: int = 0) -> Verdict:
    return judge(x_d, x, predictions, np.arange(len(x)) % NP, NP, n_rejected=n_rejected)


def test_better_everywhere() -> None:
    found = verdict(10, 8, 4)
    assert found.ratios == pytest.approx((0.4, 0.5))
    assert str(found) == (
        "Better than the physics model: 0.4 × its RMS error, in motion, in every third of the window.\n"
        "Better than hold: 0.5 × its RMS error, in motion, in every third of the window."
    )


def test_places_where_it_is_worse() -> None:
    motion = np.where(HALF, 0.0, 1e-3)
    said = str(verdict(10, 10, np.where(HALF, 11, 1), motion=motion))
    assert said.splitlines()[0].endswith("; worse at standstill and in the first third of the window.")
    said = str(verdict(10, np.where(HALF, 1, 20), 5, motion=motion))
    assert "Better than the physics model: 0.5 × its RMS error, at standstill and in motion, in every third" in said
    assert "Better than hold" in said
    assert said.endswith("; worse at standstill and in the first third of the window.")
    assert str(verdict(10, 10, 20, motion=motion)).startswith("Worse than the physics model: 2 × its RMS error, every")


def test_alike_is_neither_better_nor_worse() -> None:
    assert str(verdict(100, 101, 101)).splitlines() == [
        "As good as the physics model: 1.01 × its RMS error.",
        "As good as hold: 1 × its RMS error.",
    ]
    assert str(verdict(0, 0, 0)).startswith("As good as the physics model: 1 × its RMS error.")
    assert str(verdict(0, 0, 1)).startswith("Worse than the physics model: its RMS error is 0, everywhere.")


def test_a_prediction_that_is_unstable_is_said() -> None:
    said = "\nWhy: the prediction is unstable: it leaves the physics model by 5 × the largest residual."
    assert said in str(verdict(10, 10, 60))
    assert "Why" not in str(verdict(10, 10, 15))


def test_a_bad_beginning_is_told_from_a_bad_model() -> None:
    predictions = np.hstack([errors(10, 10, 28 if k < 10 else 2) for k in range(60)])
    found = judged(np.linspace(0.0, 1.8, 60 * NP), np.zeros(60 * NP), predictions)
    assert found.ratios[0] > 1.1
    assert found.cause == "only the first 10 windows are worse, where hardly anything has been learned yet"


@pytest.mark.parametrize(
    ("n_missing", "n_rejected", "words"),
    [
        (0, 7, "7 of 1200 measurements were not learned: 7 not plausible."),
        (3, 3, "3 of 1200 measurements were not learned: 3 missing."),
        (3, 4, "4 of 1200 measurements were not learned: 3 missing, 1 not plausible."),
    ],
)
def test_what_was_not_learned_is_told(n_missing: int, n_rejected: int, words: str) -> None:
    assert str(verdict(10, 10, 5, n_missing=n_missing, n_rejected=n_rejected)).endswith(f"\n{words}")


def test_few_windows_are_told_and_fewer_judge_nothing() -> None:
    assert "only" not in str(verdict(10, 8, 4, n=20))
    said = str(verdict(10, 8, 4, n=19))
    assert said.startswith("Better than the physics model: 0.4")
    assert said.endswith("\nJudged by 19 windows only.")
    assert str(verdict(10, 8, 4, n=2)) == "Nothing is judged: 2 windows, at least 3 are needed."
    x = np.concatenate((np.full(NP, np.nan), np.zeros(2 * NP - 1)))  # nothing measured, whole, cut
    assert judged(np.linspace(0.0, 0.1, len(x)), x, np.tile(errors(10, 8, 4), 3)[:, : len(x)]).n_windows == 1
    assert str(judged(np.empty(0), np.empty(0), np.empty((3, 0)))).startswith("Nothing is judged: 0 windows")


def test_missing_measurements_are_not_judged() -> None:
    x = np.zeros(2 * NP)
    x[[0, 1, 2, *range(NP, 2 * NP)]] = np.nan
    predictions = np.hstack((errors(10, 8, 4), np.ones((3, NP))))
    found = judged(np.linspace(0.0, 0.06, 2 * NP), x, predictions, n_rejected=NP + 3)
    assert found.ratios[0] == pytest.approx(0.4)
    assert found.n_samples == 2 * NP


def test_of_a_run() -> None:
    machine = paper_machine("spring_mass_damper")
    run = cosimulate(machine.new_predictor(), machine.new_plant(), staircase()[:1500])
    found = verdict_of(run)
    assert found.ratios[0] == pytest.approx(run.summary()["rms_h_um"] / run.summary()["rms_pb_um"])
    assert found.ratios[1] == pytest.approx(run.summary()["ratio_to_hold"])
    assert str(found).startswith("Better than the physics model")
    assert "not learned" not in str(found)


def test_outliers_of_a_run_are_told() -> None:
    machine = load_machine("spring_mass_damper")
    predictor = HybridPredictor(machine.model)
    run = cosimulate(
        predictor, machine.new_plant(), staircase()[:1000], sensor=lambda k, x: x + 1e-3 if k in (555, 666) else x
    )
    assert run.n_rejected == 2
    assert str(verdict_of(run)).endswith("2 of 1000 measurements were not learned: 2 not plausible.")
