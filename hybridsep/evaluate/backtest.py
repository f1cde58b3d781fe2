"""Causal replay over a recorded log: each window is predicted first, then revealed and learned.

Three predictors are scored against the measured position: the physics model ``x_pb``, the hold baseline ``x_hold``
(``x_pb`` plus the residual of the last sample measured before the window, held over it; 0 before any was measured in
this replay) and the hybrid ``x_h`` of eq. (4). During the warm-up all three publish ``x_pb``.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.errors import SignalError, brief, check_kind
from ..base.metrics import Score, batch_rms, hold, html_table, in_unit, line_plot, one_line
from ..base.signals import PREDICTION_MAX, Array, as_array, as_measured, as_samples, check_interval, check_same_index
from ..base.threads import one_blas_thread
from ..cosim.run import PREDICTOR, Run
from ..logs.log import Log, Table, is_table, read_log
from ..online.look_ahead import SepState
from ..predict.predictor import HybridPredictor
from .verdict import Verdict, judge

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FASTER, _FASTEST = 100.0, {"m": 50.0, "rad": 1000.0}
"""Factor of the fastest motion learned, and speed, m/s (of arrays, too) or rad/s: above both, positions are in mm."""


@dataclass(frozen=True, repr=False, eq=False)
class Backtest:
    """Result of a replay: scores and predictions.

    It prints as one line, and as a table in a notebook; :meth:`plot` draws the errors window by window.
    """

    # over all samples, and over the samples after the warm-up
    overall: Score
    after_warm_up: Score
    verdict: Verdict  # judgement of the hybrid over all samples, in words
    # (n,), m: predictions, each made before its window was revealed. With a ``measurement_delay`` they stand where what
    # they predict was measured
    x_pb: Array
    x_hold: Array
    x_h: Array
    x_h_std: Array  # (n,), m: standard deviation of the error of ``x_h``, as predicted
    active: NDArray[np.bool_]  # (n,): whether the hybrid is published, that is, after the warm-up
    # (n_batches,), m: RMS errors of each window, NaN where nothing was measured; the last one may be incomplete
    batch_rms_pb: Array
    batch_rms_hold: Array
    batch_rms_h: Array
    unit: str = "m"  # of the positions, or rad, of a log that says so

    @property
    def n_batches(self) -> int:
        """Windows that were replayed."""
        return len(self.batch_rms_h)

    def summary(self) -> dict[str, float | int]:
        """Return the figures of both scores; those with ``_after_warm_up`` are NaN if nothing is left."""
        scores = {**self.overall.figures(), **self.after_warm_up.figures("_after_warm_up")}
        return in_unit({"n_batches": self.n_batches, **scores}, self.unit)

    def __repr__(self) -> str:
        return one_line("Backtest", self._figures())

    def _repr_html_(self) -> str:
        return html_table("Prediction errors of a replay", self._figures())

    def plot(self) -> "Figure":
        """Return a matplotlib figure of the RMS errors of each window, µm."""
        errors = {"physics model": self.batch_rms_pb, "hold": self.batch_rms_hold, "hybrid": self.batch_rms_h}
        lines = {name: 1e6 * rows for name, rows in errors.items()}
        return line_plot(np.arange(float(self.n_batches)), lines, "window", f"RMS prediction error [µ{self.unit}]")

    def _figures(self) -> dict[str, float | int]:
        names = in_unit(dict.fromkeys(("n_samples", "n_batches", "rms_pb_um", "rms_hold_um", "rms_h_um")), self.unit)
        return {name: self.summary()[name] for name in names}


@one_blas_thread
def backtest(
    predictor: HybridPredictor,
    x_d: ArrayLike | Log | Mapping[str, ArrayLike] | Table,
    x_meas: ArrayLike = (),
    *,
    starts: Sequence[float] = (0,),
    progress: Callable[[float], object] = lambda _done: None,
) -> Backtest:
    """Replay a log.

    The predictor goes on from its present state; call its ``restart`` before for another run with the weights kept.

    Parameters
    ----------
    predictor : HybridPredictor
        It learns the log on the way.
    x_d, x_meas : (n,) array_like, m
        Commanded and measured positions, ``n ≥ 1``; with averaging ``x_meas`` is NaN where it is missing. Or a
        :class:`~hybridsep.logs.log.Log`, which has both, and its segments, or a table that is read as one. Arrays
        in another unit are a log of :func:`~hybridsep.logs.log.read_log`.
    starts : sequence of whole numbers
        First samples of the segments, which gaps separate: another run begins with each, and what was learned is kept.
    progress : callable, optional
        Called with the fraction done after each window.

    Raises
    ------
    ParameterError
        If the samples are not as far apart as the predictor's.
    SignalError
        If the samples are empty, of different lengths, not finite, or faster than an axis and than all that was
        learned, as in another unit; the predictor is unchanged then. If the prediction diverges.
    """
    check_kind(HybridPredictor, predictor=predictor)
    check_kind(Callable, progress=progress)
    T_s = predictor.T_s
    if is_table(x_d):
        x_d = read_log(cast("Table", x_d), T_s=T_s)
    unit = x_d.unit if isinstance(x_d, Log) else "m"
    if isinstance(x_d, Log):
        check_interval("the log", x_d.T_s, "the predictor", T_s)
        x_meas, starts, x_d = x_d.x_meas, x_d.starts, x_d.x_d
    check_same_index(x_d=x_d, x_meas=x_meas)
    command = as_samples(x_d, "x_d", T_s=T_s)
    predictor.settings.check_replay()
    measured = as_measured(x_meas, "x_meas", len(command), T_s=T_s)
    learned: Any = predictor.residual.learned  # of the paper's model no speed
    fastest, steps = getattr(learned, "largest_step", 0.0), np.abs(np.diff(command))
    moving, most = np.minimum(steps[1:], steps[:-1]), max(_FASTER * fastest, _FASTEST[unit] * T_s)  # without jumps
    if len(moving := moving[moving > 0.0]) and np.median(moving) > most and fastest > 0.0:
        raise SignalError(
            f"x_d must be in m or rad: it moves {np.median(moving):.3g} a sample, {fastest:.3g} at most were learned; "
            "read_log({'x_d': x_d, 'x': x}, T_s=…, unit='mm') makes a log of arrays in another unit"
        )
    if not predictor.settings.averaging and (missing := np.isnan(measured)).any():
        raise SignalError(
            f"x_meas must be finite, got nan at sample {np.argmax(missing)}: missing measurements need averaging = true"
        )
    n, Np, delay = len(command), predictor.Np, predictor.settings.n_late
    ends = np.append(as_array(starts, "starts"), n)
    if ends[0] != 0.0 or not (np.diff(ends) >= 1.0).all() or (ends % 1.0).any():
        raise SignalError(f"starts must be whole numbers from 0 on that rise and are below {n}, got {brief(starts)}")
    n_rejected, parts = 0, []
    for begin, end in pairwise(map(int, ends)):
        if begin:
            predictor.restart()
        late = (command[begin] if predictor.start is None else predictor.start) + predictor.state.late
        made = np.empty((4, end - begin))  # published x_pb and x_h, x_h_std, active
        for k in range(begin, end, Np):
            window = slice(k, min(k + Np, end))
            prediction = predictor.predict(command[window])
            x_pb, active = prediction.x_pb, prediction.active
            x_h = np.where(active, x_pb + prediction.e_h, x_pb)  # Eq. (4)
            if not np.all(np.abs(x_h) <= PREDICTION_MAX):
                raise SignalError(f"x_h diverges in the window from sample {k} on; raise lambda or lower p")
            made[:, k - begin : window.stop - begin] = x_pb, x_h, prediction.x_h_std, active
            n_before = predictor.n_rejected
            predictor.update(measured[window])
            n_rejected += predictor.n_rejected - n_before
            progress(window.stop / n)
        # What is predicted for an instant stands where it was measured, ``delay`` samples later; before, it follows
        x = measured[begin:end]
        arriving = np.concatenate((x[delay:], np.full(min(delay, len(x)), np.nan)))
        x_hold = hold(made[0], arriving, made[3] > 0.0, Np, late=delay)
        rows = np.stack((command[begin:end], made[0], x_hold, *made[1:]))
        at_rest = np.tile(late, (len(rows), 1))
        at_rest[4:] = 0.0
        rows = np.concatenate((at_rest, rows), axis=1)[:, : len(x)]
        compared = np.where(np.arange(len(x)) < delay, np.nan, x)
        parts.append(np.concatenate((rows[1:], compared - rows[1:4], [rows[0], compared, np.arange(len(x)) % Np])))
    x_pb, x_hold, x_h, x_h_std, published, *_ = signals = np.concatenate(parts, axis=1)
    active, errors, (arrived, compared, place) = published > 0.0, signals[5:8], signals[8:]
    of_pb, of_hold, of_h = (np.concatenate([batch_rms(part[i], Np) for part in parts]) for i in (5, 6, 7))
    made_of = (arrived, compared, signals[:3], place.astype(np.int64), Np)
    verdict = judge(*made_of, n_rejected=n_rejected, n_missing=int(np.isnan(measured).sum()))
    scores = Score.of(errors), Score.of(errors[:, active])
    return Backtest(*scores, verdict, x_pb, x_hold, x_h, x_h_std, active, of_pb, of_hold, of_h, unit)


def replayed_run(found: Backtest, x_d: Array, x_meas: Array, T_s: float, Np: int, *, measurement_delay: int = 0) -> Run:
    """Return the run of a replay of ``x_d``, ``x_meas``, ``(n,)``, m; the true position of a recorded axis is NaN.

    Each measurement is at the instant that it is of; those from before the log are left out.
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
        **{name: getattr(found, name)[arrived] for name in ("x_pb", "x_h", "x_h_std")},
        state=np.where(found.active[arrived], SepState.HYBRID, SepState.PHYSICS),
        T_s=T_s,
        Np=Np,
        measurement_delay=measurement_delay,
    )
