"""Stop time of an FMU's default experiment."""

from __future__ import annotations

from ..base.signals import as_samples
from ..plants.trajectory import staircase
from .fmu import Fmu

__all__ = ["stop_time"]

_WITHOUT_TRAJECTORY = 10.0  # s


def stop_time(fmu: Fmu) -> float:
    """Return the end of the FMU's samples, or of the machine's trajectory, with the look-ahead's delay, s.

    With ``[limits]`` the trajectory is the staircase within them; without it is 10 s.
    """
    machine = fmu.machine
    if fmu.samples is not None:
        n = len(as_samples(fmu.samples, "samples"))
    elif machine.limits is not None:
        n = len(staircase(machine.T_s, limits=machine.trajectory_limits()))
    else:
        return _WITHOUT_TRAJECTORY
    # A compensator delays by its preview, everything else runs beside a predictor.
    delay = int(fmu.table.parameters.get("preview", machine.predictor_settings.Np))
    return round((n - 1 + delay) * machine.T_s, 9)
