"""Command ``hybridsep live``."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .options import (
    PREDICTOR_ENTRIES,
    JsonOption,
    MachineOption,
    ReadingOptions,
    WeightsOption,
    takes_parameters,
    takes_reading,
)

if TYPE_CHECKING:
    from ..intake.finding import Finding
    from ..logs.units import Shown

__all__ = ["live"]


@takes_reading
@takes_parameters(PREDICTOR_ENTRIES)
def live(
    source: Annotated[
        str,
        typer.Argument(
            help="A log; udp:[HOST:]PORT, JSON messages at this machine alone unless HOST is another of its addresses; "
            "- for CSV lines on standard input; mqtt://HOST[:PORT]/TOPIC or mqtts://… (extra live).",
        ),
    ],
    machine: MachineOption,
    speed: Annotated[
        float | None,
        typer.Option(help="Speed of a log, times the recorded one; 0 for as fast as possible; 1 if left out."),
    ] = None,
    page: Annotated[bool, typer.Option(help="Serve a page to this machine's browser (extra live).")] = True,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the page; a free one if left out.")] = 0,
    plotjuggler: Annotated[
        str | None, typer.Option(help="HOST:PORT of PlotJuggler's UDP server, which gets each sample as JSON.")
    ] = None,
    predictor: Annotated[
        Path | None, typer.Option(help="Predictor FMU; the native one, built from the machine, if left out.")
    ] = None,
    weights: WeightsOption = None,
    cold: Annotated[
        bool, typer.Option("--cold", help="Start without the trained.state that lies beside the machine file.")
    ] = False,
    *,
    reading: ReadingOptions,
    parameters: dict[str, Any],
    as_json: JsonOption = False,
) -> None:
    """Show the native predictor on samples as they come.

    For looking and for acceptance on the machine, not a controller: nothing goes back to the drive. Ctrl-C ends it.
    """
    from contextlib import ExitStack

    from ..cosim.fmus import FmuController
    from ..cosim.pairing import check_predictor, values_to_build
    from ..fmi.builds import build_here
    from ..live.first_seconds import FirstSeconds
    from ..live.open_source import open_source
    from ..live.page import Page
    from ..live.plotjuggler import PlotJuggler
    from ..live.run import LiveRun, Sink, run_live
    from ..logs.units import shown_of
    from ..machines.machine import load_machine
    from .failures import errors_console
    from .log_intake import reading_of

    axis = load_machine(machine)
    if weights is None and predictor is None and not cold:
        weights = _trained(machine, parameters)
    check_predictor(axis, predictor, weights)
    values = values_to_build(axis, "HybridPredictor", parameters) if predictor is None else parameters
    how = reading_of(axis, reading, may_miss=axis.changed("predictor", parameters).predictor_settings.trust)
    run = LiveRun({}, 0)

    def say(findings: Sequence[Finding]) -> None:
        for one in findings:
            errors_console.print(f"the first seconds: {one}", soft_wrap=True)

    def watch(T_s: float, Np: int) -> FirstSeconds:
        return FirstSeconds(axis.unit, T_s, Np, stated=how["unit"] is not None, say=say)

    with ExitStack() as stack:
        sinks: list[Sink] = [] if plotjuggler is None else [PlotJuggler(plotjuggler, axis.name)]
        origin = stack.enter_context(open_source(source, axis, how, speed))
        shown = shown_of(how["unit"] or origin.file_unit, axis.unit)
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        ahead = predictor or build_here(axis, "HybridPredictor", folder, "native", weights=weights)
        served = stack.enter_context(Page(axis.title, shown, port)) if page else None
        try:
            if served is not None:
                sinks.append(served)
                errors_console.print(f"page: {served.address}", soft_wrap=True)
            controller = FmuController(ahead, values, 0.0)
            run = run_live(origin, controller, sinks, ends=(KeyboardInterrupt,), watch=watch)
            _print_run(run.status, shown, as_json=as_json)
            if served is not None and served.n_dropped:
                errors_console.print(f"note: the page was too slow for {served.n_dropped} samples")
            if served is not None and not run.interrupted:
                errors_console.print("the source has ended; Ctrl-C ends the page")
                served.wait()
        except KeyboardInterrupt:  # before the first sample, or while the page is looked at
            if not run.status:
                _print_run({}, shown, as_json=as_json)


def _trained(machine: str, parameters: Mapping[str, Any]) -> Path | None:
    """Return the state that fit left beside a machine file, None if there is none; say which start it is."""
    from .failures import errors_console

    state = Path(machine).with_name("trained.state")
    if not (Path(machine).is_file() and state.is_file()):
        return None
    if parameters:
        errors_console.print(f"note: starts cold, as {state} is of other parameters than those given", soft_wrap=True)
        return None
    errors_console.print(f"note: starts warm, from {state} (--cold starts without)", soft_wrap=True)
    return state


def _print_run(status: Mapping[str, Any], shown: Shown, *, as_json: bool) -> None:
    """Print counts, errors and step times of a run."""
    from .tables import console, print_json

    if as_json:
        print_json(status)
        return
    if not status:
        console.print("no sample came")
        return
    counts = ", ".join(f"{status[f'n_{name}']} {name}" for name in ("missing", "rejected", "repeated", "late"))
    lines = [f"{status['n_samples']} samples, {counts}"]
    names = {"rms_pb": "physics", "rms_hold": "hold", "rms_h": "hybrid"}
    errors = [f"{words} {shown.words(status[name])}" for name, words in names.items() if name in status]
    if errors:
        lines.append(f"RMS error since the warm-up: {', '.join(errors)}")
    times = {"step_p50": "median", "step_p99": "99 %", "step_max": "longest"}
    steps = [f"{words} {float(f'{1e6 * status[name]:.3g}'):g} µs" for name, words in times.items()]
    lines.append(f"step: {', '.join(steps)}")
    console.print("\n".join(lines))
