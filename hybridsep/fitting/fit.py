"""From recorded logs to FMUs: identification, choice of settings, test on held-out samples."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from ..base.errors import FmuError, IdentificationError, ParameterError
from ..base.files import COMMANDS, written_text
from ..base.metrics import rms_ratio
from ..base.settings import PredictorSettings
from ..base.signals import Array
from ..base.threads import one_blas_thread
from ..base.version import __version__
from ..cosim.adapters import FmuController
from ..fmi.archive import build_here
from ..fmi.compile import check_available, has_native
from ..fmi.flavours import FLAVOURS, FMI_VERSIONS, versions_of
from ..fmi.spec import fmu_name
from ..identify.model import machine_of
from ..identify.operation import SAMPLES_MIN, identify_operation, unit_gain_model
from ..identify.output_error import in_time
from ..logs.log import Log
from ..logs.units import DisplayUnits
from ..machines.machine import Machine
from ..machines.text import machine_text
from ..model.physics import ModalModel, Mode
from ..predict.predictor import HybridPredictor
from .choice import choose_settings, settings_for, window_scores
from .compensation import COMPENSATE, LIMITS_WORDS, estimated_limits, expected_tracking
from .period import period_finding
from .plant import commands_to_try, identified_plant, plant_words
from .replay import Recording, Replay, beginnings, replay, split_log

__all__ = ["SAMPLES_MAX", "Fit", "FitOptions", "fit", "fit_files", "sha256_of", "step_times"]

_LOOK_AHEAD = 0.1
"""Look-ahead, s, of a controller of which nothing is known."""

_TRIED_MAX = 20_000
"""Leading samples on which settings and look-aheads are tried and a plant is fitted, 20 s at 1 kHz, and a compensator
on half of them: a fit of a minute's log took twice as long without."""

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
    identification, choice, windows : plain values
        As in ``fit.json``.
    steps : dict
        Of :func:`step_times`; empty where the FMU cannot be run here.
    share : float
        Share of each log's samples that were for training.
    judged : Replay
        Replay of the logs; its test samples are held out from the physics model and from the choice.
    files : tuple of Path
        Files that were written.
    tracking : dict
        Tracking errors to be expected, of :func:`~hybridsep.fitting.compensation.expected_tracking`; empty without
        limits.
    plant : dict
        Plant to try with, of :func:`~hybridsep.fitting.plant.identified_plant`.
    untimed : str
        Why steps are not timed, though FMUs were built; empty where they are.
    """

    machine: Machine
    identification: dict[str, Any]
    choice: list[dict[str, Any]]
    windows: list[dict[str, Any]]
    steps: dict[str, float]
    share: float
    judged: Replay
    files: tuple[Path, ...]
    tracking: dict[str, Any] = field(default_factory=dict)
    plant: dict[str, Any] = field(default_factory=dict)
    untimed: str = ""

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
            "ratio": _known(rms_ratio(rms_h, best.rms, self.judged.least)),
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
        Folder of :func:`~hybridsep.fitting.fit.fit_files`; it exists.
    options : FitOptions
    progress : callable, optional
        Called with a message and the fraction done.
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
    Np = max(1, round(_LOOK_AHEAD / T_s)) if options.Np is None else options.Np
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
    default.check_replay()
    compensates = bool(options.drive_limits)
    files = fit_files(out, options.name, compensator=compensates, fmi=fmi)

    def within(begin: float, end: float, message: str) -> Callable[[float], object]:
        return lambda done: progress(message, begin + (end - begin) * done)

    found = _identified(recordings, default, logs, within(0.0, 0.33, "identify"))
    model = ModalModel([Mode(**mode) for mode in found["modes"]], found["dead_time"])
    default = replace(default, input_hold=found["input_hold"])
    progress("look for what repeats with the position", 0.33)
    found["findings"] = [*found["findings"], *period_finding(model, recordings, default, logs[0].shown)]
    tried = beginnings(recordings, _TRIED_MAX)
    settings, errors = choose_settings(model, tried, default, within(0.35, 0.6, "choose p and q"))
    choice = [
        {"p": one.p, "q": one.q, "rms_h": _known(rms_h), "chosen": one == settings} for one, rms_h in errors.items()
    ]
    predictor = HybridPredictor(model, settings)
    replayed = replay(predictor, recordings, progress=within(0.6, 0.65, "judge on the second half"))
    judged = replace(replayed, offset=found["offset"]).with_peers(within(0.65, 0.68, "peers on the second half"))
    over_windows = window_scores(model, tried, settings, found["offset"], within(0.68, 0.8, "error over Np"))
    names = ("rms_pb", "rms_hold", "rms_h")
    windows = [{"Np": size, **dict(zip(names, map(_known, rms), strict=True))} for size, rms in over_windows.items()]
    progress("a plant to try with", 0.8)
    plant = identified_plant(model, settings, recordings, tried)
    limits: dict[str, Any] = dict(options.drive_limits)
    estimated = estimated_limits(recordings, T_s)
    if not limits:
        limits = estimated
    elif "change_max" not in limits and estimated:
        limits["change_max"] = estimated["change_max"]
    machine = _machine(options, logs, model, settings, plant["entries"], limits)
    with written_text(files["machine file"]) as file:
        file.write(machine_text(machine, comments=_comments(found, machine, plant, logs[0].shown)))
    _write_commands(files["commands to try"], commands_to_try(recordings), T_s, logs[0].unit)
    predictor.save(files["trained predictor"])
    tracking: dict[str, Any] = {}
    if compensates:
        estimate = within(0.85, 0.87, "tracking error with compensation")
        tracking = expected_tracking(machine, beginnings(recordings, _TRIED_MAX // 2), estimate)
    if not fmus:
        files = {what: path for what, path in files.items() if path.suffix != ".fmu"}
    written = tuple(files.values())
    result = Fit(machine, found, choice, windows, {}, options.share, judged, written, tracking, plant)
    summary = result.summary()["judged"]
    if fmus:
        origin = _origin(result, logs, summary)
        built = _build_fmus(machine, files, within(0.87, 0.95, "build the FMUs"), fmi, origin)
        progress("time the FMU's steps", 0.95)
        try:
            result = replace(result, steps=step_times(built, recordings[0].x_d, recordings[0].x))
        except FmuError as error:  # as where no library can be loaded from the folder of temporary files
            result = replace(result, untimed=str(error))
    kept = {"identification": found, "choice": choice, "windows": windows, "plant": plant, "tracking": tracking}
    with written_text(files["results"]) as file:
        file.write(json.dumps({"hybridsep": __version__, **kept, "judged": summary}, indent=2) + "\n")
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


def _identified(
    recordings: Sequence[Recording],
    settings: PredictorSettings,
    logs: Sequence[Log],
    progress: Callable[[float], object],
) -> dict[str, Any]:
    """Return the identification from the training samples, as plain values, in the units of the logs."""
    training = [in_time(*one.training, settings.n_late) for one in recordings if one.n_train > 1]
    n, n_all = (sum(lengths) for lengths in zip(*((one.n_train, len(one.x)) for one in recordings), strict=True))
    log = "this log" if len(logs) == 1 else "these logs"
    rests = all(np.ptp(one.x_d) == 0 for one in recordings)
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
            part=log if rests else f"the first half of {log}",
            progress=lambda _message, done: progress(done),
        )
    except IdentificationError as error:
        found = unit_gain_model(settings.T_s, f"{error}; a gain of 1 without lag is taken")
    return {name: _known(value) for name, value in dict(found.summary()).items()}


def _known(value: Any) -> Any:
    """Return a value for JSON: None for a figure that is not finite."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _machine(
    options: FitOptions,
    logs: Sequence[Log],
    model: ModalModel,
    settings: PredictorSettings,
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
            sources=[f"identified from {log.path.name}, {len(log.t)} samples" for log in logs],
            predictor={"Np": settings.Np, "p": settings.p, "q": settings.q, **known},
            **{**sections, **more},
        )

    try:
        return made(compensation)
    except ParameterError:
        if options.drive_limits or not limits:
            raise
        return made({})


def _comments(found: Mapping[str, Any], machine: Machine, plant: Mapping[str, Any], shown: DisplayUnits) -> list[str]:
    """Return the lines at the head of the machine file: the structure, and what is no measurement in it."""
    lines = [found["structure"]]
    if machine.plant is not None:
        lines.append(f"[plant]: {plant_words(plant, shown)}")
    if machine.drive_limits is not None and machine.drive_limits.estimated:
        lines.append(f"[drive_limits]: {LIMITS_WORDS}")
    return lines


_MODELS = {"": "HybridPredictor", "compensator ": "SepCompensator"}
"""Models of the FMUs, by how a compensator's are called."""


def fit_files(out: Path, name: str, *, compensator: bool = False, fmi: str = FMI_VERSIONS[0]) -> dict[str, Path]:
    """Return the files that :func:`~hybridsep.fitting.fit.fit` writes and its report, by what they are.

    Parameters
    ----------
    out : Path
        Their folder.
    name : str
        The machine's.
    compensator : bool
        Whether there is a compensator's FMU beside each predictor's.
    fmi : str
        Version of the native FMUs, one of :data:`~hybridsep.fmi.flavours.FMI_CHOICES`.

    Raises
    ------
    ParameterError
        If ``fmi`` is another word.
    FmuError
        If it asks for FMUs of FMI 3.0, and no native ones can be built here.
    """
    return {
        "machine file": out / "machine.toml",
        "trained predictor": out / "trained.state",
        "results": out / "fit.json",
        "report": out / "report.html",
        "commands to try": out / COMMANDS,
        **{
            _called(what, flavour, version): out / f"{fmu_name(model, name, flavour, version)}.fmu"
            for what, model in list(_MODELS.items())[: 2 if compensator else 1]
            for flavour, version in _variants(fmi)
        },
    }


def _write_commands(path: Path, x_d: Array, T_s: float, unit: str) -> None:
    """Write commands as a CSV that ``--trajectory`` takes, m, or rad where that is the unit."""
    with written_text(path) as file:
        file.write(f"# commands of a log, by hybridsep fit, to try with\nt [s],x_d [{unit}]\n")
        file.writelines(f"{k * T_s:.9g},{position!r}\n" for k, position in enumerate(x_d.tolist()))


def _build_fmus(
    machine: Machine,
    files: Mapping[str, Path],
    progress: Callable[[float], object],
    fmi: str,
    origin: Mapping[str, Any],
) -> Path:
    """Build the FMUs among :func:`fit_files`, trained, with what they say of their origin; return the predictor's."""
    variants = _variants(fmi)
    for i, (flavour, version) in enumerate(variants):
        progress(i / len(variants))
        for what, model in _MODELS.items():
            if path := files.get(_called(what, flavour, version)):
                given: dict[str, Any] = {"weights": files["trained predictor"], "fmi": version, "origin": origin}
                build_here(machine, model, path.parent, flavour, **given)
    return files[_called("", *variants[0])]


def _variants(fmi: str) -> list[tuple[str, str]]:
    """Return flavour and version of FMI of the FMUs that can be built here."""
    if fmi != FMI_VERSIONS[0]:
        check_available(("host",))
    native = [(FLAVOURS[0], version) for version in versions_of(fmi, FLAVOURS[0])]
    python = [(flavour, FMI_VERSIONS[0]) for flavour in FLAVOURS[1:]]
    return [*native, *python] if has_native() else python


def _called(what: str, flavour: str, version: str) -> str:
    return f"{flavour} {what}FMU" if version == FMI_VERSIONS[0] else f"{flavour} {what}FMU, FMI {version}.0"


def _origin(found: Fit, logs: Sequence[Log], judged: Mapping[str, Any]) -> dict[str, Any]:
    """Return what FMUs say of their origin: logs with their hashes, settings, figures of the fit."""
    machine, identification = found.machine, found.identification
    return {
        "tool": f"hybridsep {__version__}",
        "log": [
            {"file": log.path.name, "sha256": sha256_of(log.path), "samples": len(log.t), "T_s": log.T_s}
            for log in logs
        ],
        "change": [f"{log.path.name}: {remark}" for log in logs for remark in log.remarks],
        "machine": {"name": machine.name, "unit": machine.unit},
        "identification": {"structure": identification["structure"], "offset": identification["offset"]},
        "settings": machine.predictor_settings.to_fmi(),
        "trained": {"share": found.share},
        "judged": {name: "unknown" if value is None else value for name, value in judged.items()},
    }


def sha256_of(path: Path) -> str:
    """Return the hash of a log's file, ``"unknown"`` where it is none that can be read again, as a pipe."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "unknown"


SAMPLES_MAX = 5000
"""Samples that are timed, at most."""


def step_times(fmu: Path, x_d: Array, x: Array) -> dict[str, float]:
    """Return times of a predictor FMU's steps over the beginning of a log, s.

    Parameters
    ----------
    fmu : Path
        A HybridPredictor.
    x_d, x : (n,) array, m
        Commanded and measured positions.

    Returns
    -------
    dict
        ``median``, ``p99_9`` and ``largest``.
    """
    n = min(len(x_d), SAMPLES_MAX)
    taken = np.empty(n)
    controller = FmuController(fmu, {}, 0.0)
    with controller:
        controller.initialise(float(x_d[0]))
        for k in range(n):
            begin = perf_counter()
            controller.step(k, float(x_d[k]), float(x[max(k - controller.delay, 0)]))
            taken[k] = perf_counter() - begin
    return {"median": float(np.median(taken)), "p99_9": float(np.quantile(taken, 0.999)), "largest": float(taken.max())}
