"""Compensation in ``hybridsep fit``: the tracking error to be expected without and with it, and what limits it."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from ..base.errors import FmuError, SignalError
from ..base.metrics import ErrorSize, rms
from ..base.settings import DRIVE_LIMIT_ENTRIES, PARAMETERS, CompensatorSettings
from ..base.signals import Array
from ..compensate.planning import FASTER
from ..cosim.fir_inverse import FirInverse
from ..identify.output_error import in_time
from ..logs.units import DisplayUnits
from ..machines.machine import Machine
from ..model.physics import least_look_ahead
from ..predict.averaging.model import AveragedModel
from ..predict.predictor import HybridPredictor
from .expected import Expected, Trial, limits_that_bind
from .limits import FOLLOWING_ERROR, STEPS, held_for, largest_motion, rounding_of
from .replay import Recording, beginnings, replay

_SCALE = 0.05
"""Velocity scale of what a compensator begins with, relative to the largest velocity of a log: with that of a log's
first motion no stop operator is as short as friction before sliding. Mere predictions are 2 % worse with it."""

FACTORS = (0.5, 1.0, 2.0)  # by which each limit is changed, one at a time, to say what it costs
_GAIN = 0.05  # relative gain from which on a limit twice as large, or a longer look-ahead, is advised
_TRIED_MAX = 10_000  # leading samples on which a compensator is tried
_AHEAD = (0.025, 0.05, 0.1, 0.2, 0.4)  # look-aheads, s, that are tried, doubled until a quarter of the model's is there
_LIGHTER = 1e-3  # ``jerk_weight`` relative to the machine's with which plans that it binds leave less
_LITTLE = 0.01  # share of the error without compensation below which errors are alike
_EXPLAINED = 0.7  # share of the error that the physics model's compensation leaves, from which on it knows little


@dataclass(frozen=True)
class LimitCosts:
    """What the drive's limits cost a compensator."""

    # name of a limit, such as ``a_max`` → factor → :class:`ErrorSize` with only this limit times the factor
    effects: Mapping[str, Mapping[float, ErrorSize]]
    advised: Mapping[str, float]  # name → value of the limits that are advised in their place, SI; empty where none is
    advised_error: ErrorSize  # with these

    def lines(self, shown: DisplayUnits, option: str = "--{name} ") -> list[str]:
        """Return a line for each limit and, last, the advised ones to paste, each after an ``option`` of its name."""
        lines = ["On the most demanding stretch, where the model is right, with each limit times a factor:"]
        for name, errors in self.effects.items():
            each = ", ".join(f"{factor:g} ×: {_words(error, shown)}" for factor, error in errors.items())
            lines.append(f"{name} {each}.")
        if self.advised:
            entries = {one.name: entry for entry, one in DRIVE_LIMIT_ENTRIES.items()}
            paste = (f"{option.format(name=one, entry=entries[one])}{v:.4g}" for one, v in self.advised.items())
            left, today = _words(self.advised_error, shown), _words(next(iter(self.effects.values()))[1.0], shown)
            lines.append(f"If the drive allows it: {' '.join(paste)}, with which about {left} is left of {today}.")
        return lines


def taught(machine: Machine, recordings: Sequence[Recording]) -> HybridPredictor:
    """Return a predictor that has learned recordings for a compensator, whose plans turn where no log has turned."""
    (fastest, *_), _ = largest_motion(recordings, machine.T_s)
    predictor = HybridPredictor(machine.model, machine.predictor_settings)
    residual = cast(AveragedModel, predictor.residual)
    learned = replace(residual.learned, velocity_scale=_SCALE * fastest)
    predictor.state = replace(predictor.state, residual=replace(residual, learned=learned))
    replay(predictor, recordings)
    return predictor


@dataclass(frozen=True)
class Ahead:
    """What plans leave with one look-ahead."""

    preview: int  # samples
    left: float  # RMS of the error that is left, m
    limits: Mapping[str, float]  # as of :func:`~hybridsep.fitting.expected.limits_that_bind`
    settings: tuple[str, ...] = ()  # the compensator's, with a smaller one of which less is left


@dataclass(frozen=True)
class LookAheads:
    """What the physics model's plans leave of the error of a drive that is exactly it, with several look-aheads."""

    tried: tuple[Ahead, ...]  # shortest first
    chosen: int  # preview of the machine, samples
    off: float  # RMS of the error without compensation, m
    duration: float  # of the stretch, s
    T_s: float  # s

    def figures(self, shown: DisplayUnits) -> tuple[str, list[str], list[list[str]]]:
        """Return title, head and rows of a table."""
        factor, unit = shown.error(self.off)
        title = (
            f"What a plan can do where the model is right: left of {factor * self.off:.4g} {unit} RMS on the log's "
            f"most demanding {self.duration:.3g} s"
        )
        rows = []
        for one in self.tried:
            binds = ["look-ahead"] if self.longer(one) else []
            binds += [*one.settings, *(f"{name} {100 * share:.2g} %" for name, share in one.limits.items())]
            name = f"{1e3 * one.preview * self.T_s:.4g}{', chosen' if one.preview == self.chosen else ''}"
            sizes = f"{factor * one.left:.4g}", f"{one.left / self.off:.2g}"
            rows.append([name, *sizes, ", ".join(binds) or "nothing"])
        return title, ["ahead [ms]", f"RMS [{unit}]", "× off", "what binds"], rows

    def longer(self, than: Ahead) -> Ahead | None:
        """Return the shortest longer look-ahead that gains all that a longer one can; None where none gains."""
        least = _LITTLE * self.off
        sizes = [(max(one.left, least), one) for one in self.tried if one.preview > than.preview]
        best = min((size for size, _ in sizes), default=math.inf)
        if best > (1.0 - _GAIN) * max(than.left, least):
            return None
        return next(one for size, one in sizes if (1.0 - _GAIN) * size <= best)

    @property
    def shortest(self) -> int:
        """Shortest that plans are made for and no longer one gains on, if it is half of the machine's or less."""
        least = least_look_ahead(self.T_s)
        enough = (one.preview for one in self.tried if one.preview >= least and self.longer(one) is None)
        found = next(enough, self.chosen)
        return found if 2 * found <= self.chosen else self.chosen

    def lines(self) -> list[str]:
        """Return the look-ahead that is advised, and why, in words; empty where the machine's is as good as any."""
        now = next(one for one in self.tried if one.preview == self.chosen)
        if (shortest := self.shortest) != self.chosen:
            return [
                "Where the model is right, plans leave as little or less with --look-ahead "
                f"{1e3 * shortest * self.T_s:.4g}ms: they need less of the command ahead, and follow younger "
                "measurements, at up to three times the work in a sample. With much friction a drive may be left with "
                "twice as much all the same: compare both."
            ]
        if (longer := self.longer(now)) is None:
            return []
        here, there = (f"{1e3 * one.preview * self.T_s:.4g}" for one in (now, longer))
        return [
            f"The look-ahead of {here} ms is too short for the drive: where the model is right, plans leave "
            f"{now.left / self.off:.2g} × the error without compensation, and with {there} ms "
            f"{longer.left / self.off:.2g} ×. If the controller has it: --look-ahead {there}ms."
        ]


@dataclass(frozen=True)
class Tracking:
    """Tracking errors to be expected over the test samples."""

    # as measured, and estimates with each model; NaN without a test sample, or where a plan diverges
    none: ErrorSize
    physics: ErrorSize
    hybrid: ErrorSize
    inverse: ErrorSize  # estimate with the rival, fitted to the training samples; NaN without motion there
    # model → shares of :func:`~hybridsep.fitting.expected.limits_that_bind`
    limits: Mapping[str, Mapping[str, float]]
    costs: LimitCosts | None  # on the stretch of ``look_aheads``; None where no limit binds the hybrid
    # largest change of the command, and following error above which the compensator trips, m
    change_max: float | None
    following_error_max: float
    duration: float  # of the samples that are tried, of a long log from its beginning, s
    largest: float  # servo error of the whole logs, m
    motion: Mapping[str, Sequence[float]]  # name of a limit → largest of the logs' commands, and the drive's, SI
    held: int  # samples for which each command is the same
    rounding: float  # step of the commands, m
    T_s: float  # s
    look_aheads: LookAheads | None  # None where the model has no error to compensate

    def lines(self, shown: DisplayUnits) -> list[str]:
        """Return the errors in words, what binds them and, last, how they came about."""
        change_max = "none" if self.change_max is None else shown.words(self.change_max, ".4g")
        monitored = shown.words(self.following_error_max, ".4g") if self.following_error_max > 0.0 else ""
        figures = (("RMS", "rms"), ("largest error", "largest"))
        better = " and ".join(what for what, one in figures if getattr(self.inverse, one) < getattr(self.hybrid, one))
        lines = [
            f"Tracking error (commanded minus measured, RMS) over {self.duration:.3g} s of the log: "
            f"{_words(self.none, shown)} as recorded; with the compensator about {_words(self.hybrid, shown)} by the "
            f"hybrid, with which the FMU starts, and about {_words(self.physics, shown)} by the physics model "
            "(compensate = physics).",
            f"A finite impulse response with friction's sign, fitted to the first half and inverted, would leave about "
            f"{_words(self.inverse, shown)}, without limits and without learning on."
            + (f" That is better than the hybrid in {better}: such a filter of the command may do." if better else ""),
            f"change_max is {change_max}. {binding_words(self.limits.get('hybrid', {}))}",
        ]
        if self.change_max is not None:
            lines[-1] += (
                " For a program whose largest servo error is above the log's, set change_max to twice that error"
                + (f" and following_error_max to {FOLLOWING_ERROR:g} times that error" if monitored else "")
                + f"; motion more than {FASTER:g} times as fast as all that was learned may use half of change_max at "
                "first."
            )
        if self.change_max is not None and self.change_max < self.largest:
            left = shown.words(self.largest - self.change_max, ".4g")
            lines.append(
                f"The largest servo error of the log, {shown.words(self.largest, '.4g')}, is above change_max: "
                f"{left} of it cannot be compensated."
            )
        if self.held > 1:
            lines.append(
                f"The log's commands are held, or rounded to the same, for {self.held} samples each; where their steps "
                "exceed a limit, that bounds what the compensator adds."
            )
        _, most = self.motion.get("j_max", (0.0, math.inf))
        if self.held == 1 and 4.0 * self.rounding > most * self.T_s**3:
            lines.append(
                f"The log's commands are rounded to {shown.words(self.rounding)}, by which alone their jerk is above "
                "j_max: that bounds what the compensator adds; finer set points leave less."
            )
        factor, unit = shown.position
        for power, (name, sizes) in zip(("", "²", "³"), self.motion.items(), strict=False):
            reached, most = (float(f"{factor * size:.4g}") for size in sizes)  # as they are shown
            if most < reached:
                lines.append(
                    f"The log's commands reach {reached:.4g} {unit}/s{power}, above {name} = {most:.4g} "
                    f"{unit}/s{power}: where they do, it bounds what the compensator adds; is it the drive's?"
                )
        trips = (
            "Where the measured following error, or its geometric mean with that from the modified command, is above "
            f"following_error_max = {monitored} for three samples in a row, the compensator trips: the change fades."
            if monitored
            else "following_error_max is 0: nothing trips."
        )
        if monitored and self.following_error_max < self.none.largest:
            trips += (
                " The log's own error is above it, so the compensator may trip at once: take what the zeros are apart "
                "from the measurement or, where the axis sags, give both limits."
            )
        how = (
            "An estimate: the compensator plans in closed loop on the identified model, to which the residual of the "
            "log is added as it was recorded; that the residual changes with the command is left out."
        )
        if self.physics.rms > _EXPLAINED * self.none.rms:
            how += " The physics model explains little of the error, so this leaves out most of it, and may be far off."
        return [
            *lines,
            *(self.costs.lines(shown) if self.costs is not None else ()),
            *(self.look_aheads.lines() if self.look_aheads is not None else ()),
            trips,
            how,
        ]


def _words(error: ErrorSize, shown: DisplayUnits) -> str:
    if math.isnan(error.rms):
        return "not known"
    return f"{shown.words(error.rms, '.4g')} (largest {shown.words(error.largest, '.4g')})"


def expected_tracking(
    machine: Machine, recordings: Sequence[Recording], progress: Callable[[float], object]
) -> Tracking:
    """Return the tracking errors to be expected with and without a machine's compensator, and what its limits cost."""
    allowed, first = machine.compensator_settings, beginnings(recordings, _TRIED_MAX)
    settings = {model: replace(allowed, compensate=model) for model in ("physics", "hybrid")}
    with Trial.of(machine) as trial:
        judged = {model: _expected(trial, one, first) for model, one in settings.items()}
        progress(0.8)
        bound = {
            model: limits_that_bind(one.x_d, one.x_dm, machine.compensator_predictor.T_s, allowed)
            for model, one in judged.items()
            if len(one.x_d)
        }
        stretch = Stretch.of(trial, recordings)
        costs = stretch.limit_costs() if stretch and bound.get("hybrid") else None
        ahead = stretch.look_aheads() if stretch else None
    progress(1.0)
    without = max((one.without for one in judged.values()), key=len)
    none, physics, hybrid = map(ErrorSize.of, (without, *(one.compensated for one in judged.values())))
    inverse, limits = _inverted(machine, first), (allowed.change_max, allowed.following_error_max)
    motion, error = largest_motion(recordings, machine.T_s)
    commands = [one.x_d for one in recordings if np.count_nonzero(np.diff(one.x_d)) > STEPS]  # fewer are steps
    drive = {} if allowed.limits is None else allowed.limits.to_fmi()
    reached = {name: (size, most) for size, (name, most) in zip(motion.tolist(), drive.items(), strict=False)}
    return Tracking(
        *(none, physics, hybrid, inverse, bound, costs, *limits, len(without) * machine.T_s),
        *(error, reached, max(map(held_for, commands), default=1), max(map(rounding_of, commands), default=0.0)),
        *(machine.T_s, ahead),
    )


@dataclass(frozen=True)
class Stretch:
    """Most demanding 2000 commands, on which the physics model plans for a drive that is exactly it.

    Nothing is learned, and no residual is added: of a drive that differs from its model more is left.
    """

    trial: Trial
    # (n,), m: commands, from rest at 0 to rest, and the model's response to them
    x_d: Array
    x: Array
    judged: slice  # samples that are judged

    @classmethod
    def of(cls, trial: Trial, recordings: Sequence[Recording]) -> "Stretch | None":
        """Return the stretch where the model alone errs most; None where it has no error to compensate."""
        machine = trial.machine
        model, known = machine.model, machine.compensator_predictor
        discrete, n = model.discretise(known.T_s, known.input_hold), min(2000, 5 * machine.look_ahead)
        most, lead, steps = 0.0, n // 4, np.empty(0)
        for one in recordings:
            x_d = one.x_d - one.x_d[0]
            errors = x_d - discrete.forced_response(discrete.rest(), x_d)[0]
            sums = np.cumsum(np.concatenate(([0.0], errors**2)))
            parts = sums[n:] - sums[:-n] if len(sums) > n else sums[-1:]
            first = int(np.argmax(parts))
            if parts[first] > most:
                most, steps = float(parts[first]), np.pad(np.diff(x_d), (lead + 1, lead), mode="edge")
                steps = steps[first : first + n + 2 * lead]
        if not most:
            return None
        # The log moves where it is cut: on both sides, for as long as a step's response, its velocity is led from rest
        # and to it
        k = np.arange(len(steps))
        x_d = np.cumsum(np.sin(0.5 * np.pi * np.minimum(np.minimum(k, k[::-1]) / lead, 1.0)) ** 2 * steps)
        found = cls(trial, x_d, discrete.forced_response(discrete.rest(), x_d)[0], slice(lead, -lead))
        return found if found.off > _LITTLE * largest_motion(recordings, known.T_s)[1] else None

    @property
    def off(self) -> float:
        """RMS of the error without compensation, m."""
        return rms((self.x_d - self.x)[self.judged])

    def expected(self, settings: CompensatorSettings, Np: int) -> Expected:
        """Return the errors to be expected with a compensator's settings and ``Np`` samples in a window."""
        known = replace(self.trial.machine.compensator_predictor, Np=Np, p=1, q=0, measurement_delay=0)
        (found,) = self.trial.expected(known, replace(settings, compensate="physics"), [(self.x_d, self.x)])
        return Expected(*(signal[self.judged] for signal in found))

    def limit_costs(self) -> LimitCosts:
        """Return what each limit of the machine's drive costs.

        One twice as large is advised where RMS falls and the largest error does not rise, also with all together.
        """
        own, Np = self.trial.machine.compensator_settings, self.trial.machine.compensator_predictor.Np
        least = _LITTLE * self.off

        def error_of(settings: CompensatorSettings) -> ErrorSize:
            return ErrorSize.of(self.expected(settings, Np).compensated)

        def gains(error: ErrorSize) -> bool:
            return max(error.rms, least) < (1.0 - _GAIN) * now.rms and error.largest <= now.largest

        now, wanted, effects, advised = error_of(own), own, {}, {}
        for entry in ("acceleration", "jerk", "change_max")[: 2 if own.change_max is None else 3]:
            name = DRIVE_LIMIT_ENTRIES[entry].name
            effects[name] = {one: now if one == 1.0 else error_of(_scaled(own, entry, one)) for one in FACTORS}
            if gains(effects[name][2.0]):
                wanted = _scaled(wanted, entry, 2.0)
                advised[name] = float(wanted.to_fmi()[name])
        advised_error = error_of(wanted) if advised else now
        return LimitCosts(effects, advised if gains(advised_error) else {}, advised_error)

    def look_aheads(self) -> LookAheads:
        """Return what plans leave with some look-aheads."""
        machine = self.trial.machine
        known, own = machine.compensator_predictor, machine.compensator_settings
        least, needed, tried = PARAMETERS["preview"].minimum, machine.look_ahead, []
        unit = 2.0 ** math.ceil(max(0.0, math.log2(0.25 * needed * known.T_s / _AHEAD[-1]))) / known.T_s
        chosen, sizes = own.preview or needed, (round(unit * one) for one in _AHEAD)
        for preview in sorted({*(one for one in sizes if least <= one <= len(self.x_d)), chosen, needed}):
            settings, Np = own, known.Np
            if preview != own.preview:
                settings = replace(settings, preview=preview, spacing=None, horizon=None)
                settings = settings.for_window(Np := settings.window(needed, known.T_s), needed, known.T_s)
            found = self.expected(settings, Np)
            bound = limits_that_bind(found.x_d, found.x_dm, known.T_s, own)
            left, finer = rms(found.compensated), dict[str, Any](jerk_weight=_LIGHTER * settings.jerk_weight)
            if (spacing := settings.spacing or 1) > 1:
                finer["spacing"] = max(n for n in range(1, spacing) if spacing % n == 0)
            binds = [
                name
                for name, value in finer.items()
                if left > _LITTLE * self.off
                and rms(self.expected(replace(settings, **{name: value}), Np).compensated) < (1.0 - _GAIN) * left
            ]
            tried.append(Ahead(preview, left, bound, tuple(binds)))
        return LookAheads(tuple(tried), chosen, self.off, len(found.x_d) * known.T_s, known.T_s)


def _expected(trial: Trial, compensator: CompensatorSettings, recordings: Sequence[Recording]) -> Expected:
    """Return the errors to be expected over the test samples, one log after the other; empty where a plan diverges."""
    settings = trial.machine.compensator_predictor
    firsts = [one.first_judged(settings.Np) for one in recordings if len(one.x) > settings.n_late]
    try:
        found = trial.expected(settings, compensator, [(one.x_d, one.x) for one in recordings])
    except (SignalError, FmuError):
        return Expected(*[np.empty(0)] * 4)
    parts = [Expected(*(signal[first:] for signal in one)) for one, first in zip(found, firsts, strict=True)]
    return Expected(*map(np.concatenate, zip(*parts, strict=True)))


def _inverted(machine: Machine, recordings: Sequence[Recording]) -> ErrorSize:
    """Return the errors to be expected of the rival over the test samples, on the same drive."""
    settings = machine.compensator_predictor
    late, Np = settings.n_late, settings.Np
    rival = FirInverse.fitted([in_time(*one.training, late) for one in recordings], Np)
    discrete, errors = machine.model.discretise(settings.T_s, settings.input_hold), []
    for one in recordings if rival else ():
        x_d, x = in_time(one.x_d, one.x, late)
        if len(x) > 0 and rival is not None:
            change = rival.command(x_d) - x_d
            errors.append((x_d - x - discrete.forced_response(discrete.rest(), change)[0])[one.first_judged(Np) :])
    return ErrorSize.of(np.concatenate(errors) if errors else np.empty(0))


def _scaled(settings: CompensatorSettings, entry: str, factor: float) -> CompensatorSettings:
    """Return the settings with a limit of ``[drive_limits]`` times a factor."""
    part: Any = settings if entry == "change_max" else settings.limits
    changed = replace(part, **{entry: factor * getattr(part, entry)})
    return changed if part is settings else replace(settings, limits=changed)


def binding_words(shares: Mapping[str, float]) -> str:
    """Return which limits bind a compensated command, and in which share of its samples, in words."""
    each = ", ".join(f"{name} in {100 * share:.2g} %" for name, share in shares.items())
    some = f"Limits bind the compensated command: {each} of the samples."
    return some if each else "No limit binds the compensated command."
