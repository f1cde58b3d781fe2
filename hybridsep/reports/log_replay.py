"""Replay of a whole log beside ARX models, as ``hybridsep backtest`` scores and saves it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..cosim.run import Run
from ..evaluate.backtest import Batch, backtest, backtest_stream
from ..evaluate.replayed import replayed_run
from ..evaluate.scores import Scores
from ..evaluate.verdict import Verdict
from ..logs.log import Log, LogReader
from ..predict.predictor import HybridPredictor
from .backtest_peers import BacktestPeers, backtest_peers

__all__ = ["LogReplay", "replay_log"]

_BATCHES_A_LINE = 100
"""Windows after which progress is said."""


@dataclass(frozen=True)
class LogReplay:
    """A log that was replayed.

    Attributes
    ----------
    scores : Scores
    first : Batch
        The first window.
    batches : list of (t, rms_pb, rms_hold, rms_h), s and m
        Of each window, where they were asked for.
    peers : BacktestPeers or None
        ARX models; None where the log was not held in memory.
    run : Run or None
        Predictions sample by sample, likewise.
    """

    scores: Scores
    first: Batch
    batches: list[tuple[float, ...]]
    peers: BacktestPeers | None = None
    run: Run | None = None

    @property
    def verdict(self) -> Verdict:
        """Verdict with all that was compared."""
        return self.scores.verdict if self.peers is None else self.peers.verdict

    def summary(self) -> dict[str, float | int | str]:
        """Return the figures of the replay and of the ARX models by name."""
        more = {} if self.peers is None else self.peers.summary()
        return {**self.scores.summary(), **more}

    def without_first_window(self) -> dict[str, float]:
        """Return the RMS errors from the second window on by name, m; empty where there is one window."""
        if self.scores.n_batches < 2:
            return {}
        first = self.first
        n = int(np.count_nonzero(~np.isnan(first.x)))
        rest = self.scores.overall.rms_without(n, (first.rms_pb, first.rms_hold, first.rms_h))
        more = {} if self.peers is None else self.peers.rms_from(len(first.x))
        return {**dict(zip(("pb", "hold", "h"), rest, strict=True)), **more}


def replay_log(
    predictor: HybridPredictor,
    opened: LogReader | Log,
    *,
    whole: bool,
    batches: bool,
    progress: Callable[[str, float], object] = lambda _message, _done: None,
) -> LogReplay:
    """Replay a log.

    Parameters
    ----------
    predictor : HybridPredictor
        It learns the log on the way.
    opened : LogReader or Log
    whole : bool
        Whether the log is held in memory, for ARX models and predictions sample by sample; a Log always is.
    batches : bool
        Whether the errors of each window are kept.
    progress : callable, optional
        Called with a message and the fraction done.

    Raises
    ------
    SignalError
        If a prediction diverges.
    """
    n_samples = len(opened.t) if isinstance(opened, Log) else opened.n_samples
    rows: list[tuple[float, ...]] = []
    first: list[Batch] = []

    def on_batch(batch: Batch) -> None:
        if batches:
            rows.append((round(batch.k * opened.T_s, 9), batch.rms_pb, batch.rms_hold, batch.rms_h))
        if batch.j == 0:
            first.append(batch)
        if batch.j % _BATCHES_A_LINE == 0:
            progress("replay", 0.8 * batch.k / n_samples)

    if isinstance(opened, LogReader) and not whole:
        scores = backtest_stream(predictor, opened.chunks(), on_batch=on_batch)
        return LogReplay(scores, first[0], rows)
    log = opened if isinstance(opened, Log) else opened.read()
    found = backtest(predictor, log.x_d, log.x_meas, on_batch=on_batch)
    peers = backtest_peers(found, log.x_d, log.x_meas, predictor, lambda done: progress("ARX models", 0.8 + 0.2 * done))
    delay = predictor.settings.measurement_delay
    run = replayed_run(found, log.x_d, log.x_meas, log.T_s, predictor.Np, measurement_delay=delay)
    return LogReplay(found, first[0], rows, peers, run)
