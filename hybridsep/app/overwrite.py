"""Checks of output files: an input is never overwritten, an existing file only by one of its kind unless forced."""

from __future__ import annotations

import hashlib
import os
import zipfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from ..base.errors import ParameterError
from ..cosim.run import COMPENSATOR, PREDICTOR
from ..logs.example import EXAMPLE, HEAD

__all__ = [
    "BATCHES",
    "BATCH_COLUMNS",
    "BY_ENDING",
    "EXAMPLE_LOG",
    "FIGURE",
    "FIT_FILES",
    "FMU",
    "MACHINE",
    "REPORT",
    "RUN",
    "Kind",
    "Output",
    "check_outputs",
    "fit_comment",
]

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
    """

    name: str
    recognises: Callable[[Path], bool]


@dataclass(frozen=True)
class Output:
    """A file that will be written.

    Attributes
    ----------
    option : str
        Option that named it.
    path : Path
    kind : Kind
    """

    option: str
    path: Path
    kind: Kind


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


def _contains(*parts: bytes) -> Callable[[Path], bool]:
    """Return a test for a small file with one of the parts in it."""

    def recognises(path: Path) -> bool:
        with path.open("rb") as file:
            content = file.read(100_000)
        return any(part in content for part in parts)

    return recognises


def _is_our_fmu(path: Path) -> bool:
    if not zipfile.is_zipfile(path) or "modelDescription.xml" not in _members(path):
        return False
    with zipfile.ZipFile(path) as archive:
        return b'generationTool="hybridsep ' in archive.read("modelDescription.xml")


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
RUN = Kind("result of hybridsep cosim", _has_columns(PREDICTOR.columns, COMPENSATOR.columns))
MACHINE = Kind("machine file", _contains(b"\n[physics", b"\n[[physics"))
FIGURE = Kind("PNG", _begins_with(b"\x89PNG\r\n\x1a\n"))
VECTOR_FIGURE = Kind("figure of hybridsep", _is_our_drawing)
FMU = Kind("FMU of hybridsep", _is_our_fmu)
EXAMPLE_LOG = Kind("example log of hybridsep", _is_example)
STATE = Kind("saved predictor", _begins_with(b"HSEP"))
_FIT_MARK = "Identified by hybridsep fit"
"""How the comment begins that a machine file of ``hybridsep fit`` begins with."""


def fit_comment(text: str) -> str:
    """Return the first line of the machine file ``text`` of ``hybridsep fit``: its mark and the rest's checksum."""
    return f"# {_FIT_MARK}; checksum {hashlib.sha256(text.encode()).hexdigest()[:12]}\n"


def _is_unedited_fit(path: Path) -> bool:
    """Return whether a machine file is as ``hybridsep fit`` wrote it; one that was edited since is the user's."""
    first, _, rest = path.read_text(encoding="utf-8").partition("\n")
    return f"{first}\n" == fit_comment(rest)


FITTED = Kind("unedited machine file of hybridsep fit", _is_unedited_fit)
STAGES = Kind("result of hybridsep fit", _begins_with(b'{\n  "hybridsep": "'))
REPORT = Kind("report of hybridsep", _begins_with(b"<!DOCTYPE html>\n<!-- report of hybridsep -->"))
SUMMARY = Kind("summary of hybridsep demo", _begins_with(b'{\n  "staircase": {'))

BY_ENDING = {
    ".csv": RUN,
    ".npz": RUN,
    ".png": FIGURE,
    ".pdf": VECTOR_FIGURE,
    ".svg": VECTOR_FIGURE,
    ".fmu": FMU,
    ".state": STATE,
    ".json": SUMMARY,
}
"""Kinds of the files that the library names itself."""

FIT_FILES = {".toml": FITTED, ".json": STAGES, ".html": REPORT, ".fmu": FMU, ".state": STATE}
"""Kinds of the files of ``hybridsep fit``."""


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
    known = list(outputs)
    for output in known:
        path = output.path
        for what, other in taken:
            if _same_file(path, other):
                raise ParameterError(f"{output.option} {path} is the same file as {what}; choose another name")
        taken.append((f"{output.option} {path}", path))
        if path.is_dir():
            raise ParameterError(f"{output.option} must be a file, got the folder {path}")
        if path.is_file() and path.stat().st_size and not force and not _recognised(output):
            raise ParameterError(
                f"{output.option} {path} exists and is no {output.kind.name}; choose another name, or overwrite it "
                "with --force"
            )
    for output in known:
        try:
            output.path.parent.mkdir(parents=True, exist_ok=True)
        except (FileExistsError, NotADirectoryError) as error:
            raise ParameterError(
                f"{output.option} {output.path}: a file has the name of the folder {output.path.parent}; choose another"
            ) from error
        folder = Path(os.path.realpath(output.path)).parent
        if not os.access(folder, os.W_OK):
            raise ParameterError(f"{output.option} {output.path}: no file can be written in {folder}")


def _same_file(one: Path, other: Path) -> bool:
    """Return whether two names lead to one file, by symbolic and hard links too, whether it exists yet or not."""
    try:
        return one.samefile(other)
    except OSError:
        return os.path.realpath(one) == os.path.realpath(other)


def _recognised(output: Output) -> bool:
    try:
        return output.kind.recognises(output.path)
    except (zipfile.BadZipFile, OSError, ValueError, KeyError, RuntimeError, NotImplementedError):
        return False  # damaged or unreadable: not known to be ours
