"""Candidates: defaults, combinations, refusals."""

from __future__ import annotations

from dataclasses import replace

import pytest

from hybridsep.base.errors import ParameterError
from hybridsep.base.settings import PredictorSettings
from hybridsep.fitting.choice import with_window
from hybridsep.fitting.tuning import TUNED, candidates, default_values

PAPER = PredictorSettings(Np=100, p=50, q=3, lam=1e-12, averaging=False)
AVERAGING = replace(PAPER, averaging=True)


def test_the_defaults_are_a_few_replays() -> None:
    assert 20 <= len(candidates(PAPER, default_values(PAPER))) <= 30
    assert 10 <= len(candidates(AVERAGING, default_values(AVERAGING))) <= 20


@pytest.mark.parametrize("averaging", [False, True])
@pytest.mark.parametrize("Np", [1, 2, 19, 5000])
def test_all_fit_the_window_and_the_machines_own_come_first(Np: int, averaging: bool) -> None:
    own = replace(with_window(PAPER, Np), averaging=averaging, forgetting=7.0)
    assert (own.p, own.q) == (min(50, Np), min(3, Np - 1))
    tried = candidates(own, default_values(own))
    assert tried[0] == own
    assert len(set(tried)) == len(tried)
    differing = {field for field in TUNED if len({getattr(one, field) for one in tried}) > 1}
    assert differing <= ({"p", "q", "forgetting"} if averaging else {"p", "q", "lam"})
    assert {replace(one, **{field: getattr(own, field) for field in TUNED}) for one in tried} == {own}


def test_the_least_penalty_that_is_allowed_bounds_the_defaults() -> None:
    least = replace(PAPER, lam=1e-40)
    assert min(default_values(least)["lam"]) == 1e-40


@pytest.mark.parametrize(
    ("settings", "values", "words"),
    [
        (PAPER, {"p": (5, 101)}, "p must be 1 … Np = 100, got 101; lower p or raise Np"),
        (PAPER, {"q": (100,)}, "q must be 0 … Np − 1 = 99, got 100; lower q or raise Np"),
        (PAPER, {"effect": (1e-5,)}, "effect has an effect with averaging only: set averaging = true, too"),
    ],
)
def test_what_does_not_fit_is_refused(settings: PredictorSettings, values: dict[str, list[float]], words: str) -> None:
    with pytest.raises(ParameterError) as refused:
        candidates(settings, values)
    assert str(refused.value) == words
