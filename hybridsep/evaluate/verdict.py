"""Verdict on a hybrid model in words: better or worse than the physics model, hold and other peers, where, and why.

The errors of a run are summed up by place: a third of the look-ahead window, and whether the axis is commanded to move.
What is kept does not grow with the run.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.metrics import rms_ratio
from ..base.signals import Array
from ..cosim.run import Run

ALIKE = 0.02
"""Relative difference of two RMS errors below which they count as equal."""

WINDOWS_MIN = 3
"""Windows below which nothing is judged: what one or two of them show is chance."""

WINDOWS_ENOUGH = 20
"""Windows from which on a judgement is stated without caution: some moves, each with its beginning and its end."""

_LEAST_SHARE = 0.01
"""Share of the samples from which on a place is judged."""

STANDSTILL = 1e-3
"""Commanded motion of a sample, relative to the largest, below which the axis is at rest."""

_UNSTABLE = 3.0
"""Largest change of the prediction, relative to the largest residual, from which on the model counts as unstable."""

_LITTLE_MOTION = 0.1
"""Share of samples in motion below which there is too little of it to learn from."""

_N_EARLY = 10
"""Windows that count as the beginning of a run."""

_N_THIRDS = 3
_THIRDS = ("first third", "second third", "last third")
_MOTIONS = ("standstill", "motion")
_PEERS = ("the physics model", "hold")
"""Peers of every hybrid model, whose errors also tell why it is worse."""


@dataclass(frozen=True)
class Verdict:
    """Judgement of the hybrid model against its peers."""

    peers: tuple[str, ...]  # their names, :data:`_PEERS` first
    # RMS error of the hybrid relative to each peer's; NaN where the log's resolution does not show the peer's
    ratios: tuple[float, ...]
    worse: tuple[tuple[str, ...], ...]  # places where it is worse than each peer
    judged: tuple[str, ...]  # places with enough samples
    causes: tuple[str, ...]  # what explains it where it is worse, as far as the run shows
    # number of measurements that were not learned, as they were missing or not plausible; of missing ones; and of all
    n_rejected: int
    n_missing: int
    n_samples: int
    n_windows: int  # whole windows with measurements, which were judged

    def __str__(self) -> str:
        if self.n_windows < WINDOWS_MIN:
            return f"Nothing is judged: {counted(self.n_windows)}, at least {WINDOWS_MIN} are needed."
        lines = [
            f"Not compared with {peer}: its error is below what the log's resolution shows"
            if math.isnan(value)
            else f"{_comparison(value, peer)}{_where(value, places, self.judged)}"
            for peer, value, places in zip(self.peers, self.ratios, self.worse, strict=True)
        ]
        lines += [f"Why: {cause}" for cause in self.causes]
        if self.n_windows < WINDOWS_ENOUGH:
            lines.append(f"Judged by {counted(self.n_windows)} only")
        if self.n_rejected:
            lines.append(_not_learned(self.n_rejected, self.n_missing, self.n_samples))
        return "\n".join(f"{line}." for line in lines)


def verdict_of(run: Run) -> Verdict:
    """Return the verdict on the prediction of a run."""
    tally, predictions = Tally(run.Np), np.stack((run.x_pb, run.x_hold, run.x_h))
    for first in range(0, len(run.t), run.Np):
        window = slice(first, first + run.Np)
        tally.add(run.x_d[window], run.x_meas[window], predictions[:, window])
    return tally.verdict(n_rejected=run.n_rejected)


class Tally:
    """Running sums of the errors of the peers and of the hybrid, by their place.

    Parameters
    ----------
    Np : int
        Samples in a window.
    further : sequence of str
        Names of peers besides :data:`_PEERS`.
    least : float
        Least RMS error, m, that the measurement's resolution shows: no ratio to a smaller one is formed.
    """

    def __init__(self, Np: int, further: Sequence[str] = (), least: float = 0.0) -> None:
        self.Np, self._least = Np, least
        self._peers = (*_PEERS, *further)
        self._squares = np.zeros((len(self._peers) + 1, len(_MOTIONS), _N_THIRDS))
        self._counts = np.zeros((len(_MOTIONS), _N_THIRDS))
        self._early, self._n_windows, self._n_whole = np.zeros(len(self._squares)), 0, 0
        self._last_x_d = math.nan
        self._fastest = 0.0
        self._largest_residual = self._largest_change = 0.0
        self._n_missing = 0

    def add(self, x_d: Array, x: Array, predictions: Array) -> None:
        """Add a window.

        Parameters
        ----------
        x_d, x : (n,) array, m
            Commanded and measured positions, NaN where missing.
        predictions : (3 or more, n) array, m
            ``x_pb``, ``x_hold``, further peers' predictions, and ``x_h``.
        """
        speed = np.empty(len(x_d))
        speed[0] = 0.0 if math.isnan(self._last_x_d) else abs(x_d[0] - self._last_x_d)
        np.abs(x_d[1:] - x_d[:-1], out=speed[1:])
        self._last_x_d = float(x_d[-1])
        self._fastest = max(self._fastest, float(speed.max()))
        moving = (speed > STANDSTILL * self._fastest).astype(np.int64)
        third = np.minimum(np.arange(len(x)) * _N_THIRDS // self.Np, _N_THIRDS - 1)
        known = ~np.isnan(x)
        squares = (x - predictions) ** 2
        if not known.all():
            squares = np.where(known, squares, 0.0)
        place = _N_THIRDS * moving + third
        for total, weights in zip((*self._squares, self._counts), (*squares, known), strict=True):
            total += np.bincount(place, weights, total.size).reshape(total.shape)
        self._n_missing += int((~known).sum())
        self._largest_change = max(self._largest_change, float(np.abs(predictions[-1] - predictions[0]).max()))
        if known.any():
            self._largest_residual = max(self._largest_residual, float(np.sqrt(squares[0].max())))
        if self._n_windows < _N_EARLY:
            self._early += squares.sum(axis=1)
        self._n_windows += 1
        self._n_whole += int(len(x) == self.Np and known.any())

    def verdict(self, *, n_rejected: int = 0, n_missing: int | None = None) -> Verdict:
        """Return the verdict on the windows so far, with the numbers of measurements not learned, and of missing ones.

        The latter are among the former; as many as the windows lack, if left out.
        """
        *peers, h = self._squares
        least = self._least**2 * self._counts.sum()
        ratios = tuple(math.nan if peer.sum() < least else _ratio(h.sum(), peer.sum()) for peer in peers)
        n_samples = int(self._counts.sum()) + self._n_missing
        return Verdict(
            self._peers,
            ratios,
            tuple(self._worse(h, peer) for peer in peers),
            tuple(self._places()),
            tuple(self._causes(ratios[: len(_PEERS)])),
            n_rejected,
            min(self._n_missing if n_missing is None else n_missing, n_rejected),
            n_samples,
            self._n_whole,
        )

    def _places(self) -> dict[str, tuple[int, int]]:
        """Return the places with enough samples: name → axis of the sums, and place there."""
        places = {name: (0, i) for i, name in enumerate(_MOTIONS)} | {name: (1, i) for i, name in enumerate(_THIRDS)}
        least = max(_LEAST_SHARE * self._counts.sum(), 1.0)
        return {name: (axis, i) for name, (axis, i) in places.items() if self._counts.take(i, axis=axis).sum() >= least}

    def _worse(self, h: Array, peer: Array) -> tuple[str, ...]:
        """Return the places where the hybrid is worse."""
        return tuple(
            name
            for name, (axis, i) in self._places().items()
            if _ratio(h.take(i, axis=axis).sum(), peer.take(i, axis=axis).sum()) > 1.0 + ALIKE
        )

    def _causes(self, ratios: Sequence[float]) -> list[str]:
        """Return what explains a hybrid that is worse than some of :data:`_PEERS`."""
        if self._largest_change > _UNSTABLE * self._largest_residual > 0.0:
            times = self._largest_change / self._largest_residual
            return [f"the prediction is unstable: it leaves the physics model by {times:.2g} × the largest residual"]
        peers = [peer for peer, value in enumerate(ratios) if value > 1.0 + ALIKE]
        if not peers:
            return []
        causes = []
        moving = float(self._counts[1].sum() / max(self._counts.sum(), 1.0))
        if moving < _LITTLE_MOTION:
            causes.append(f"hardly any motion, in {100 * moving:.2g} % of these samples")
        rest = np.maximum(self._squares.sum(axis=(1, 2)) - self._early, 0.0)
        good_later = all(_ratio(rest[-1], rest[peer]) <= 1.0 + ALIKE for peer in peers)
        if good_later and self._n_windows > 2 * _N_EARLY:
            causes.append(f"only the first {_N_EARLY} windows are worse, where hardly anything has been learned yet")
        elif ratios[0] <= 1.0 + ALIKE and not causes:
            causes.append("the residual changes so slowly that its last value predicts it better than the motion does")
        elif not causes:
            causes.append("the residual does not repeat with the motion")
        return causes


def _not_learned(n_rejected: int, n_missing: int, n_samples: int) -> str:
    """Return how many measurements were not learned, and why."""
    n_implausible = n_rejected - n_missing
    if n_missing and n_implausible:
        return (
            f"{n_rejected} of {n_samples} measurements were not learned: {n_missing} missing, {n_implausible} not "
            "plausible"
        )
    were, why = "was" if n_rejected == 1 else "were", "missing" if n_missing else "not plausible"
    return f"{n_rejected} of {n_samples} measurements {were} {why}, and not learned"


def counted(n: int) -> str:
    """Return a number of windows as text."""
    return f"{n} window{'' if n == 1 else 's'}"


def _ratio(own: float, other: float) -> float:
    """Return the ratio of two RMS errors from their sums of squares."""
    return rms_ratio(math.sqrt(own), math.sqrt(other))


def _comparison(value: float, peer: str) -> str:
    how = "As good as" if abs(value - 1.0) <= ALIKE else "Better than" if value < 1.0 else "Worse than"
    times = f"{value:.3g} × its RMS error" if math.isfinite(value) else "its RMS error is 0"
    return f"{how} {peer}: {times}"


def _where(value: float, worse: tuple[str, ...], judged: tuple[str, ...]) -> str:
    """Return where the hybrid is worse; everywhere or nowhere, where that says it."""
    if not worse:
        return f", {_listed(judged)}" if value < 1.0 - ALIKE else ""
    return ", everywhere" if worse == judged else f"; worse {_listed(worse)}"


def _listed(places: tuple[str, ...]) -> str:
    """Return places as text: "at standstill and in the first third of the window"."""
    shown = [text for place, text in zip(_MOTIONS, ("at standstill", "in motion"), strict=True) if place in places]
    thirds = [place.partition(" ")[0] for place in places if place in _THIRDS]
    if len(thirds) == _N_THIRDS:
        return f"{' and '.join(shown)}{', ' if shown else ''}in every third of the window"
    if thirds:
        shown.append(f"in the {' and '.join(thirds)} third of the window")
    return " and ".join(shown)
