"""Tuning on one or several logs: losses of all candidates, in processes side by side, and their ranking."""

from __future__ import annotations

import itertools
import math
import signal
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cached_property, partial
from multiprocessing import get_context
from typing import Any

import numpy as np

from ..base.errors import ParameterError, SignalError
from ..base.metrics import rms_ratio
from ..base.settings import PredictorSettings
from ..base.signals import Array
from ..logs.checks import starts_in_motion
from ..model.physics import ModalModel
from ..predict.predictor import HybridPredictor
from .choice import WORTH, settings_to_try
from .replay import Recording, replay

Logs = Mapping[str, Sequence[Recording]]
"""Logs by name, each in pieces without a gap, as of :func:`unsettled`."""

Values = Mapping[str, Sequence[Any]]
"""Values to try, by the fields of settings."""

Progress = Callable[[float], object]

_Task = tuple[Sequence[Recording], PredictorSettings]
"""A log and a candidate."""

TUNED = {name: PredictorSettings.parameters()[name] for name in PredictorSettings.TUNED}
"""Parameters that can be tuned, by their fields."""

_LAMBDA_FACTORS = (1.0, 1e2, 1e4)
"""Values without averaging, relative to the machine's own."""

_FORGETTING = 30
"""Windows after which samples are forgotten in half of the candidates with averaging."""


@dataclass(frozen=True)
class Tuning:
    """Losses of candidates with a given look-ahead."""

    logs: tuple[str, ...]  # their names
    candidates: tuple[PredictorSettings, ...]  # the machine's own settings first
    # (n_logs,), m: RMS errors of physics model and hold baseline
    rms_pb: Array
    rms_hold: Array
    rms_h: Array  # (n_candidates, n_logs), m: of the hybrids; infinite where the prediction diverges

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
                name: {"rms_pb": self.rms_pb[i], "rms_hold": self.rms_hold[i]} for i, name in enumerate(self.logs)
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
    if math.inf in ratios or 0.0 in ratios:
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
    """Return the losses of candidates, which have one look-ahead, the machine's own first, on each of the logs.

    On each log every candidate begins untrained; the result is the same for any number of processes, ``jobs``.
    """
    tasks = [(recordings, one) for recordings in logs.values() for one in candidates]
    by_log = np.reshape(_losses(model, tasks, jobs, progress), (len(logs), -1, 3))
    # A replay that diverges leaves no baselines; all replays of a log have the same.
    sound = np.argmax(~np.isnan(by_log[:, :, 0]), axis=1)
    rms_pb, rms_hold = by_log[np.arange(len(logs)), sound, :2].T
    return Tuning(tuple(logs), tuple(candidates), rms_pb, rms_hold, by_log[:, :, 2].T)


def _losses(model: ModalModel, tasks: Sequence[_Task], jobs: int, progress: Progress) -> list[Array]:
    """Return the losses of each task, in their order."""
    n_jobs, found = min(jobs, len(tasks)), []
    with ExitStack() as stack:
        each: Iterable[Array] = map(partial(losses, model), tasks)
        if n_jobs > 1:
            ignore = (signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is this process's
            pool = ProcessPoolExecutor(n_jobs, get_context("spawn"), initializer=signal.signal, initargs=ignore)
            stack.callback(pool.shutdown, cancel_futures=True)
            each = pool.map(partial(losses, model), tasks)
        for one in each:
            found.append(one)
            progress(len(found) / len(tasks))
    return found


def unsettled(x_d: Array, x: Array, Np: int) -> Recording:
    """Return a piece of a log whose first window does not judge where it begins in motion.

    No model knows the state of the axis there, so its error says nothing of a candidate, but would dominate the RMS.
    """
    return Recording(x_d, x, 0, Np if len(x_d) > Np and starts_in_motion(x_d) else 0)


def losses(model: ModalModel, task: _Task) -> Array:
    """Return the losses of a candidate by a replay of its own: RMS of physics model, hold and hybrid, ``(3,)``, m.

    Where it diverges the last is infinite, and the others are NaN.
    """
    recordings, candidate = task
    try:
        return np.array(replay(HybridPredictor(model, candidate), recordings).rms())
    except SignalError:  # samples that were read are sound: it diverges
        return np.array([math.nan, math.nan, math.inf])


def default_values(settings: PredictorSettings) -> dict[str, tuple[Any, ...]]:
    """Return the values to try, a machine's own among them, by the fields of settings.

    Some sixteen combinations with averaging, and two dozen without.
    """
    tried = settings_to_try(settings)
    lags = {name: tuple(sorted({getattr(one, name) for one in tried})) for name in ("p", "q")}
    if settings.averaging:
        forgetting = {settings.forgetting, float(f"{_FORGETTING * settings.Np * settings.T_s:.3g}")}
        return {**lags, "forgetting": tuple(sorted(forgetting))}
    lam = {settings.lam, *(float(f"{settings.lam * factor:.6g}") for factor in _LAMBDA_FACTORS)}
    return {**lags, "lam": tuple(sorted(value for value in lam if TUNED["lam"].allows(value)))}


def candidates(settings: PredictorSettings, values: Values) -> list[PredictorSettings]:
    """Return all combinations of values, after a machine's own settings, which have the other parameters.

    Raises
    ------
    ParameterError
        If a value does not fit the window, or has no effect.
    """
    for name in values:
        if name in PredictorSettings.AVERAGING and not settings.averaging:
            raise ParameterError(f"{TUNED[name].name} has an effect with averaging only: set averaging = true, too")
    combinations = itertools.product(*values.values())
    combined = [replace(settings, **dict(zip(values, one, strict=True))) for one in combinations]
    return list(dict.fromkeys([settings, *combined]))
