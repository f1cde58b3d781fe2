"""Output-error fit of one structure: least squares of measured minus simulated position.

The linear parameters, a constant offset and the state at the start of each segment are eliminated by variable
projection (Golub, Pereyra, Inverse Problems 19 (2003) R1), so that the search is only over poles.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from ..base.signals import Array, as_measured, as_samples
from .structure import Structure, free_responses, responses, sections_of

SAMPLES_MAX = 60_000  # samples that are used of long recordings: the parts in which the axis moves most
_PIECE = 6_000  # samples of one part of a long recording


@dataclass(frozen=True)
class Segment:
    """Consecutive samples, relative to the first command."""

    u: Array  # (n,), m: commanded positions
    y: Array  # (n,), m: measured positions, NaN where missing
    stop: int  # samples before this one are fitted to

    @property
    def motion(self) -> Array:
        """Commanded path up to each sample, ``(n,)``, m."""
        return np.concatenate(([0.0], np.cumsum(np.abs(np.diff(self.u)))))

    @property
    def known(self) -> NDArray[np.bool_]:
        """Samples with a measured position, ``(n,)``; the others have no residual."""
        return np.asarray(~np.isnan(self.y))


def as_segments(recordings: Iterable[tuple[ArrayLike, ArrayLike]]) -> list[Segment]:
    """Return the segments of pairs ``(x_d, x)``, of long ones the parts with most motion; none without measurements."""
    segments = [(u := as_samples(x_d, "x_d"), as_measured(x, "x", len(u))) for x_d, x in recordings]
    if sum(len(u) for u, _ in segments) > SAMPLES_MAX:
        pieces = [
            (u[i : i + _PIECE], y[i : i + _PIECE])
            for u, y in segments
            for i in range(0, len(u), _PIECE)
            if len(u) - i > _PIECE // 2 or i == 0
        ]
        power = [float(np.sum(np.diff(u) ** 2)) for u, _ in pieces]  # the squared velocity
        segments = [pieces[i] for i in sorted(np.argsort(power)[::-1][: SAMPLES_MAX // _PIECE])]
    return [Segment(u - u[0], y - u[0], len(u)) for u, y in segments if np.count_nonzero(~np.isnan(y)) > 1]


def motion_split(segments: Sequence[Segment], fraction: float) -> list[Segment]:
    """Return the segments with ``stop`` where that fraction of all commanded motion is over; 0 in later ones."""
    left = fraction * sum(float(segment.motion[-1]) for segment in segments)
    split = []
    for segment in segments:
        motion = segment.motion
        stop = len(motion) if motion[-1] <= left else int(np.searchsorted(motion, left)) if left > 0 else 0
        split.append(replace(segment, stop=stop))
        left -= float(motion[-1])
    return split


def delayed(u: Array, n: int) -> Array:
    """Return a command ``n`` samples later, at rest at its first value before."""
    return np.pad(u, (max(n, 0), 0), mode="edge")[: len(u)]


def in_time(x_d: Array, x: Array, n_late: int) -> tuple[Array, Array]:
    """Return commands and the positions of the same instants, of measurements that are ``n_late`` samples late."""
    return x_d[: max(0, len(x_d) - n_late)], x[n_late:]


_EVALUATIONS_MAX = 20  # largest number of iterations of one start; a good one converges within 15

_ROWS_MAX = 4000
"""Residuals that take part in a search, evenly spaced: the filters run over every sample, but neighbouring residuals
tell the same."""

_EDGE = 0.01  # distance from a bound, in the logarithm of a parameter, within which it counts as at the bound


@dataclass(frozen=True, order=True)
class Delay:
    """Dead time in half samples, even ones whole with a first-order hold: a zero-order hold delays by half a sample."""

    halves: int

    @property
    def samples(self) -> int:
        """Whole samples of dead time."""
        return self.halves // 2

    @property
    def input_hold(self) -> str:
        """Hold between the samples."""
        return "zoh" if self.halves % 2 else "foh"


@dataclass(frozen=True)
class Fit:
    """Fitted structure."""

    structure: Structure
    delay: Delay
    theta: Array  # (order,), nonlinear parameters
    linear: Array  # (n_linear,), linear parameters
    offset: float  # mean of the segments' offsets, m
    rms: float  # root mean square of the residual, m
    slowest: float  # lower bound of the natural frequencies, rad/s
    at_bound: bool  # whether a nonlinear parameter is at the end of its range, but for a lag that acts at once


class _Problem:
    """Separable least-squares problem of a structure with one dead time."""

    def __init__(
        self, segments: Sequence[Segment], T_s: float, structure: Structure, delay: Delay, rows_max: int
    ) -> None:
        self._structure, self._T_s, self._input_hold = structure, T_s, delay.input_hold
        used = [segment for segment in segments if segment.known[: segment.stop].sum() > 1]
        step = max(1, sum(s.stop for s in used) // rows_max)
        self._data = [
            (delayed(s.u[: s.stop], delay.samples), s.y[rows], rows)
            for s in used
            for rows in [np.flatnonzero(s.known[: s.stop])[::step]]
        ]
        # A derivative changes one mode: the others' responses are there already
        self._responses = lru_cache(8 * len(used))(self._responses_of)

    def solve(self, theta: Array) -> tuple[Array, Array, float]:
        """Return residual, linear parameters and mean offset for one set of poles."""
        blocks = [self._signals(theta, i) for i in range(len(self._data))]
        both = np.concatenate([without(free, signals).T for signals, free in blocks], axis=1)
        Phi, target = both[:-1].T, both[-1]
        norms = np.linalg.norm(Phi, axis=0)
        norms[norms == 0] = 1.0
        linear: Array = np.linalg.lstsq(Phi / norms, target, rcond=1e-12)[0] / norms  # with columns of unit norm
        means = [signals.mean(axis=0) for signals, _ in blocks]
        return target - Phi @ linear, linear, float(np.mean([one[-1] - one[:-1] @ linear for one in means]))

    def _signals(self, theta: Array, i: int) -> tuple[Array, Array]:
        """Return columns and, last, the target; and what offset and initial states may add to them.

        The filters run over every sample; some samples, all of them measured, have residuals.
        """
        structure, (u, y, rows), m = self._structure, self._data[i], 2 * self._structure.n_modes
        parts = [*theta[:m].reshape(-1, 2), *theta[m:].reshape(-1, 1)]
        found = [self._responses(i, *part.tolist()) for part in parts]
        forced = [one[:1] for one, _ in found] + [one[1:] for one, _ in found] or [u[None, rows]]
        columns, target = affine(structure, np.concatenate(forced).T, y)
        free = np.concatenate((np.ones((1, len(y))), *(one for _, one in found)))
        return np.concatenate((columns.T, target[None])).T, free.T

    def _responses_of(self, i: int, *theta: float) -> tuple[Array, Array]:
        """Return the responses of one mode, or of the lag, to the command and to initial states, ``(k, n)``."""
        (u, _, rows), is_mode = self._data[i], len(theta) == 2
        one = Structure(int(is_mode), lag=not is_mode, zero=self._structure.zero)
        sections = sections_of(one, np.array(theta), self._T_s, self._input_hold)
        return responses(one, sections, u).T[:, rows], free_responses(sections, len(u)).T[:, rows]


def without(nuisance: Array, signals: Array) -> Array:
    """Return signals, ``(n, m)``, less their least-squares projection onto the nuisance columns, ``(n, k)``."""
    norms = np.linalg.norm(nuisance, axis=0)
    there = norms > 0.0  # in few samples an initial state may show nowhere, and explains nothing then
    basis = np.linalg.qr(nuisance[:, there] / norms[there])[0]
    return np.asarray(signals - basis @ (basis.T @ signals))


def affine(structure: Structure, columns: Array, y: Array) -> tuple[Array, Array]:
    """Return the columns of the linear parameters and the target; a unit gain is subtracted from both."""
    if not structure.unit_gain:
        return columns, y
    n = max(structure.n_modes + structure.lag, 1)
    first = columns[:, :1]
    return np.hstack((columns[:, 1:n] - first, columns[:, n:])), y - columns[:, 0]


def fit_structure(
    segments: Sequence[Segment],
    T_s: float,
    structure: Structure,
    delay: Delay,
    starts: Sequence[Array],
    slowest: float,
    rows_max: int = _ROWS_MAX,
) -> Fit:
    """Return the best fit from several starts, nonlinear parameters ``(order,)`` each.

    ``slowest``, rad/s, bounds the natural frequencies from below; about ``rows_max`` residuals take part.
    """
    problem = _Problem(segments, T_s, structure, delay, rows_max)
    (low, high), searched = structure.bounds(T_s, slowest), structure.searched

    def relative_residual(found: Array, theta: Array, scale: float) -> Array:
        theta[searched] = found
        return problem.solve(theta)[0] / scale

    best: Fit | None = None
    for start in starts if structure.order else [np.empty(0)]:
        theta = np.clip(start, low + 1e-9, high - 1e-9)
        if structure.order:
            scale = float(np.sqrt(np.mean(problem.solve(theta)[0] ** 2))) or 1.0
            theta[searched] = least_squares(
                relative_residual,
                *(theta[searched],),
                args=(theta, scale),
                bounds=(low[searched], high[searched]),
                xtol=1e-6,
                ftol=1e-7,
                gtol=1e-10,
                max_nfev=_EVALUATIONS_MAX,
            ).x
        residual, linear, offset = problem.solve(theta)
        rms = float(np.sqrt(np.mean(residual**2)))
        if best is None or rms < best.rms:
            at_bound = bool((theta < low + _EDGE).any() or (theta > high - _EDGE)[: 2 * structure.n_modes].any())
            best = Fit(structure, delay, theta, linear, offset, rms, slowest, at_bound)
    assert best is not None  # there is a start
    return best


def simulated(fit: Fit, segment: Segment, T_s: float) -> Array:
    """Return the position of the fitted model, which starts at rest as the predictor does, ``(n,)``, m."""
    u = delayed(segment.u, fit.delay.samples)
    columns = responses(fit.structure, sections_of(fit.structure, fit.theta, T_s, fit.delay.input_hold), u)
    gains, betas = fit.structure.gains(fit.linear)
    return columns @ np.concatenate((gains, betas if fit.structure.zero else []))
