"""Planners of a look-ahead's commands: a compensator, or a predictor, which is the planner that changes nothing."""

from __future__ import annotations

from typing import Protocol

from ..base.signals import Array
from ..predict.predictor import HybridPredictor
from ..predict.window import PublishedWindow

__all__ = ["Planner", "Unmodified", "WindowPlanner"]


class WindowPlanner(Protocol):
    """Interface of what a look-ahead asks for its windows.

    Attributes
    ----------
    predictor : HybridPredictor
    preview : int
        Samples of a plan, at least ``Np``.
    """

    predictor: HybridPredictor
    preview: int

    def restart(self, start: float | None = None, *, t_init: float = 0.0, lead_in: int = 0) -> None:
        """Begin another run, at rest at ``start``, m, for ``lead_in`` samples; what was learned is kept."""

    def plan(self, x_d: Array) -> PublishedWindow:
        """Plan the next window from ``(preview,)`` commands, m."""

    def update(self, x: Array) -> None:
        """Learn from the positions measured over the planned window, ``(Np,)``, m."""

    @property
    def is_planned(self) -> bool:
        """Whether a planned window is pending measurement."""


class Planner(WindowPlanner, Protocol):
    """Interface of a planner, which modifies the commands of a window before they are predicted; it can be saved."""

    def to_bytes(self) -> bytes:
        """Return parameters and state, the predictor's included."""

    @classmethod
    def from_bytes(cls, blob: bytes) -> Planner:
        """Return the planner of :meth:`to_bytes`."""


class Unmodified:
    """Planner that sends the commands as they are, with a predictor's prediction of them.

    The lead-in is one window, at rest, which is neither predicted nor learned.

    Parameters
    ----------
    predictor : HybridPredictor
    at_rest : bool
        Whether the current window is the lead-in.
    """

    def __init__(self, predictor: HybridPredictor, *, at_rest: bool) -> None:
        self.predictor, self.preview = predictor, predictor.Np
        self._at_rest = at_rest

    def restart(self, start: float | None = None, *, t_init: float = 0.0, lead_in: int = 0) -> None:
        """Begin another run behind the lead-in, at rest at ``start``, m; the warm-up ``t_init``, s, begins there."""
        self.predictor.restart(start, t_init=t_init)
        self._at_rest = lead_in > 0

    def plan(self, x_d: Array) -> PublishedWindow:
        """Predict the next window, but for the lead-in; SignalError if the prediction diverges."""
        if self._at_rest:
            return PublishedWindow.at_rest(float(x_d[0]), self.preview)
        return PublishedWindow.of_prediction(x_d, self.predictor.predict(x_d))

    def update(self, x: Array) -> None:
        """Learn from the positions measured over a predicted window, ``(Np,)``, m."""
        if not self._at_rest:
            self.predictor.update(x)
        self._at_rest = False

    @property
    def is_planned(self) -> bool:
        """Whether the current window is predicted, or the lead-in, and pending measurement."""
        return self.predictor.n_pending == (0 if self._at_rest else self.preview)
