"""Identification from a file of any kind: a log, a swept sine, a frequency response, Klipper's accelerometers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..base.errors import ParameterError
from ..base.signals import Array
from ..intake.finding import Finding
from ..intake.repair import changes, take_in
from ..logs.log import Log, read_log
from .frequency_response import IdentifiedResponse, identify_frequency_response
from .kinds import KINDS
from .klipper import identify_resonance, is_klipper, read_klipper
from .model import IdentifiedModel
from .operation import identify_operation
from .response_files import has_response, read_response
from .segments import in_time
from .swept_sine import h1

__all__ = ["Choices", "FileReading", "RecordedFile", "identify_recording", "read_recording"]


@dataclass(frozen=True)
class FileReading:
    """How a file is read.

    Attributes
    ----------
    kind : str
        Of :data:`hybridsep.identify.kinds.KINDS`.
    columns : mapping
        Role (``t``, ``x_d``, ``x``) → name of its column, where it is not told by its name.
    unit : str or None
        Unit of the positions, where the file does not say it.
    T_s : float, s, or None
        Sampling interval of a log; with a response the model's, 1 ms if it is left out.
    axis : str or None
        Of a file that holds several.
    measurement_delay : int
        Samples by which the measured positions of a log are late.
    fix : bool
        Whether the fixes of all findings of a log are applied.
    """

    kind: str
    columns: Mapping[str, str]
    unit: str | None
    T_s: float | None
    axis: str | None
    measurement_delay: int
    fix: bool


@dataclass(frozen=True)
class Choices:
    """What is chosen of the model rather than identified; None: by the data.

    Attributes
    ----------
    unit_gain : bool or None
        Whether the static gain is 1; with a response None is no.
    modes : int or None
        Number of modes of a response.
    hold : {"zoh", "foh"}
        Hold of the command, with a response.
    dead_time : int
        Whole samples, with a response.
    """

    unit_gain: bool | None
    modes: int | None
    hold: str
    dead_time: int


@dataclass(frozen=True)
class RecordedFile:
    """A file that was read.

    Attributes
    ----------
    path : Path
    reading : FileReading
        With the kind that the file is of, never ``auto``.
    log : Log or None
        Of operation or of a swept sine, repaired.
    findings : tuple of Finding
        Of the checks of a log of operation.
    pieces : tuple of ((n,), (n,) arrays), m
        Commands, and positions of the same instants, of each segment of the log.
    """

    path: Path
    reading: FileReading
    log: Log | None = None
    findings: tuple[Finding, ...] = ()
    pieces: tuple[tuple[Array, Array], ...] = ()

    @property
    def is_operation(self) -> bool:
        """Whether it is a log of operation."""
        return self.reading.kind == "operation"

    @property
    def changed(self) -> list[str]:
        """What the fixes have changed, in words."""
        return changes({self.path.name: self.findings})


def read_recording(path: Path, reading: FileReading) -> RecordedFile:
    """Return a file as :func:`identify_recording` takes it; of a response and of Klipper's no more than its kind.

    Raises
    ------
    LogError
        If a log cannot be read, or errors computed from it would be invalid.
    ParameterError
        If the kind is unknown, an option is none of its kind, or a swept sine misses samples.
    """
    if reading.kind not in KINDS:
        raise ParameterError(f"--kind must be one of {', '.join(KINDS)}, got {reading.kind!r}")
    kind = _found_kind(path, reading) if reading.kind == "auto" else reading.kind
    for option, kinds, given in (
        ("--fix is for a log of operation", ("operation",), reading.fix),
        ("--measurement-delay is for a log", ("operation", "sweep"), reading.measurement_delay),
    ):
        if given and kind not in kinds:
            raise ParameterError(f"{option}, {path.name} is read as --kind {kind}")
    reading = replace(reading, kind=kind)
    if kind in ("klipper", "response"):
        return RecordedFile(path, reading)
    sweeps = kind == "sweep"
    log = read_log(
        path,
        columns=reading.columns,
        unit=reading.unit,
        T_s=reading.T_s,
        axis=reading.axis,
        uniform=sweeps,
        may_miss=True,
    )
    n_missing = int(np.isnan(log.x_meas).sum())
    if sweeps and n_missing:
        raise ParameterError(
            f"{path}: a swept sine must be measured in every sample, {n_missing} measured positions are missing; "
            "record it again, or read it as a log of operation (--kind operation)"
        )
    findings: tuple[Finding, ...] = ()
    if not sweeps:
        (log,), found = take_in([log], fix=reading.fix)
        findings = found[path.name]
    pieces = (in_time(piece.x_d, piece.x_meas, reading.measurement_delay) for piece in log.segments())
    return RecordedFile(path, reading, log, findings, tuple(piece for piece in pieces if len(piece[0])))


def identify_recording(
    recording: RecordedFile,
    choices: Choices,
    progress: Callable[[str, float], object] = lambda _message, _done: None,
) -> IdentifiedModel | IdentifiedResponse:
    """Identify the physics model from a file.

    Raises
    ------
    IdentificationError
        If the data do not determine a model.
    LogError
        If a response or Klipper's file cannot be read.
    ParameterError
        If a choice is out of range, an axis is missing, or a swept sine has a gap.
    """
    path, reading, log, pieces = recording.path, recording.reading, recording.log, recording.pieces
    T_s = 1e-3 if reading.T_s is None else reading.T_s
    if reading.kind == "klipper":
        return identify_resonance(read_klipper(path), _klipper_axis(reading.axis), T_s=T_s)
    if log is not None and recording.is_operation:
        return identify_operation(
            pieces, log.T_s, unit_gain=choices.unit_gain, unit=log.unit, shown=log.shown, progress=progress
        )
    if log is None:
        frequency, response, std = read_response(path)
    else:
        if len(pieces) > 1:
            raise ParameterError(f"{path}: a swept sine must have no gap, got {len(pieces)} pieces")
        lines = h1(*pieces[0], log.T_s)
        frequency, response, std = lines.frequency, lines.response, lines.std
    return identify_frequency_response(
        frequency,
        response,
        std=std,
        n_modes=choices.modes,
        unit_gain=bool(choices.unit_gain),
        T_s=T_s if log is None else log.T_s,
        input_hold=choices.hold,
        dead_time=choices.dead_time,
        sampled=log is not None,
        progress=progress,
    )


def _found_kind(path: Path, reading: FileReading) -> str:
    if is_klipper(path):
        return "klipper"
    return "response" if not reading.columns and has_response(path) else "operation"


def _klipper_axis(axis: str | None) -> str:
    if axis is None or axis not in ("x", "y", "z"):
        raise ParameterError(f"Klipper's file holds three axes: say which was shaken, --axis x, y or z, got {axis!r}")
    return axis
