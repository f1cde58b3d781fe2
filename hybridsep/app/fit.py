"""``fit``, from the log of an axis to its model, FMUs and a report."""

import gc
import math
import shlex
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from ..base.errors import ParameterError
from ..base.settings import PARAMETERS, Cascade, Limits
from . import options

if TYPE_CHECKING:
    from ..fitting.result import Fit

_Parsed = TypeVar("_Parsed")


@options.takes_reading
@options.takes_known
def fit(
    logs: Annotated[list[Path], typer.Argument(help="Recorded logs of one axis: commanded and measured positions.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder for machine file, FMUs and report; named after the log if left out.")
    ] = None,
    Np: Annotated[
        int | None,
        typer.Option("--Np", min=1, help="Samples in a window of the predictor, its look-ahead; 100 ms if left out."),
    ] = None,
    look_ahead: Annotated[
        str | None,
        typer.Option(
            "--look-ahead",
            metavar="TIME",
            help="What the controller has for a compensator, as 60ms; what the drive's model needs if left out.",
        ),
    ] = None,
    p: Annotated[
        str | None,
        typer.Option("--p", metavar="NUMBERS", help="Numbers of lags to choose from, as 5,10,50; its own if left out."),
    ] = None,
    cascade: Annotated[
        str | None,
        typer.Option(
            metavar="GAINS",
            help=f"Gains of the loop in SI, NAME=VALUE with commas, of {', '.join(Cascade.parameters())}: the physics "
            "model is theirs, and the log is compared with it.",
        ),
    ] = None,
    in_position: Annotated[
        float | None,
        typer.Option(
            "--in_position",
            min=0.0,
            help="Window, m or rad, within which a move has settled: the report says how long that takes.",
        ),
    ] = None,
    name: Annotated[str | None, typer.Option(help="Name of the axis; the log's, with --axis, if left out.")] = None,
    *,
    known: dict[str, float],
    reading: options.ReadingOptions,
    list_channels: Annotated[
        bool, typer.Option("--list-channels", help="Print what the log holds, with units, and do nothing else.")
    ] = False,
    force: options.ForceOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """From the log of an axis to its model, FMUs and a report."""
    from ..logs.log import read_log
    from ..machines.machine import checked_name, machine_name
    from .console import check_outputs, print_channels, written_before
    from .logs import different_logs, show

    if list_channels:
        print_channels(logs, as_json=as_json)
        return
    machine = checked_name(name) if name else machine_name(logs[0], reading.axis)
    inputs: dict[str, str | Path | None] = {f"log {path.name}": path for path in logs}
    check_outputs((), inputs)
    numbers = _parsed(p, _numbers, "--p must be whole numbers with commas") or []
    lags = [PARAMETERS["p"].checked(one, "--p") for one in numbers]
    ahead = _parsed(look_ahead, _seconds, "--look-ahead must be a time with its unit, such as 60ms or 0.06s")
    gains = _parsed(cascade, _gains, "--cascade must be NAME=VALUE with commas, each a number")
    used = different_logs([read_log(path, **reading.arguments()) for path in logs])
    # What computes takes seconds to import: a log that cannot be read is said before
    from ..fitting.fit import fit as fit_logs
    from ..fitting.limits import drive_limits
    from ..fitting.result import fit_files
    from ..logs.checks import findings_table
    from .console import console, print_json, progress_bar

    gc.freeze()  # what is imported stays: to look through it again and again takes a twentieth of the time
    folder = out or Path(machine)
    files = fit_files(folder, machine, compensator=bool(drive_limits(known)))
    outputs = [("--out", path, ()) for path in files.values()]
    check_outputs(outputs, inputs, force=force, ours=written_before(files["results"], logs))
    for log in used:
        show((f"{log.path.name}: {remark}" for remark in log.remarks), ())
    with progress_bar(as_json) as advance:
        given: dict[str, Any] = {"Np": Np, "p": lags, "look_ahead": ahead, "cascade": gains, "name": machine, **known}
        result = fit_logs(used, progress=lambda words, done: advance(words, 0.87 * done), **given)
        result.build(folder, in_position=in_position, progress=lambda words, done: advance(words, 0.87 + 0.13 * done))
    if as_json:
        listed = {log_name: findings_table(one) for log_name, one in result.findings.items()}
        written = {what: str(path) for what, path in files.items()}
        print_json({**result.results(), "advice": result.advice, "findings": listed, "files": written})
        return
    _print_fit(result)
    console.print(f"\n{result.advice}")
    console.print("\n".join(f"{what}: {path}" for what, path in files.items()), soft_wrap=True)
    console.print("\n".join(_next_steps(result, files)), soft_wrap=True, highlight=False)


def _parsed(text: str | None, parse: Callable[[str], _Parsed], must: str) -> _Parsed | None:
    """Return what an option's text says, None without one; ParameterError if it cannot be parsed."""
    try:
        return None if text is None else parse(text)
    except ValueError:
        raise ParameterError(f"{must}, got {text!r}") from None


def _numbers(text: str) -> list[int]:
    return list(map(int, text.split(",")))


def _gains(text: str) -> dict[str, float]:
    return {gain.strip(): float(value) for gain, _, value in (one.partition("=") for one in text.split(","))}


def _seconds(text: str) -> float:
    seconds = 1e-3 * float(text[:-2]) if text.endswith("ms") else float(text[:-1] if text.endswith("s") else "")
    if not 0.0 < seconds < math.inf:
        raise ValueError(text)
    return seconds


def _print_fit(found: "Fit") -> None:
    """Print what was read and what the checks found, what was identified and how it was judged."""
    import numpy as np

    from ..fitting.advice import extent
    from .console import console, print_judged, print_rows

    judged, model, settings = found.judged, found.identification, found.machine.predictor_settings
    factor, position = judged.shown.position
    for log in found.logs:
        travel = float(np.ptp(log.x_d))
        stated = "" if log.unit_stated else f", as the file states no unit of positions: taken as {log.unit} (--unit)"
        console.print(f"{log.path.name}: {extent([log])}, travel {factor * travel:.4g} {position}{stated}")
    for name, of_log in found.findings.items():
        for finding in of_log:
            console.print(f"{name}: {finding}")
    console.print(f"{model.structure}, dead time {model.model.dead_time} samples")
    for line in model.findings:
        console.print(f"  {line}")
    window = f"{1e3 * settings.Np * settings.T_s:.4g} ms"
    console.print(f"Np = {settings.Np} ({window}), p = {settings.p}, q = {settings.q}")
    if found.machine.drive_limits is not None:
        preview = found.machine.compensator_settings.preview or 0
        console.print(f"A compensator looks preview = {preview} ahead ({1e3 * preview * settings.T_s:.4g} ms)")
    print_judged(judged, "Error on held-out samples", str(judged.replay.verdict()))
    for line in found.tracking.lines(judged.shown) if found.tracking else ():
        console.print(line)
    if found.tracking and found.tracking.look_aheads:
        print_rows(*found.tracking.look_aheads.figures(judged.shown))


def _next_steps(found: "Fit", files: Mapping[str, Path]) -> list[str]:
    """Return what to do after a fit that wrote ``files``, as lines to paste."""
    from ..fmi.archive import other_platforms
    from ..fmi.compile import no_native

    file, state = (shlex.quote(str(files[what])) for what in ("machine file", "trained predictor"))
    limits = found.machine.drive_limits
    lines = ["", "Next, to paste:"]
    if found.machine.plant is None:
        lines.append(f"  # no plant to try with: {found.plant.reason}")
    else:
        what, how = "prediction, on the identified model", ""
        if limits is not None:
            # What was learned of the axis helps on a plant that has its disturbances and its offset, and on no other.
            noted = {one.name for of_log in found.findings.values() for one in of_log}
            lacks = "friction and stiffness" if not found.plant.disturbed else "offset" if "offset" in noted else ""
            cold = f", without the log's {lacks} and so without --weights" if lacks else ""
            what, how = f"the compensated axis, on the identified model{cold}", " --compensate hybrid"
            how += "" if lacks else f" --weights {state}"
        lines.append(f"  # {what}: to try with, results are optimistic")
        lines += [f"  hybridsep cosim -m {file} --compensate off"] if limits is not None else []
        lines += [
            f"  hybridsep cosim -m {file}{how}",
            "  # the same as one file for tools that read SSP",
            f"  hybridsep system -m {file}{how}",
        ]
    if limits is not None and limits.estimated:
        names = [(one.name, getattr(limits, entry)) for entry, one in Limits.parameters().items()]
        known = [f"--{name} {value:g}" for name, value in names]
        unit = found.machine.unit
        rates = f"in {unit}/s, {unit}/s² and {unit}/s³"
        factor, own = found.judged.shown.position
        powers = zip(names, ("", "²", "³"), strict=True)
        here = [f"{factor * value:.4g} {own}/s{power}" for (_, value), power in powers]
        lines.append(f"  # a compensator FMU for the drive; the limits are estimates: put in your drive's, {rates}")
        lines += [f"  # (these are {', '.join(here)})"] if own != unit else []
        lines.append(f"  hybridsep {shlex.join(sys.argv[1:])} {' '.join(known)}")
    native = files.get("native FMU")
    if native is None:
        lines += [f"  # no FMUs, {no_native()}; then", f"  hybridsep build -m {file}"]
    elif said := other_platforms(native, files["machine file"], files["trained predictor"]):
        lines += [f"  # {said[0]}", f"  {said[1]}"]
    lines.append("  # your own compensator, sample by sample, in Python: docs/howto/python.md")
    return lines
