"""Recordings in two parts, for training and for testing, and their replay."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import SignalError
from ..base.metrics import ErrorSize, known_rms, rms_ratio
from ..base.signals import Array, Indices
from ..evaluate.backtest import Backtest, backtest
from ..evaluate.peers import Peer, Piece, predict_peers
from ..evaluate.verdict import Verdict, judge
from ..identify.output_error import delayed
from ..logs.checks import resolution
from ..predict.predictor import HybridPredictor


@dataclass(frozen=True)
class Recording:
    """Piece of a recording without a gap."""

    # (n,), m: commanded and measured positions
    x_d: Array
    x: Array
    n_train: int  # leading training samples; the others are test samples
    n_settling: int = 0  # leading samples that do not judge, as after a gap no model knows the state of the axis

    @property
    def training(self) -> tuple[Array, Array]:
        """Commanded and measured positions of the training part."""
        return self.x_d[: self.n_train], self.x[: self.n_train]

    @property
    def judges_from(self) -> int:
        """First test sample."""
        return max(self.n_train, self.n_settling)

    def first_judged(self, Np: int) -> int:
        """Return the first sample of the first window of ``Np`` that begins in the test part."""
        return -(-self.judges_from // Np) * Np


def split_log(pieces: Iterable[tuple[Array, Array]], share: float, n_settling: int = 0) -> list[Recording]:
    """Split one log, the pieces ``(x_d, x)`` between its gaps, where the share of its samples for training is over.

    ``n_settling`` samples after each gap are no test samples, unless fewer than half of the test samples were left.

    SignalError if the test is left without samples.
    """
    given = list(pieces)
    n = sum(len(x_d) for x_d, _ in given)
    left = round(share * n)
    if not 0 <= left < n:
        raise SignalError(f"a log of {n} samples has none to test with a share of {share:g} to train")
    found = []
    for x_d, x in given:
        found.append(Recording(x_d, x, min(left, len(x_d))))
        left -= found[-1].n_train
    settled = [*found[:1], *(replace(one, n_settling=min(n_settling, len(one.x))) for one in found[1:])]
    left, most = (sum(len(one.x) - one.judges_from for one in each) for each in (settled, found))
    return settled if 2 * left >= most else found


def beginnings(recordings: Sequence[Recording], n_most: int) -> list[Recording]:
    """Return the beginnings of recordings, ``n_most`` samples in all, half of them for training at most.

    They begin where the recordings do, as what is learned of the position counts from there, less a long rest before
    the first motion, and end at rest where the command rests in the last quarter.
    """
    n = sum(len(one.x) for one in recordings)
    if n <= n_most:
        return list(recordings)
    found = []
    for one in recordings:
        end, moving = max(n_most * len(one.x) // n, 2), np.flatnonzero(np.diff(one.x_d))
        rest = int(moving[0]) - end // 20 if len(moving) else 0
        rest = max(0, min(rest, len(one.x) - end, one.n_train - end // 2))
        one = Recording(one.x_d[rest:], one.x[rest:], one.n_train - rest, max(one.n_settling - rest, 0))
        at_rest = np.flatnonzero(np.diff(one.x_d[3 * end // 4 : end]) == 0.0)
        last = 3 * end // 4 + int(at_rest[-1]) + 2 if len(at_rest) else end
        settling = min(one.n_settling, last)
        found.append(Recording(one.x_d[:last], one.x[:last], min(one.n_train, end // 2), settling))
    return found


@dataclass(frozen=True)
class Errors:
    """Errors of a prediction over the test samples."""

    name: str
    errors: Array  # (n,), m: measured minus predicted position, NaN where a measurement is missing
    diverged: bool = False  # whether the prediction diverged; then its errors mean nothing

    @cached_property
    def rms(self) -> float:
        """RMS of the errors, m; infinite where it diverged, NaN without a measurement."""
        return math.inf if self.diverged else known_rms(self.errors)


@dataclass(frozen=True)
class Replay:
    """Causal replay of recordings one after the other, what is learned kept.

    The test samples are the same everywhere: the whole windows from the first one that begins in the test part, and
    the shorter one at a recording's end.
    """

    recordings: tuple[Recording, ...]
    backtest: Backtest  # of all recordings, joined
    Np: int  # samples in a window
    # samples by which the measurements are late; as many measurements at a recording's beginning are from before it,
    # and count as missing
    delay: int = 0
    offset: float = 0.0  # measured minus modelled position, m, identified beside the physics model and tested with it
    peers: tuple[Peer, ...] = ()  # what the hybrid is compared with besides physics model and hold

    @cached_property
    def least(self) -> float:
        """Least RMS error, m, that the measurement's resolution shows: of one step of it in 10⁴ samples.

        Rounding itself has more where the axis moves; but where it rests, command and measurement are rounded alike.
        """
        return 0.01 * min((resolution(one.x[~np.isnan(one.x)]) for one in self.recordings), default=0.0)

    def with_peers(self, progress: Callable[[float], object] = lambda _done: None) -> "Replay":
        """Return the replay with the peers' predictions of the test samples."""
        pieces = [Piece(one.x_d, one.x, one.n_train, one.first_judged(self.Np)) for one in self.recordings]
        return replace(self, peers=predict_peers(pieces, self.Np, delay=self.delay, progress=progress))

    def joined(self, name: str) -> Array:
        """Return a signal of the :class:`Backtest` over all test samples, ``(n,)``."""
        return np.asarray(getattr(self.backtest, name)[self._judged])

    def commands(self) -> Array:
        """Return the commanded position over all test samples, ``(n,)``, m."""
        return np.concatenate([one.x_d for one in self.recordings])[self._judged]

    def errors(self) -> Array:
        """Return ``x`` minus what physics model, hold and hybrid predict, over the test samples, ``(3, n)``, m.

        NaN where a measurement is missing. The physics model is judged with its offset.
        """
        return (self._compared - self._predictions)[:, self._judged]

    def rms(self) -> list[float]:
        """Return the RMS of each of :meth:`errors`, m; NaN without a measurement."""
        return [known_rms(row) for row in self.errors()]

    def scored(self) -> list[Errors]:
        """Return the errors of physics model, hold, every peer, and the hybrid, over the test samples."""
        pb, hold, h = self.errors()
        errors = [(self._compared - np.concatenate(one.predictions))[self._judged] for one in self.peers]
        peers = [Errors(peer.title, one, peer.diverged) for peer, one in zip(self.peers, errors, strict=True)]
        return [Errors("physics model", pb), Errors("hold", hold), *peers, Errors("hybrid", h)]

    def best_ways(self) -> list[Peer]:
        """Return the peers, each fitted in the way that is better over the test samples; none that diverged."""
        scored = zip(self.peers, self.scored()[2:-1], strict=True)
        best: dict[str, Peer] = {}
        for peer, _ in sorted((one for one in scored if not one[0].diverged), key=lambda one: one[1].rms):
            best.setdefault(peer.name, peer)
        return [peer for peer in self.peers if best.get(peer.name) is peer]

    def best(self) -> Errors:
        """Return the best of physics model, hold and peers over the test samples."""
        return min(self.scored()[:-1], key=lambda one: one.rms)

    def horizon(self) -> Array:
        """Return the RMS of each prediction at each sample of the window, judged, ``(3, Np)``, m; NaN without any."""
        place, errors = self._place[self._judged], self.errors()
        return np.array([[known_rms(row[place == i]) for i in range(self.Np)] for row in errors])

    def rms_within(self, n: int) -> list[float]:
        """Return the RMS of each of :meth:`scored` over the first n samples of every window, m; NaN without any."""
        return [known_rms(one.errors[self._place[self._judged] < n]) for one in self.scored()]

    def modelled(self, *, tested: bool = False) -> list[tuple[Array, Array, Array]]:
        """Return commands, positions and the physics model's errors of the same instants, (n,) each, m.

        One of each recording, NaN where a measurement is missing; all samples, or the ``tested`` ones.
        """
        errors, found, end = self._compared - self._predictions[0], [], 0
        for one in self.recordings:
            span = slice(end, end := end + len(one.x))
            rows = np.stack((delayed(one.x_d, self.delay), self._compared[span], errors[span]))
            x_d, x, e = rows[:, self._judged[span]] if tested else rows
            found.append((x_d, x, e))
        return found

    def verdict(self) -> Verdict:
        """Return the verdict on the test samples."""
        peers = self.best_ways()
        pb, hold, h = self._predictions
        rows = np.stack((pb, hold, *(np.concatenate(peer.predictions) for peer in peers), h))
        of = (self.commands(), self._compared[self._judged], rows[:, self._judged], self._place[self._judged])
        return judge(*of, self.Np, further=[peer.title for peer in peers], least=self.least)

    def figures(self) -> dict[str, Any]:
        """Return the figures over the test samples, m, by name; the physics model is judged with its offset.

        ``best`` of physics model, hold and peers, to which the hybrid's error has the ``ratio``; the ``largest`` error
        of each that did not diverge.
        """
        scored, verdict, best = self.scored(), self.verdict(), self.best()
        rms_pb, rms_hold, rms_h = self.rms()
        return {
            "rms_pb": rms_pb,
            "rms_hold": rms_hold,
            "rms_h": rms_h,
            "peers": {one.name: "diverged" if one.diverged else one.rms for one in scored[2:-1]},
            "best": best.name,
            "ratio": rms_ratio(rms_h, best.rms, self.least),
            "largest": {one.name: ErrorSize.of(one.errors).largest for one in scored if not one.diverged},
            "n_windows": verdict.n_windows,
            "verdict": str(verdict),
        }

    @cached_property
    def _place(self) -> Indices:
        """Number of each sample in its window, ``(n,)``."""
        return np.concatenate([np.arange(len(one.x)) % self.Np for one in self.recordings])

    @cached_property
    def _judged(self) -> NDArray[np.bool_]:
        """Whether a sample is a test sample, ``(n,)``."""
        return np.concatenate([np.arange(len(one.x)) >= one.first_judged(self.Np) for one in self.recordings])

    @property
    def _predictions(self) -> Array:
        """What physics model, hold and hybrid are judged by, ``(3, n)``, m."""
        return np.stack((self.backtest.x_pb + self.offset, self.backtest.x_hold, self.backtest.x_h))

    @cached_property
    def _compared(self) -> Array:
        """Measured positions, ``(n,)``, m, NaN where one is of before its recording."""
        measured = [np.where(np.arange(len(one.x)) < self.delay, np.nan, one.x) for one in self.recordings]
        return np.concatenate(measured)


def replay(
    predictor: HybridPredictor,
    recordings: Sequence[Recording],
    progress: Callable[[float], object] = lambda _done: None,
) -> Replay:
    """Replay recordings with one predictor, which is at the beginning of a run, and learns them.

    Another run begins with each further recording.

    SignalError if samples cannot be used, or a prediction diverges.
    """
    x_d, x = (np.concatenate([getattr(one, name) for one in recordings]) for name in ("x_d", "x"))
    starts = np.cumsum([0, *(len(one.x) for one in recordings[:-1])]).tolist()
    found = backtest(predictor, x_d, x, starts=starts, progress=progress)
    return Replay(tuple(recordings), found, predictor.Np, predictor.settings.n_late)


def knew(saved: HybridPredictor, replayed: HybridPredictor) -> bool:
    """Return whether a saved predictor was trained with the log that it has replayed: both ended with its samples."""
    one, other = saved.state, replayed.state
    alike = (one.k, one.start, one.residual.last) == (other.k, other.start, other.residual.last)
    return alike and np.array_equal(one.physics, other.physics)
