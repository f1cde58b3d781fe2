"""Monitor of the following error, as drives have one, and of measurements that are missing.

Where a change of the command helps, the distance from the original command falls, and the distance from the modified
command stays as it was without the change. Where force is lacking or the sensor is wrong, both grow.
"""

import math
from dataclasses import dataclass, field

from ..base.state import FIXED


@dataclass
class Monitor:
    """Samples in a row that are missing, or whose following error is above the limit, or the mean of both is."""

    n_lost: int = field(default=0, metadata=FIXED)  # samples without a measurement after which it is lost; 0: never
    error_max: float = field(default=0.0, metadata=FIXED)  # largest following error, m; 0: none
    n_missing: int = 0  # measurements that were missing one after another
    n_over: int = 0  # samples above ``error_max`` one after another, three from when it tripped on
    n_taken: int = 0  # samples taken in since the window began

    @property
    def is_lost(self) -> bool:
        """Whether no measurement came for so long that the change of the command fades, until one comes."""
        return 0 < self.n_lost <= self.n_missing

    @property
    def is_tripped(self) -> bool:
        """Whether the change of the command fades until a reset."""
        return self.n_over >= 3  # in a row, missing ones aside: one or two may be the sensor's outliers

    def take_in(self, error: float, change: float) -> bool:
        """Take in a sample's following error, measured position minus command as it came, m, and the command's change.

        NaN where missing. Returns whether the error, and its geometric mean with the error from the modified command,
        are within the limit, and nothing has tripped: what is not is not learned.
        """
        self.n_taken += 1
        if math.isnan(error):
            self.n_missing += 1
            return True
        self.n_missing = 0
        if not self.is_tripped:
            square = max(error * error, error * (error - change))
            self.n_over = self.n_over + 1 if square > self.error_max**2 > 0.0 else 0
        return self.n_over == 0

    def reset(self) -> None:
        """End a trip; what was learned before it is kept."""
        self.n_over = 0
