"""``hybridsep tune``."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..base.files import written_text
from ..base.settings import PredictorSettings
from .options import (
    PREDICTOR_ENTRIES,
    ForceOption,
    JsonOption,
    MachineOption,
    ReadingOptions,
    takes_parameters,
    takes_reading,
)

if TYPE_CHECKING:
    from ..base.parameters import Parameter
    from ..base.signals import Array
    from ..logs.checks import Finding
    from ..logs.units import DisplayUnits
    from ..machines.machine import Machine

__all__ = ["tune"]


@takes_reading
@takes_parameters(PREDICTOR_ENTRIES, ranges=PredictorSettings.TUNED)
def tune(
    logs: Annotated[list[Path], typer.Argument(help="Recorded logs of one axis: commanded and measured positions.")],
    machine: MachineOption,
    *,
    reading: ReadingOptions,
    parameters: dict[str, Any],
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Processes; as many as there are processors if left out.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Machine file to write, with what was chosen.")] = None,
    figure: Annotated[
        Path | None, typer.Option(help="PNG, PDF or SVG with the error over each parameter and over the look-ahead.")
    ] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Rank settings of the predictor by causal replays of logs.

    The look-ahead is the controller's.
    """
    from ..fitting.tuning import n_unjudged, over_windows
    from ..fitting.tuning import tune as tune_on
    from ..machines.machine import load_machine, machine_path
    from .console import FIGURES, check_outputs, console, print_json, print_written, progress_bar
    from .logs import show
    from .tune_table import print_tuning, tuning_summary

    if figure is not None:
        from ..fitting.tuning import tuning_figure

    given = load_machine(machine)
    outputs = (("--out", out, (".toml",)), ("--figure", figure, FIGURES))
    inputs: dict[str, str | Path | None] = {f"log {path}": path for path in logs}
    check_outputs(outputs, {**inputs, "machine file": machine_path(machine)}, force=force)
    changed, values, tried = _tried(given, parameters, writes=out is not None)
    read = _read(logs, given, reading, may_miss=changed.predictor_settings.averaging)
    with progress_bar(as_json) as advance:
        jobs = jobs or os.cpu_count() or 1
        tuning = tune_on(
            *(given.model, read.pieces, tried),
            jobs=jobs,
            progress=lambda done: advance(f"replay {len(tried)} candidates", 0.9 * done),
        )
        chosen = tuning.candidates[tuning.chosen]
        windows = over_windows(
            *(given.model, read.pieces, chosen),
            jobs=jobs,
            progress=lambda done: advance("error over Np", 0.9 + 0.1 * done),
        )
    if figure is not None:
        tuning_figure(tuning, windows, values, given.title, figure)
    Np = changed.predictor_settings.Np
    in_motion = [name for name, one in read.pieces.items() if any(n_unjudged(x_d, Np) for x_d, _ in one)]
    if in_motion and not as_json:
        show([f"{', '.join(in_motion)}: begins in motion, and is ranked without its first window"], ())
    if as_json:
        print_json({**tuning_summary(tuning, windows, values), "findings": read.findings_table()})
    else:
        for line in read.partly:
            console.print(line)
        print_tuning(tuning, windows, values, given.title, read.shown)
    if out is not None:
        _write_machine(changed, chosen, values, read, out)
    if not as_json:
        print_written(out, figure)


@dataclass(frozen=True)
class _Read:
    """Logs by name: their segments, findings, what share of the files is used in words, and the last one's units."""

    pieces: dict[str, list[tuple[Array, Array]]]
    findings: dict[str, tuple[Finding, ...]]
    partly: list[str]
    shown: DisplayUnits

    def findings_table(self) -> dict[str, Any]:
        from ..logs.checks import findings_table

        return {name: findings_table(found) for name, found in self.findings.items()}


def _tried(
    given: Machine, parameters: Mapping[str, Any], *, writes: bool
) -> tuple[Machine, dict[str, tuple[Any, ...]], list[PredictorSettings]]:
    """Return the machine with what is fixed, the values of what is tuned, and the settings that are tried."""
    from ..fitting.choice import with_window
    from ..fitting.tuning import TUNED, candidates, default_values

    ranges = {
        field: _values(parameters[parameter.name], parameter)
        for field, parameter in TUNED.items()
        if parameter.name in parameters
    }
    fixed = {name: value for name, value in parameters.items() if name in ("Np", "t_init", "averaging")}
    fitting = with_window(given.predictor_settings, fixed.get("Np", given.predictor_settings.Np))
    changed = given.changed("predictor", {"p": fitting.p, "q": fitting.q, **fixed})
    values = {**default_values(changed.predictor_settings), **ranges}
    tried = candidates(changed.predictor_settings, values)
    if writes:  # a [compensator] that takes over p and q may not allow the largest
        changed.changed("predictor", {"p": max(one.p for one in tried), "q": max(one.q for one in tried)})
    return changed, values, tried


def _values(text: str, parameter: Parameter) -> tuple[Any, ...]:
    """Return the values of an option, which commas separate, ascending."""
    found = set()
    for part in text.split(","):
        try:
            value: Any = float(part)
        except ValueError:
            value = part  # refused by its name
        found.add(parameter.checked(value, f"--{parameter.name}"))
    return tuple(sorted(found))


def _read(logs: Sequence[Path], given: Machine, reading: ReadingOptions, *, may_miss: bool) -> _Read:
    """Read and check the logs."""
    from ..fitting.advice import partly_used
    from ..logs.units import shown_of
    from .logs import read_checked, reading_of

    how = reading_of(given, reading)
    pieces, findings, partly = {}, {}, []
    for name, path in _named(logs).items():
        log, findings[name] = read_checked(path, how, given, may_miss=may_miss)
        pieces[name] = [(segment.x_d, segment.x_meas) for segment in log.segments()]
        partly += [line] if (line := partly_used(log)) else []
        shown = shown_of(log.file_unit, given.unit)
    return _Read(pieces, findings, partly, shown)


def _write_machine(
    changed: Machine, chosen: PredictorSettings, values: Mapping[str, Sequence[Any]], read: _Read, out: Path
) -> None:
    """Write the machine file with the settings that were chosen."""
    from ..machines.text import machine_text
    from .tune_table import entries

    best = changed.changed("predictor", {"Np": chosen.Np, **entries(chosen, values)})
    comment = f"Settings of [predictor] from hybridsep tune on {', '.join(Path(name).name for name in read.pieces)}."
    with written_text(out) as file:
        file.write(machine_text(best, [comment]))


def _named(logs: Sequence[Path]) -> dict[str, Path]:
    """Return the logs by their files' names, or paths where two have the same name."""
    names = [path.name for path in logs]
    return {name if names.count(name) == 1 else str(path): path for name, path in zip(names, logs, strict=True)}
