"""Library adapters of the co-simulation loop: a predictor or compensator, and a plant.

The adapters of FMUs (``fmus.py``) have the same attributes and methods.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any, Protocol

from ..base.settings import check
from ..base.signals import check_position
from ..compensate.compensator import SepCompensator
from ..online.look_ahead import LookAhead
from ..plants.encoder import Encoder
from ..plants.plant import Plant
from ..predict.predictor import HybridPredictor
from .run import COMPENSATOR, PREDICTOR, Kind

__all__ = ["Compensator", "LibraryController", "LibraryDrive", "OwnController"]


class Compensator(Protocol):
    """Interface of a compensator of your own in a run; :class:`SepCompensator` has it too."""

    @property
    def T_s(self) -> float:
        """Sampling interval, s."""

    @property
    def delay(self) -> int:
        """Samples by which it delays the command, its look-ahead, ≥ 1."""

    def restart(self, start: float) -> None:
        """Begin a run at rest at ``start``, m."""

    def step(self, x_d_ahead: float, x_meas: float) -> float:
        """Process one sample: the command for ``delay`` samples later and the position measured now, m.

        Return the command of the next sample, m.
        """


class LibraryController:
    """A predictor or compensator behind its look-ahead, with the FMU's timing.

    Parameters
    ----------
    controller : HybridPredictor or SepCompensator
    t_init : float, optional
        Warm-up, s; its own if left out.

    Attributes
    ----------
    name : str
        Name in error messages.
    kind : Kind
    T_s : float
        Sampling interval, s; an FMU's, like the next three, is known after :meth:`initialise`.
    Np, delay, late : int
        Samples in a window; samples by which it delays the trajectory, and by which it is told that measurements are
        late.
    """

    name: str = "the controller"

    def __init__(self, controller: HybridPredictor | SepCompensator, t_init: float | None) -> None:
        self._controller, self._t_init = controller, t_init
        self.kind: Kind
        if isinstance(controller, SepCompensator):
            self.kind, predictor, self.delay = COMPENSATOR, controller.predictor, controller.preview
        else:
            self.kind, predictor, self.delay = PREDICTOR, controller, controller.Np
        self.T_s, self.Np, self.late = predictor.T_s, predictor.Np, predictor.settings.measurement_delay

    def initialise(self, start: float) -> None:
        """Begin a run at rest at ``start``, m, with what was learned kept."""
        self._look_ahead = LookAhead(self._controller, start, t_init=self._t_init)

    def outputs(self) -> tuple[tuple[float, ...], int]:
        """Return the positions of the kind's outputs, m, and the state, now."""
        ahead, kind = self._look_ahead, self.kind
        return tuple(getattr(ahead, name) for name in kind.outputs), kind.lowest + int(getattr(ahead, kind.state))

    def n_rejected(self) -> int:
        """Return how many measurements were missing or not plausible."""
        return self._look_ahead.n_rejected

    def step(self, k: int, x_d_ahead: float, x_meas: float) -> None:
        """Take in sample ``k``, m, and move on to the next."""
        self._look_ahead.sample(x_d_ahead, x_meas)


class OwnController:
    """A compensator of the user's own; a run has NaN for the predictions that it does not make.

    Raises
    ------
    ParameterError
        If ``T_s`` or ``delay`` is out of range.
    """

    name: str = "the compensator"
    kind: Kind = COMPENSATOR
    late: int = 0

    def __init__(self, compensator: Compensator) -> None:
        self._compensator = compensator
        self.T_s: float = check("T_s", compensator.T_s, label="the compensator's T_s")
        self.delay = self.Np = int(check("Np", compensator.delay, label="the compensator's delay"))

    def initialise(self, start: float) -> None:
        """Begin a run at rest at ``start``, m."""
        self._compensator.restart(start)
        self._x_dm, self._ahead = start, deque([start] * self.delay)

    def outputs(self) -> tuple[tuple[float, ...], int]:
        """Return the positions of the kind's outputs, m, and the state, now."""
        return (self._x_dm, self._ahead[0], *(math.nan,) * 3), 0

    def n_rejected(self) -> int:
        """Return 0: it does not tell."""
        return 0

    def step(self, k: int, x_d_ahead: float, x_meas: float) -> None:
        """Take in sample ``k``, m, and move on to the next."""
        x_dm = float(self._compensator.step(x_d_ahead, x_meas))
        check_position("the compensator's command", x_dm, f" at sample {k}")
        self._x_dm = x_dm
        self._ahead.append(x_d_ahead)
        self._ahead.popleft()


class LibraryDrive:
    """A plant and its encoder.

    Attributes
    ----------
    name : str
        Name in error messages.
    T_s : float, optional
        Sampling interval, s; None if it can be any.
    plant : object
        Passed to ``disturb``.
    """

    name: str = "the plant"
    T_s: float | None = None

    def __init__(self, plant: Plant, encoder: Encoder) -> None:
        self.plant: Any = plant
        self._encoder = encoder

    def initialise(self, start: float) -> None:
        """Put the plant to rest at ``start``, m."""
        self.plant.reset(start)

    def outputs(self) -> tuple[float, float]:
        """Return the true and the measured position now, m."""
        x = self.plant.x
        return x, self._encoder.measure(x)

    def step(self, k: int, x_d: float, h: float) -> None:
        """Advance by ``h`` seconds with the command ``x_d``, m, held."""
        self.plant.step(x_d, h)
