"""Recordings of which the first part teaches and the later part judges, and their replay."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.errors import SignalError
from ..base.metrics import rms
from ..base.signals import Array, Indices
from ..evaluate.backtest import Backtest, backtest
from ..evaluate.verdict import Tally, Verdict
from ..predict.predictor import HybridPredictor

__all__ = ["PREDICTIONS", "Recording", "Replay", "halves", "replay"]

PREDICTIONS = ("x_pb", "x_hold", "x_h")
"""What a replay predicts by: physics model, hold baseline, hybrid."""


@dataclass(frozen=True)
class Recording:
    """Piece of a recording without a gap.

    Attributes
    ----------
    x_d, x : (n,) array, m
        Commanded and measured positions.
    n_taught : int
        Leading samples that teach; the others judge.
    n_settling : int
        Leading samples that do not judge, as after a gap no model knows the state of the axis.
    """

    x_d: Array
    x: Array
    n_taught: int
    n_settling: int = 0

    @property
    def taught(self) -> tuple[Array, Array]:
        """Commanded and measured positions of the part that teaches."""
        return self.x_d[: self.n_taught], self.x[: self.n_taught]

    @property
    def judges_from(self) -> int:
        """First sample that judges."""
        return max(self.n_taught, self.n_settling)

    def first_judged(self, Np: int) -> int:
        """Return the first sample of the first window of ``Np`` that judges as a whole."""
        return -(-self.judges_from // Np) * Np


def halves(pieces: Iterable[tuple[Array, Array]], share: float, n_settling: int = 0) -> list[Recording]:
    """Split one log, the pieces ``(x_d, x)`` between its gaps, where a share of its samples is over.

    Parameters
    ----------
    pieces : iterable of two (n,) arrays, m
    share : float
        Share of the samples that teaches.
    n_settling : int
        Samples after each gap that do not judge, unless fewer than half of those that judge were left.

    Raises
    ------
    SignalError
        If a part is left without samples.
    """
    given = list(pieces)
    n = sum(len(x_d) for x_d, _ in given)
    left = round(share * n)
    if not 0 < left < n:
        raise SignalError(f"a log of {n} samples has none to teach or none to judge with a share of {share:g}")
    found = []
    for x_d, x in given:
        found.append(Recording(x_d, x, min(left, len(x_d))))
        left -= found[-1].n_taught
    settled = [*found[:1], *(replace(one, n_settling=min(n_settling, len(one.x))) for one in found[1:])]
    left, most = (sum(len(one.x) - one.judges_from for one in each) for each in (settled, found))
    return settled if 2 * left >= most else found


@dataclass(frozen=True)
class Replay:
    """Causal replay of recordings one after the other, what is learned kept.

    Attributes
    ----------
    recordings : tuple of Recording
    results : tuple of Backtest
        One a recording.
    Np : int
        Samples in a window.
    """

    recordings: tuple[Recording, ...]
    results: tuple[Backtest, ...]
    Np: int

    def joined(self, name: str, *, taught: bool = False) -> Array:
        """Return a signal of a :class:`Backtest` over all samples that judge, or over those that teach, ``(n,)``."""
        return self._parts([getattr(result, name) for result in self.results], taught)

    def errors(self, *, taught: bool = False) -> Array:
        """Return ``x`` minus each of :data:`PREDICTIONS` over the samples that judge, or teach, ``(3, n)``, m.

        NaN where a measurement is missing.
        """
        x = self._parts([recording.x for recording in self.recordings], taught)
        return np.stack([x - self.joined(name, taught=taught) for name in PREDICTIONS])

    def rms(self, *, taught: bool = False) -> list[float]:
        """Return the RMS of each of :meth:`errors`, m."""
        return [rms(row[~np.isnan(row)]) for row in self.errors(taught=taught)]

    def horizon(self) -> Array:
        """Return the RMS of each prediction at each sample of the window, judged, ``(3, Np)``, m; NaN without any."""
        place = self._parts(
            [np.arange(len(recording.x), dtype=np.float64) % self.Np for recording in self.recordings], False
        )
        errors = self.errors()
        found = np.full((3, self.Np), np.nan)
        for i in range(self.Np):
            at = errors[:, (place == i) & ~np.isnan(errors[0])]
            if at.size:
                found[:, i] = np.sqrt(np.mean(at**2, axis=1))
        return found

    def window_errors(self) -> tuple[Indices, Array]:
        """Return the first sample of each window that judges as a whole, and the RMS of each prediction over it.

        Returns
        -------
        begins : (n,) array of int
            Counted in the samples that judge.
        rms : (3, n) array, m
            NaN where nothing was measured.
        """
        begins, found = [], []
        for recording, window, predictions, begin in self._windows():
            begins.append(begin)
            errors = recording.x[window] - predictions
            known = errors[:, ~np.isnan(errors[0])]
            found.append(np.sqrt(np.mean(known**2, axis=1)) if known.size else np.full(len(PREDICTIONS), np.nan))
        return np.array(begins, dtype=np.intp), np.reshape(found, (-1, len(PREDICTIONS))).T

    def verdict(self) -> Verdict:
        """Return the verdict on the samples that judge."""
        tally = Tally(self.Np)
        for recording, window, predictions, _ in self._windows():
            tally.add(recording.x_d[window], recording.x[window], predictions)
        return tally.verdict()

    def _windows(self) -> Iterator[tuple[Recording, slice, Array, int]]:
        """Yield recording, samples, predictions, ``(3, m)``, and place in what judges, of each window that judges."""
        before = 0
        for recording, result in zip(self.recordings, self.results, strict=True):
            predictions = np.stack([getattr(result, name) for name in PREDICTIONS])
            before -= recording.judges_from
            for i in range(recording.first_judged(self.Np), len(recording.x), self.Np):
                window = slice(i, i + self.Np)
                yield recording, window, predictions[:, window], before + i
            before += len(recording.x)

    def _parts(self, signals: Sequence[Array], taught: bool) -> Array:
        parts = [
            signal[: recording.n_taught] if taught else signal[recording.judges_from :]
            for recording, signal in zip(self.recordings, signals, strict=True)
        ]
        return np.concatenate(parts)


def replay(
    predictor: HybridPredictor,
    recordings: Sequence[Recording],
    *,
    taught: bool = False,
    progress: Callable[[float], object] = lambda _done: None,
) -> Replay:
    """Replay recordings with one predictor, which goes on from its state and learns them.

    Parameters
    ----------
    predictor : HybridPredictor
        It is at the beginning of a run; another begins with each further recording.
    recordings : sequence of Recording
    taught : bool
        Whether only the parts that teach are replayed.
    progress : callable, optional
        Called with the fraction done.

    Raises
    ------
    SignalError
        If samples cannot be used, or a prediction diverges.
    """
    used = [
        Recording(*recording.taught, recording.n_taught) if taught else recording
        for recording in recordings
        if recording.n_taught or not taught
    ]
    n, done, results = sum(len(recording.x) for recording in used), 0, []
    for i, recording in enumerate(used):
        if i:
            predictor.restart()
        before = done
        results.append(
            backtest(
                predictor,
                recording.x_d,
                recording.x,
                on_batch=lambda batch, before=before: progress((before + batch.k) / n),  # type: ignore[misc]
            )
        )
        done += len(recording.x)
    return Replay(tuple(used), tuple(results), predictor.Np)
