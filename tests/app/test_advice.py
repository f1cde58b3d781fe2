"""What ``fit`` and ``report`` advise: more motion is asked for where there is little of it, and nowhere else."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from hybridsep.base.signals import Array
from hybridsep.evaluate.peers import Peer
from hybridsep.logs.units import shown_in
from hybridsep.reports.judged import Judged, recommendation
from hybridsep.tune.recordings import Recording, Replay

NP, N = 20, 1000


def judged(x_d: Array, hybrid: float, arx: float) -> Judged:
    """Return a replay in which physics model and hold err by 3 µm, hybrid and ARX by their own, m."""
    x = np.zeros(N)
    result = SimpleNamespace(x_pb=x + 3e-6, x_hold=x - 3e-6, x_h=x + hybrid)
    peer = Peer("ARX20", "refitted", (x + arx,))
    return Judged(
        Replay((Recording(x_d, x, N // 2),), (cast(Any, result),), NP, peers=(peer,)), 1e-3, shown_in("m"), "the half"
    )


@pytest.mark.parametrize(
    ("hybrid", "arx", "own"),
    [
        (4e-6, 9e-6, "Do not use the hybrid on what this log shows: 1.33 × the error of the physics model alone"),
        (2e-6, 1e-6, "Best on what this log shows is ARX20 (refitted): the hybrid has 2.00 × its error"),
    ],
)
def test_more_motion_is_advised_where_there_is_little(hybrid: float, arx: float, own: str) -> None:
    t = np.arange(N) * 1e-3
    moving = 1e-3 * np.sin(2 * np.pi * 3.3 * t)
    resting = np.where(t < 0.1, moving, moving[100])
    advice = recommendation(judged(moving, hybrid, arx))
    assert advice.startswith(own)
    assert advice.endswith("judged by 25 windows.")
    advice = recommendation(judged(resting, hybrid, arx))
    assert advice.startswith(own)
    assert advice.endswith("judged by 25 windows; the axis moves in 10 % of the samples: record more motion.")
