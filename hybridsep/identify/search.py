"""Search for poles and dead time of one structure: starts from simpler fits, dead time in doubling, halving steps."""

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from ..base.signals import Array
from .output_error import Delay, Fit, Segment, fit_structure
from .structure import RATES_MIN, Structure
from .uncertainty import estimates

_CONTRADICTED = 4.0  # ratio of likelihoods, twice its logarithm, that contradicts: two standard deviations
_SHORTER = 8  # shorter dead times that are tried, evenly spaced
_DEAD_TIME_MAX = 0.25  # longest dead time that is tried, s, and at most a quarter of the recording


def fit_delay(segments: Sequence[Segment], T_s: float, structure: Structure, known: Mapping[Structure, Fit]) -> Fit:
    """Return the fit of a structure over poles and dead time; ``known`` fits of simpler ones give the starts."""
    n = max(segment.stop for segment in segments)
    limit, slowest = int(2 * min(_DEAD_TIME_MAX / T_s, n / 4)), RATES_MIN / (T_s * n)
    cache: dict[int, Fit] = {}
    starts = _starts(structure, known, T_s, _bandwidth(segments, T_s, known))

    def at(halves: int) -> Fit:
        if halves not in cache:
            nearest = min(cache.values(), key=lambda fit: abs(fit.delay.halves - halves), default=None)
            tried = starts if nearest is None else [nearest.theta]
            cache[halves] = fit_structure(segments, T_s, structure, Delay(halves), tried, slowest)
        return cache[halves]

    # The dead time of the best simpler fit of at least the same kind
    simpler = [fit for other, fit in known.items() if 0 < other.order <= structure.order]
    first = min(simpler, key=lambda fit: fit.rms).delay.halves if simpler else 0
    return _minimum(at, min(limit, first), limit)


def fit_near(segments: Sequence[Segment], T_s: float, fit: Fit) -> Fit:
    """Return the fit of the same structure to other samples, with a dead time within a sample of the known one."""
    fits = [
        fit_structure(segments, T_s, fit.structure, Delay(halves), [fit.theta], fit.slowest)
        for halves in range(max(0, fit.delay.halves - 2), fit.delay.halves + 3)
    ]
    best = min(fits, key=lambda fit: fit.rms)
    n = sum(segment.stop for segment in segments)
    return fit_structure(segments, T_s, fit.structure, best.delay, [best.theta], fit.slowest, rows_max=n)


def shorter_delays(segments: Sequence[Segment], T_s: float, fit: Fit) -> Iterator[Fit]:
    """Yield second orders with shorter dead times, shortest first, that the recording contradicts no more than the fit.

    Only of a lag, or a second order, with a dead time longer than half of what its poles lag by, less what its zero
    leads by. Contradicted is by the likelihood ratio, of as many samples as tell as much as white ones.
    """
    structure, theta, halves = fit.structure, fit.theta, fit.delay.halves
    if structure.order not in (1, 2):
        return
    lag = np.exp(-theta[-1]) if structure.lag else 2.0 * np.exp(theta[1] - theta[0])
    lead = structure.gains(fit.linear)[1][0] * np.exp(-theta[0]) if structure.zero else 0.0
    if halves * T_s <= max(lag - lead, 0.0):
        return
    fitted = [Segment(s.u[: s.stop], s.y[: s.stop], s.stop) for s in segments if s.known[: s.stop].sum() > 1]
    _, n_effective = estimates(fit, fitted, T_s)
    most = fit.rms * np.sqrt(1.0 + _CONTRADICTED / n_effective)
    second, all_late = Structure(1, zero=structure.zero, unit_gain=structure.unit_gain), lag + halves * T_s / 2
    for shorter in range(0, halves, -(-halves // _SHORTER)):
        starts = [np.log([2.0 * zeta / (all_late - shorter * T_s / 2), zeta]) for zeta in (0.5, 1.0)]
        found = fit_structure(segments, T_s, second, Delay(shorter), starts, fit.slowest)
        if found.rms <= most and not found.at_bound:
            yield found


def _minimum(at: Callable[[int], Fit], first: int, limit: int) -> Fit:
    """Descend from a first number of half samples with steps that double while they help, then halve."""
    best, step = at(first), 1
    while True:
        neighbours = {max(0, min(limit, best.delay.halves + sign * step)) for sign in (-1, 1)}
        better = min((at(halves) for halves in neighbours), key=lambda fit: fit.rms)
        if better.rms < best.rms * (1 - 1e-9):
            best, step = better, step * 2
        elif step > 1:
            step //= 2
        else:
            return best


def _starts(structure: Structure, known: Mapping[Structure, Fit], T_s: float, rate: float) -> list[Array]:
    """Return starts: the other gain's fit, else what a simpler one found with a mode or a lag added."""
    for other, fit in known.items():
        if (other.n_modes, other.lag) == (structure.n_modes, structure.lag) and other.order:
            return [fit.theta]
    if structure.n_modes == 0:
        return [np.log([rate])] if structure.lag else [np.empty(0)]
    if structure.n_modes == 1 and not structure.lag:
        return [np.log([factor * rate, zeta]) for factor, zeta in ((1.0, 0.5), (2.0, 0.9))]
    n_modes = structure.n_modes - (not structure.lag)
    bases = [fit for other, fit in known.items() if other.n_modes == n_modes and not (other.lag and structure.lag)]
    if not bases:
        return []
    base = min(bases, key=lambda fit: fit.rms).theta[: 2 * n_modes]
    fastest = 0.5 * np.pi / T_s
    added = np.exp(np.linspace(np.log(rate), np.log(fastest), 6)[1:]) if fastest > rate else [fastest]
    if structure.lag:
        lags = [np.append(base, np.log(factor * rate)) for factor in (0.5, 3.0)]
        if n_modes == 1:  # a slow part of integrators beside a fast loop, or of a feed-forward
            return [lags[0], np.log([0.03 * rate, 0.7, 3.0 * rate])]
        # Two modes may have been found in the place of one and a lag: then the flexible mode is added to these
        one = min((fit for other, fit in known.items() if other.n_modes == 1 and other.lag), key=lambda fit: fit.rms)
        return [*lags, np.concatenate((np.log([added[0], 0.1]), one.theta))]
    return [np.concatenate((base, np.log([omega, 0.1]))) for omega in added]


def _bandwidth(segments: Sequence[Segment], T_s: float, known: Mapping[Structure, Fit]) -> float:
    """Return the bandwidth, rad/s: of the fitted lag and its dead time, or of what the servo error tells if less."""
    # The error is about velocity · lag + acceleration/ω²; with velocity feed-forward there is no lag
    lags = [fit for structure, fit in known.items() if structure.lag and not structure.n_modes]
    moving = [(s, np.gradient(s.u[: s.stop], T_s)) for s in segments if s.stop > 1]
    rows = [np.column_stack((v, np.gradient(v, T_s), (s.u - s.y)[: s.stop]))[s.known[: s.stop]] for s, v in moving]
    data = np.concatenate(rows)
    motion, error = data[:, :2], data[:, 2]
    tau, square = np.linalg.lstsq(motion - motion.mean(axis=0), error - error.mean(), rcond=None)[0]
    if lags:
        lag = min(lags, key=lambda fit: fit.rms)
        tau = np.exp(-lag.theta[0]) + T_s * lag.delay.halves / 2
    return float(1.0 / min(max(tau, np.sqrt(max(square, 0.0)), 2 * T_s), 1.0))
