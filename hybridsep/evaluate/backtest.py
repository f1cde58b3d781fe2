"""Causal replay over a recorded log: each window is predicted first, then revealed and learned.

Three predictors are scored against the measured position: the physics model ``x_pb``, the hold baseline ``x_hold``
(``x_pb`` plus the residual of the last sample measured before the window, held over it; 0 before any was measured in
this replay) and the hybrid ``x_h`` of eq. (4). During the warm-up all three publish ``x_pb``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.errors import SignalError
from ..base.metrics import RunningErrors, html_table, last_residual, line_plot, one_line, reduction_percent, rms_ratio
from ..base.signals import PREDICTION_MAX, Array, as_measured, as_samples
from ..base.threads import one_blas_thread
from ..cosim.run import PREDICTOR, Run
from ..logs.log import Log
from ..online.look_ahead import SepState
from ..predict.predictor import HybridPredictor
from .verdict import Tally, Verdict

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Backtest", "Batch", "Score", "Scores", "backtest", "replayed_run"]


@dataclass(frozen=True)
class Score:
    """Prediction errors against the measured position; NaN where there are no samples.

    Attributes
    ----------
    n_samples : int
        Samples they were taken over.
    rms_pb, rms_hold, rms_h : float
        RMS of physics model, hold baseline and hybrid, m.
    max_pb, max_hold, max_h : float
        Largest absolute error of each, m.
    """

    n_samples: int
    rms_pb: float
    rms_hold: float
    rms_h: float
    max_pb: float
    max_hold: float
    max_h: float

    @property
    def ratio_to_hold(self) -> float:
        """RMS of the hybrid relative to the hold baseline's."""
        return rms_ratio(self.rms_h, self.rms_hold)

    @property
    def reduction_percent(self) -> float:
        """By how much the hybrid's RMS is below the physics model's, percent of the latter."""
        return reduction_percent(self.rms_h, self.rms_pb)

    @classmethod
    def of(cls, errors: RunningErrors) -> Score:
        """Return the score of the errors of physics model, hold baseline and hybrid."""
        return cls(errors.n, *errors.rms, *errors.peaks)


@dataclass(frozen=True)
class Scores:
    """Scores of a replay.

    Attributes
    ----------
    overall, after_warm_up : Score
        Over all samples, and over the samples after the warm-up.
    n_batches : int
        Windows replayed, the last one may be incomplete.
    verdict : Verdict
        Judgement of the hybrid over all samples, in words.
    """

    overall: Score
    after_warm_up: Score
    n_batches: int
    verdict: Verdict

    def summary(self) -> dict[str, float | int]:
        """Return all scores by name: ``rms_pb_um``, ``max_h_um``, ``reduction_percent``, ``ratio_to_hold``, ….

        Errors are in micrometres against the measured position; the names with ``_after_warm_up`` leave the warm-up
        out and are NaN if nothing is left.
        """
        result: dict[str, float | int] = {"n_batches": self.n_batches}
        for score, suffix in ((self.overall, ""), (self.after_warm_up, "_after_warm_up")):
            for quantity in ("rms", "max"):
                for name in ("pb", "hold", "h"):
                    result[f"{quantity}_{name}_um{suffix}"] = 1e6 * float(getattr(score, f"{quantity}_{name}"))
            result[f"reduction_percent{suffix}"] = score.reduction_percent
            result[f"ratio_to_hold{suffix}"] = score.ratio_to_hold
            result[f"n_samples{suffix}"] = score.n_samples
        return result


class Batch(NamedTuple):
    """Window of a replay, after it was revealed.

    Attributes
    ----------
    j : int
        Its number in this replay, from 0.
    k : int
        Index of its first sample in this replay, from 0.
    n_warm_up : int
        Its leading samples that belong to the warm-up.
    x_d, x : (n,) array, m
        Commanded and measured positions, NaN where missing.
    x_pb, x_hold, x_h : (n,) array, m
        Predictions made before any of ``x`` was known. With a ``measurement_delay`` they, ``x_h_std`` and ``x_d``
        belong to the instants at which ``x`` was measured; before the first of these ``x`` counts as missing.
    x_h_std : (n,) array, m
        Standard deviation of ``x − x_h``, as predicted.
    rms_pb, rms_hold, rms_h : float
        RMS of ``x`` minus each prediction over the window, m; NaN if all of ``x`` is missing.
    """

    j: int
    k: int
    n_warm_up: int
    x_d: Array
    x: Array
    x_pb: Array
    x_hold: Array
    x_h: Array
    x_h_std: Array
    rms_pb: float
    rms_hold: float
    rms_h: float


@dataclass(frozen=True, repr=False)
class Backtest(Scores):
    """Result of a replay: scores and predictions.

    It prints as one line, and as a table in a notebook; :meth:`plot` draws the errors window by window.

    Attributes
    ----------
    x_pb, x_hold, x_h : (n,) array, m
        Predictions, each made before its window was revealed.
    x_h_std : (n,) array, m
        Standard deviation of the error of ``x_h``, as predicted.
    active : (n,) array of bool
        Whether the hybrid is published, that is, after the warm-up.
    batch_rms_pb, batch_rms_hold, batch_rms_h : (n_batches,) array, m
        RMS errors of each window.
    """

    x_pb: Array
    x_hold: Array
    x_h: Array
    x_h_std: Array
    active: NDArray[np.bool_]
    batch_rms_pb: Array
    batch_rms_hold: Array
    batch_rms_h: Array

    def __repr__(self) -> str:
        """Return the RMS errors in one line."""
        return one_line("Backtest", self._figures())

    def _repr_html_(self) -> str:
        return html_table("Prediction errors of a replay", self._figures())

    def plot(self) -> Figure:
        """Return a matplotlib figure of the RMS errors of each window, µm."""
        lines = {
            name: 1e6 * errors
            for name, errors in (
                ("physics model", self.batch_rms_pb),
                ("hold", self.batch_rms_hold),
                ("hybrid", self.batch_rms_h),
            )
        }
        return line_plot(np.arange(float(self.n_batches)), lines, "window", "RMS prediction error [µm]")

    def pieces(self, starts: Sequence[int]) -> list[Backtest]:
        """Return the predictions of each segment, the scores those of all."""
        names = ("x_pb", "x_hold", "x_h", "x_h_std", "active")
        return [
            replace(self, **{name: getattr(self, name)[start:end] for name in names})
            for start, end in zip(starts, (*starts[1:], len(self.x_pb)), strict=True)
        ]

    def _figures(self) -> dict[str, float | int]:
        score = self.overall
        errors = {"rms_pb_um": score.rms_pb, "rms_hold_um": score.rms_hold, "rms_h_um": score.rms_h}
        return {"n_samples": score.n_samples, "n_batches": self.n_batches} | {
            name: 1e6 * error for name, error in errors.items()
        }


OnBatch = Callable[[Batch], object]


def backtest(
    predictor: HybridPredictor,
    x_d: ArrayLike | Log,
    x_meas: ArrayLike = (),
    *,
    starts: Sequence[int] = (0,),
    on_batch: OnBatch | None = None,
) -> Backtest:
    """Replay a log.

    The predictor goes on from its present state; call its ``restart`` before for another run with the weights kept.

    Parameters
    ----------
    predictor : HybridPredictor
        It learns the log on the way.
    x_d, x_meas : (n,) array_like, m
        Commanded and measured positions, ``n ≥ 1``; with averaging ``x_meas`` is NaN where it is missing. Or a
        :class:`~hybridsep.logs.log.Log` alone, which has both, and its segments.
    starts : sequence of int
        First samples of the segments, which gaps separate: another run begins with each, and what was learned is kept.
    on_batch : callable, optional
        Called with each :class:`Batch` when it is finished.

    Returns
    -------
    Backtest

    Raises
    ------
    SignalError
        If the samples are empty, of different lengths or not finite; the predictor is unchanged then.
    """
    if isinstance(x_d, Log):
        if abs(x_d.T_s - predictor.T_s) > 0.01 * predictor.T_s:
            raise SignalError(f"the log has T_s = {x_d.T_s:g} s, the predictor {predictor.T_s:g} s; they must agree")
        x_meas, starts, x_d = x_d.x_meas, x_d.starts, x_d.x_d
    command = as_samples(x_d, "x_d")
    measured = _measured(predictor, x_meas, "x_meas", len(command))
    batches: list[Batch] = []

    def keep(batch: Batch) -> None:
        batches.append(batch)
        if on_batch is not None:
            on_batch(batch)

    def joined(name: str) -> Array:
        return np.concatenate([np.atleast_1d(getattr(batch, name)) for batch in batches])

    both = np.stack((command, measured))
    segments = [both[:, start:end] for start, end in zip(starts, (*starts[1:], len(command)), strict=True)]
    scores = _replayed(predictor, segments, keep)
    return Backtest(
        scores.overall,
        scores.after_warm_up,
        scores.n_batches,
        scores.verdict,
        active=np.concatenate([np.arange(len(batch.x)) >= batch.n_warm_up for batch in batches]),
        **{name: joined(name) for name in ("x_pb", "x_hold", "x_h", "x_h_std")},
        **{f"batch_{name}": joined(name) for name in ("rms_pb", "rms_hold", "rms_h")},
    )


@one_blas_thread
def _replayed(predictor: HybridPredictor, segments: Iterable[Array], on_batch: OnBatch) -> Scores:
    """Replay segments, (2, m) each, whose samples are checked."""
    overall, after, tally = RunningErrors(3), RunningErrors(3), Tally(predictor.Np)
    j = k = n_rejected = n_missing = 0
    late: Array | None = None
    residual, begin = 0.0, 0
    for new, commands, x in _windows(segments, predictor.Np):
        if new and j:
            predictor.restart()
            late, residual, begin = None, 0.0, k
        window = _predicted(predictor, commands, residual)
        if late is None:
            late = _at_rest(commands[0] if predictor.start is None else predictor.start, predictor.state.late)
        n = len(x)
        signals = np.concatenate((late, window), axis=1)
        late = signals[:, n:]
        x_d, x_h_std, predicted = signals[_X_D, :n], signals[_STD, :n], signals[_PREDICTED, :n]
        warm = n - int(signals[_ACTIVE, :n].sum())
        compared = np.where(np.arange(k - begin, k - begin + n) < late.shape[1], np.nan, x)
        error = compared - predicted
        residual = last_residual(compared, predicted[0], residual)
        n_known, squares, peaks = _measure(error, k)
        if warm == 0:
            after.add(n_known, squares, peaks)
        elif warm < n:
            after.add(*_measure(error[:, warm:], k))
        rms = [math.sqrt(square / n_known) if n_known else math.nan for square in squares]
        batch = Batch(j, k, warm, x_d, compared, predicted[0], predicted[1], predicted[2], x_h_std, *rms)
        overall.add(n_known, squares, peaks)
        tally.add(x_d, compared, predicted)
        n_before = predictor.n_rejected
        predictor.update(x)
        n_rejected += predictor.n_rejected - n_before
        n_missing += int(np.isnan(x).sum())
        j, k = j + 1, k + n
        on_batch(batch)
    if j == 0:
        raise SignalError("a log must have at least one sample, got none")
    return Scores(Score.of(overall), Score.of(after), j, tally.verdict(n_rejected=n_rejected, n_missing=n_missing))


_X_D, _STD, _ACTIVE, _PREDICTED = 0, 1, 2, slice(3, 6)
"""Rows of the signals of a window: command, standard deviation, whether the hybrid is published, the predictions."""


def _predicted(predictor: HybridPredictor, x_d: Array, residual: float) -> Array:
    """Predict a window, and return its signals, ``(6, n)``, hold with the ``residual`` measured before it, m."""
    prediction = predictor.predict(x_d)
    active, x_pb = prediction.active, prediction.x_pb
    hold, x_h = x_pb + residual, x_pb + prediction.e_h  # Eq. (4)
    return np.stack((x_d, prediction.x_h_std, active, x_pb, np.where(active, hold, x_pb), np.where(active, x_h, x_pb)))


def _at_rest(start: float, late: Array) -> Array:
    """Return the signals of a drive that follows its commands, ``late`` relative to ``start``, m, ``(6, delay)``."""
    rest = np.tile(start + late, (6, 1))
    rest[_STD] = rest[_ACTIVE] = 0.0
    return rest


def _measure(error: Array, k: int) -> tuple[int, list[float], list[float]]:
    """Return number, sums of squares and largest magnitudes of the three errors of the window from sample ``k`` on."""
    missing = np.isnan(error[0])
    if missing.any():
        error = error[:, ~missing]
    peaks: list[float] = np.abs(error).max(axis=1, initial=0.0).tolist()
    if not all(peak <= PREDICTION_MAX for peak in peaks):
        raise SignalError(f"x_h diverges in the window from sample {k} on; raise lambda or lower p")
    return error.shape[1], [float(row.dot(row)) for row in error], peaks


def _windows(segments: Iterable[Array], Np: int) -> Iterator[tuple[bool, Array, Array]]:
    """Yield the windows of segments, (2, m) each, with whether it is the first of one; a last one may be shorter."""
    for samples in segments:
        for i in range(0, samples.shape[1], Np):
            yield i == 0, samples[0, i : i + Np], samples[1, i : i + Np]


def _measured(predictor: HybridPredictor, x: ArrayLike, name: str, length: int) -> Array:
    """Return measured positions, NaN where missing; SignalError if one is missing without averaging."""
    predictor.settings.check_replay()
    measured = as_measured(x, name, length)
    if not predictor.settings.averaging and np.isnan(measured).any():
        i = int(np.argmax(np.isnan(measured)))
        raise SignalError(f"{name} must be finite, got nan at sample {i}: missing measurements need averaging = true")
    return measured


def replayed_run(found: Backtest, x_d: Array, x_meas: Array, T_s: float, Np: int, *, measurement_delay: int = 0) -> Run:
    """Return the run of a replay, each measurement at the instant that it is of.

    Parameters
    ----------
    found : Backtest
    x_d, x_meas : (n,) array, m
        What was replayed; the true position of a recorded axis is NaN.
    T_s : float
        Sampling interval, s.
    Np : int
        Samples in a window.
    measurement_delay : int
        Samples by which measurements arrived late: measurements from before the log are left out.
    """
    n = max(len(x_meas) - measurement_delay, 0)
    arrived = slice(measurement_delay, None)
    return Run(
        kind=PREDICTOR,
        t=np.asarray(np.arange(n) * T_s, dtype=np.float64),
        x_d=x_d[:n],
        x_dm=x_d[:n],
        x=np.full(n, np.nan),
        x_meas=x_meas[arrived],
        x_pb=found.x_pb[arrived],
        x_h=found.x_h[arrived],
        x_h_std=found.x_h_std[arrived],
        state=np.where(found.active[arrived], SepState.HYBRID, SepState.PHYSICS),
        T_s=T_s,
        Np=Np,
        measurement_delay=measurement_delay,
    )
