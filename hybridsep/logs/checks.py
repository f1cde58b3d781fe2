"""Checks of a log: what its columns mean, which may be refused, and what of its samples is worth a note.

One statistic accuses: the share of a signal's variance that is left by the best mixture of earlier samples of another,
none of them with a negative weight. A drive makes such a mixture of its command, whatever its lag and friction. Another
reading of the columns, such as a flipped sign, is accepted if its residual is smaller by a ratio that no good log of a
thousand, simulated and recorded, reached. What is noted changes nothing.
"""

import math
import shlex
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from ..base.errors import LogError
from ..base.signals import Array, Indices
from ..base.threads import one_blas_thread
from .columns import error_option
from .log import Log, uneven
from .units import POSITION_UNITS

_SAMPLES_MIN = 100  # samples below which nothing can be learned and judged: a window of the default length

_LAG_MAX, _LAGS, _SPAN = 1000, 48, 20_000
"""Largest lag of a mixture, samples, number of its lags, and samples, those with most motion, that it is fitted to."""

_POOR, _LOOSE = 0.1, 0.7
"""Share of the variance left from which the given reading is doubted, and from which x does not follow at all."""

_BETTER, _BETTER_SWAPPED = 4.0, 20.0
"""Ratio of what the given reading leaves to what another leaves from which the other is believed. Good logs have at
most 1.01, and at most 10 with their columns exchanged: an axis whose feed-forward is too large leads its command."""

_NOISIER = 3.0  # ratio of the columns' noise from which the noisier one is the measured one

_GAINS, _KNOWN = (0.1, 5.0), 0.03
"""Gains beyond which no position loop is: a small servo under load was recorded at 0.25; and relative distance from the
ratio of two units within which it is meant."""

_TRAVEL_MAX, _ACCELERATION_MAX, _ACCELERATION_MIN, _OVER = 20.0, 500.0, 1e-4, 10
"""Largest travel, m, and acceleration, m/s² over this many samples, of a linear axis that states no unit; and the least
one, m/s² or rad/s², of an axis that follows a second late, whose times state none: these may be in ms."""

_START = 0.25  # velocity between the first samples, in the largest, from which a start is in motion; EMPS has 0.12
_COUNTS, _IN_A_SAMPLE, _WHOLE = 2**16, 0.1, 1e-2  # of a counter: range, motion in a sample relative to it, rounding

_USUAL = 0.98  # quantile of what is usual, beyond which are the samples that are looked for

_HELD, _REPEATED = 0.1, 0.2
"""Way of the command, relative to its travel, while the measured position is held; and share of the samples in fast
motion that repeat the one before, from which they are noted."""

_RESTED, _STOOD, _NOISE, _BACK = 0.3, 0.1, 8.0, 0.1
"""Rest of a command, s, after which something else moves an axis if it leaves where it stood for as many seconds by
more than its largest error in motion and as many deviations of its noise; and share of that within which it is back."""


@dataclass(frozen=True)
class Finding:
    """What is wrong with a log, or worth knowing of it."""

    name: str  # a key of ``FINDINGS`` of ``docs/messages.py``
    words: str  # what it is, by how much, and what to do
    evidence: Mapping[str, float]  # the statistic, by name; SI units
    refused: bool = False  # whether the columns do not mean what they were read for; otherwise it is a note
    options: tuple[tuple[str, str], ...] = ()  # options that put it right, one of them, each with what it means

    def __str__(self) -> str:
        return f"{'error' if self.refused else 'note'}: {self.plain}"

    @property
    def plain(self) -> str:
        """Name and words, without the severity."""
        remedy = f" ({' or '.join(option for option, _ in self.options)})" if self.options else ""
        return f"{self.name}: {self.words}{remedy}"


def findings_table(findings: Iterable[Finding]) -> list[dict[str, Any]]:
    """Return findings as plain data, for JSON."""
    return [
        {"name": one.name, "severity": "error" if one.refused else "note", "words": one.words}
        | {"evidence": dict(one.evidence), "options": [option for option, _ in one.options]}
        for one in findings
    ]


def checked(log: Log) -> tuple[Finding, ...]:
    """Return the notes on a log; LogError where it is refused."""
    findings = check(log)
    if refused := [one for one in findings if one.refused]:
        options = [option for one in refused for option in one.options]
        raise LogError(f"{log.path}: {'; '.join(one.plain for one in refused)}", options)
    return findings


@one_blas_thread
@np.errstate(all="ignore")  # a log may hold any finite number
def check(log: Log) -> tuple[Finding, ...]:
    """Return all findings on a log, those for which it is refused first."""
    if hopeless := tuple(_hopeless(log)) or tuple(_wraps(log)):
        return hopeless
    part = _liveliest(log)
    x_d, x = log.x_d[part], log.x_meas[part].copy()
    x[_spikes(x, _travel(x_d))[0]] = np.nan
    given = following(x_d, x) if np.isfinite(x).sum() >= _SAMPLES_MIN else None
    found = (*_unit(log), *(_meaning(log, x_d, x, given) if given else ()))
    if any(one.refused for one in found):
        return found
    notes = (*found, *_note_missing(log), *_note_rate(log), *_note_outliers(log), *_note_start(log))
    notes += (*_note_anew(log), *_note_moved_at_rest(log), *_note_held(log, given.lag_of_one if given else 0))
    return (*notes, *(_note_relation(log, x_d, x, given) if given else ()))


# What is refused


def _hopeless(log: Log) -> Iterator[Finding]:
    """Find a log that has no command or no motion, too few samples, or one column for both."""
    n, n_known = len(log.t), int(np.isfinite(log.x_meas).sum())
    still = [name for name, x in (("commanded", log.x_d), ("measured", log.x_meas)) if _travel(x) == 0.0]
    if still:
        words = (
            f"the {' and the '.join(still)} position never change{'s' if len(still) == 1 else ''}: an axis at rest "
            "shows neither its model nor its errors; record it while it moves over the travel that is used, or name "
            "other columns (--x_d NAME, --x NAME)"
        )
        yield Finding("no motion", words, {"n": float(n)}, refused=True)
    elif n_known < _SAMPLES_MIN:
        words = f"{n_known} samples are measured, at least {_SAMPLES_MIN} are needed; record half a minute"
        yield Finding("too short", words, {"n": float(n_known)}, refused=True)
    elif np.array_equal(log.x_d, log.x_meas):
        words = (
            "the measured position is the commanded one in every sample: one column is read for both, or the axis was "
            "simulated; name the measured position's column (--x NAME)"
        )
        yield Finding("same column", words, {"n": float(n)}, refused=True)


def _wraps(log: Log) -> Iterator[Finding]:
    """Find positions that jump by all that a counter counts, and go on after the jump as before it."""
    for name, column in (("commanded", "x_d"), ("measured", "x_meas")):
        signals = [getattr(one, column) for one in log.segments()]
        x, jumps = np.concatenate(signals), np.concatenate([np.diff(one) for one in signals])
        step = resolution(x)
        counts = np.abs(jumps[np.isfinite(jumps)]) / step
        beside = np.abs(counts - _COUNTS)
        wraps, others = beside < _IN_A_SAMPLE * _COUNTS, counts[beside >= _IN_A_SAMPLE * _COUNTS]
        is_counter = _travel(x) < _COUNTS * step and (np.abs(counts - np.round(counts)) < _WHOLE).all()
        if wraps.any() and is_counter and beside[wraps].max() <= 2.0 * others.max(initial=0.0):
            words = (
                f"the {name} position jumps by {_COUNTS} of its smallest steps, in {wraps.sum()} samples: a counter of "
                f"16 bits wraps; unwrap it before, with a period of {log.shown.words(_COUNTS * step, '.6g')}"
            )
            yield Finding("wraps", words, {"n": float(wraps.sum())}, refused=True)


def _unit(log: Log) -> Iterator[Finding]:
    """Find positions that no axis has in metres; they are refused where nothing states their unit."""
    if log.unit != "m":
        return
    usual, travel = _acceleration(log), _travel(log.x_d)
    if travel <= _TRAVEL_MAX and usual <= _ACCELERATION_MAX:
        return
    words = (
        f"read in {log.file_unit or 'm'}, {travel:.4g} m of travel and {usual:.4g} m/s² of acceleration are more than "
        "a feed axis has: are the positions in a smaller unit or, of a rotary axis, in deg?"
    )
    evidence, stated = {"travel": travel, "acceleration": usual}, log.unit_stated
    options = (("--unit mm", "a linear axis in mm"), ("--unit um", "in µm"), ("--unit deg", "a joint in degrees"))
    yield Finding("unit", words, evidence, refused=not stated, options=() if stated else options)


def _acceleration(log: Log) -> float:
    """Return what is usually the largest acceleration of a command in motion, m/s² or rad/s²."""
    accelerations = [
        np.abs(one.x_d[2 * _OVER :] - 2.0 * one.x_d[_OVER:-_OVER] + one.x_d[: -2 * _OVER]) / (_OVER * log.T_s) ** 2
        for one in log.segments()
    ]
    moving = np.concatenate([one[one > 0.0] for one in accelerations])
    return float(np.quantile(moving, _USUAL)) if len(moving) else 0.0


class _Following(NamedTuple):
    """How one signal follows another."""

    left: float  # share of its variance that the best mixture of the other's earlier samples leaves, 0 … 1
    gain: float  # sum of the mixture's weights
    lag: float  # their mean lag, samples
    gain_at_one: float  # weight of the other one at just about the lag below
    lag_of_one: int  # the lag with which the two correlate best, samples


def following(u: Array, x: Array) -> _Following:
    """Return how ``x``, (n,), NaN where it is missing, follows ``u``, (n,), which was at rest before."""
    known = np.isfinite(x)
    largest = min(_LAG_MAX, len(u) // 4)
    lags = np.concatenate(([0], np.unique(np.round(np.geomspace(1.0, max(largest, 1), _LAGS)).astype(np.intp))))
    A, y = _lagged(u, lags, known), x[known] - x[known].mean()
    scale, total = float(np.abs(A).max()), float(np.abs(y).max())
    if not (0.0 < scale < math.inf and 0.0 < total < math.inf):
        return _Following(1.0, 0.0, 0.0, 0.0, 0)
    A, y = A / scale, y / total
    squares, products = (A * A).sum(axis=0), A.T @ y
    singly = products**2 * np.sign(products) / np.where(squares > 0.0, squares, np.inf) / float(y @ y)
    one = int(np.argmax(singly))
    near = np.arange(lags[max(one - 1, 0)], lags[min(one + 1, len(lags) - 1)] + 1)
    between = _lagged(u, near, known) / scale
    best = np.argmax(between.T @ y / np.sqrt(np.maximum((between * between).sum(axis=0), 1e-300)))
    basis, R = np.linalg.qr(A)
    h, _ = nnls(R, basis.T @ y, maxiter=len(lags) ** 2)
    left = float(np.sum((y - A @ h) ** 2) / (y @ y))
    gain = float(h.sum())
    lag = float(h @ lags) / gain if gain > 0.0 else 0.0
    at_one = float(products[one] / squares[one]) if squares[one] > 0.0 else 0.0
    return _Following(left, gain * total / scale, lag, at_one * total / scale, int(near[best]))


def _lagged(u: Array, lags: Indices, known: NDArray[np.bool_]) -> Array:
    """Return a signal, (n,), at rest before, by some lags, without its means, ``(n_known, n_lags)``."""
    found = np.stack([u[np.maximum(np.arange(len(u)) - lag, 0)] for lag in lags], axis=1)[known]
    return np.asarray(found - found.mean(axis=0))


def _meaning(log: Log, x_d: Array, x: Array, given: _Following) -> Iterator[Finding]:
    """Find columns that mean something else: exchanged, a flipped sign, another unit, no position, another axis."""
    known = np.isfinite(x)
    evidence, gains = given._asdict(), (given.gain, given.gain_at_one)
    filled = np.interp(np.arange(len(x)), np.flatnonzero(known), x[known])  # also where it is missing
    exchanged = following(filled, np.where(known, x_d, np.nan))
    noise = noise_std(x_d) / _travel(x_d), noise_std(filled) / _travel(x)
    better = _BETTER if noise[0] > _NOISIER * noise[1] else _BETTER_SWAPPED
    if "error" in log.columns:
        flipped = following(*((x_d, 2.0 * x_d - x) if "x_d" in log.columns else (2.0 * filled - x_d, x)))
        if _BETTER_SWAPPED * flipped.left < given.left and flipped.lag >= 1.0:  # much feed-forward leads a little
            words = "the position that the error tells runs ahead: the error is the other way, its sign is flipped"
            other_sign = ((error_option(log.columns["error"], -1), "the error's other sign"),)
            yield Finding("sign", words, evidence, refused=True, options=other_sign)
            return
    elif better * exchanged.left < given.left and exchanged.lag >= 1.0:
        words = (
            f"x_d follows x, {exchanged.lag:.1f} samples later, and x does not follow x_d ({exchanged.left:.1e} and "
            f"{given.left:.1e} of the variance are left): the two columns are exchanged; read them the other way"
        )
        swap = f"--x_d {shlex.quote(log.columns['x'])} --x {shlex.quote(log.columns['x_d'])}"
        options: tuple[tuple[str, str], ...] = ((swap, "the two columns exchanged"),)
        if noise[1] > _NOISIER * noise[0]:  # then x is the measured one
            options = (*options, (f"--delay {-round(exchanged.lag) - 1}", "if x was recorded too early"))
        evidence = {**evidence, "left_exchanged": exchanged.left, "lag_exchanged": exchanged.lag}
        yield Finding("columns swapped", words, evidence, refused=True, options=options)
        return
    other = _other_meaning(x_d, x, filled, given) if given.left > _POOR else ""
    if other:
        yield Finding(other, _MEANINGS[other], evidence, refused=True)
    elif given.left > _LOOSE:
        words = (
            f"the measured position hardly follows the command ({100 * given.left:.3g} % of its variance is left): is "
            "it another axis (--x NAME)?"
        )
        yield Finding("hardly follows", words, evidence, refused=True)
    elif given.left < _POOR and (max(gains) < _GAINS[0] or min(gains) > _GAINS[1]):
        gain, units = given.gain, product(POSITION_UNITS.values(), repeat=2)  # above a bandwidth the other is smaller
        meant = ((a, b) for a, b in units if a.si == b.si and abs(gain * a.factor / b.factor - 1.0) < _KNOWN)
        said = next((f": measured in {a.name} and commanded in {b.name}?" for a, b in meant), "")
        words = (
            f"the measured position moves {gain:.4g} times as far as the commanded one{said}: state the "
            "unit of each column in its name, such as 'x [mm]', or name another column (--x NAME)"
        )
        yield Finding("scale", words, evidence, refused=True)


_MEANINGS = {
    "sign": "the measured position moves opposite to the command: its sign is flipped, or the axis counts the other "
    "way; correct it where it is recorded, as your controller must do the same",
    "following error": "the column holds the following error, not the measured position: the command less it, or plus "
    "it, is where a drive would be; name the column of the actual position (--x NAME), or this one as --error NAME",
    "velocity": "one of the columns holds a velocity, not a position; name another (--x_d NAME, --x NAME)",
}


def _other_meaning(x_d: Array, x: Array, filled: Array, given: _Following) -> str:
    """Return the reading of two columns, ``(n,)``, that explains them far better than the given one; empty without."""
    variance, errors = float(np.nanvar(x)), [1.0]
    for position in (x_d - x, x_d + x):
        one = following(x_d, position)
        if abs(one.gain - 1.0) < _POOR:
            errors.append(one.left * float(np.nanvar(position)) / variance)
    found = {
        "sign": following(x_d, -x).left,
        "following error": min(errors),
        "velocity": min(following(x_d, np.cumsum(filled)).left, following(np.cumsum(x_d - x_d[0]), x).left),
    }
    return next((name for name, left in found.items() if _BETTER * left < given.left), "")


# What is noted


def starts_in_motion(x_d: Array) -> bool:
    """Return whether a command, (n,), moves from its first sample on, and not only flickers at rest."""
    n = min(_OVER, len(x_d) - 1)
    if n < 1:
        return False
    steps, means = np.abs(np.diff(x_d)), np.abs(x_d[n:] - x_d[:-n])
    return bool(steps[0] > _START * steps.max() and means[0] > _START * means.max())


def noise_std(x: Array) -> float:
    """Return the standard deviation of white noise on a smooth signal, from the median of its fifth differences."""
    return float(np.median(np.abs(np.diff(x, 5)))) / (0.6745 * math.sqrt(252.0)) if len(x) >= 12 else 0.0


def resolution(x: Array) -> float:
    """Return the smallest change of a signal, 0 if it has none."""
    steps = np.abs(np.diff(x))
    return float(steps[steps > 0].min(initial=np.inf)) if (steps > 0).any() else 0.0


def _note_start(log: Log) -> Iterator[Finding]:
    if starts_in_motion(log.x_d):
        speeds, (factor, unit) = np.abs(np.diff(log.x_d)) / log.T_s, log.shown.position
        words = (
            f"the log begins in motion, at {factor * speeds[0]:.3g} {unit}/s of {factor * speeds.max():.3g} at most; "
            "the state in which the axis begins is estimated from its first samples"
        )
        yield Finding("start in motion", words, {"velocity": float(speeds[0]), "largest": float(speeds.max())})


def _note_missing(log: Log) -> Iterator[Finding]:
    missing = np.flatnonzero(~np.isfinite(log.x_meas))
    if len(missing):
        words = (
            f"{len(missing)} of {len(log.t)} measured positions {'are' if len(missing) > 1 else 'is'} missing, the "
            f"first is sample {missing[0] + 1}: they are left out"
        )
        yield Finding("missing samples", words, {"n": float(len(missing))})


def _note_anew(log: Log) -> Iterator[Finding]:
    """Note a measured position that jumps by all of its range from one sample to the next, and goes on from there."""
    steps = np.nan_to_num(np.concatenate([np.diff(one.x_meas) for one in log.segments()]))
    most = (1.0 - _IN_A_SAMPLE) * _travel(log.x_meas)
    jumps = np.abs(steps) > most
    n, turn, others = int(jumps.sum()), float(np.abs(steps).max()), np.abs(np.where(jumps, 0.0, steps))
    way = float(np.ptp(np.cumsum(np.where(jumps, steps - np.copysign(turn, steps), steps))))
    if n > 1 and others.max() < _IN_A_SAMPLE * most and way > turn / 2.0:
        words = (
            f"the measured position jumps {n} times by all of its range, {log.shown.words(turn, '.4g')}, between two "
            "samples, and goes on from there: does it begin anew, as a modulo axis or a counter? Unwrap both positions "
            "before; such jumps are identified and judged as motion"
        )
        yield Finding("begins anew", words, {"n": float(n), "range": turn})


def moved_by_command(log: Log) -> Array:
    """Return a segment's measured positions, ``(n,)``, NaN where something else moves the axis at a command's rest."""
    at, error, x = np.arange(len(log.t)), log.x_meas - log.x_d, np.array(log.x_meas)
    moves, known = np.diff(log.x_d, prepend=log.x_d[:1]) != 0.0, np.isfinite(error)
    rests = at - np.maximum.accumulate(np.where(moves, at, 0)) > _RESTED / log.T_s
    edges, moving = np.flatnonzero(np.diff(rests, prepend=False, append=False)), error[known & ~rests & moves.any()]
    if not len(moving):
        return x
    most = max(np.max(np.abs(moving - np.median(moving))), _NOISE * noise_std(error[known & rests]))
    error[_spikes(error, 0.0)[0]] = np.nan  # an outlier is no motion
    for first, end in edges.reshape(-1, 2).tolist():
        stood = error[first:end][np.isfinite(error[first:end])][: max(1, round(_STOOD / log.T_s))]
        away = np.abs(error[first:end] - (np.median(stood) if len(stood) else np.nan))
        far, near = np.flatnonzero(away > most), np.flatnonzero(away <= _BACK * most)
        if len(far) and len(near) and near[0] < far[0]:
            begins, back = near[near < far[0]][-1], near[near > far[-1]]
            x[first + begins : first + back[0] if len(back) else end + round(_RESTED / log.T_s)] = np.nan
    return x


def _note_moved_at_rest(log: Log) -> Iterator[Finding]:
    moved = np.concatenate([np.isnan(moved_by_command(one)) & ~np.isnan(one.x_meas) for one in log.segments()])
    if moved.any():
        n, duration = int((np.diff(moved, prepend=False) & moved).sum()), float(moved.sum()) * log.T_s
        words = (
            f"something else moves the axis while its command rests, {n} time{'s' if n > 1 else ''}, the first at "
            f"{log.t[np.argmax(moved)]:.4g} s, {duration:.3g} s in all: fit neither learns nor judges these samples"
        )
        yield Finding("moved at rest", words, {"n": float(n), "duration": duration})


def _note_rate(log: Log) -> Iterator[Finding]:
    where = uneven(log.t, log.T_s, log.starts)
    if len(where):
        steps = np.diff(log.t)
        largest = float(np.abs(steps[where - 1] / log.T_s - 1.0).max())
        words = (
            f"{len(where)} of {len(steps)} intervals differ from {log.T_s:.6g} s, by up to {100 * largest:.3g} %; the "
            "rows are taken as if they were even"
        )
        options = (("--resample", "at even times, linearly between samples"),)
        yield Finding("rate", words, {"n": float(len(where)), "largest": largest}, options=options)
    if log.T_s > 0.1:
        yield Finding("slow samples", f"samples are {log.T_s:.3g} s apart: were ms given as s?", {"T_s": log.T_s})


def _note_relation(log: Log, x_d: Array, x: Array, found: _Following) -> Iterator[Finding]:
    """Note a measured position that is late by more than the usual look-ahead, 0.1 s, or counts from another zero."""
    late, least = found.lag_of_one, "at least " if found.lag_of_one >= min(_LAG_MAX, len(x_d) // 4) else ""
    if late * log.T_s > 0.1 and found.lag < 1.5 * late:  # noise spreads a mixture over lags
        words = (
            f"the measured position lags its command by {least}{late} samples ({late * log.T_s:.3g} s), drive, dead "
            f"time and recorder together{': were ms given as s?' if late * log.T_s > 1.0 else ''}"
        )
        options: tuple[tuple[str, str], ...] = (("--delay N", "where the recorder is known to be N samples late"),)
        if refused := late * log.T_s > 1.0 and not log.time_stated and _acceleration(log) < _ACCELERATION_MIN:
            options = ((f"--T_s {1e-3 * log.T_s:g}", "where times are in ms"), (f"--T_s {log.T_s:g}", "where in s"))
        yield Finding("late", words, {"lag": late * log.T_s}, refused, options)
    error = x - x_d[np.maximum(np.arange(len(x_d)) - late, 0)]
    way = np.sign(np.diff(x_d, prepend=x_d[0]))  # in only one direction a lag looks like an offset
    parts = [part for part in (error[way == one] for one in (-1.0, 0.0, 1.0)) if np.isfinite(part).sum() > _SAMPLES_MIN]
    medians = [float(np.nanmedian(part)) for part in parts]
    if len(medians) < 2 or min(medians) * max(medians) <= 0.0:
        return
    offset = min(medians, key=abs)
    spread = float(np.nanquantile(np.abs(error - np.nanmedian(error)), _USUAL))
    if abs(offset) > max(spread, resolution(x)):
        words = (
            f"the measured position is {log.shown.words(offset, '+.4g')} away from its command, while the error varies "
            f"by {log.shown.words(spread)}: a compensator moves the axis by as much, which is right where it stands "
            "beside its command, as under gravity; where only the zeros differ, take the offset away from the measured "
            "column, and from what a compensator is to measure"
        )
        yield Finding("offset", words, {"offset": offset, "spread": spread})


def _note_outliers(log: Log) -> Iterator[Finding]:
    """Note samples of a column that leave it for one sample."""
    for name, x in (("commanded", log.x_d), ("measured", log.x_meas)):
        wrong, heights = _spikes(x, _travel(log.x_d))
        if len(wrong):
            height = float(heights.max())
            words = (
                f"{len(wrong)} {name} position{'s leave' if len(wrong) > 1 else ' leaves'} the signal for one sample, "
                f"by up to {log.shown.words(height)}, first sample {wrong[0] + 1}: identified and judged as recorded; "
                "blank in the file it counts as missing"
            )
            yield Finding("outliers", words, {"n": float(len(wrong)), "largest": height})


def _spikes(x: Array, travel: float) -> tuple[Indices, Array]:
    """Return the samples that leave a signal, (n,), by far, and by how much; it comes back, but at its ends."""
    steps = np.diff(np.pad(x, 1, mode="reflect"))
    heights = np.where(steps[:-1] * steps[1:] < 0.0, np.minimum(np.abs(steps[:-1]), np.abs(steps[1:])), 0.0)
    wrong = np.flatnonzero(heights > max(10.0 * float(np.nanquantile(np.abs(steps), _USUAL)), 0.02 * travel))
    return wrong, heights[wrong]


def _note_held(log: Log, lag: int) -> Iterator[Finding]:
    """Note a measured position that is held while its command, ``lag`` samples ago, moves: clipped, stuck, repeated."""
    x, x_d = log.x_meas, log.x_d[np.maximum(np.arange(len(log.x_d)) - lag, 0)]
    same = np.diff(x) == 0.0
    speed = np.abs(np.diff(x_d))
    fast = speed > max(_REPEATED * float(np.quantile(speed, _USUAL)), resolution(x))
    if fast.sum() > _SAMPLES_MIN and same[fast].mean() > _REPEATED:
        share = float(same[fast].mean())
        words = (
            f"{100 * share:.3g} % of the measured positions repeat the one before in fast motion: they are renewed "
            f"every {fast.sum() / max((fast & ~same).sum(), 1):.2g} samples in the mean"
        )
        yield Finding("repeated samples", words, {"share": share})
    edges = np.flatnonzero(~np.concatenate(([False], same, [False])))  # a run is from edge to edge
    moved = (np.maximum.reduceat(x_d, edges[:-1]) - np.minimum.reduceat(x_d, edges[:-1])) / _travel(x_d)
    longest = int(np.argmax(moved))
    if moved[longest] > _HELD:
        first, last = int(edges[longest]), int(edges[longest + 1])
        at_end = "clipped", "at its end, where the recorder's range ends, or the axis stands by friction or load"
        between = "stuck samples", "the sensor was held, or the axis sticks"
        name, why = at_end if x[first] in (np.nanmin(x), np.nanmax(x)) else between
        n = int((moved > _HELD).sum())
        words = (
            f"the measured position stands {n} time{'s' if n > 1 else ''} while the command goes on, longest from "
            f"sample {first + 1} for {last - first} samples, {moved[longest]:.2g} of the travel: {why}"
        )
        yield Finding(name, words, {"n": float(n), "n_samples": float(last - first), "moved": float(moved[longest])})


def _travel(x: Array) -> float:
    """Return the range of a signal, NaN aside; 0 without any."""
    known = x[np.isfinite(x)]
    return float(np.ptp(known)) if known.size else 0.0


def _liveliest(log: Log) -> slice:
    """Return the samples of one segment, at most :data:`_SPAN`, in which the command moves most."""
    best, most = slice(0, len(log.t)), -1.0
    for start, end in pairwise((*log.starts, len(log.t))):
        way = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(log.x_d[start:end])))))
        for first in range(0, max(end - start - _SPAN, 0) + 1, _SPAN):
            last = min(first + _SPAN, end - start) - 1
            if way[last] - way[first] > most:
                best, most = slice(start + first, start + last + 1), float(way[last] - way[first])
    return best
