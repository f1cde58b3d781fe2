"""Result of a fit: what was found of an axis, as objects of the library, as a page and as files."""

import errno
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.errors import SignalError, check_kind
from ..base.files import COMMANDS, as_path, plain, sha256_of, write_whole
from ..base.metrics import html_table, line_plot
from ..base.parameters import finite
from ..base.signals import Array, as_samples
from ..base.version import __version__
from ..compensate.compensator import SepCompensator
from ..fmi.archive import build_fmu
from ..fmi.compile import no_native
from ..fmi.spec import fmu_name
from ..identify.model import IdentifiedModel
from ..logs.checks import Finding
from ..logs.log import Log
from ..logs.units import DisplayUnits, si_factor
from ..machines.machine import Machine, machine_text
from ..predict.predictor import HybridPredictor
from ..predict.window import Prediction
from . import report as sections
from .advice import Judged, advice_on, settling_words
from .compensation import Tracking
from .identified_plant import IdentifiedPlant, commands_to_try
from .lags import Tried
from .limits import LIMITS_WORDS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Progress = Callable[[str, float], object]


@dataclass(frozen=True, repr=False, eq=False)
class Fit:
    """What was found of an axis; it prints as one line, and as a table in a notebook.

    Positions are in m, or rad, but in :meth:`predict`, which takes and gives the unit of the log, :attr:`unit`.

    Attributes
    ----------
    logs : tuple of Log
    findings : mapping
        Log's name → notes of its checks.
    machine : Machine
        Physics model, settings, plant to try with, and limits.
    identification : IdentifiedModel
    choice : tuple of Tried
        Settings that were tried, the default first.
    judged : Judged
        Replay of the logs; its test samples are held out from the physics model and from the choice.
    plant : IdentifiedPlant
    tracking : Tracking, optional
        Tracking errors to be expected; None without limits of the drive.
    trained : bytes
        The predictor, saved after the logs; with limits of the drive as a compensator begins best.
    """

    logs: tuple[Log, ...]
    findings: Mapping[str, Sequence[Finding]]
    machine: Machine
    identification: IdentifiedModel
    choice: tuple[Tried, ...]
    judged: Judged
    plant: IdentifiedPlant
    tracking: Tracking | None
    trained: bytes

    def __repr__(self) -> str:
        (scale, unit), best = self.judged.unit, self.judged.replay.best()
        hybrid = self.judged.replay.scored()[-1]
        errors = f"hybrid {scale * hybrid.rms:.3g} {unit} RMS, {best.name} {scale * best.rms:.3g} {unit}"
        notes = dict.fromkeys(one.name for found in self.findings.values() for one in found)
        said = f"; findings: {', '.join(notes)}" if notes else ""
        return f"Fit({self.machine.name}: Np = {self.judged.replay.Np}, positions in {self.unit}, {errors}{said})"

    def _repr_html_(self) -> str:
        scale, unit = self.judged.unit
        errors = {f"{one.name}, RMS [{unit}]": scale * one.rms for one in self.judged.replay.scored()}
        return html_table(f"{self.machine.name}, {self.identification.structure}: {self.advice}", errors)

    @property
    def unit(self) -> str:
        """Unit of the positions that :meth:`predict` takes and gives, that of the first log, such as ``"mm"``."""
        return self.logs[0].file_unit or self.machine.unit

    @property
    def advice(self) -> str:
        """What to do, in words."""
        return advice_on(self.judged)

    def predictor(self) -> HybridPredictor:
        """Return the trained predictor at the beginning of a run."""
        predictor = HybridPredictor.from_bytes(self.trained)
        predictor.restart()
        return predictor

    def compensator(self, compensate: str = "hybrid") -> SepCompensator:
        """Return a compensator that begins with what was learned, within the machine's limits of the drive.

        ``compensate`` is the best model allowed: ``"off"``, ``"physics"`` or ``"hybrid"``.
        """
        settings = replace(self.machine.compensator_settings, compensate=compensate)
        return self.machine.new_compensator(settings, trained=self.predictor())

    def predict(self, x_d: ArrayLike) -> Prediction:
        """Return what is predicted, with what was learned, of a window ``(n,)`` from rest at its first command.

        It has at most ``Np`` commanded positions, in :attr:`unit`, as what is predicted; a quantity may have another.
        SignalError if there are more, or they cannot be used.
        """
        factor, predictor = si_factor(self.unit), self.predictor()
        command = as_samples(x_d, "x_d", factor=factor, T_s=predictor.T_s)
        if len(command) > predictor.Np:
            raise SignalError(f"x_d must have at most Np = {predictor.Np} samples, got {len(command)}")
        found, scale = predictor.predict(command), 1.0 / factor("")
        return replace(found, x_pb=scale * found.x_pb, e_h=scale * found.e_h, x_h_std=scale * found.x_h_std)

    def plot(self) -> "Figure":
        """Return a matplotlib figure of the errors over the held-out samples."""
        scale, unit = self.judged.unit
        errors: Array = scale * self.judged.replay.errors()
        lines = dict(zip(("physics model", "hold", "hybrid"), errors, strict=True))
        t: Array = self.machine.T_s * np.arange(float(errors.shape[1]))
        return line_plot(t, lines, "t [s]", f"error x − x̂ [{unit}]")

    def report(self, path: str | Path, fmus: Sequence[str] = (), *, in_position: float | None = None) -> None:
        """Write the report, one HTML file that needs nothing else, also about FMUs with these names of files.

        With a window ``in_position``, m or rad, it says how long moves take to settle within it, and which are worst.

        OSError if it cannot be written, or ``path`` is a folder.
        """
        if as_path(path).is_dir():
            raise IsADirectoryError(errno.EISDIR, "the report's path must be a file", str(path))
        fmus, judged = [fmus] if isinstance(fmus, str) else fmus, self.judged
        check_kind(Sequence, fmus=fmus)
        report = sections.begun_report(
            *(f"Axis {self.machine.name}: from its log to its FMU", self.logs, judged, "Tested on held-out samples"),
            "The first half of each log trained the physics model and chose the settings; these are the errors of the "
            f"second half.{settling_words(judged.replay)}",
        )
        if in_position is not None:
            sections.write_moves(report, judged, finite(in_position, "in_position", above=0.0))
        sections.write_findings(report, self.logs, self.findings)
        sections.write_identification(report, self.identification, judged)
        sections.write_validation(report, self.identification, judged)
        sections.write_settings(report, self.choice, judged)
        if self.tracking is not None:
            report.heading("Compensation")
            for line in self.tracking.lines(judged.shown):
                report.paragraph(line)
            if self.tracking.look_aheads is not None:
                title, head, rows = self.tracking.look_aheads.figures(judged.shown)
                report.paragraph(f"{title}:")
                report.table(head, rows, words=3)
        if fmus:
            sections.write_use(report, fmus[0], judged.T_s, judged.replay.Np, self.logs[0])
            report.paragraph(f"{' and '.join(fmus)} start trained with the log.")
        report.write(path)

    def build(
        self,
        out: str | Path,
        *,
        fmus: bool = True,
        report: bool = True,
        in_position: float | None = None,
        progress: Progress = lambda _message, _done: None,
    ) -> dict[str, Path]:
        """Write the files of :func:`fit_files` to a folder; return them, by what they are.

        ``fmus`` and ``report`` say whether they are among them; ``in_position`` is the report's; ``progress`` is
        told a message and the fraction done.
        """
        out = as_path(out, "out")
        check_kind(Callable, progress=progress)
        if out.exists() and not out.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, "out must be a folder", str(out))
        files = fit_files(out, self.machine.name, compensator=self.tracking is not None)
        archives = {what: path for what, path in files.items() if path.suffix == ".fmu"}
        for what in [*([] if report else ["report"]), *([] if fmus else archives)]:
            del files[what]
        comments = [self.identification.structure]  # and what is no measurement
        if self.machine.plant is not None:
            comments.append(f"[plant]: {self.plant.words(self.judged.shown)}")
        if self.machine.drive_limits is not None and self.machine.drive_limits.estimated:
            comments.append(f"[drive_limits]: {LIMITS_WORDS}")
        write_whole(files["machine file"], machine_text(self.machine, comments=comments))
        commands = commands_to_try(self.judged.replay.recordings)
        write_commands(files["commands to try"], commands, self.machine.T_s, self.logs[0].shown)
        write_whole(files["trained predictor"], self.trained)
        for i, (what, path) in enumerate(archives.items() if fmus else ()):
            progress(f"build the {what}", i / len(archives))
            build_fmu(self.machine, path.stem, path.parent, weights=files["trained predictor"])
        if report:
            self.report(files["report"], [path.name for path in archives.values() if fmus], in_position=in_position)
        hashes = {path.name: sha256_of(path) for what, path in files.items() if what != "results"}
        written = {"logs": [str(log.path.resolve()) for log in self.logs], "files": hashes}
        results = {"hybridsep": __version__, **self.results(), "written": written}
        write_whole(files["results"], json.dumps(results, indent=2) + "\n")
        progress("done", 1.0)
        return files

    def results(self) -> dict[str, Any]:
        """Return plain values for JSON, as in ``fit.json``: errors in m over the test samples."""
        return {
            "identification": self.identification.summary(),
            "choice": plain(self.choice),
            "plant": plain(self.plant),
            "tracking": plain(self.tracking) or {},
            "judged": plain(self.judged.replay.figures()),
            "controller": plain(self.judged.controller) or {},
        }


def fit_files(out: Path, name: str, *, compensator: bool = False) -> dict[str, Path]:
    """Return the files of a fit of a machine, in their folder, by what they are; FMUs where they can be built."""
    models = {"": "HybridPredictor", **({"compensator ": "SepCompensator"} if compensator else {})}
    archives = {f"native {what}FMU": out / f"{fmu_name(model, name)}.fmu" for what, model in models.items()}
    return {
        "machine file": out / "machine.toml",
        "trained predictor": out / "trained.state",
        "results": out / "fit.json",
        "report": out / "report.html",
        "commands to try": out / COMMANDS,
        **({} if no_native() else archives),
    }


def write_commands(path: Path, x_d: Array, T_s: float, shown: DisplayUnits) -> None:
    """Write commands, m or rad, as a CSV that ``--trajectory`` takes, in the unit in which positions are shown."""
    factor, unit = shown.position
    rows = [f"{k * T_s:.9g},{position!r}\n" for k, position in enumerate((factor * x_d).tolist())]
    write_whole(path, f"# commands of a log, by hybridsep fit, to try with\nt [s],x_d [{unit}]\n{''.join(rows)}")
