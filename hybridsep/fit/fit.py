"""From recorded logs to FMUs: identification, choice of settings, test on held-out samples."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import IdentificationError, ParameterError
from ..base.metrics import rms_ratio, shown_figure
from ..base.output import written_text
from ..base.settings import PredictorSettings
from ..base.threads import one_blas_thread
from ..fmi.flavours import FMI_VERSIONS
from ..identify.model import machine_of
from ..identify.operation import SAMPLES_MIN, identify_operation, unit_gain_model
from ..identify.segments import in_time
from ..logs.log import Log
from ..logs.units import Shown
from ..machines.machine import Machine
from ..machines.seal import sealed
from ..machines.text import machine_text
from ..model.physics import ModalModel, Mode
from ..predict.predictor import HybridPredictor
from ..reports.step_times import step_times
from ..tune.choice import choose_settings, settings_for, window_scores
from ..tune.period import period_hint
from ..tune.recordings import Recording, Replay, replay, split_log
from .compensation import COMPENSATE, LIMITS_WORDS, estimated_limits, expected_tracking
from .files import build_fmus, fit_files, write_commands
from .origin import fit_origin
from .plant import commands_to_try, identified_plant, plant_words
from .stages import Stages, key_of

__all__ = ["REPEATS", "Fit", "FitOptions", "fit"]

REPEATS = "the residual repeats every"
"""Beginning of the finding that a period would help, which names its option."""

_LOOK_AHEAD = 0.1
"""Look-ahead, s, of a controller of which nothing is known."""

Progress = Callable[[str, float], object]


@dataclass(frozen=True)
class FitOptions:
    """Options of :func:`fit`.

    Attributes
    ----------
    Np : int, optional
        Samples of the controller's look-ahead; 0.1 s of them if left out.
    name : str
        The machine's.
    share : float
        Share of each log's samples for training; the rest is held out for the test.
    known : mapping
        What is known of the axis: entries of ``[predictor]`` such as ``period`` and ``measurement_delay``.
    drive_limits : mapping
        Entries of ``[drive_limits]``; with them a compensator is built, too.
    """

    Np: int | None
    name: str
    share: float = 0.5
    known: Mapping[str, Any] = field(default_factory=dict)
    drive_limits: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Fit:
    """What was found.

    Attributes
    ----------
    machine : Machine
    identification, choice, windows, steps : plain values
        As in ``fit.json``.
    share : float
        Share of each log's samples that were for training.
    judged : Replay
        Replay of the logs; its test samples are held out from the physics model and from the choice.
    files : tuple of Path
        Files that were written.
    tracking : dict
        Tracking errors to be expected, of :func:`~hybridsep.fit.compensation.expected_tracking`; empty without limits.
    plant : dict
        Plant to try with, of :func:`~hybridsep.fit.plant.identified_plant`.
    """

    machine: Machine
    identification: dict[str, Any]
    choice: list[dict[str, Any]]
    windows: list[dict[str, Any]]
    steps: dict[str, float]
    share: float
    judged: Replay
    files: tuple[Path, ...]
    tracking: dict[str, float | None] = field(default_factory=dict)
    plant: dict[str, Any] = field(default_factory=dict)

    def summary(self) -> dict[str, Any]:
        """Return plain values: errors in m over the test samples, settings, identification, step times in s.

        The physics model is judged with the offset that was identified beside it, which the FMU's ``x_pb`` has not.
        ``ratio`` is the hybrid's error relative to the error of the best of physics model, hold and peers.
        """
        rms_pb, rms_hold, rms_h = self.judged.rms()
        verdict, best = self.judged.verdict(), self.judged.best()
        peers = self.judged.scored()[2:-1]
        judged = {
            "rms_pb": _known(rms_pb),
            "rms_hold": _known(rms_hold),
            "rms_h": _known(rms_h),
            "peers": {one.name: "diverged" if one.diverged else _known(one.rms) for one in peers},
            "best": best.name,
            "ratio": _known(rms_ratio(rms_h, best.rms)),
            "n_windows": verdict.n_windows,
            "verdict": str(verdict),
        }
        settings = {name: getattr(self.machine.predictor_settings, name) for name in ("Np", "p", "q")}
        parts: dict[str, Any] = {"identification": self.identification, "tried": self.choice, "over_Np": self.windows}
        return {
            "judged": judged,
            "settings": settings,
            **parts,
            "step_times": self.steps,
            "tracking": self.tracking,
            "plant": self.plant,
        }


@one_blas_thread
def fit(
    logs: Sequence[Log],
    out: Path,
    options: FitOptions,
    progress: Progress = lambda _message, _done: None,
    *,
    changes: Sequence[str] = (),
    fmus: bool = True,
    fmi: str = FMI_VERSIONS[0],
) -> Fit:
    """Identify an axis from its logs, choose settings, judge them, and build its FMUs.

    The first half of each log is for training: the physics model is identified from it, and settings are chosen by
    causal replays of it. Then the whole is replayed, causally; its second half is the test. What the predictor has
    learned at the end is the state with which the FMUs start.

    Parameters
    ----------
    logs : sequence of Log
        Of one axis, all sampled alike.
    out : Path
        Folder of :func:`~hybridsep.fit.files.fit_files`; it exists.
    options : FitOptions
    progress : callable, optional
        Called with a message and the fraction done.
    changes : sequence of str
        What was done to the logs' positions before, for the machine file's ``sources``.
    fmus : bool
        Whether FMUs are built, and their steps timed.
    fmi : str
        Version of the native FMUs, one of :data:`~hybridsep.fmi.flavours.FMI_CHOICES`.

    Raises
    ------
    ParameterError
        If ``fmi`` is another word, the logs are sampled differently or in different units, or ``Np`` does not fit into
        the test part.
    SignalError
        If a log is too short to be split.
    """
    T_s = _common(logs)
    Np = _window(options.Np, T_s)
    recordings = [
        piece for log in logs for piece in split_log([(s.x_d, s.x_meas) for s in log.segments()], options.share, Np)
    ]
    judging = max(len(recording.x) - recording.n_train for recording in recordings)
    if options.Np is not None and options.Np > judging:
        raise ParameterError(
            f"--Np must be at most {judging}, got {options.Np}: the first half of each log trains, and the "
            f"longest stretch for the test has {judging} samples; give a smaller --Np, or a log of {2 * options.Np} "
            "samples or more"
        )
    default = replace(settings_for(Np, T_s, "zoh"), **options.known)
    compensates = bool(options.drive_limits)
    files = fit_files(out, options.name, compensator=compensates, fmi=fmi)
    stages = Stages(files["results"], key_of(recordings, (options, T_s, logs[0].unit, logs[0].shown)))

    def within(begin: float, end: float, message: str) -> Callable[[float], object]:
        return lambda done: progress(message, begin + (end - begin) * done)

    found = stages.result(
        "identification", lambda: _identified(recordings, default, logs, within(0.0, 0.33, "identify"))
    )
    model = ModalModel([Mode(**mode) for mode in found["modes"]], found["dead_time"])
    default = replace(default, input_hold=found["input_hold"])
    progress("look for what repeats with the position", 0.33)
    repeats = stages.result("period", lambda: _repeats(model, recordings, default, logs[0]))
    found = {**found, "findings": [*found["findings"], *repeats]}
    choice = stages.result("choice", lambda: _choice(model, recordings, default, within(0.35, 0.6, "choose p and q")))
    p, q = _chosen(choice)
    settings = replace(default, p=p, q=q)
    windows = stages.result(
        "windows",
        lambda: [
            {name: _known(value) for name, value in asdict(one).items()}
            for one in window_scores(
                *(model, recordings, settings, within(0.6, 0.8, "error over Np")), offset=found["offset"]
            )
        ],
    )
    predictor = HybridPredictor(model, settings)
    replayed = replay(predictor, recordings, progress=within(0.8, 0.83, "judge on the second half"))
    judged = replace(replayed, offset=found["offset"]).with_peers(within(0.83, 0.85, "peers on the second half"))
    plant = stages.result("plant", lambda: identified_plant(model, settings, recordings))
    limits = dict(options.drive_limits) or estimated_limits(recordings, T_s)
    machine = _machine(options, logs, model, settings, changes, plant["entries"], limits)
    with written_text(files["machine file"]) as file:
        file.write(sealed(machine_text(machine, comments=_comments(found, machine, plant, logs[0].shown)), "fit"))
    write_commands(files["commands to try"], commands_to_try(recordings), T_s, logs[0].unit)
    predictor.save(files["trained predictor"])
    tracking: dict[str, float | None] = {}
    if compensates:
        estimate = within(0.85, 0.87, "tracking error with compensation")
        tracking = stages.result("tracking", lambda: expected_tracking(machine, recordings, estimate))
    if not fmus:
        files = {what: path for what, path in files.items() if path.suffix != ".fmu"}
    result = Fit(machine, found, choice, windows, {}, options.share, judged, tuple(files.values()), tracking, plant)
    if fmus:
        origin = fit_origin(machine, logs, found, result.summary()["judged"], share=options.share, changes=changes)
        built = build_fmus(machine, files, within(0.87, 0.95, "build the FMUs"), fmi, origin)
        progress("time the FMU's steps", 0.95)
        result = replace(result, steps=step_times(built, recordings[0].x_d, recordings[0].x))
    stages.keep("judged", result.summary()["judged"])
    progress("done", 1.0)
    return result


def _common(logs: Sequence[Log]) -> float:
    """Return the sampling interval of all logs, s; ParameterError if they differ in it or in the unit."""
    T_s = logs[0].T_s
    for log in logs[1:]:
        if abs(log.T_s - T_s) > 0.01 * T_s:
            raise ParameterError(f"{log.path.name} is sampled every {log.T_s:g} s, {logs[0].path.name} every {T_s:g} s")
        if log.unit != logs[0].unit:
            raise ParameterError(f"{log.path.name} is in {log.unit}, {logs[0].path.name} in {logs[0].unit}")
    return T_s


def _window(Np: int | None, T_s: float) -> int:
    """Return the window, samples."""
    return max(1, round(_LOOK_AHEAD / T_s)) if Np is None else Np


def _identified(
    recordings: Sequence[Recording],
    settings: PredictorSettings,
    logs: Sequence[Log],
    progress: Callable[[float], object],
) -> dict[str, Any]:
    """Return the identification from the training samples, as plain values, in the units of the logs."""
    training = [in_time(*one.training, settings.measurement_delay) for one in recordings if one.n_train > 1]
    n, n_all = (sum(lengths) for lengths in zip(*((one.n_train, len(one.x)) for one in recordings), strict=True))
    try:
        if n < SAMPLES_MIN:
            raise IdentificationError(
                f"this log cannot determine a model, because {n} of its {n_all} samples train, at least {SAMPLES_MIN} "
                "are needed"
            )
        found = identify_operation(
            *(training, settings.T_s),
            unit=logs[0].unit,
            shown=logs[0].shown,
            part=_what_trains(recordings, logs),
            progress=lambda _message, done: progress(done),
        )
    except IdentificationError as error:
        found = unit_gain_model(settings.T_s, f"{error}; a gain of 1 without lag is taken")
    summary = dict(found.summary())
    return {name: _known(value) for name, value in summary.items()}


def _what_trains(recordings: Sequence[Recording], logs: Sequence[Log]) -> str:
    """Return what the training samples are, in words: where all of it rests, all of the log."""
    log = "this log" if len(logs) == 1 else "these logs"
    return log if all(np.ptp(one.x_d) == 0 for one in recordings) else f"the first half of {log}"


def _known(value: Any) -> Any:
    """Return a value for JSON: None for a figure that is not finite."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _repeats(model: ModalModel, recordings: Sequence[Recording], settings: PredictorSettings, log: Log) -> list[str]:
    """Return the finding that the residual repeats with the position, where it does and no period is given."""
    hint = period_hint(model, recordings, settings) if settings.period == 0.0 else None
    if hint is None:
        return []
    factor, position = log.shown.position
    scale, unit = log.shown.error(hint.rms_without)
    before, after = shown_figure(scale * hint.rms_without), shown_figure(scale * hint.rms_with)
    return [
        f"{REPEATS} {factor * hint.period:.6g} {position}: with --period {hint.period:g} the hybrid's "
        f"error would go from {before} to {after} {unit}, by replays of the training half"
    ]


def _choice(
    model: ModalModel,
    recordings: Sequence[Recording],
    default: PredictorSettings,
    progress: Callable[[float], object],
) -> list[dict[str, Any]]:
    """Return all settings that were tried, as plain values."""
    choice = choose_settings(model, recordings, default, progress)
    return [
        {
            "p": one.settings.p,
            "q": one.settings.q,
            "rms_h": _known(one.rms_h),
            "chosen": one.settings == choice.settings,
        }
        for one in choice.tried
    ]


def _chosen(choice: Sequence[dict[str, Any]]) -> tuple[int, int]:
    """Return ``p`` and ``q``."""
    chosen = next(one for one in choice if one["chosen"])
    return int(chosen["p"]), int(chosen["q"])


def _machine(
    options: FitOptions,
    logs: Sequence[Log],
    model: ModalModel,
    settings: PredictorSettings,
    changes: Sequence[str],
    plant: Mapping[str, Any],
    limits: Mapping[str, Any],
) -> Machine:
    """Return the machine; without limits that are estimates where no compensator is possible with its look-ahead."""
    name = options.name
    sections: dict[str, Any] = {"plant": {"kind": "identified", **plant}} if plant else {}
    compensation = {"drive_limits": dict(limits), "compensator": {"compensate": COMPENSATE}} if limits else {}
    known = {key: value for key in ("period", "measurement_delay") if (value := getattr(settings, key))}

    def made(more: Mapping[str, Any]) -> Machine:
        return machine_of(
            *(model, settings.input_hold, settings.T_s, name, f"Axis {name}, identified"),
            unit=logs[0].unit,
            sources=[f"identified from {log.path.name}, {len(log.t)} samples" for log in logs] + list(changes),
            predictor={"Np": settings.Np, "p": settings.p, "q": settings.q, **known},
            **{**sections, **more},
        )

    try:
        return made(compensation)
    except ParameterError:
        if options.drive_limits or not limits:
            raise
        return made({})


def _comments(found: Mapping[str, Any], machine: Machine, plant: Mapping[str, Any], shown: Shown) -> list[str]:
    """Return the lines at the head of the machine file: the structure, and what is no measurement in it."""
    lines = [found["structure"]]
    if machine.plant is not None:
        lines.append(f"[plant]: {plant_words(plant, shown)}")
    if machine.drive_limits is not None and machine.drive_limits.estimated:
        lines.append(f"[drive_limits]: {LIMITS_WORDS}")
    return lines
