"""What ``fit`` and ``report`` advise: more motion is asked for where there is little of it, and nowhere else."""

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from hybridsep.base.signals import Array
from hybridsep.evaluate.peers import Peer
from hybridsep.fitting.advice import Judged, advice_on
from hybridsep.fitting.replay import Recording, Replay
from hybridsep.logs.units import shown_in

NP, N = 20, 1000
MOVING = 1e-3 * np.sin(2 * np.pi * 3.3e-3 * np.arange(N))  # m: a command that moves all the time


def judged(x_d: Array, hybrid: float, arx: float) -> Judged:
    """Return a replay in which physics model and hold err by 3 µm, hybrid and ARX by their own, m."""
    x = np.zeros(N)
    result = SimpleNamespace(x_pb=x + 3e-6, x_hold=x - 3e-6, x_h=x + hybrid)
    peer = Peer("ARX20", "refitted", (x + arx,))
    return Judged(
        Replay((Recording(x_d, x, N // 2),), cast(Any, result), NP, peers=(peer,)), 1e-3, shown_in("m"), "the half"
    )


@pytest.mark.parametrize(
    ("hybrid", "arx", "own"),
    [
        (4e-6, 9e-6, "Do not use the hybrid on what this log shows: 1.33 × the error of the physics model alone"),
        (2e-6, 1e-6, "Best on what this log shows is ARX20 (refitted): the hybrid has 2.00 × its error"),
    ],
)
def test_more_motion_is_advised_where_there_is_little(hybrid: float, arx: float, own: str) -> None:
    resting = MOVING[np.minimum(np.arange(N) % (N // 2), N // 20)]
    advice = advice_on(judged(MOVING, hybrid, arx))
    assert advice.startswith(own)
    assert advice.endswith("judged by 25 windows.")
    advice = advice_on(judged(resting, hybrid, arx))
    assert advice.startswith(own)
    assert advice.endswith("judged by 25 windows; the axis moves in 10 % of the samples: record more motion.")


@pytest.mark.parametrize("hybrid", [0.5e-6, 1e-6, 2e-6, 4e-6])
@pytest.mark.parametrize("n", [N, N // 5])
def test_a_hybrid_that_alone_began_trained_is_called_so(hybrid: float, n: int) -> None:
    """Beside rivals that learn from nothing, in the sentence that compares them, whatever it advises."""
    found = judged(MOVING, hybrid, 1e-6)
    cut = replace(found.replay, Np=NP * N // n)
    sentence = re.compile(r"the hybrid \(the only one that began trained\)[^.]*\d\.\d\d ×", re.IGNORECASE)
    for warm in (False, True):
        assert bool(sentence.search(advice_on(replace(found, replay=cut, warm=warm)))) == warm


def test_a_difference_of_a_few_percent_is_none() -> None:
    for hybrid in (1.01e-6, 0.99e-6):
        words = f"neither better nor worse here: {hybrid / 1e-6:.2f} × the error of ARX20 (refitted), judged by 25"
        assert words in advice_on(judged(MOVING, hybrid, 1e-6))
    words = "Use the hybrid: its error is 0.50 × the error of ARX20 (refitted), the best of the others"
    assert advice_on(judged(MOVING, 0.5e-6, 1e-6)).startswith(words)


def test_nothing_is_advised_where_the_axis_rests() -> None:
    """In the half that is tested, or in the one that physics model and others learn from."""
    advice = advice_on(judged(np.where(np.arange(N) < 100, MOVING, MOVING[100]), 1e-6, 9e-6))
    assert advice == "Nothing was tested: the commanded position does not move in the half; record moves to its end."
    advice = advice_on(replace(judged(MOVING, 1e-6, 9e-6), unidentified=True))
    assert advice.startswith("So far the hybrid is better than the physics model alone, 0.33 × its error, but the")
    assert advice.endswith("record moves in both halves.")


def judged_of_rounded(peer: float) -> Judged:
    """Return a judged log that is rounded to 1 µm, with the error of its peer, m."""
    found = judged(MOVING, 2e-6, peer)
    rounded = 1e-6 * np.round(MOVING / 1e-6)
    result, [of_peer] = found.replay.backtest, found.replay.peers
    shifted = SimpleNamespace(**{name: getattr(result, name) + rounded for name in ("x_pb", "x_hold", "x_h")})
    peers = (replace(of_peer, predictions=(of_peer.predictions[0] + rounded,)),)
    of_rounded = Recording(MOVING, rounded, N // 2)
    return replace(
        found, replay=replace(found.replay, recordings=(of_rounded,), backtest=cast(Any, shifted), peers=peers)
    )


def test_no_ratio_is_formed_to_an_error_that_the_resolution_does_not_show() -> None:
    """It was "71545304172.46 × lag + hold"."""
    found = judged_of_rounded(1e-12)
    assert advice_on(found) == (
        "There is nothing to gain in the half: the log's resolution does not show the error of ARX20 (refitted)."
    )
    words = str(found.replay.verdict())
    assert "Better than hold: 0.667 × its RMS error" in words
    assert "Not compared with ARX20 (refitted): its error is below what the log's resolution shows." in words


def test_an_axis_that_dwells_may_have_less_error_than_rounding_alone() -> None:
    """A milling machine's log in whole millimetres has 0.1 mm: at rest both positions are rounded alike."""
    assert "Worse than ARX20 (refitted)" in str(judged_of_rounded(1e-7).replay.verdict())


def test_what_would_help_is_said() -> None:
    """A hybrid that is best at first in each window, and gets better over the log."""
    one = judged(MOVING, 0.0, 9e-6)
    late = np.arange(N) % NP >= NP // 2
    error = np.where(late, np.where(np.arange(N) < 3 * N // 4, 9e-6, 5e-6), 1e-6)
    result = SimpleNamespace(x_pb=np.full(N, 3e-6), x_hold=np.full(N, -3e-6), x_h=error)
    learned = replace(one, replay=replace(one.replay, backtest=cast(Any, result)), period="with --period 0.005 better")
    words = advice_on(learned)
    assert "× the error of the physics model alone, which is best, judged by 25 windows. What may help:" in words
    assert "over the first 10 of 20 samples of the windows it has 0.33 × the error of the physics model alone" in words
    assert words.endswith("(--Np 10); with --period 0.005 better.")
