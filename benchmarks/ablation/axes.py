"""Axes that a change to the model with averaging is judged on, in groups: those to choose on, and those that judge.

Of a recorded axis the physics model is identified from the first half of the log; the second half judges, relative to
the best of seven baselines in hindsight: physics, hold, lag + hold and four ARX models. Simulated cases, random drives
of both generators, plants that have changed before the warm run, and runs that begin in motion are relative to the
physics model.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from benchmarks.ablation.core import Run
from benchmarks.averaging import RECORDINGS, Case, cases
from benchmarks.conditions import CUTS, SETTLED, changed_plants
from benchmarks.random_drives import GENERATORS
from hybridsep.base.errors import IdentificationError
from hybridsep.base.metrics import coverage, rms
from hybridsep.base.settings import PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.evaluate.peers import Piece, predict_peers
from hybridsep.fitting.lags import with_window
from hybridsep.identify.model import IdentifiedModel
from hybridsep.identify.operation import identify_operation, unit_gain_model
from hybridsep.logs.log import read_log
from hybridsep.machines.machine import paper_machine
from hybridsep.model.physics import ModalModel

SO101 = "so101"  # beginning of the names of the arm's logs
WINDOWS = {"recordings": (100, 20), SO101: (5, 20)}  # samples in a window, ``Np``, by the group of the logs

CHOOSE = ("cnc_a", "xl330_sin_sin", "rotation")
"""Parts of the names of logs that constants may be chosen on; the others judge."""

SEEDS = {"modal": 103, "two_mass": 104, "changed": 101}  # seeds of the random drives, which no constant was chosen on
LEVELS = (0.5, 0.9, 0.95)  # probabilities of intervals whose coverage is measured

_NOTHING = (np.empty(0), np.empty(0))

Replayed = tuple[tuple[Array, Array], tuple[Array, Array]]

Replay = Callable[[ModalModel, PredictorSettings, Run, Run], Replayed]
"""Replay of a cold and a warm run: predictions and their standard deviations, ``(n,)`` each, m."""


@dataclass(frozen=True)
class Axis:
    """Axis and its runs."""

    group: str
    name: str
    # ``G_pb`` and the settings with averaging
    model: ModalModel
    settings: PredictorSettings
    x_d: Array  # (n,), m: commanded positions
    x: tuple[Array, Array]  # each (n,), m: measured positions of the cold run and of the warm one after it
    first: int  # first test sample
    # whether the warm run is of only the test samples, after one of the samples before them; else of all samples
    split: bool
    # m: RMS error over the test samples to which the errors of the cold run are relative; the warm run's are relative
    # to ``best_warm``
    best: float
    best_warm: float  # m


class Errors(NamedTuple):
    """Errors of the prediction, relative to what an axis is judged by."""

    # RMS
    cold: float
    warm: float
    score: float  # of the interval of 90 %, cold: mean of its width, and twenty times what an error is beyond it, m
    # percent of the errors within each of the intervals of :data:`LEVELS`, cold
    within: tuple[float, ...]


def errors_of(axis: Axis, replay: Replay) -> Errors:
    """Return the errors of a replay on an axis."""
    runs = [(axis.x_d, x) for x in axis.x]
    model, settings, first = axis.model, axis.settings, axis.first
    if axis.split:
        before, judged = ((x_d[part], x[part]) for (x_d, x) in runs[:1] for part in (slice(first), slice(first, None)))
        (x_h, std), _ = replay(model, settings, runs[0], _NOTHING)
        _, (warm, _) = replay(model, settings, before, judged)
        of_warm = judged[1] - warm
    else:
        (x_h, std), (warm, _) = replay(model, settings, runs[0], runs[1])
        of_warm = (axis.x[1] - warm)[first:]
    error, std = (axis.x[0] - x_h)[first:], std[first:]
    half = NormalDist().inv_cdf(0.95) * std
    score = float(np.mean(2.0 * half + 20.0 * np.maximum(np.abs(error) - half, 0.0)))
    within = tuple(100.0 * coverage(error, std, level) for level in LEVELS)
    return Errors(rms(error) / axis.best, rms(of_warm) / axis.best_warm, score, within)


def logs_of(emps: Path | None) -> Iterator[Callable[[], Axis]]:
    """Yield what returns the recorded axes, each with each window: identification takes time."""
    for path in (*([] if emps is None else [emps]), *RECORDINGS):
        name = SO101 if path.stem.startswith(SO101) else "recordings"
        yield from (partial(_log, name, path, Np) for Np in WINDOWS[name])


def _log(name: str, path: Path, Np: int) -> Axis:
    """Return the axis of a log, identified from its first half."""
    log = read_log(path, columns=paper_machine("emps").log.columns if path.suffix == ".mat" else None)
    x_d, x, T_s = log.x_d, log.x_meas, log.T_s
    n_train = round(0.5 * len(x))
    first = -(-n_train // Np) * Np
    found = _identified(x_d[:n_train].tobytes(), x[:n_train].tobytes(), T_s)
    settings = with_window(PredictorSettings(T_s=T_s, input_hold=found.input_hold), Np)
    residual = x - physics(found.model, settings, x_d)
    begins = np.arange(len(x)) // Np * Np
    errors = [rms((residual - found.offset)[first:]), rms((residual - residual[begins - 1])[first:])]
    peers = predict_peers([Piece(x_d, x, n_train, first)], Np)
    errors += [np.inf if peer.diverged else rms((x - peer.predictions[0])[first:]) for peer in peers]
    chooses = any(part in path.stem for part in CHOOSE)
    best = float(min(errors))
    group = f"{name} {'to choose on' if chooses else 'that judge'}"
    return Axis(group, f"{path.stem}, Np = {Np}", found.model, settings, x_d, (x, x), first, True, best, best)


def physics(model: ModalModel, settings: PredictorSettings, x_d: Array) -> Array:
    """Return the position by the physics model from rest, (n,), m."""
    discrete = model.discretise(settings.T_s, settings.input_hold)
    return np.asarray(x_d[0] + discrete.forced_response(discrete.rest(), x_d - x_d[0])[0])


@lru_cache
def _identified(x_d: bytes, x: bytes, T_s: float) -> IdentifiedModel:
    """Return the model of a log that trains, float64 arrays as bytes."""
    try:
        return identify_operation([(np.frombuffer(x_d), np.frombuffer(x))], T_s)
    except IdentificationError as error:
        return unit_gain_model(T_s, f"{error}")


def simulations_of(n: int) -> Iterator[Axis]:
    """Yield simulated cases, random drives, ``n`` of each generator, starts in motion and changed plants."""
    for case in cases():
        yield _of_case("simulated", case)
    for kind, generator in GENERATORS.items():
        seed = SEEDS[kind]
        for drive in generator.drives_at(range(n), generator.true_positions(range(n), seed=seed), seed):
            case = Case(f"{kind} {drive.index}", drive.model, drive.settings, drive.x_d, (drive.x_meas, drive.x_meas))
            yield _of_case(f"drives, {kind}", case)
            yield _of_case("start in motion", _cut(case))
    for case in changed_plants(n, SEEDS["changed"]):
        yield replace(_of_case("changed plants", case), first=round(SETTLED / case.settings.T_s))


def _cut(case: Case) -> Case:
    """Return a case that begins where it moves fastest within a tenth after a third of it."""
    first = round(CUTS[1] * len(case.x_d))
    first += int(np.argmax(np.abs(np.diff(case.x_d[first : first + len(case.x_d) // 10]))))
    x, again = (one[first:] for one in case.x_meas)
    return replace(case, name=f"{case.name}, from sample {first} on", x_d=case.x_d[first:], x_meas=(x, again))


def _of_case(group: str, case: Case) -> Axis:
    """Return an axis whose errors are relative to the physics model's."""
    settings = replace(case.settings, averaging=True, t_init=-1.0)
    x_pb = physics(case.model, settings, case.x_d)
    cold, warm = (rms(x - x_pb) for x in case.x_meas)  # of the whole runs
    return Axis(group, case.name, case.model, settings, case.x_d, case.x_meas, 0, False, cold, warm)
