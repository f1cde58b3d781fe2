"""From the importer's communication points to sample numbers."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

from ..errors import FmuError

__all__ = ["SampleClock"]


@dataclass
class SampleClock:
    """Counts samples of ``T_s`` in integers, ``t_k = t_start + k·T_s``; sub-steps divide a sample evenly.

    Attributes
    ----------
    start, T_s : float
        Start time and sampling interval, s.
    k : int
        Sample that is in progress.
    done, parts : int
        Sub-steps done of this sample, and how many it is made of.
    """

    start: float
    T_s: float
    k: int = 0
    done: int = 0
    parts: int = 1

    def check(self, t: float, h: float) -> int:
        """Return how many steps of ``h`` make up the sample in progress; nothing changes.

        Raises
        ------
        FmuError
            If ``h`` does not divide ``T_s``, differs within a sample, or ``t`` is not the communication point expected.
        """
        parts = round(self.T_s / h) if h > 0 and math.isfinite(self.T_s / h) else 0
        if parts < 1 or abs(parts * h - self.T_s) > 1e-6 * self.T_s:
            raise FmuError(f"the communication step size must divide T_s = {self.T_s:g} s, got {h:g} s")
        if self.done and parts != self.parts:
            raise FmuError(
                f"the communication step size must stay {self.T_s / self.parts:g} s within a sample of "
                f"T_s = {self.T_s:g} s, got {h:g} s"
            )
        expected = self.start + (self.k + self.done / parts) * self.T_s
        if not abs(t - expected) <= 0.5 * h:
            raise FmuError(f"the communication point must be {expected:.9g} s, got {t:.9g} s")
        return parts

    def advance(self, parts: int) -> bool:
        """Count one sub-step of ``parts``; return whether it completed the sample."""
        self.parts = parts
        self.done += 1
        if self.done < parts:
            return False
        self.k, self.done = self.k + 1, 0
        return True

    def state(self) -> dict[str, float]:
        """Return all fields as plain data."""
        return asdict(self)
