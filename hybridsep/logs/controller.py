"""What a controller says of itself, by its own signals beside the pair: delay, following error, contour deviation."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.metrics import ErrorSize
from ..base.signals import Array
from .log import Log
from .names import SIGNALS
from .units import DisplayUnits


@dataclass(frozen=True)
class Controller:
    """Figures of a controller's own signals; None of what logs do not have."""

    T_s: float  # sampling interval, s
    # samples by which the planned position leads the measured one: transport, interpolation and drive together
    delay: int | None = None
    look_ahead: int | None = None  # samples by which it leads the command of the position loop
    # planned minus measured position, and the same with the planned one taken ``delay`` samples later
    behind_plan: ErrorSize | None = None
    without_delay: ErrorSize | None = None
    # as the controller computes them
    following_error: ErrorSize | None = None
    contour_deviation: ErrorSize | None = None

    def lines(self, shown: DisplayUnits, Np: int) -> list[str]:
        """Return what the figures mean for a look-ahead of ``Np`` samples, in words."""

        def words(size: ErrorSize) -> str:
            return f"{shown.words(size.rms, '.4g')} RMS, {shown.words(size.largest, '.4g')} at most"

        def time(n: int) -> str:
            return f"{n} samples ({1e3 * n * self.T_s:.3g} ms)"

        said = []
        if self.delay is not None and self.behind_plan and self.without_delay:
            said.append(
                f"delay: the planned position ({SIGNALS['planned_position']}) leads the measured one by "
                f"{time(self.delay)}; their difference is {words(self.behind_plan)}, and without the delay "
                f"{words(self.without_delay)}"
            )
        for what, size in (("following_error", self.following_error), ("contour_deviation", self.contour_deviation)):
            if size:
                said.append(f"{what.replace('_', ' ')} ({SIGNALS[what]}): {words(size)}")
        command = SIGNALS["loop_command"]
        if self.look_ahead is not None:
            said.append(
                f"look-ahead of its own: the planned position leads the command of the position loop ({command}) by "
                f"{time(self.look_ahead)}; a compensation that is added to that command has these of its Np = {Np} for "
                "nothing, and needs the others from the program"
            )
        elif self.delay:
            said.append(f"look-ahead of its own: what of the delay is before the position loop; {command} would say it")
        return said


def controller_of(logs: Sequence[Log]) -> Controller | None:
    """Return the figures of a controller's own signals in logs of one axis; None where not all logs have some."""
    parts = [{**part.signals, "x": part.x_meas} for log in logs for part in log.segments()]
    there = set.intersection(*(set(part) for part in parts))
    if there == {"x"}:
        return None
    turn = 2.0 * math.pi if logs[0].unit == "rad" else math.inf

    def behind(leader: str, follower: str, n: int) -> Array:
        """Return how far one signal is behind another that is taken ``n`` samples later."""
        joined = np.concatenate([part[leader][: max(len(part["x"]) - n, 0)] - part[follower][n:] for part in parts])
        return joined if math.isinf(turn) else joined - turn * np.round(joined / turn)  # where one has its jump first

    def lead(leader: str, follower: str) -> int | None:
        """Return the samples by which one signal leads another, to the first least deviation of their difference."""
        if not {leader, follower} <= there:
            return None
        most, n, left = max(len(part["x"]) for part in parts) // 2, 0, math.inf
        while n <= most and (now := float(np.nanstd(behind(leader, follower, n)))) < left:
            n, left = n + 1, now
        return n - 1

    found: dict[str, ErrorSize] = {}
    delay = lead("planned_position", "x")
    if delay is not None:
        found["behind_plan"] = ErrorSize.of(behind("planned_position", "x", 0))
        found["without_delay"] = ErrorSize.of(behind("planned_position", "x", delay))
    for what in there & {"following_error", "contour_deviation"}:
        found[what] = ErrorSize.of(np.concatenate([part[what] for part in parts]))
    return Controller(logs[0].T_s, delay, lead("planned_position", "loop_command"), **found)
