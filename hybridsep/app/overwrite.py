"""Checks of output files: an input is never overwritten, an existing file only by one of its kind unless forced.

A machine file is overwritten only as it was written: one that was edited since, or that the user wrote, is the user's.
"""

from __future__ import annotations

import os
import zipfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from ..base.data_files import COMMANDS_HEAD
from ..base.errors import ParameterError
from ..base.new_folders import make_folder
from ..base.zip_files import ZIP_DAMAGE
from ..logs.example import EXAMPLE, HEAD
from ..machines.seal import edited_since, is_as_written

__all__ = [
    "AXIS_HEADER",
    "BATCHES",
    "BATCH_COLUMNS",
    "BY_ENDING",
    "EXAMPLE_LOG",
    "FIGURE",
    "FIGURES",
    "FIT_FILES",
    "FMU",
    "HAL_FILES",
    "MACHINE",
    "PNG",
    "REPORT",
    "RUN",
    "RUNS",
    "STATE",
    "SYSTEM",
    "TWINCAT",
    "Kind",
    "Output",
    "check_outputs",
]

_Answer = TypeVar("_Answer")

BATCH_COLUMNS = ("t", "rms_pb", "rms_hold", "rms_h")
"""Columns of the CSV of ``hybridsep backtest``."""


@dataclass(frozen=True)
class Kind:
    """Kind of files that the command line writes.

    Attributes
    ----------
    name : str
        Name in messages.
    recognises : callable
        Whether an existing file is of that kind.
    changed : callable, optional
        What has happened to an existing file that was of that kind, in words; empty if it never was.
    """

    name: str
    recognises: Callable[[Path], bool]
    changed: Callable[[Path], str] = lambda _path: ""


@dataclass(frozen=True)
class Output:
    """A file that will be written.

    Attributes
    ----------
    option : str
        Option that named it.
    path : Path or None
        None where the option is not given.
    kind : Kind or mapping
        Or kinds by the endings that the file may have.

    Raises
    ------
    ParameterError
        If it has another ending.
    """

    option: str
    path: Path | None
    kind: Kind | Mapping[str, Kind]

    def __post_init__(self) -> None:
        if self.path is not None and not isinstance(self.kind, Kind) and self.path.suffix.lower() not in self.kind:
            raise ParameterError(f"{self.option} must end in {' or '.join(self.kind)}, got {self.path.name!r}")

    def chosen(self, path: Path) -> Kind:
        """Return the kind of the file."""
        return self.kind if isinstance(self.kind, Kind) else self.kind[path.suffix.lower()]


def _begins_with(start: bytes) -> Callable[[Path], bool]:
    def recognises(path: Path) -> bool:
        with path.open("rb") as file:
            return file.read(len(start)) == start

    return recognises


def _has_columns(*tables: tuple[str, ...]) -> Callable[[Path], bool]:
    """Return a test for a CSV or an ``.npz`` with the columns of one of the tables."""
    headers = [",".join(columns).encode() for columns in tables]
    members = [[f"{name}.npy" for name in columns] for columns in tables]

    def recognises(path: Path) -> bool:
        with path.open("rb") as file:
            if file.readline(1000).rstrip(b"\r\n") in headers:
                return True
        return zipfile.is_zipfile(path) and _members(path) in members

    return recognises


def _is_run(path: Path) -> bool:
    from ..cosim.run import COMPENSATOR, PREDICTOR

    return _has_columns(PREDICTOR.columns, COMPENSATOR.columns)(path)


def _is_our_archive(description: str) -> Callable[[Path], bool]:
    def recognises(path: Path) -> bool:
        if not zipfile.is_zipfile(path) or description not in _members(path):
            return False
        with zipfile.ZipFile(path) as archive:
            return b'generationTool="hybridsep ' in archive.read(description)

    return recognises


def _is_example(path: Path) -> bool:
    content = path.read_bytes()
    first = HEAD.splitlines()[0].encode()
    return content.startswith(first) or content == EXAMPLE.read_bytes()


def _is_our_drawing(path: Path) -> bool:
    """Return whether a PDF or SVG names its creator; a PDF may be the user's own paper."""
    content = path.read_bytes()
    named = (b"/Creator (hybridsep)", b"<dc:title>hybridsep</dc:title>")
    return content.startswith((b"%PDF", b"<?xml")) and any(name in content for name in named)


def _members(path: Path) -> list[str]:
    with zipfile.ZipFile(path) as archive:
        return archive.namelist()


BATCHES = Kind("CSV of hybridsep backtest", _has_columns(BATCH_COLUMNS))
RUN = Kind("result of hybridsep cosim", _is_run)
FIGURE = Kind("PNG", _begins_with(b"\x89PNG\r\n\x1a\n"))
VECTOR_FIGURE = Kind("figure of hybridsep", _is_our_drawing)
FMU = Kind("FMU of hybridsep", _is_our_archive("modelDescription.xml"))
SYSTEM = Kind("system of hybridsep", _is_our_archive("SystemStructure.ssd"))
EXAMPLE_LOG = Kind("example log of hybridsep", _is_example)
STATE = Kind("saved predictor", _begins_with(b"HSEP"))

MACHINE = Kind("machine file that hybridsep wrote", is_as_written, edited_since)
COMMANDS_TO_TRY = Kind("commands of hybridsep fit", _begins_with(COMMANDS_HEAD.encode()))
STAGES = Kind("result of hybridsep fit", _begins_with(b'{\n  "hybridsep": "'))
REPORT = Kind("report of hybridsep", _begins_with(b"<!DOCTYPE html>\n<!-- report of hybridsep -->"))
SUMMARY = Kind("summary of hybridsep demo", _begins_with(b'{\n  "staircase": {'))

PNG = {".png": FIGURE}
FIGURES = PNG | {".pdf": VECTOR_FIGURE, ".svg": VECTOR_FIGURE}
RUNS = {".csv": RUN, ".npz": RUN}

BY_ENDING = RUNS | FIGURES | {".fmu": FMU, ".state": STATE, ".json": SUMMARY, ".html": REPORT}
"""Kinds of the files that the library names itself."""

FIT_FILES = {".csv": COMMANDS_TO_TRY, ".toml": MACHINE, ".json": STAGES, ".html": REPORT, ".fmu": FMU, ".state": STATE}
"""Kinds of the files of ``hybridsep fit``."""

TWINCAT = Kind(
    "configuration of hybridsep build", _begins_with(b"<?xml version='1.0' encoding='utf-8'?>\n<CustomConfigurations")
)
AXIS_HEADER = {".h": Kind("header of hybridsep header", _begins_with(b"/* Axis of hybridsep"))}
HAL_FILES = {
    ".bin": Kind("file of hybridsep hal", _begins_with(b"HSEP")),
    ".c": Kind("HAL component of hybridsep", _begins_with(b"/* HAL component for LinuxCNC")),
}
"""Kinds of the files of ``hybridsep hal``."""


def check_outputs(outputs: Iterable[Output], inputs: Mapping[str, str | Path | None], *, force: bool = False) -> None:
    """Make the folders of files that will be written, or raise ParameterError if one may not be written.

    Parameters
    ----------
    outputs : iterable of Output
    inputs : mapping
        Role of a file that is read → its path; None if it is not given.
    force : bool
        Whether an existing file of another kind may be overwritten; an input never is.

    Raises
    ------
    ParameterError
        If an output is an input, by whatever name, or another output; a folder; an existing file of another kind; or in
        a folder that cannot be made or written to.
    """
    taken = [(f"the {what} {path}", Path(path)) for what, path in inputs.items() if path is not None]
    known = [(output.option, output.path, output.chosen(output.path)) for output in outputs if output.path is not None]
    for option, path, kind in known:
        for what, other in taken:
            if _same_file(path, other):
                raise ParameterError(f"{option} {path} is the same file as {what}; choose another name")
        taken.append((f"{option} {path}", path))
        if path.is_dir():
            raise ParameterError(f"{option} must be a file, got the folder {path}")
        if path.is_file() and path.stat().st_size and not force and not _asked(path, kind.recognises, False):
            changed = _asked(path, kind.changed, "")
            raise ParameterError(
                f"{option} {path} exists and {changed or f'is no {kind.name}'}; choose another name, or "
                f"overwrite it{' and lose the edits' if changed else ''} with --force"
            )
    for option, path, _ in known:
        try:
            make_folder(path.parent)
        except (FileExistsError, NotADirectoryError) as error:
            raise ParameterError(
                f"{option} {path}: a file has the name of the folder {path.parent}; choose another"
            ) from error
        folder = Path(os.path.realpath(path)).parent
        if not os.access(folder, os.W_OK):
            raise ParameterError(f"{option} {path}: no file can be written in {folder}")


def _same_file(one: Path, other: Path) -> bool:
    """Return whether two names lead to one file, by symbolic and hard links too, whether it exists yet or not."""
    try:
        return one.samefile(other)
    except OSError:
        return os.path.realpath(one) == os.path.realpath(other)


def _asked(path: Path, question: Callable[[Path], _Answer], otherwise: _Answer) -> _Answer:
    """Return what a kind says of the existing file."""
    try:
        return question(path)
    except ZIP_DAMAGE:
        return otherwise  # damaged or unreadable: not known to be ours
