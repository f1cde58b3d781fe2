"""Output-error fit of one structure: least squares of measured minus simulated position.

The linear parameters, a constant offset and the state at the start of each segment are eliminated by variable
projection (Golub, Pereyra, Inverse Problems 19 (2003) R1), so that the search is only over poles.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares
from scipy.signal import lfilter

from ..base.metrics import rms
from ..base.signals import Array, as_measured, as_samples
from .structure import Structure, polynomials

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
"""Residuals that take part in a search, evenly spaced: neighbouring ones tell the same."""

_DEPENDENT = 1e-12  # size of a direction, relative to the largest, below which columns of unit norm do not span it
_STEP = 1e-5  # step of the differences of responses, in the logarithm of a parameter

_FADED = 1e-30  # size of the response to an impulse from which on it counts as over
_LEAD = 4  # zeros before a command: of a second order the numerators of derivatives look so far back

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


class _Basis(NamedTuple):
    """Orthonormal basis of what columns span."""

    q: Array  # (n, rank)
    inverse: Array  # (k, rank): ``inverse @ q.T @ y`` are the least-squares coefficients of the columns

    @classmethod
    def of(cls, columns: Array) -> "_Basis":
        """Return the basis of columns ``(n, k)``; of those that are zero, or follow from others, none is part."""
        q, r = np.linalg.qr(columns)
        norms = np.linalg.norm(r, axis=0)
        norms[norms == 0.0] = 1.0
        u, s, vt = np.linalg.svd(r / norms, full_matrices=False)
        there = s > _DEPENDENT * s.max(initial=0.0)
        inverse = vt[there].T / s[there] / norms[:, None]
        return cls(q, inverse @ u.T) if there.all() else cls(q @ u[:, there], inverse)


class _Solved(NamedTuple):
    """Solution of the linear part for one set of poles."""

    residual: Array  # (n,), m
    linear: Array  # (n_linear,)
    offset: float  # mean of the segments' offsets, m
    basis: _Basis  # of the linear parameters' columns, without what offset and initial states explain of them
    segments: list[tuple[_Basis, Array]]  # what these explain of a segment, and that part of its columns and target


class Problem:
    """Separable least-squares problem of a structure with one dead time."""

    def __init__(self, segments: Sequence[Segment], T_s: float, structure: Structure, delay: Delay, n_max: int) -> None:
        self._structure = structure
        self._section = cache(partial(polynomials, T_s=T_s, hold=delay.input_hold, zero=structure.zero))
        used = [segment for segment in segments if segment.known[: segment.stop].sum() > 1]
        step = max(1, sum(s.stop for s in used) // n_max)
        self._data = [
            (np.pad(delayed(s.u[: s.stop], delay.samples), (_LEAD, 0)), s.y[rows], rows)
            for s in used
            for rows in [np.flatnonzero(s.known[: s.stop])[::step]]
        ]
        self._rows = cache(lambda i, n: self._data[i][2] + _LEAD - np.arange(n)[:, None])
        self._divided = lru_cache(8 * len(used))(self._divided_by)
        self._last = lru_cache(2)(self._solved)  # a search asks twice for its start, and for each point that it takes

    def solve(self, theta: Array) -> _Solved:
        """Return the solution for one set of poles."""
        return self._last(*theta.tolist())

    def _solved(self, *theta: float) -> _Solved:
        segments, left, means = [], [], []
        for i in range(len(self._data)):
            free, signals = self.signals(theta, i)
            basis = _Basis.of(free)
            inside = basis.q.T @ signals
            segments.append((basis, inside))
            left.append(signals - basis.q @ inside)
            means.append(signals.mean(axis=0))
        both = np.concatenate(left)
        basis = _Basis.of(both[:, :-1])
        linear: Array = basis.inverse @ (basis.q.T @ both[:, -1])
        offset = float(np.mean([one[-1] - one[:-1] @ linear for one in means]))
        return _Solved(both[:, -1] - both[:, :-1] @ linear, linear, offset, basis, segments)

    def jacobian(self, theta: Array) -> Array:
        """Return the derivatives of the residual, ``(n, order)``.

        Of ``r = y - M c``, by Golub and Pereyra: ``-P M' c - (M⁺)ᵀ M'ᵀ r``, where P takes away what M explains.
        """
        at, structure, n = self.solve(theta), self._structure, self._structure.n_modes + self._structure.lag
        gains, betas = structure.gains(at.linear)
        columns, cuts = [], np.cumsum([len(y) for _, y, _ in self._data])[:-1]
        for mode, part in enumerate(self.parts(theta.tolist())):
            weights, states = np.array([gains[mode], *betas[mode : mode + 1]]), slice(1 + 2 * mode, 3 + 2 * mode)
            slopes, told, known = [], np.zeros((len(part), 2 * n)), np.zeros((len(part), len(at.linear)))
            for i, (residual, (basis, inside)) in enumerate(zip(np.split(at.residual, cuts), at.segments, strict=True)):
                by_command, by_state = self.slopes_of(i, part)
                own = basis.inverse @ (inside[:, -1] - inside[:, :-1] @ at.linear)
                slope = -weights[: by_command.shape[1]] @ by_command - own[states] @ by_state
                by_own = (by_state @ residual) @ basis.inverse[states]
                slopes.append(slope - (slope @ basis.q + by_own) @ basis.q.T)
                told[:, [mode, n + mode][: by_command.shape[1]]] += by_command @ residual
                known += by_own @ inside[:, :-1]
            slope, raw = np.concatenate(slopes, axis=1), told[:, : n + structure.zero * structure.n_modes]
            by_linear = affine(structure, raw, np.zeros(len(raw)))[0] - known
            columns.append(slope - (slope @ at.basis.q + by_linear @ at.basis.inverse) @ at.basis.q.T)
        return np.asarray(np.concatenate(columns).T)

    def parts(self, theta: Sequence[float]) -> list[tuple[float, ...]]:
        """Return the nonlinear parameters of each mode and of the lag."""
        m = 2 * self._structure.n_modes
        return [tuple(theta[i : i + 2]) for i in range(0, m, 2)] + ([tuple(theta[m:])] if self._structure.lag else [])

    def signals(self, theta: Sequence[float], i: int) -> tuple[Array, Array]:
        """Return what offset and initial states may add; and columns and, last, the target; ``(n, k)`` each.

        The filters run over every sample; some samples, all of them measured, have residuals.
        """
        u, y, _ = self._data[i]
        found = [self._responses_of(i, part) for part in self.parts(theta)]
        forced = [one[:1] for one, _ in found] + [one[1:] for one, _ in found] or [self._late(u, 1, i)]
        columns, target = affine(self._structure, np.concatenate(forced).T, y)
        free = np.concatenate((np.ones((1, len(y))), *(one for _, one in found)))
        return free.T, np.concatenate((columns.T, target[None])).T

    def _responses_of(self, i: int, theta: tuple[float, ...]) -> tuple[Array, Array]:
        """Return the responses of one mode, or of the lag, to the command and to initial states, ``(k, n)``."""
        (u, impulse), n = self._divided(i, 1, theta), len(theta)
        return self._section(theta)[0] @ self._late(u, n + 1, i), self._late(impulse, n, i)

    def slopes_of(self, i: int, theta: tuple[float, ...]) -> tuple[Array, Array]:
        """Return the derivatives of the responses with respect to each parameter, ``(n_parameters, k, n)``.

        Of ``b/a``, polynomials in z⁻¹, they are ``b'/a − b a'/a²``.
        """
        b, n, by_command, by_state = self._section(theta)[0], len(theta), [], []
        once, (u, impulse) = self._late(self._divided(i, 1, theta)[0], n + 1, i), self._divided(i, 2, theta)
        twice, impulse = self._late(u, 2 * n + 1, i), self._late(impulse, 2 * n, i)
        for step in _STEP * np.eye(n):
            (b_0, a_0), (b_1, a_1) = (self._section(tuple(one)) for one in (theta - step, theta + step))
            b_slope, a_slope = (b_1 - b_0) / (2.0 * _STEP), (a_1 - a_0) / (2.0 * _STEP)
            by_command.append(b_slope @ once - np.stack([np.convolve(one, a_slope) for one in b]) @ twice)
            by_state.append(-np.stack([np.convolve(one, a_slope) for one in np.eye(n)]) @ impulse)
        return np.stack(by_command), np.stack(by_state)

    def _divided_by(self, i: int, times: int, theta: tuple[float, ...]) -> tuple[Array, Array]:
        """Return a command, and an impulse, divided once or twice by the denominator of a mode, or of the lag."""
        u, a = self._data[i][0], self._section(theta)[1]
        u, impulse = (u, np.eye(1, len(u), _LEAD)[0]) if times == 1 else self._divided(i, times - 1, theta)
        half, product = -0.5 * a[1], a[2] if len(theta) == 2 else 0.0
        slowest = half + math.sqrt(half**2 - product) if half**2 > product else math.sqrt(product)
        n, found = len(u), np.zeros(len(u))
        if slowest < 1.0:
            n = min(n, _LEAD + 4 + int(math.log(_FADED) / math.log(max(slowest, _FADED))))
        found[:n] = lfilter([1.0], a, impulse[:n])
        return lfilter([1.0], a, u), found

    def _late(self, signal: Array, n: int, i: int) -> Array:
        """Return the rows of a signal as it is, and 1 to n − 1 samples late, ``(n, m)``."""
        return signal.take(self._rows(i, n))


def without(nuisance: Array, signals: Array) -> Array:
    """Return signals, ``(n, m)``, less their least-squares projection onto the nuisance columns, ``(n, k)``."""
    q = _Basis.of(nuisance).q
    return np.asarray(signals - q @ (q.T @ signals))


def affine(structure: Structure, columns: Array, y: Array) -> tuple[Array, Array]:
    """Return the columns of the linear parameters and the target; a unit gain is subtracted from both."""
    if not structure.unit_gain:
        return columns, y
    n = max(structure.n_modes + structure.lag, 1)
    return np.hstack((columns[:, 1:n] - columns[:, :1], columns[:, n:])), y - columns[:, 0]


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
    problem = Problem(segments, T_s, structure, delay, rows_max)
    (low, high), searched = structure.bounds(T_s, slowest), structure.searched

    def relative_residual(found: Array, theta: Array, scale: float) -> Array:
        theta[searched] = found
        return problem.solve(theta).residual / scale

    def derivatives(found: Array, theta: Array, scale: float) -> Array:
        theta[searched] = found
        return problem.jacobian(theta)[:, searched] / scale

    best: Fit | None = None
    for start in starts if structure.order else [np.empty(0)]:
        theta = np.clip(start, low + 1e-9, high - 1e-9)
        if structure.order:
            scale = rms(problem.solve(theta).residual) or 1.0
            theta[searched] = least_squares(
                relative_residual,
                *(theta[searched], derivatives),
                args=(theta, scale),
                bounds=(low[searched], high[searched]),
                xtol=1e-6,
                ftol=1e-7,
                gtol=1e-10,
                max_nfev=_EVALUATIONS_MAX,
            ).x
        at = problem.solve(theta)
        error = rms(at.residual)
        if best is None or error < best.rms:
            at_bound = bool((theta < low + _EDGE).any() or (theta > high - _EDGE)[: 2 * structure.n_modes].any())
            best = Fit(structure, delay, theta, at.linear, at.offset, error, slowest, at_bound)
    assert best is not None  # there is a start
    return best


def simulated(fit: Fit, segment: Segment, T_s: float) -> Array:
    """Return the position of the fitted model, which starts at rest as the predictor does, ``(n,)``, m."""
    n = len(segment.u)
    problem = Problem([Segment(segment.u, np.zeros(n), n)], T_s, fit.structure, fit.delay, n)
    signals = problem.signals(fit.theta.tolist(), 0)[1]
    return np.asarray(signals[:, :-1] @ fit.linear - signals[:, -1])
