"""Files that a command will write, checked before its work: no input and no file of the user's is overwritten."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path

from ..base.errors import ParameterError, brief

__all__ = ["FIGURES", "RUNS", "Output", "check_outputs", "keep_written", "written_before"]

FIGURES = (".png", ".pdf", ".svg")
RUNS = (".csv", ".npz")
"""Endings of figures and of runs."""

Output = tuple[str, Path | None, tuple[str, ...]]
"""Option that names a file, the file where it is given, and the endings that it may have; any where there are none."""

_WRITTEN = "written"
"""Entry of ``fit.json``: the logs of the fit, and the hash of each file."""


def check_outputs(
    outputs: Iterable[Output],
    inputs: Mapping[str, str | Path | None],
    *,
    force: bool = False,
    ours: Collection[Path] = (),
) -> None:
    """Check that files can be written where they will be.

    Parameters
    ----------
    outputs : iterable of Output
    inputs : mapping
        Role of a file that is read → its path; None if it is not given.
    force : bool
        Whether existing files may be overwritten; an input never is.
    ours : collection of Path
        Existing files that may be overwritten without ``force``.

    Raises
    ------
    ParameterError
        If an output is an input, by whatever name, or another output; a folder; an existing file; of another ending; or
        cannot be written for its name or its folder.
    """
    taken = [(f"the {what} {path}", Path(path)) for what, path in inputs.items() if path is not None]
    for _, given in taken:
        _check_name("the name of a file that is read", given)
    for option, path, endings in outputs:
        if path is None:
            continue
        if endings and path.suffix.lower() not in endings:
            raise ParameterError(f"{option} must end in {' or '.join(endings)}, got {path.name!r}")
        _check_name(option, path)
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


def _check_name(option: str, path: Path) -> None:
    """Raise ParameterError if a path cannot be a file's, or not be written into a text."""
    try:
        str(path).encode()
        path.lstat()
    except UnicodeEncodeError as error:
        raise ParameterError(
            f"{option} must be in UTF-8, got {brief(str(path))}; rename the file or the folder"
        ) from error
    except (FileNotFoundError, NotADirectoryError):
        return
    except OSError as error:
        raise ParameterError(f"{option} {brief(str(path))}: {error.strerror}; choose a shorter name") from error


def _same_file(one: Path, other: Path) -> bool:
    """Return whether two names lead to one file, by symbolic and hard links too, whether it exists yet or not."""
    try:
        return one.samefile(other)
    except OSError:
        return os.path.realpath(one) == os.path.realpath(other)


def written_before(results: Path, logs: Sequence[Path]) -> set[Path]:
    """Return the files beside a ``fit.json`` that the fit of the same logs wrote, and that nobody has edited since."""
    try:
        written = json.loads(results.read_bytes())[_WRITTEN]
        same = written["logs"] == _absolute(logs)
        hashes = {results.with_name(name): str(known) for name, known in written["files"].items()}
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return set()
    return (
        {results, *(path for path, known in hashes.items() if path.is_file() and _hash(path) == known)}
        if same
        else set()
    )


def keep_written(results: Path, logs: Sequence[Path], files: Iterable[Path]) -> None:
    """Add to a ``fit.json`` which logs it is of, and the hashes of the files that were written beside it."""
    from ..base.output import written_text

    found = json.loads(results.read_bytes())
    hashes = {path.name: _hash(path) for path in files if path != results}
    with written_text(results) as file:
        file.write(json.dumps({**found, _WRITTEN: {"logs": _absolute(logs), "files": hashes}}, indent=2) + "\n")


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _absolute(logs: Sequence[Path]) -> list[str]:
    return [os.path.realpath(log) for log in logs]
