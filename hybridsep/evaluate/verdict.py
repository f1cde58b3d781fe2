"""Verdict on a hybrid model in words: better or worse than the physics model, hold and other peers, where, and why.

The errors of a run are summed up by place: a third of the look-ahead window, and whether the axis is commanded to move.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.metrics import rms_ratio
from ..base.signals import Array, Indices
from ..cosim.run import Run

ALIKE = 0.02  # relative difference of two RMS errors below which they count as equal
WINDOWS_MIN = 3  # windows below which nothing is judged: what one or two of them show is chance

WINDOWS_ENOUGH = 20
"""Windows from which on a judgement is stated without caution: some moves, each with its beginning and its end."""

_LEAST_SHARE = 0.01  # share of the samples from which on a place is judged
STANDSTILL = 1e-3  # commanded motion of a sample, relative to the largest, below which the axis is at rest
_UNSTABLE = 3.0  # largest change of the prediction, relative to the largest residual; beyond, the model is unstable

_N_EARLY = 10  # windows that count as the beginning of a run

_THIRDS = ("first third", "second third", "last third")
_MOTIONS = ("standstill", "motion")
_PEERS = ("the physics model", "hold")  # peers of every hybrid model, whose errors also tell why it is worse


@dataclass(frozen=True)
class Verdict:
    """Judgement of the hybrid model against its peers."""

    peers: tuple[str, ...]  # their names, :data:`_PEERS` first
    # RMS error of the hybrid relative to each peer's; NaN where the log's resolution does not show the peer's
    ratios: tuple[float, ...]
    worse: tuple[tuple[str, ...], ...]  # places where it is worse than each peer
    judged: tuple[str, ...]  # places with enough samples
    cause: str  # what explains that it is worse, as far as the run shows
    # number of measurements that were not learned, as they were missing or not plausible; of missing ones; and of all
    n_rejected: int
    n_missing: int
    n_samples: int
    n_windows: int  # whole windows with measurements, which were judged

    def __str__(self) -> str:
        if self.n_windows < WINDOWS_MIN:
            return f"Nothing is judged: {counted(self.n_windows)}, at least {WINDOWS_MIN} are needed."
        lines = [_compared(*one, self.judged) for one in zip(self.peers, self.ratios, self.worse, strict=True)]
        lines += [f"Why: {self.cause}"] if self.cause else []
        if self.n_windows < WINDOWS_ENOUGH:
            lines.append(f"Judged by {counted(self.n_windows)} only")
        if self.n_rejected:
            causes = ((self.n_missing, "missing"), (self.n_rejected - self.n_missing, "not plausible"))
            why = ", ".join(f"{n} {cause}" for n, cause in causes if n)
            lines.append(f"{self.n_rejected} of {self.n_samples} measurements were not learned: {why}")
        return "\n".join(f"{line}." for line in lines)


def verdict_of(run: Run) -> Verdict:
    """Return the verdict on the prediction of a run."""
    predictions, place = np.stack((run.x_pb, run.x_hold, run.x_h)), np.arange(len(run.t)) % run.Np
    return judge(run.x_d, run.x_meas, predictions, place, run.Np, n_rejected=run.n_rejected)


def judge(
    x_d: Array,
    x: Array,
    predictions: Array,
    place: Indices,
    Np: int,
    *,
    further: Sequence[str] = (),
    least: float = 0.0,
    n_rejected: int = 0,
    n_missing: int | None = None,
) -> Verdict:
    """Return the verdict on predictions of whole windows, of which the last may be shorter.

    ``x_d``, ``x``, (n,), m: commanded and measured positions, NaN where missing; ``predictions``, (3 or more, n), m:
    ``x_pb``, ``x_hold``, further peers' predictions, and ``x_h``; ``place``: (n,) of int: number of each sample in
    its window of ``Np``; ``further``: names of peers besides :data:`_PEERS`; ``least``: least RMS error, m, that the
    measurement's resolution shows: no ratio to a smaller one is formed; ``n_rejected``, ``n_missing``: measurements
    not learned, and of these missing ones; as many as the samples lack, if left out.
    """
    begin, known = np.flatnonzero(place == 0), ~np.isnan(x)
    window, n_known = np.cumsum(place == 0) - 1, int(known.sum())
    speed = np.abs(np.diff(x_d, prepend=x_d[:1]))
    fastest = np.maximum.accumulate(np.maximum.reduceat(speed, begin))[window] if len(x) else speed
    moving, third = speed > STANDSTILL * fastest, place * len(_THIRDS) // Np
    there = dict(zip(_MOTIONS, (~moving, moving), strict=True))
    there |= {name: third == i for i, name in enumerate(_THIRDS)}
    squares = np.where(known, (x - predictions) ** 2, 0.0)
    enough = max(_LEAST_SHARE * n_known, 1.0)
    sums = {name: squares[:, one].sum(axis=1) for name, one in there.items() if (one & known).sum() >= enough}
    *peers, h = squares.sum(axis=1).tolist()
    whole = (np.bincount(window) == Np) & (np.bincount(window, known) > 0)
    lost = len(x) - n_known
    ratios = tuple(math.nan if peer < least**2 * n_known else _ratio(h, peer) for peer in peers)
    worse = (tuple(key for key, at in sums.items() if _ratio(at[-1], at[i]) > 1.0 + ALIKE) for i in range(len(peers)))
    later = squares[:, window >= _N_EARLY].sum(axis=1) if len(begin) > 2 * _N_EARLY else None
    change = float(np.abs(predictions[-1] - predictions[0]).max(initial=0.0))
    largest = math.sqrt(squares[0].max(initial=0.0))
    return Verdict(
        (*_PEERS, *further),
        ratios,
        tuple(worse),
        tuple(sums),
        _cause(ratios[: len(_PEERS)], change, largest, later),
        n_rejected,
        min(lost if n_missing is None else n_missing, n_rejected),
        len(x),
        int(whole.sum()),
    )


def _cause(ratios: Sequence[float], change: float, largest: float, later: Array | None) -> str:
    """Return what explains a hybrid that is worse than some of :data:`_PEERS`.

    ``change`` is the largest of the prediction and ``largest`` the largest residual, m, ``later`` the sums of squares
    after the beginning of a long run.
    """
    if change > _UNSTABLE * largest > 0.0:
        far = f"{change / largest:.2g} × the largest residual"
        return f"the prediction is unstable: it leaves the physics model by {far}"
    peers = [peer for peer, value in enumerate(ratios) if value > 1.0 + ALIKE]
    if peers and later is not None and all(_ratio(later[-1], later[peer]) <= 1.0 + ALIKE for peer in peers):
        return f"only the first {_N_EARLY} windows are worse, where hardly anything has been learned yet"
    return ""


def counted(n: int) -> str:
    """Return a number of windows as text."""
    return f"{n} window{'' if n == 1 else 's'}"


def _ratio(own: float, other: float) -> float:
    return rms_ratio(math.sqrt(own), math.sqrt(other))


def _compared(peer: str, value: float, worse: tuple[str, ...], judged: tuple[str, ...]) -> str:
    """Return how good the hybrid is beside a peer, and where it is worse; everywhere or nowhere, where that says it."""
    if math.isnan(value):
        return f"Not compared with {peer}: its error is below what the log's resolution shows"
    how = "As good as" if abs(value - 1.0) <= ALIKE else "Better than" if value < 1.0 else "Worse than"
    times = f"{value:.3g} × its RMS error" if math.isfinite(value) else "its RMS error is 0"
    where = f", {_listed(judged)}" if value < 1.0 - ALIKE else ""
    if worse:
        where = ", everywhere" if worse == judged else f"; worse {_listed(worse)}"
    return f"{how} {peer}: {times}{where}"


def _listed(places: tuple[str, ...]) -> str:
    """Return places as text: "at standstill and in the first third of the window"."""
    shown = [text for place, text in zip(_MOTIONS, ("at standstill", "in motion"), strict=True) if place in places]
    thirds = [place.partition(" ")[0] for place in places if place in _THIRDS]
    if len(thirds) == len(_THIRDS):
        return f"{' and '.join(shown)}{', ' if shown else ''}in every third of the window"
    if thirds:
        shown.append(f"in the {' and '.join(thirds)} third of the window")
    return " and ".join(shown)
