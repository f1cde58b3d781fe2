"""What a plan can do on a log's most demanding stretch: what the drive's limits cost, and what look-aheads leave."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base.metrics import ErrorSize, rms
from ..base.settings import DRIVE_LIMIT_ENTRIES, PARAMETERS, CompensatorSettings
from ..base.signals import Array
from ..logs.units import DisplayUnits
from ..model.physics import least_preview
from .expected import Expected, Trial, limits_that_bind
from .limits import largest_motion
from .replay import Recording

FACTORS = (0.5, 1.0, 2.0)  # by which each limit is changed, one at a time, to say what it costs
_GAIN = 0.05  # relative gain from which on a limit twice as large, or a longer look-ahead, is advised
_AHEAD = (0.025, 0.05, 0.1, 0.2, 0.4)  # look-aheads, s, that are tried, doubled until a quarter of the model's is there
_LIGHTER = 1e-3  # ``jerk_weight`` relative to the machine's with which plans that it binds leave less
_LITTLE = 0.01  # share of the error without compensation below which errors are alike


def in_words(error: ErrorSize, shown: DisplayUnits) -> str:
    """Return an error in units to show."""
    if math.isnan(error.rms):
        return "not known"
    return f"{shown.words(error.rms, '.4g')} (largest {shown.words(error.largest, '.4g')})"


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
            each = ", ".join(f"{factor:g} ×: {in_words(error, shown)}" for factor, error in errors.items())
            lines.append(f"{name} {each}.")
        if self.advised:
            entries = {one.name: entry for entry, one in DRIVE_LIMIT_ENTRIES.items()}
            paste = (f"{option.format(name=one, entry=entries[one])}{v:.4g}" for one, v in self.advised.items())
            left, today = in_words(self.advised_error, shown), in_words(next(iter(self.effects.values()))[1.0], shown)
            lines.append(f"If the drive allows it: {' '.join(paste)}, with which about {left} is left of {today}.")
        return lines


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
        least = least_preview(self.T_s)
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
        discrete, n = model.discretise(known.T_s, known.input_hold), min(2000, 5 * machine.needed_preview)
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
        least, needed, tried = PARAMETERS["preview"].minimum, machine.needed_preview, []
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


def _scaled(settings: CompensatorSettings, entry: str, factor: float) -> CompensatorSettings:
    """Return the settings with a limit of ``[drive_limits]`` times a factor."""
    part: Any = settings if entry == "change_max" else settings.limits
    changed = replace(part, **{entry: factor * getattr(part, entry)})
    return changed if part is settings else replace(settings, limits=changed)
