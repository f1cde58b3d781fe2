"""Stop time of an FMU's default experiment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import ArrayLike

from ..base.signals import as_samples
from ..machines.machine import Machine
from ..plants.trajectory import staircase

__all__ = ["stop_time"]

_WITHOUT_TRAJECTORY = 10.0  # s


def stop_time(machine: Machine, description: Mapping[str, Any], samples: ArrayLike | None = None) -> float:
    """Return the end of the machine's trajectory with the look-ahead's delay, s; 10 s if it has none.

    Parameters
    ----------
    machine : Machine
        With ``[limits]``, its trajectory is the staircase within them.
    description : mapping
        ``model`` and ``parameters`` of the FMU.
    samples : (n,) array_like, m, optional
        The trajectory that a ReferenceTrajectory plays instead.
    """
    if samples is not None:
        n = len(as_samples(samples, "samples"))
    elif machine.limits is not None:
        n = len(staircase(machine.T_s, limits=machine.trajectory_limits()))
    else:
        return _WITHOUT_TRAJECTORY
    # A compensator delays by its preview, everything else runs beside a predictor.
    delay = int(description["parameters"].get("preview", machine.predictor_settings.Np))
    return round((n - 1 + delay) * machine.T_s, 9)
