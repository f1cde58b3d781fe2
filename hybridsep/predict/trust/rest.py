"""Rest before the first motion of a run: the offset that earlier runs have trained in motion is not there yet."""

from __future__ import annotations

import numpy as np

from ...base.errors import SignalError
from ...base.saved import COUNT_MAX
from ...base.signals import Array

__all__ = ["N_REST", "RestBefore"]

N_REST = 2
"""Numbers of a state."""


class RestBefore:
    """Rest at the beginning of a run, as its commands tell.

    Parameters
    ----------
    late : int
        Samples by which the measurement is late: so many from before the run are measured in it.

    Attributes
    ----------
    lasts : bool
        Whether the command has not moved yet, in what was measured.
    known : int
        Samples behind these that are known to be at rest; 0 once the command has moved.
    """

    def __init__(self, late: int) -> None:
        self.lasts, self.known = True, late

    def ahead(self, path: Array, n: int) -> int:
        """Return how many of the next ``n`` samples are at rest.

        Parameters
        ----------
        path : (m,) array, m
            Commanded positions of the last ``m`` of them, relative to the start; what is late is before them.
        n : int
        """
        late = n - len(path)
        if not self.lasts or self.known < late:
            return self.known
        moving = np.flatnonzero(path)
        return late + int(moving[0]) if len(moving) else n

    def pass_by(self, m: int, n_rest: int) -> None:
        """Go on by ``m`` samples, ``n_rest`` being ahead at rest."""
        self.lasts, self.known = n_rest >= m, max(n_rest - m, 0)

    def state(self) -> list[float]:
        """Return the state as plain numbers."""
        return [float(self.lasts), float(self.known)]

    def restore(self, state: Array) -> None:
        """Restore a :meth:`state`; SignalError if it is none."""
        lasts, known = state.tolist()
        if not (lasts in (0.0, 1.0) and 0 <= known <= COUNT_MAX):
            raise SignalError("the rest before a run must be a truth value and a number of samples")
        self.lasts, self.known = lasts > 0.0, int(known)
