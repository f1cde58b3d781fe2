"""Planners of a look-ahead's commands and their windows: a compensator, or a predictor, which changes nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from ..base.signals import Array
from ..predict.predictor import HybridPredictor
from ..predict.window import Prediction

__all__ = ["Planner", "PublishedWindow", "Unmodified", "WindowPlanner"]


@dataclass(frozen=True)
class PublishedWindow:
    """Commands of a window and the position predicted under them.

    Attributes
    ----------
    x_d, x_dm : (Np,) arrays, m
        Commanded position, and the modified command sent to the drive; the same without a planner.
    x_pb, x_h : (Np,) arrays, m
        Predictions under ``x_dm`` by the physics model and by the best available model.
    x_h_std : (Np,) array, m
        Standard deviation of the error of ``x_h``; 0 where it is not known.
    state : int
        Model that planned it (:class:`~hybridsep.compensate.planning.SepState`); 0 without a planner.
    n_warm_up : int
        Leading samples where ``x_h = x_pb``.
    n_followed, state_before : int
        Number of leading samples that follow the plan before, while a real-time implementation makes this plan; and the
        model that planned them.
    """

    SIGNALS: ClassVar[tuple[str, ...]] = ("x_d", "x_dm", "x_pb", "x_h", "x_h_std")

    x_d: Array
    x_dm: Array
    x_pb: Array
    x_h: Array
    x_h_std: Array
    state: int
    n_warm_up: int
    n_followed: int = 0
    state_before: int = 0

    @classmethod
    def at_rest(cls, start: float, Np: int) -> PublishedWindow:
        """Return the window of a drive at rest at ``start``, m, without a prediction."""
        rest = np.full(Np, start)
        return cls(rest, rest, rest, rest, np.zeros(Np), 0, Np)

    @classmethod
    def of_prediction(cls, x_d: Array, prediction: Prediction) -> PublishedWindow:
        """Return the window of unmodified commands; SignalError if its prediction diverges."""
        return cls(x_d, x_d, prediction.x_pb, prediction.x_h, prediction.x_h_std, 0, prediction.n_warm_up)


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

    def is_lost(self, x: Array) -> bool:
        """Return whether no measurement came for so long that changes of the command fade.

        Parameters
        ----------
        x : (n,) array, m
            Positions measured since the window began, NaN where missing.
        """

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

    def is_lost(self, x: Array) -> bool:
        """Return that no change fades, as there is none."""
        return False

    @property
    def is_planned(self) -> bool:
        """Whether the current window is predicted, or the lead-in, and pending measurement."""
        return self.predictor.n_pending == (0 if self._at_rest else self.preview)
