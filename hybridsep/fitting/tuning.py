"""Tuning on one or several logs: losses of all candidates, in processes side by side, and their ranking."""

from __future__ import annotations

import itertools
import math
import signal
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property, partial
from multiprocessing import get_context
from typing import Any

import numpy as np

from ..base.errors import ParameterError, SignalError
from ..base.metrics import rms_ratio
from ..base.settings import PredictorSettings
from ..base.signals import Array, as_measured, as_samples
from ..logs.checks import starts_in_motion
from ..model.physics import ModalModel
from ..predict.predictor import HybridPredictor
from .choice import WORTH, settings_to_try
from .replay import Recording, replay

__all__ = [
    "TUNED",
    "Piece",
    "Tuning",
    "candidates",
    "default_values",
    "joint_ratio",
    "n_unjudged",
    "replayed_losses",
    "tune",
]

Piece = tuple[Array, Array]
"""Commanded and measured positions of a part of a log without a gap, ``(n,)`` each, m."""

Logs = Mapping[str, Sequence[Piece]]
"""Logs by name, each in pieces without a gap."""

Values = Mapping[str, Sequence[Any]]
"""Values to try, by the fields of settings."""

Progress = Callable[[float], object]

_Task = tuple[str, Sequence[Piece], PredictorSettings]
"""Name and pieces of a log, and a candidate."""

TUNED = {name: PredictorSettings.parameters()[name] for name in PredictorSettings.TUNED}
"""Parameters that can be tuned, by their fields."""

_CANDIDATES_MAX = 100_000
"""Candidates beyond which a list is a slip of the pen."""

_LAMBDA_FACTORS = (1.0, 1e2, 1e4)
"""Values without averaging, relative to the machine's own."""

_FORGETTING = 30
"""Windows after which samples are forgotten in half of the candidates with averaging."""


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
    def fields(self) -> tuple[str, ...]:
        """Fields of :data:`TUNED` in which the candidates differ."""
        return tuple(name for name in TUNED if len({getattr(one, name) for one in self.candidates}) > 1)

    def entries(self, i: int) -> dict[str, Any]:
        """Return the entries of ``[predictor]`` that candidate ``i`` has for the fields that differ."""
        return {TUNED[name].name: getattr(self.candidates[i], name) for name in self.fields}

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

    def results(self) -> dict[str, Any]:
        """Return plain values for JSON, errors in m (or rad); the candidates by their rank."""
        chosen = self.candidates[self.chosen]
        return {
            "Np": chosen.Np,
            "averaging": chosen.averaging,
            "logs": {
                name: {"rms_pb": pb, "rms_hold": hold}
                for name, pb, hold in zip(self.logs, self.rms_pb.tolist(), self.rms_hold.tolist(), strict=True)
            },
            "chosen": self.entries(self.chosen),
            "ratio_to_hold": float(self.ratio[self.chosen]),
            "n_diverged": self.n_diverged,
            "n_alike": len(self.alike),
            "candidates": [
                {
                    **self.entries(i),
                    "rms_h": dict(zip(self.logs, self.rms_h[i].tolist(), strict=True)),
                    "ratio_to_hold": float(self.ratio[i]),
                    "own": i == 0,
                }
                for i in self.ranking
            ],
        }


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
    tasks = [(name, pieces, one) for name, pieces in logs.items() for one in candidates]
    by_log = np.reshape(_losses(model, tasks, jobs, progress), (len(logs), -1, 3))
    # A replay that diverges leaves no baselines; all replays of a log have the same.
    sound = np.argmax(~np.isnan(by_log[:, :, 0]), axis=1)
    rms_pb, rms_hold = by_log[np.arange(len(logs)), sound, :2].T
    return Tuning(tuple(logs), tuple(candidates), rms_pb, rms_hold, by_log[:, :, 2].T)


def _losses(model: ModalModel, tasks: Sequence[_Task], jobs: int, progress: Progress) -> list[Array]:
    """Return the losses of each task, in their order."""
    n, n_jobs = len(tasks), min(jobs, len(tasks))
    if n_jobs == 1:
        return [
            _task_losses(model, task, lambda done, i=i: progress((i + done) / n))  # type: ignore[misc]
            for i, task in enumerate(tasks)
        ]
    ignore = (signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is this process's
    pool = ProcessPoolExecutor(n_jobs, get_context("spawn"), initializer=signal.signal, initargs=ignore)
    found = []
    try:
        for losses in pool.map(partial(_task_losses, model), tasks):
            found.append(losses)
            progress(len(found) / n)
    finally:
        pool.shutdown(cancel_futures=True)
    return found


def _task_losses(model: ModalModel, task: _Task, progress: Progress = lambda _done: None) -> Array:
    name, pieces, candidate = task
    try:
        return replayed_losses(model, pieces, candidate, progress)
    except SignalError as error:
        raise SignalError(f"{name}: {error}") from error


def n_unjudged(x_d: Array, Np: int) -> int:
    """Return how many leading samples of a piece are not scored: the first window, if the piece begins in motion.

    No model knows the state of the axis there, so its error says nothing of a candidate, but would dominate the RMS.
    """
    return Np if len(x_d) > Np and starts_in_motion(x_d) else 0


def replayed_losses(
    model: ModalModel,
    pieces: Sequence[Piece],
    candidate: PredictorSettings,
    progress: Progress = lambda _done: None,
) -> Array:
    """Return the losses of a candidate by a replay of its own: RMS of physics model, hold and hybrid, ``(3,)``, m.

    Without :func:`n_unjudged` samples. Where it diverges the last is infinite, and the others are NaN.

    Parameters
    ----------
    model : ModalModel
        ``G_pb``.
    pieces : sequence of pairs ``(x_d, x)`` of (n,) arrays, m
        Each begins at rest; what was learned before is kept, and only the first has a warm-up. With averaging
        measurements may be NaN, and are not scored there.
    candidate : PredictorSettings
    progress : callable, optional
        Called with the fraction done.

    Raises
    ------
    SignalError
        If samples cannot be used.
    """
    for x_d, x in pieces:
        if len(x_d) != len(x) or not len(x_d):
            raise SignalError(f"x_d and x must have as many samples, at least one, got {len(x_d)}, {len(x)}")
        (as_measured if candidate.averaging else as_samples)(x, "x", len(as_samples(x_d, "x_d")))
    try:
        recordings = [Recording(x_d, x, 0) for x_d, x in pieces]
        found = replay(HybridPredictor(model, candidate), recordings, progress=progress)
    except SignalError:  # the samples are sound: it diverges
        return np.array([math.nan, math.nan, math.inf])
    firsts = np.cumsum([0, *(len(x) for _, x in pieces[:-1])])
    left = [first + np.arange(n_unjudged(x_d, candidate.Np)) for first, (x_d, _) in zip(firsts, pieces, strict=True)]
    errors = np.delete(found.errors(), np.concatenate(left), axis=1)
    return np.asarray(np.sqrt(np.nanmean(errors**2, axis=1)))


def default_values(settings: PredictorSettings) -> dict[str, tuple[Any, ...]]:
    """Return the values to try, by the fields of settings.

    Some sixteen combinations with averaging, and two dozen without.

    Parameters
    ----------
    settings : PredictorSettings
        The machine's own, whose values are among them.
    """
    tried = settings_to_try(settings)
    lags = {name: tuple(sorted({getattr(one, name) for one in tried})) for name in ("p", "q")}
    if settings.averaging:
        forgetting = {settings.forgetting, float(f"{_FORGETTING * settings.Np * settings.T_s:.3g}")}
        return {**lags, "forgetting": tuple(sorted(forgetting))}
    lam = {settings.lam, *(float(f"{settings.lam * factor:.6g}") for factor in _LAMBDA_FACTORS)}
    return {**lags, "lam": tuple(sorted(value for value in lam if TUNED["lam"].allows(value)))}


def candidates(settings: PredictorSettings, values: Values) -> list[PredictorSettings]:
    """Return all combinations of values, after the settings themselves.

    Parameters
    ----------
    settings : PredictorSettings
        The machine's own, which have the other parameters.
    values : mapping
        Values by the fields of settings, of :data:`TUNED`.

    Raises
    ------
    ParameterError
        If a value does not fit the window or has no effect, or there are too many candidates.
    """
    for name, given in values.items():
        if name in PredictorSettings.AVERAGING and not settings.averaging:
            raise ParameterError(f"{TUNED[name].name} has an effect with averaging only: set averaging = true, too")
        for value in given:
            try:
                replace(settings, **{name: value})
            except ParameterError as error:
                raise ParameterError(f"{TUNED[name].name}: {error}") from error
    n = math.prod(len(given) for given in values.values())
    if n > _CANDIDATES_MAX:
        names = " and ".join(TUNED[name].name for name in values)
        raise ParameterError(f"{names} have {n} combinations, at most {_CANDIDATES_MAX} are allowed; take fewer")
    combined = [
        replace(settings, **dict(zip(values, combination, strict=True)))
        for combination in itertools.product(*values.values())
    ]
    return list(dict.fromkeys([settings, *combined]))
