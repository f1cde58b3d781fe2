"""Work of a fleet on one log and axis: fitted as by ``hybridsep fit``, or replayed with a machine file and judged."""

import hashlib
import json
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hybridsep.base.errors import MachineError, brief
from hybridsep.base.files import plain
from hybridsep.base.metrics import rms_ratio
from hybridsep.base.signals import check_interval
from hybridsep.base.threads import one_blas_thread
from hybridsep.fitting.advice import Judged, advice_on
from hybridsep.fitting.fit import fit
from hybridsep.fitting.replay import Recording, Replay, replay
from hybridsep.fitting.sections import begun_report, write_findings
from hybridsep.logs.checks import Finding, checked, findings_table
from hybridsep.logs.formats import open_source
from hybridsep.machines.machine import Machine, check_unit, load_machine, machine_name
from hybridsep.model.physics import Mode
from hybridsep.predict.predictor import HybridPredictor

from .settings import AxisTask, FleetSettings, Looked
from .sources import LogFile, local_copy

_FAST = 0.1  # share of the largest velocity from which on an axis counts as moving, for the estimate of friction


@dataclass
class _Judged:
    """What came of an axis."""

    judged: Judged
    machine: Machine
    findings: Mapping[str, Sequence[Finding]]
    modes: Sequence[Mode] = ()
    folder: str = ""


def look(task: tuple[LogFile, FleetSettings]) -> Looked:
    """Return the hash of a log's content, and its axes; LogError if it cannot be read."""
    log, settings = task
    with local_copy(log.url) as path:
        content = hashlib.sha256()
        with path.open("rb") as file:
            while piece := file.read(1 << 20):
                content.update(piece)
        there = tuple(open_source(path).axes)
    axes = tuple(axis for axis in settings.axes if axis in there) if settings.axes and there else there
    return Looked(log, content.hexdigest(), axes or settings.axes[:1] or ("",))


def work(task: AxisTask) -> dict[str, Any]:
    """Fit or replay an axis; return its row; HybridSepError if the log, or the axis, cannot be used."""
    begin = time.perf_counter()
    with one_blas_thread, local_copy(task.looked.log.url) as path:
        found = _replayed(task, path) if task.settings.machines else _fitted(task, path)
        return {**task.row(), **_figures(found), "seconds": time.perf_counter() - begin}


def _fitted(task: AxisTask, path: Path) -> _Judged:
    log = task.settings.read(path, task.axis)
    folder = _folder(task)
    found = fit(log, Np=task.settings.Np, name=machine_name(path, task.axis))
    found.build(folder, fmus=task.settings.fmus, report=task.settings.reports)
    return _Judged(found.judged, found.machine, found.findings, found.identification.model.modes, _below(task, folder))


def _replayed(task: AxisTask, path: Path) -> _Judged:
    log = task.settings.read(path, task.axis)
    machine = _machine(task)
    check_unit(path.name, log, machine)
    check_interval(path.name, log.T_s, f"machine {machine.name}", machine.T_s)
    findings = {log.path.name: checked(log)}
    predictor = HybridPredictor(machine.model, machine.predictor_settings)
    recordings = [Recording(one.x_d, one.x_meas, 0) for one in log.segments()]
    judged = Judged(replay(predictor, recordings).with_peers(), log.T_s, log.shown, "the log")
    folder = _folder(task)
    if task.settings.reports:
        words = "The predictor began without any knowledge."
        report = begun_report(f"{machine.title}: {path.name}", [log], judged, "Errors of the replay", words)
        write_findings(report, [log], findings)
        report.write(folder / "report.html")
    return _Judged(judged, machine, findings, (), _below(task, folder))


def _machine(task: AxisTask) -> Machine:
    """Return the machine file of a log and axis."""
    machine = task.looked.log.machine
    names = [f"{machine}_{task.axis}", machine] if task.axis else [machine]
    folder = Path(task.settings.machines)
    for name in names:
        for path in (folder / f"{name}.toml", folder / name / "machine.toml"):
            if path.is_file():
                return load_machine(path)
    raise MachineError(f"{folder}: there is no machine file for {brief(machine)}: {names[0]}.toml")


def _folder(task: AxisTask) -> Path:
    name = machine_name(Path(task.looked.log.url.rpartition("/")[2]), task.axis)
    folder = Path(task.out) / "axes" / f"{name}_{task.key[:12]}"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _below(task: AxisTask, folder: Path) -> str:
    return folder.relative_to(task.out).as_posix() if task.settings.reports or not task.settings.machines else ""


def _figures(found: _Judged) -> dict[str, Any]:
    judged, settings = found.judged, found.machine.predictor_settings
    rms_pb, rms_hold, rms_h = judged.replay.rms()
    best, verdict = judged.replay.best(), judged.replay.verdict()
    peers = {one.name: None if one.diverged else _known(one.rms) for one in judged.replay.scored()[2:-1]}
    findings = [one for listed in found.findings.values() for one in findings_table(listed)]
    return {
        "status": "done",
        "message": "",
        "unit": found.machine.unit,
        "T_s": judged.T_s,
        "n_samples": sum(len(one.x) for one in judged.replay.recordings),
        "n_windows": verdict.n_windows,
        "Np": settings.Np,
        "p": settings.p,
        "q": settings.q,
        "dead_time": float(found.machine.model.dead_time),
        "rms_pb": _known(rms_pb),
        "rms_hold": _known(rms_hold),
        "rms_h": _known(rms_h),
        "best": best.name,
        "ratio": _known(rms_ratio(rms_h, best.rms, judged.replay.least)),
        "verdict": str(verdict),
        "advice": advice_on(judged),
        "peers": json.dumps(peers),
        "modes": json.dumps(plain(found.modes)),
        "findings": json.dumps([[one["name"], one["severity"], one["words"]] for one in findings]),
        "friction": _known(_friction(judged.replay)),
        "folder": found.folder,
    }


def _friction(judging: Replay) -> float:
    """Return half the difference of the physics model's mean residual between forward and backward motion, m."""
    residual, v = judging.errors()[0], np.gradient(judging.commands()) if len(judging.commands()) > 1 else np.zeros(1)
    fast = np.abs(v) > _FAST * np.abs(v).max(initial=0.0)
    sides = [residual[fast & (side * v > 0) & ~np.isnan(residual)] for side in (1, -1)]
    if not all(len(side) for side in sides):
        return math.nan
    return 0.5 * float(sides[0].mean() - sides[1].mean())


def _known(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
