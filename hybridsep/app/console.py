"""What commands print and write: consoles, progress, tables or JSON; and the check of files before the work."""

import json
import os
import shlex
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

import typer
from rich import box
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from ..base.errors import ParameterError, brief
from ..base.files import plain
from ..base.metrics import rms_ratio, shown_figure

if TYPE_CHECKING:
    from ..cosim.run import Run
    from ..fitting.advice import Judged
    from ..logs.units import DisplayUnits
    from ..machines.machine import Machine


class _WholeLines(Console):
    """Console that breaks no line of text where it is no terminal: what reads it may look for one."""

    def print(self, *objects: Any, **options: Any) -> None:
        if not self.is_terminal and all(isinstance(one, str) for one in objects):
            options.setdefault("soft_wrap", True)
        super().print(*objects, **options)


errors_console = Console(stderr=True, emoji=False, markup=False, highlight=False)
console = _WholeLines(emoji=False, markup=False, highlight=False)
"""Standard output. Units and names of files may have brackets, which are text there, as in the tables."""


def print_judged(judged: "Judged", title: str, verdict: str) -> None:
    """Print the errors of a replay, what they mean, and what the controller says of itself."""
    from ..fitting.advice import OF_ITSELF

    print_rows(title, *judged.figures())
    console.print(verdict)
    if said := judged.of_the_controller():
        console.print("\n  ".join((f"{OF_ITSELF}:", *said)))


def print_rows(
    title: str, head: Sequence[str], rows: Sequence[Sequence[str]], *, whole_names: bool = False, **look: Any
) -> None:
    """Print a table of figures, with the names of its rows first; ``look``: as for rich's ``Table``."""
    table = Table(title=title, box=box.SIMPLE, pad_edge=False, **look)
    table.add_column(head[0], no_wrap=whole_names)
    for column in head[1:]:
        table.add_column(column, justify="right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    console.print(table)


def print_run(
    run: "Run", as_json: bool, title: str, unit: str, shown: "DisplayUnits", limits: Mapping[str, Any] | None = None
) -> None:
    """Print the figures of a run of positions in ``unit``, m or rad; of ``limits`` what binds the command."""
    from ..cosim.run import PREDICTOR
    from ..evaluate.verdict import verdict_of

    summary = replace(run, unit=unit).summary()
    if as_json:
        print_json({**summary, **({"verdict": str(verdict_of(run))} if run.kind == PREDICTOR else limits or {})})
        return
    if run.kind != PREDICTOR:
        _print_tracking(summary, title, unit, shown, limits)
        return
    scale, name = shown.error(1e-6 * summary[f"rms_pb_u{unit}"])
    rows = []
    for label, size in (("RMS", "rms"), ("largest", "max")):
        figures = [1e-6 * scale * summary[f"{size}_{by}_u{unit}"] for by in ("pb", "hold", "h")]
        rows.append([label, *map(shown_figure, (*figures, rms_ratio(figures[2], figures[1])))])
    title = f"{title}: prediction error in {name} against the measured position"
    print_rows(title, ["", "physics", "hold", "hybrid", "× hold"], rows)
    console.print(str(verdict_of(run)))


def _print_tracking(
    summary: Mapping[str, float], title: str, unit: str, shown: "DisplayUnits", limits: Mapping[str, Any] | None
) -> None:
    from ..fitting.compensation import binding_words

    factor, position = shown.position
    scale, small = shown.error(1e-6 * summary[f"tracking_rms_u{unit}"])
    rows = [
        [label, *(shown_figure(1e-6 * scale * summary[f"{name}_{quantity}_u{unit}"]) for quantity in ("rms", "max"))]
        for name, label in (
            ("tracking", "tracking error, true position"),
            ("tracking_measured", "tracking error, measured position"),
            ("change", "change of the command"),
        )
    ]
    print_rows(title, ["", f"RMS [{small}]", f"max [{small}]"], rows)
    peaks = [summary[f"peak_{name}"] for name in (f"velocity_{unit}_s", f"acceleration_{unit}_s2", f"jerk_{unit}_s3")]
    console.print(
        f"command to the drive: at most {factor * peaks[0]:.4g} {position}/s, {factor * peaks[1]:.4g} {position}/s², "
        f"{factor * peaks[2]:.4g} {position}/s³\n"
        f"planned by the hybrid {summary['share_hybrid']:.1%}, by the physics model {summary['share_physics']:.1%}, "
        f"not compensated {summary['share_off']:.1%}, tripped {summary['share_tripped']:.1%} of the samples"
    )
    if limits is not None:
        console.print(binding_words(limits["limits_that_bind"]))


def print_contours(figures: Mapping[str, Mapping[str, float]], as_json: bool, title: str) -> None:
    """Print the contour errors of each compensated run."""
    from ..evaluate.figures import CASES

    if as_json:
        print_json(figures)
        return
    rows = [[CASES.get(key, ("FIR inverse",))[0], *map(shown_figure, found.values())] for key, found in figures.items()]
    print_rows(title, ["contour error, µm", "RMS", "99.9 %", "largest"], rows)


def print_written(*paths: Path | None) -> None:
    """Print the names of files that were written, None being none."""
    for path in filter(None, paths):
        console.print(f"wrote {path}", soft_wrap=True)


def print_built(archives: Iterable[Path]) -> None:
    """Print the names and the sizes of archives that were written."""
    for path in archives:
        console.print(f"{path}  {path.stat().st_size / 1024:.0f} KiB", soft_wrap=True)


def print_json(result: Any) -> None:
    """Print JSON; figures that are not finite, such as scores over no sample, are null."""
    typer.echo(json.dumps(plain(result), indent=2))


def print_channels(logs: Sequence[Path], *, as_json: bool) -> None:
    """Print what files hold: names, units, and what is read without a word; LogError if one cannot be read."""
    from ..logs.columns import channels
    from ..logs.formats import open_source

    roles = {"t": "time", "x_d": "commanded", "x": "measured"}
    found = {str(path): channels(open_source(path)) for path in logs}
    if as_json:
        print_json(found)
        return
    for path, listed in found.items():
        table = Table("channel", "unit", "read as", title=path, box=box.SIMPLE)
        for one in listed:
            table.add_row(one.name, one.unit, roles.get(one.role, one.role.replace("_", " ")))
        console.print(table)
        missing = [role for role in ("x_d", "x") if role not in {one.role for one in listed}]
        if missing and not all(one.role for one in listed):
            words = " and ".join(roles[role] for role in missing)
            options = " ".join(f"--{role} NAME" for role in missing)
            said = f"none is read as the {words} position; name it: hybridsep fit {shlex.quote(path)} {options}"
            console.print(said, soft_wrap=True)


def warn_of_estimates(machines: "Iterable[Machine]") -> None:
    """Say on standard error whose limits of the drive are estimated from a log's motion."""
    from ..fitting.limits import LIMITS_WORDS

    for machine in machines:
        if machine.drive_limits is not None and machine.drive_limits.estimated:
            errors_console.print(f"warning: [drive_limits] of {machine.name}: {LIMITS_WORDS}", soft_wrap=True)


# Progress -------------------------------------------------------------------------------------------------------------

_SILENT = 2.0  # time for which no line is printed, s: what is done by then needs no progress
_PAUSE = 5.0  # time without a line after which one says how far the stage is, s


@contextmanager
def progress_bar(quiet: bool) -> Iterator[Callable[[str, float], None]]:
    """Show progress on stderr; yield a function of a message, which names the stage, and the fraction done."""
    if errors_console.is_terminal and not quiet:
        columns = TextColumn("{task.description}", markup=False), BarColumn(), TaskProgressColumn(), TimeElapsedColumn()
        with Progress(*columns, console=errors_console, transient=True) as bar:
            task = bar.add_task("starting", total=1.0)
            yield lambda message, fraction: bar.update(task, description=message, completed=fraction)
        return
    begun, stage, printed = monotonic(), "", 0.0

    def print_line(message: str, fraction: float) -> None:
        """Print where a stage begins, and while it lasts after each pause."""
        nonlocal stage, printed
        now = monotonic()
        if quiet or now - begun < _SILENT or fraction >= 1.0 or (message == stage and now - printed < _PAUSE):
            return
        stage, printed = message, now
        errors_console.print(f"[{fraction:4.0%}] {message}", soft_wrap=True)

    yield print_line


# Files ----------------------------------------------------------------------------------------------------------------

FIGURES = (".png", ".pdf", ".svg")
RUNS = (".csv", ".npz")  # endings of figures and of runs

Output = tuple[str, Path | None, tuple[str, ...]]
"""Option that names a file, the file where it is given, and the endings that it may have; any where there are none."""


def check_outputs(
    outputs: Iterable[Output],
    inputs: Mapping[str, str | Path | None],
    *,
    force: bool = False,
    ours: Collection[Path] = (),
) -> None:
    """Check that files can be written where they will be.

    Existing files are overwritten with ``force``, and ``ours`` without it; ``inputs``, role → path, never.

    ParameterError if an output is an input, by whatever name, or another output; a folder; an existing file; of
    another ending; or cannot be written in its folder.
    """
    taken = [(f"the {what} {path}", Path(path)) for what, path in inputs.items() if path is not None]
    for what, given in taken:
        if not given.name.isprintable():  # it goes into texts
            raise ParameterError(f"{brief(what)} must have a name in UTF-8; rename it")
    for option, path, endings in outputs:
        if path is None:
            continue
        if endings and path.suffix.lower() not in endings:
            raise ParameterError(f"{option} must end in {' or '.join(endings)}, got {path.name!r}")
        for what, other in taken:
            if _same_file(path, other):
                raise ParameterError(f"{option} {path} is the same file as {what}; choose another name")
        taken.append((f"{option} {path}", path))
        if path.is_dir():
            raise ParameterError(f"{option} must be a file, got the folder {path}")
        if path.is_file() and not force and path not in ours:
            raise ParameterError(f"{option} {path} exists; choose another name, or overwrite it with --force")
        folder = next(one for one in Path(os.path.realpath(path)).parents if one.exists())
        if not folder.is_dir():
            raise ParameterError(f"{option} {path}: {folder} is a file, not a folder; choose another")
        if not os.access(folder, os.W_OK):
            raise ParameterError(f"{option} {path}: no file can be written in {folder}")


def _same_file(one: Path, other: Path) -> bool:
    """Return whether two names lead to one file, by symbolic and hard links too, whether it exists yet or not."""
    try:
        return one.samefile(other)
    except OSError:
        return os.path.realpath(one) == os.path.realpath(other)


def written_before(results: Path, logs: Sequence[Path]) -> set[Path]:
    """Return the files beside a ``fit.json`` that the fit of the same logs wrote, and that nobody has edited since."""
    from ..base.files import sha256_of

    try:
        written = json.loads(results.read_bytes())["written"]
        same = set(written["logs"]) == {os.path.realpath(log) for log in logs}
        hashes = {results.with_name(name): known for name, known in written["files"].items()}
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return set()
    return {results, *(path for path, known in hashes.items() if sha256_of(path) == known)} if same else set()
