"""Tuning on one or several logs: losses of all candidates, in processes side by side, and their ranking."""

from __future__ import annotations

import math
import multiprocessing
import signal
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from ..base.errors import SignalError
from ..base.metrics import rms_ratio
from ..base.settings import PredictorSettings
from ..base.signals import Array
from ..model.physics import ModalModel
from .choice import WORTH, window_sizes, with_window
from .losses import Losses, Piece, replayed_losses

__all__ = ["Tuning", "joint_ratio", "over_windows", "tune"]

Logs = Mapping[str, Sequence[Piece]]
"""Logs by name, each in pieces without a gap."""

Progress = Callable[[float], object]

_Task = tuple[str, Sequence[Piece], PredictorSettings]
"""Name and pieces of a log, and a candidate."""


@dataclass(frozen=True)
class Tuning:
    """Losses of candidates with a given look-ahead.

    Attributes
    ----------
    logs : tuple of str
        Their names.
    candidates : tuple of PredictorSettings
        The machine's own settings first.
    rms_pb, rms_hold : (n_logs,) array, m
        RMS errors of physics model and hold baseline.
    rms_h : (n_candidates, n_logs) array, m
        Of the hybrids; infinite where the prediction diverges.
    """

    logs: tuple[str, ...]
    candidates: tuple[PredictorSettings, ...]
    rms_pb: Array
    rms_hold: Array
    rms_h: Array

    @cached_property
    def ratio(self) -> Array:
        """Geometric mean over the logs of RMS relative to hold, ``(n_candidates,)``.

        Which baseline the ratios are to does not change the ranking by it, and no log counts more for its size.
        """
        return np.array([joint_ratio(row, self.rms_hold) for row in self.rms_h])

    @property
    def ratio_pb(self) -> float:
        """The same for the physics model."""
        return joint_ratio(self.rms_pb, self.rms_hold)

    @cached_property
    def ranking(self) -> list[int]:
        """Indices of the candidates, the best first."""
        return sorted(range(len(self.candidates)), key=lambda i: self.ratio[i])

    @property
    def chosen(self) -> int:
        """Index of the best candidate, or 0, the machine's own settings, if they are at most 5 % worse."""
        best = self.ranking[0]
        return best if self.ratio[best] < (1.0 - WORTH) * self.ratio[0] else 0

    @property
    def alike(self) -> list[int]:
        """Indices of the candidates that are at most 5 % worse than the best, the best first."""
        limit = self.ratio[self.ranking[0]] / (1.0 - WORTH)
        return [i for i in self.ranking if self.ratio[i] <= limit < math.inf]

    @property
    def n_diverged(self) -> int:
        """Number of candidates whose prediction diverges on some log."""
        return int(np.isinf(self.rms_h).any(axis=1).sum())


def joint_ratio(rms: Array, rms_hold: Array) -> float:
    """Return the geometric mean of RMS errors relative to hold's; infinite if one is."""
    ratios = [rms_ratio(float(one), float(hold)) for one, hold in zip(rms, rms_hold, strict=True)]
    if any(math.isinf(ratio) for ratio in ratios) or 0.0 in ratios:
        return math.inf if math.inf in ratios else 0.0
    return math.exp(math.fsum(map(math.log, ratios)) / len(ratios))


def tune(
    model: ModalModel,
    logs: Logs,
    candidates: Sequence[PredictorSettings],
    *,
    jobs: int = 1,
    progress: Progress = lambda _done: None,
) -> Tuning:
    """Return the losses of candidates, which have one look-ahead, on each of the logs.

    Parameters
    ----------
    model : ModalModel
        ``G_pb``.
    logs : mapping
        Pieces ``(x_d, x)`` by the log's name; on each log every candidate begins untrained.
    candidates : sequence of PredictorSettings
        The machine's own first; each takes a replay a log.
    jobs : int
        Processes; the result is the same for any number.
    progress : callable, optional
        Called with the fraction done.

    Raises
    ------
    SignalError
        If a log's samples cannot be used; the message names the log.
    """
    given = tuple(candidates)
    tasks = [(name, pieces, one) for name, pieces in logs.items() for one in given]
    return _tuning(logs, given, _losses(model, tasks, jobs, progress))


def over_windows(
    model: ModalModel,
    logs: Logs,
    settings: PredictorSettings,
    *,
    jobs: int = 1,
    progress: Progress = lambda _done: None,
) -> dict[int, Tuning]:
    """Return the losses of settings with shorter and longer windows, as far as the logs reach, by ``Np``.

    Parameters
    ----------
    model, logs, jobs, progress
        As for :func:`tune`.
    settings : PredictorSettings
        Of the controller's window; others have as many of the lags as fit into them.
    """
    sizes = window_sizes(settings.Np, min(sum(len(x) for _, x in pieces) for pieces in logs.values()))
    tried = [with_window(settings, Np) for Np in sizes]
    tasks = [(name, pieces, one) for one in tried for name, pieces in logs.items()]
    found = _losses(model, tasks, jobs, progress)
    n = len(logs)
    return {one.Np: _tuning(logs, (one,), found[i * n : (i + 1) * n]) for i, one in enumerate(tried)}


def _tuning(logs: Logs, candidates: tuple[PredictorSettings, ...], found: list[Losses]) -> Tuning:
    """Return the tuning of the losses of each log, one after the other."""
    n = len(found) // len(logs)
    by_log = [found[i : i + n] for i in range(0, len(found), n)]
    # A replay that diverges leaves no baselines; all replays of a log have the same.
    baselines = [next((one for one in losses if not math.isnan(one.rms_pb)), losses[0]) for losses in by_log]
    return Tuning(
        tuple(logs),
        candidates,
        np.array([one.rms_pb for one in baselines]),
        np.array([one.rms_hold for one in baselines]),
        np.array([[one.rms_h for one in losses] for losses in by_log]).T,
    )


def _losses(model: ModalModel, tasks: Sequence[_Task], jobs: int, progress: Progress) -> list[Losses]:
    """Return the losses of each task, in their order."""
    n, n_jobs = len(tasks), min(jobs, len(tasks))
    if n_jobs == 1:
        return [
            _task_losses(model, task, lambda done, i=i: progress((i + done) / n))  # type: ignore[misc]
            for i, task in enumerate(tasks)
        ]
    found = []
    pool = ProcessPoolExecutor(
        n_jobs,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=signal.signal,  # a terminal's Ctrl-C ends this process, which ends them
        initargs=(signal.SIGINT, signal.SIG_IGN),
    )
    try:
        for losses in pool.map(partial(_task_losses, model), tasks):
            found.append(losses)
            progress(len(found) / n)
    finally:
        pool.shutdown(cancel_futures=True)
    return found


def _task_losses(model: ModalModel, task: _Task, progress: Progress = lambda _done: None) -> Losses:
    name, pieces, candidate = task
    try:
        return replayed_losses(model, pieces, candidate, progress)
    except SignalError as error:
        raise SignalError(f"{name}: {error}") from error
