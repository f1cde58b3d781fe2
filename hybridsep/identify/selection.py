"""Choice of the structure by the error on a later part of the recording that was not fitted to."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from ..base.signals import Array, Indices
from ..model.physics import Mode
from .output_error import Fit, Segment, as_segments, fit_structure, motion_split, simulated, without
from .search import fit_delay, shorter_delays
from .structure import RATES_MIN, STRUCTURES, Structure
from .uncertainty import estimates

_APART = 2.5
"""Least ratio of frequencies between slow parts and the others: a 14 Hz part of an axis of 35 Hz is one of its own."""

_CANCELLED = 0.25
"""Static gain of the slow parts, relative to the others', below which zeros all but cancel their poles."""


def slow_parts(modes: Sequence[Mode]) -> list[float]:
    """Return the frequencies, Hz, of the slow parts that are nearly cancelled, by each other or by zeros.

    The parts are the partial fractions of eq. (15): the modes, an over-damped mode as its two real poles.
    """
    parts = sorted(part for mode in modes for part in _parts(mode))
    frequencies = [f for f, _, _ in parts]
    for i in range(len(parts) - 1, 0, -1):
        if frequencies[i] > _APART * frequencies[i - 1] and _size(parts[:i]) < _CANCELLED * _size(parts[i:]):
            return frequencies[:i]
    return []


def _size(parts: Sequence[tuple[float, float, float]]) -> float:
    """Return the static gain of parts, or what the largest resonance among them adds to it."""
    return max(abs(sum(gain for _, gain, _ in parts)), max(resonance for _, _, resonance in parts))


def _parts(mode: Mode) -> Iterator[tuple[float, float, float]]:
    """Yield frequency, Hz, static gain and ``|β|/ω``, 0 without oscillation, of the parts of a mode."""
    omega, zeta, alpha, beta = mode.omega, mode.zeta, mode.alpha, mode.beta
    root = omega * np.sqrt(max(zeta**2 - 1.0, 0.0))
    if zeta < 1.0 or root < 1e-6 * omega:  # of two poles in one place, a lag's zero cancels one
        yield mode.f_n, alpha / omega**2, abs(beta) / omega if zeta < 1.0 else 0.0
        return
    # (α + β s)/((s + a)(s + b)) = Σ r/(s + p), at p = a: r = (α − β a)/(b − a)
    slow = omega / (zeta + np.sqrt(zeta**2 - 1.0))
    for pole, other in ((slow, slow + 2 * root), (slow + 2 * root, slow)):
        yield pole / (2 * np.pi), (alpha - beta * pole) / (other - pole) / pole, 0.0


HELD_OUT = 0.35  # part of the commanded motion that is held out
SETTLING = 10  # the first 1/10 of a segment is not scored: it may start in motion, where the model starts at rest
_BLOCKS = 12  # blocks of the held-out part whose errors are compared pair by pair
TOLERANCE = 0.02  # relative increase of the held-out error that a simpler structure may always have

_EXCESS_MAX = 0.1
"""Relative increase of the held-out error that a simpler structure may have within the standard error: few blocks
whose errors are alike tell little. With less dead time, or more damping, that of fitted times held-out error."""

_GAIN_MAX = 10.0
"""Largest static gain, and inverse of the smallest one, of a position loop: what friction holds seems to have a smaller
one, by which plans would ask for many times the motion. Small servos under load were recorded at 0.2."""

_GAINS_MAX = 20.0
"""Largest sum of the modes' gains in static gains (Table 1: 6.6): above it large modes cancel each other."""

_SPREAD_MAX = 0.5
"""Largest relative standard deviation of a natural frequency where a structure has several poles to place."""

_AT_ONCE = 0.2  # time constant of a lag, samples, below which it is a part that follows at once, whatever it is

_FITTED_BETTER = 0.7
"""Ratio of the fitted errors at which a larger structure is taken though the held-out errors are alike: most of the
held-out error may be what no structure explains, such as a first reversal."""

_CANCELLING_WORTH, _HELD_OUT_WORTH, _MORE_WORTH = 0.6, 0.75, 0.8
"""Ratios of the errors at which a model with a slow part that its zeros all but cancel is taken, geometric mean of
fitted and held-out ones, and of only the latter: friction that creeps looks like a slow part while it is fitted. And
the ratio, beside friction, at which poles are taken that are no slow part."""

_CREEPS = 5.0  # ratio of the rates at which friction may follow the command's sign

_LIGHT, _DAMPED = 0.25, 0.5
"""Damping ratio below which a second order is hardly damped; that of a loop whose motion does not tell it."""

_UNCERTAIN = "a parameter at the end of its range", "poles that the recording does not determine"

_GROWTH = 2  # orders above the best one that are tried before the search ends
_LAGS = 20  # lags at which the residual's correlation is looked at: nothing is left to model where it is white


@dataclass(frozen=True)
class Candidate:
    """Structure with its fit to the first part and its error on the later one."""

    fit: Fit
    held_out: Array  # (n,), m: measured minus simulated position on the later part, the common offset removed
    objection: str  # why it cannot be chosen, in words; empty if it can

    @property
    def structure(self) -> Structure:
        """Its structure."""
        return self.fit.structure

    @property
    def slow_parts(self) -> list[float]:
        """Frequencies of slow parts that its zeros all but cancel, Hz."""
        fit = self.fit
        return slow_parts(fit.structure.modes(fit.theta, fit.linear, 1.0)) if fit.structure.order > 1 else []

    @property
    def rms_held_out(self) -> float:
        """Root mean square of the held-out error, m."""
        return float(np.sqrt(np.mean(self.held_out**2)))


def compare_structures(
    segments: Sequence[Segment],
    T_s: float,
    structures: Sequence[Structure] = STRUCTURES,
    progress: Callable[[str, float], object] = lambda _message, _done: None,
) -> list[Candidate]:
    """Return the candidates, simplest first, fitted to the first part of the motion and judged on the later one.

    Higher orders are left out once two of them have brought no smaller error, or the residual is white; ``progress`` is
    called with a message and the fraction done.
    """
    split = motion_split(segments, 1.0 - HELD_OUT)
    n_fitted = sum(segment.stop for segment in split)
    known: dict[Structure, Fit] = {}
    found: list[tuple[Fit, Array, str]] = []
    best, best_order, white = np.inf, 0, False
    orders = sorted({structure.order for structure in structures})
    for i, structure in enumerate(structures):
        if known and structure.n_parameters > n_fitted / 10:
            break
        growth = orders.index(structure.order) - orders.index(best_order)
        if structure.order > _GROWTH and (growth > _GROWTH or (growth > 0 and white)):
            break
        progress(structure.name, i / len(structures))
        fit = known[structure] = fit_delay(split, T_s, structure, known)
        residual = _held_out_error(fit, split, T_s)
        found.append((fit, residual, _objection(fit, split, T_s)))
        rms = float(np.std(residual))
        if rms < best * (1 - TOLERANCE):  # whatever is objected to it: a pole more may mend that
            best, best_order, white = rms, structure.order, _is_white(residual)
    offsets = [fit.offset for fit, _, _ in found if fit.structure.order] or [found[0][0].offset]
    common = float(np.median(offsets))
    return [Candidate(fit, residual - common, objection) for fit, residual, objection in found]


def held_out(segment: Segment) -> Indices:
    """Return the samples of a split segment that judge: after the fitted ones, settled, and measured."""
    first = max(segment.stop, len(segment.u) // SETTLING)
    return first + np.flatnonzero(segment.known[first:])


def choose(candidates: Sequence[Candidate]) -> Candidate:
    """Return the simplest candidate whose held-out error equals the best one's within its standard error.

    A larger one within it is taken where it fits the first part much better. Of two that differ only in whether the
    static gain is 1, the candidate with the estimated gain is taken if its error is smaller on the first part and no
    larger on the later part.
    """
    usable = [candidate for candidate in candidates if not candidate.objection] or list(candidates[:1])
    chosen = _chosen_of(usable)
    plain = [candidate for candidate in usable if not candidate.slow_parts]
    if not chosen.slow_parts or not plain:
        return chosen
    other = _chosen_of(plain)
    ratios = chosen.fit.rms / other.fit.rms, chosen.rms_held_out / other.rms_held_out
    is_worth = np.sqrt(np.prod(ratios)) < _CANCELLING_WORTH and ratios[1] < _HELD_OUT_WORTH
    return chosen if is_worth else other


def without_long_delay(chosen: Candidate, segments: Sequence[Segment], T_s: float) -> Candidate:
    """Return a second order with a shorter dead time that is as good on both parts together, or the chosen one.

    Loops of drives rarely have a dead time longer than half of what their poles lag by; where a disturbance, of gravity
    for instance, is large beside what motion of low frequencies tells, it stands for another pole. Learning makes good
    a dead time that is too short. One that is too long it does not: what the drive does before it is over does not
    follow the commands that the regressions look at.
    """
    split = motion_split(segments, 1.0 - HELD_OUT)
    found = (_in_place_of(chosen, fit, split, T_s) for fit in shorter_delays(split, T_s, chosen.fit))
    return next(filter(None, found), chosen)


def with_slow_part(
    chosen: Candidate, candidates: Sequence[Candidate], segments: Sequence[Segment], T_s: float
) -> Candidate:
    """Return the simplest candidate that was refused for its poles though its slow part repeats, or the chosen one.

    Motion may not tell the fast poles beside a slow part, which then are anywhere. It repeats where each part of the
    log tells the other one. Friction that creeps does not, or what follows the command's sign as slowly explains it.
    """
    split = motion_split(segments, 1.0 - HELD_OUT)
    allowed = [c for c in candidates if c.objection in ("", *_UNCERTAIN) and c.slow_parts]
    left = [c for c in allowed if c.rms_held_out < _HELD_OUT_WORTH * chosen.rms_held_out]
    earlier = [Segment(s.u[: s.stop], s.y[: s.stop], s.stop) for s in split if s.known[: s.stop].sum() > 1]
    later = as_segments((s.u[s.stop :], s.y[s.stop :]) for s in split if s.known[s.stop :].sum() > 1)

    def back(fit: Fit) -> float:  # its error, m, on the earlier part, fitted to the later one
        again = fit_structure(later, T_s, fit.structure, fit.delay, [fit.theta], fit.slowest)
        errors = [(s.y - simulated(again, s, T_s))[s.known][len(s.u) // SETTLING :] for s in earlier]
        return float(np.std(np.concatenate(errors)))

    most = _HELD_OUT_WORTH * back(chosen.fit) if left else 0.0
    while left:
        candidate = _chosen_of(left)
        of_friction, _ = _beside_friction(chosen.fit, candidate.fit, segments, T_s)
        if of_friction < _CANCELLING_WORTH and back(candidate.fit) < most:
            return replace(candidate, objection="")
        left.remove(candidate)
    return chosen


def second_order(chosen: Candidate, tried: Sequence[Candidate], segments: Sequence[Segment], T_s: float) -> Candidate:
    """Return a second order beside which a larger chosen one explains little but friction, or the chosen one.

    Poles that stand for friction are right for one motion, and make plans as long as they are slow; it is learned.
    """
    worth = _CANCELLING_WORTH if chosen.slow_parts else _MORE_WORTH
    small = [c for c in tried if 0 < c.structure.order <= 2 < chosen.structure.order and not c.objection]
    beside = ((c, *_beside_friction(c.fit, chosen.fit, segments, T_s)) for c in small)
    # poles that are not slow beside the others are the drive's where friction explains none of what they do
    rubs = 1.0 if chosen.slow_parts else _MORE_WORTH
    like = (c for c, of_friction, left in beside if of_friction > worth and left <= rubs)
    found = (without_long_delay(c, segments, T_s) for c in like)  # a lag's dead time may stand for a pole
    return next((second for second in found if second.structure.order == 2), chosen)


def _beside_friction(fit: Fit, other: Fit, segments: Sequence[Segment], T_s: float) -> tuple[float, float]:
    """Return the ratio of the errors that friction leaves with and without what another fit has more than a fit.

    Friction is the command's sign, and what follows it at rates from the other's slowest one on. Returns also what it
    leaves of the fit's error.
    """
    rates, errors = other.structure.slowest_rate(other.theta) * _CREEPS ** np.arange(4.0), []
    for s in segments:
        sign, x = np.sign(np.diff(s.u, prepend=s.u[0])), simulated(fit, s, T_s)
        late = [lfilter([1.0 - kept], [1.0, -kept], sign) for kept in np.exp(-rates * T_s)]
        friction, more = np.stack((np.ones(len(x)), sign, *late)).T[s.known], simulated(other, s, T_s) - x
        both = without(friction, np.stack((s.y - x, more)).T[s.known])
        error = (s.y - x)[s.known]
        errors.append((error - error.mean(), both[:, 0], without(both[:, 1:], both[:, :1])[:, 0]))
    alone, of_friction, of_both = (np.linalg.norm(np.concatenate(one)) for one in zip(*errors, strict=True))
    return float(of_both / of_friction), float(of_friction / alone)


def well_damped(chosen: Candidate, segments: Sequence[Segment], T_s: float) -> Candidate:
    """Return a second order with a usual damping and a zero that is as good on both parts together, or the chosen one.

    A loop with velocity feed-forward follows without a lag however it is damped, so that motion that is slow beside it
    tells only its natural frequency. Without a zero only what is hardly damped has no lag; plans by it ring.
    """
    fit, structure = chosen.fit, chosen.structure
    if structure.n_modes != 1 or structure.lag or fit.theta[1] >= np.log(_LIGHT):
        return chosen
    split, start = motion_split(segments, 1.0 - HELD_OUT), np.array([fit.theta[0], np.log(_DAMPED)])
    fit = fit_structure(split, T_s, replace(structure, zero=True, zeta=_DAMPED), fit.delay, [start], fit.slowest)
    return _in_place_of(chosen, fit, split, T_s) or chosen


def _in_place_of(chosen: Candidate, fit: Fit, split: Sequence[Segment], T_s: float) -> Candidate | None:
    """Return the candidate of a fit if it is plausible, and as good as the chosen one on both parts together."""
    error = _held_out_error(fit, split, T_s)
    together = fit.rms / chosen.fit.rms * np.std(error) / np.std(chosen.held_out)
    if _objection(fit, split, T_s) or together > 1 + _EXCESS_MAX:
        return None
    return Candidate(fit, error - error.mean(), "")


def _held_out_error(fit: Fit, split: Sequence[Segment], T_s: float) -> Array:
    return np.concatenate([(s.y - simulated(fit, s, T_s))[held_out(s)] for s in split])


def _chosen_of(usable: Sequence[Candidate]) -> Candidate:
    """Return the simplest of these candidates that is as good as the best, as :func:`choose` does."""
    best = min(usable, key=lambda candidate: candidate.rms_held_out)
    by_size = sorted(usable, key=lambda candidate: candidate.structure.n_parameters)
    chosen, *others = (candidate for candidate in by_size if _as_good(candidate, best))
    for candidate in others:
        if candidate.fit.rms < _FITTED_BETTER * chosen.fit.rms:
            chosen = candidate
    free = replace(chosen.structure, unit_gain=False)
    other = next((candidate for candidate in usable if candidate.structure == free), chosen)
    is_better = other.fit.rms < (1 - TOLERANCE) * chosen.fit.rms and free.gains(other.fit.linear)[0].sum() > 0
    is_no_worse = other.rms_held_out <= (1 + TOLERANCE) * chosen.rms_held_out
    return other if free.order and is_better and is_no_worse else chosen


def _as_good(candidate: Candidate, best: Candidate) -> bool:
    if candidate.rms_held_out <= (1 + TOLERANCE) * best.rms_held_out:
        return True
    if candidate.rms_held_out > (1 + _EXCESS_MAX) * best.rms_held_out:
        return False
    excess = candidate.held_out**2 - best.held_out**2
    means = np.array([block.mean() for block in np.array_split(excess, min(_BLOCKS, len(excess)))])
    return len(means) > 1 and bool(means.mean() <= means.std(ddof=1) / np.sqrt(len(means)))


def _is_white(residual: Array) -> bool:
    """Return whether no correlation at the first lags is significant."""
    centred = residual - residual.mean()
    power = float(centred @ centred)
    return len(centred) > 10 * _LAGS and all(
        abs(float(centred[lag:] @ centred[:-lag])) < 4 * power / np.sqrt(len(centred)) for lag in range(1, _LAGS + 1)
    )


def _objection(fit: Fit, segments: Sequence[Segment], T_s: float) -> str:
    """Return why a fit is no plausible drive, or cannot be told from others; empty if neither."""
    structure = fit.structure
    gains, _ = structure.gains(fit.linear)
    gain = float(gains.sum())
    if not 1.0 / _GAIN_MAX <= gain <= _GAIN_MAX:
        return f"static gain of {gain:.3g}"
    if float(np.abs(gains).sum()) > _GAINS_MAX * gain:
        return "large modes that cancel each other"
    if structure.order <= 1:
        return ""
    if fit.at_bound:
        return _UNCERTAIN[0]
    if structure.slowest_rate(fit.theta) < RATES_MIN / (T_s * max(segment.stop for segment in segments)):
        return "a pole slower than the recording shows"
    if structure.order > 2:
        fitted = [Segment(s.u[: s.stop], s.y[: s.stop], s.stop) for s in segments if s.known[: s.stop].sum() > 1]
        poles = "f_n" if structure.lag and fit.theta[-1] > -np.log(_AT_ONCE * T_s) else ("f_n", "tau")
        spreads = [e.std / e.value for e in estimates(fit, fitted, T_s)[0] if e.name.endswith(poles)]
        if max(spreads) > _SPREAD_MAX:
            return _UNCERTAIN[1]
    return ""
