"""Command ``hybridsep live``."""

import json
import math
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from hybridsep.logs.checks import Finding
    from hybridsep.logs.units import DisplayUnits

__all__ = ["live"]


def live(
    source: Annotated[
        str,
        typer.Argument(
            help="A log; udp:[HOST:]PORT, JSON messages at this machine only unless HOST is another of its addresses; "
            "- for lines of CSV or JSON on standard input."
        ),
    ],
    machine: Annotated[
        str, typer.Option("--machine", "-m", help="Machine file (.toml), or the name of one of the library's.")
    ],
    speed: Annotated[
        float | None,
        typer.Option(help="Speed of a log, times the recorded one; 0 for as fast as possible; 1 if left out."),
    ] = None,
    page: Annotated[bool, typer.Option(help="Serve a page to this machine's browser.")] = True,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the page; a free one if left out.")] = 0,
    plotjuggler: Annotated[
        str | None, typer.Option(help="HOST:PORT of PlotJuggler's UDP server, which gets each sample as JSON.")
    ] = None,
    predictor: Annotated[
        Path | None, typer.Option(help="Predictor FMU; the native one, built from the machine, if left out.")
    ] = None,
    weights: Annotated[
        Path | None, typer.Option(help="State of a trained predictor that the one that is built starts warm with.")
    ] = None,
    cold: Annotated[
        bool, typer.Option("--cold", help="Start without the trained.state that lies beside the machine file.")
    ] = False,
    unit: Annotated[str | None, typer.Option(help="Unit of the positions, where their names do not say it.")] = None,
    T_s: Annotated[
        float | None, typer.Option("--T_s", help="Sampling interval [s], for a log without a time column.")
    ] = None,
    axis: Annotated[str | None, typer.Option(help="Axis of a log that holds several.")] = None,
    t: Annotated[str | None, typer.Option("--t", help="Name of the time.")] = None,
    x_d: Annotated[str | None, typer.Option("--x_d", help="Name of the commanded position.")] = None,
    x: Annotated[str | None, typer.Option("--x", help="Name of the measured position.")] = None,
    error: Annotated[
        str | None, typer.Option("--error", help="Name of the error, commanded − measured; -NAME: the other way.")
    ] = None,
    *,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON, and nothing else.")] = False,
) -> None:
    """Show the native predictor on samples as they come.

    For looking and for acceptance on the machine, not a controller: nothing goes back to the drive. Ctrl-C ends it.
    """
    from contextlib import ExitStack

    from hybridsep import build_fmu, fmu_names, load_machine
    from hybridsep.base.errors import ParameterError
    from hybridsep.cosim.loop import FmuController, check_controller
    from hybridsep.cosim.run import PREDICTOR
    from hybridsep.logs.units import shown_of

    from .first_seconds import FirstSeconds
    from .page import Page
    from .plotjuggler import PlotJuggler
    from .run import LiveRun, Sink, run_live
    from .sources import Given, open_source

    own = load_machine(machine)
    if weights is None and predictor is None and not cold:
        state = Path(machine).with_name("trained.state")
        if Path(machine).is_file() and state.is_file():
            weights = state
            _say(f"note: starts warm, from {state} (--cold starts without)")
    if predictor is not None:
        if weights is not None:
            raise ParameterError("--weights go into an FMU that is built here; leave out --predictor")
        check_controller(predictor, PREDICTOR)
    columns = {role: column for role, column in (("t", t), ("x_d", x_d), ("x", x), ("error", error)) if column}
    given = Given(columns, unit, T_s, axis, speed)
    run = LiveRun({}, 0)

    def say(findings: "Sequence[Finding]") -> None:
        for one in findings:
            _say(f"the first seconds: {one}")

    def watch(T_s: float, Np: int) -> FirstSeconds:
        return FirstSeconds(own.unit, T_s, Np, stated=unit is not None or own.log.unit is not None, say=say)

    with ExitStack() as stack:
        sinks: list[Sink] = [] if plotjuggler is None else [PlotJuggler(plotjuggler, own.name)]
        origin = stack.enter_context(open_source(source, own, given, _say))
        shown = shown_of(unit or own.log.unit or origin.file_unit, own.unit)
        if predictor is None:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            (name,) = [name for name, model in fmu_names(own, "native").items() if model == "HybridPredictor"]
            predictor = build_fmu(own, name, folder, "native", targets=("host",), weights=weights)
        served = stack.enter_context(Page(own.title, shown, port)) if page else None
        try:
            if served is not None:
                sinks.append(served)
                _say(f"page: {served.address}")
            run = run_live(origin, FmuController(predictor, {}), sinks, watch=watch)
            _print_run(run.status, shown, as_json=as_json)
            if served is not None and served.n_dropped:
                _say(f"note: the page was too slow for {served.n_dropped} samples")
            if served is not None and not run.interrupted:
                _say("the source has ended; Ctrl-C ends the page")
                served.wait()
        except KeyboardInterrupt:  # before the first sample, or while the page is looked at
            if not run.status:
                _print_run({}, shown, as_json=as_json)


def _say(words: str) -> None:
    typer.echo(words, err=True)


def _print_run(status: Mapping[str, Any], shown: "DisplayUnits", *, as_json: bool) -> None:
    """Print counts, errors and step times of a run."""
    if as_json:
        finite = {name: value if math.isfinite(value) else None for name, value in status.items()}
        typer.echo(json.dumps(finite, indent=2))
        return
    if not status:
        typer.echo("no sample came")
        return
    names = ("missing", "rejected", "repeated", "late", "malformed")
    counts = ", ".join(f"{status[f'n_{name}']} {name}" for name in names)
    typer.echo(f"{status['n_samples']} samples, {counts}")
    predictions = {"rms_pb": "physics", "rms_hold": "hold", "rms_h": "hybrid"}
    errors = [f"{words} {shown.words(status[name])}" for name, words in predictions.items() if name in status]
    if errors:
        typer.echo(f"RMS error since the warm-up: {', '.join(errors)}")
    times = {"step_p50": "median", "step_p99": "99 %", "step_max": "longest"}
    steps = [f"{words} {float(f'{1e6 * status[name]:.3g}'):g} µs" for name, words in times.items()]
    typer.echo(f"step: {', '.join(steps)}")
