"""From recorded logs to a model that was tested on held-out samples: what ``hybridsep fit`` does, in its order."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from numpy.typing import ArrayLike

from ..base.errors import IdentificationError, ParameterError, check_kind, listed
from ..base.parameters import finite
from ..base.settings import DRIVE_LIMIT_ENTRIES, PARAMETERS, Cascade, CompensatorSettings, Limits, PredictorSettings
from ..base.signals import check_interval
from ..base.threads import one_blas_thread
from ..identify.model import IdentifiedModel, machine_of, of_cascade
from ..identify.operation import TOO_LITTLE, identify_operation, unit_gain_model
from ..identify.output_error import in_time
from ..logs.checks import checked, moved_by_command
from ..logs.controller import controller_of
from ..logs.log import Log, Table, read_log
from ..machines.machine import Machine, checked_name
from ..model.physics import ModalModel
from ..predict.predictor import HybridPredictor
from .advice import Judged
from .compensation import expected_tracking, taught
from .identified_plant import identified_plant
from .lags import choose_settings, period_finding, settings_to_try, with_window
from .limits import drive_limits, estimated_limits, far_words, largest_motion, usual_error
from .replay import Recording, beginnings, replay, split_log
from .result import Fit, Progress

_SHARE = 0.5  # share of each log's samples for training; the rest is held out for the test

_TRIED_MAX = 20_000
"""Leading samples on which settings are tried and a plant is fitted: a minute's log took twice as long without."""


@one_blas_thread
def fit(
    x_d: Log | Sequence[Log] | ArrayLike | Mapping[str, ArrayLike] | Table,
    x: ArrayLike | None = None,
    *,
    T_s: float | None = None,
    unit: str | None = None,
    columns: Mapping[str, str] | None = None,
    axis: str | None = None,
    Np: int | None = None,
    p: Iterable[int] = (),
    look_ahead: float | None = None,
    cascade: Mapping[str, float] | None = None,
    name: str = "axis",
    progress: Progress = lambda _message, _done: None,
    **known: float,
) -> Fit:
    """Identify an axis from what was recorded of it, choose settings, and judge them on samples that were held out.

    The first half of each log is for training: the physics model is identified from it, and settings are chosen by
    causal replays of it. Then the whole is replayed, causally; its second half is the test. What the predictor has
    learned at the end is what it begins with; with limits of the drive it learns the logs once more, for a compensator.

    Parameters
    ----------
    x_d, x : (n,) array_like
        Commanded and measured positions; ``x`` is NaN where it is missing. Or a single table with these columns, or
        with others that ``columns`` names; a :class:`~hybridsep.logs.log.Log`, or several of one axis.
    T_s, unit, columns, axis
        Of arrays and of a table, as of :func:`~hybridsep.logs.log.read_log`: sampling interval, s, unit of the
        positions, m if left out, names, and one of several axes. What is returned has positions in m, of a rotary axis
        in rad; only its ``predict`` takes and gives the unit.
    Np : int, optional
        Samples in a window of the predictor, its look-ahead; 0.1 s of them if left out.
    p : iterable of int
        Numbers of lags to choose from; some shares of ``Np`` if left out, none longer than a compensator's window.
    look_ahead : float, optional
        That the controller has for a compensator, s; what the model needs if left out
        (:meth:`~hybridsep.model.physics.ModalModel.needed_preview`).
    cascade : mapping, optional
        Gains of the loop, by the names of :class:`~hybridsep.base.settings.Cascade`: the physics model is theirs, and
        what the log says of them is among the findings of the identification.
    name : str
        The machine's.
    progress : callable, optional
        Called with a message and the fraction done.
    **known : float
        What is known of the axis: ``period`` and ``measurement_delay`` of its predictor; ``v_max``, ``a_max``,
        ``j_max``, ``change_max`` and ``following_error_max``, the drive's limits, with which a compensator is judged
        and built, too; the last two are from the log if left out.

    Raises
    ------
    ParameterError
        If the logs are sampled differently or in different units, ``Np`` does not fit into the test part, or what is
        known has another name, is out of its range, or incomplete.
    LogError
        If a log's columns do not mean what they were read for.
    SignalError
        If a log is too short to be split.
    """
    checked_name(name)
    check_kind(Iterable | None, p=p)
    p = () if p is None else tuple(p)
    check_kind(Mapping | None, cascade=cascade)
    check_kind(Callable, progress=progress)
    if unknown := set(cascade or ()) - Cascade.parameters().keys():
        raise ParameterError(f"cascade has {', '.join(Cascade.parameters())}, got {listed(sorted(unknown))}")
    gains = None if cascade is None else Cascade(**cascade)
    given_limits = drive_limits(known)
    names = [*PredictorSettings.KNOWN, *(one.name for one in DRIVE_LIMIT_ENTRIES.values())]
    entries: dict[str, Any] = {name: known[name] for name in PredictorSettings.KNOWN if name in known}
    if unknown := known.keys() - set(names):
        raise ParameterError(f"what is known of an axis must be of {', '.join(names)}, got {listed(sorted(unknown))}")
    Np = None if Np is None else PARAMETERS["Np"].checked(Np)
    logs = _logs(x_d, x, {"T_s": T_s, "unit": unit, "columns": columns, "axis": axis})
    T_s, shown = logs[0].T_s, logs[0].shown
    findings = {log.path.name: checked(log) for log in logs}
    window = max(1, round(0.1 / T_s)) if Np is None else Np  # 0.1 s of a controller of which nothing is known
    recordings = _recordings(logs, window, fits=Np is not None)
    default = replace(with_window(PredictorSettings(T_s=T_s), window), **entries)
    default.check_replay()
    settings_to_try(default, p)  # which refuses what does not fit into the window
    ahead = None
    if look_ahead is not None:
        look_ahead = finite(look_ahead, "look_ahead, a time in s,", above=0.0)
        label = f"look_ahead = {look_ahead:g} s, in samples of {T_s:g} s,"
        ahead = PARAMETERS["preview"].checked(round(look_ahead / T_s), label)

    def stage(message: str, begin: float, end: float) -> Callable[[float], object]:
        return lambda done: progress(message, begin + (end - begin) * done)

    found = _identified(recordings, default, logs, stage("identify", 0.0, 0.38))
    if gains is not None:
        found = of_cascade(gains, [in_time(*one.training, default.n_late) for one in recordings], found, shown)
    model = found.model
    default = replace(default, input_hold=found.input_hold)
    progress("look for what repeats with the position", 0.38)
    period, usual = period_finding(model, recordings, default, shown), usual_error(recordings, T_s)
    far = far_words(largest_motion(recordings, T_s)[1], usual, shown)
    found = replace(found, findings=(*found.findings, *filter(None, (period, far))))
    tried = beginnings(recordings, _TRIED_MAX)
    needed = model.needed_preview(T_s, default.input_hold)
    # A compensator has shorter windows, and what the predictor has learned is to serve it, too
    limits: dict[str, Any] = {**estimated_limits(recordings, T_s, usual), **given_limits}
    if given_limits:
        limits.pop("estimated", None)
    own = Limits(**{one: limits[one] for one in Limits.parameters()}) if limits else None
    compensation = CompensatorSettings(preview=ahead or needed, limits=own, change_max=limits.get("change_max"))
    most = compensation.window(needed, T_s)
    if look_ahead is not None and p and max(p) > most:
        raise ParameterError(
            f"p must be at most {most}, the samples in a window of a compensator that looks {look_ahead:g} s ahead, "
            f"got {max(p)}"
        )
    default = replace(default, p=min(default.p, most))
    settings, choice = choose_settings(model, tried, default, stage("choose p and q", 0.4, 0.7), p, most)
    predictor = HybridPredictor(model, settings)
    replayed = replay(predictor, recordings, progress=stage("judge on the second half", 0.7, 0.8))
    replayed = replace(replayed, offset=found.offset).with_peers(stage("peers on the second half", 0.8, 0.9))
    progress("a plant to try with", 0.9)
    plant = identified_plant(model, settings, recordings, tried)
    machine = _machine(name, logs, model, settings, compensation, plant.entries, limits)
    tracking = None
    if given_limits:
        tracking = expected_tracking(machine, recordings, stage("tracking error with compensation", 0.95, 1.0))
        predictor = taught(machine, recordings)
    judged = Judged(
        *(replayed, T_s, shown, "the log's second half"),
        share=1.0 - _SHARE,
        period=period,
        controller=controller_of(logs),
        unidentified=not found.parameters or any(one.startswith(TOO_LITTLE) for one in found.findings),
    )
    progress("fitted", 1.0)
    return Fit(logs, findings, machine, found, choice, judged, plant, tracking, predictor.to_bytes())


def _logs(x_d: Any, x: ArrayLike | None, reading: Mapping[str, Any]) -> tuple[Log, ...]:
    """Return the logs that :func:`fit` is given, of one interval and in one unit, or the log of its arrays."""
    logs = (x_d,) if isinstance(x_d, Log) else tuple(x_d) if isinstance(x_d, list | tuple) else ()
    if not logs or not all(isinstance(one, Log) for one in logs):
        return (read_log(x_d if x is None else {"x_d": x_d, "x": x}, **reading),)
    if given := [name for name, value in {"x": x, **reading}.items() if value is not None]:
        raise ParameterError(f"{listed(given, str)} must be left out where a Log is given, which has said them")
    first = logs[0]
    for log in logs[1:]:
        check_interval(log.path.name, log.T_s, first.path.name, first.T_s)
        if log.unit != first.unit:
            raise ParameterError(f"{log.path.name} is in {log.unit}, {first.path.name} in {first.unit}")
    return logs


def _recordings(logs: Sequence[Log], Np: int, *, fits: bool) -> list[Recording]:
    """Return the logs' pieces, split for training and test; windows of ``Np`` must fit into the test if ``fits``."""
    pieces = ([(one.x_d, moved_by_command(one)) for one in log.segments()] for log in logs)
    recordings = [one for of_log in pieces for one in split_log(of_log, _SHARE, Np)]
    judging = max(len(recording.x) - recording.n_train for recording in recordings)
    if fits and Np > judging:
        raise ParameterError(
            f"Np must be at most {judging}, got {Np}: the first half of each log trains, and the longest stretch for "
            f"the test has {judging} samples; give a smaller Np, or {2 * Np} samples or more without a gap"
        )
    return recordings


def _identified(
    recordings: Sequence[Recording],
    settings: PredictorSettings,
    logs: Sequence[Log],
    progress: Callable[[float], object],
) -> IdentifiedModel:
    training = [in_time(*one.training, settings.n_late) for one in recordings if one.n_train > 1]
    try:
        return identify_operation(
            *(training, settings.T_s),
            unit=logs[0].unit,
            shown=logs[0].shown,
            part=f"the first half of {'this log' if len(logs) == 1 else 'these logs'}",
            progress=lambda _message, done: progress(done),
        )
    except IdentificationError as error:
        return unit_gain_model(settings.T_s, f"{error}; a gain of 1 without lag is taken")


def _machine(
    name: str,
    logs: Sequence[Log],
    model: ModalModel,
    settings: PredictorSettings,
    given: CompensatorSettings,
    plant: Mapping[str, Any],
    limits: Mapping[str, Any],
) -> Machine:
    """Return the machine; without limits that are estimated where no compensator is possible with its look-ahead."""
    sections: dict[str, Any] = {"plant": {"kind": "identified", **plant}} if plant else {}
    compensation = {"drive_limits": dict(limits)} if limits else {}
    known = {key: value for key in PredictorSettings.KNOWN if (value := getattr(settings, key))}
    if limits:  # as numbers, for whoever reads the file, and at least as many samples in a window as there are lags
        needed, T_s = model.needed_preview(settings.T_s, settings.input_hold), settings.T_s
        given = given.for_window(Np := given.window(needed, T_s), needed, T_s)
        assert given.spacing is not None
        assert given.preview is not None
        if settings.p > Np:
            Np = -(-settings.p // given.spacing) * given.spacing
            given = replace(given, preview=None, horizon=None).for_window(Np, given.preview, T_s)
        numbers = {"Np": Np, "preview": given.preview, "spacing": given.spacing}
        if given.horizon != given.preview:
            numbers["horizon"] = given.horizon
        compensation["compensator"] = numbers

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
        if "estimated" not in limits:
            raise
        return made({})
