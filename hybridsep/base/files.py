"""Files: written whole or not at all, and where this installation's are.

A file is written beside its target, flushed to the disk, and moved over it: the target is unchanged until the last byte
is on the disk, so that a full disk, an exception, Ctrl-C or the end of the process loses the new file only. A killed
process leaves ``.hybridsep-….tmp`` in the target's folder.
"""

import errno
import hashlib
import math
import os
import stat
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import IO, Any

from .errors import check_kind

DEFAULT_MACHINE = "spring_mass_damper"  # machine file of the paper's staircase; its FMUs have no suffix
COMMANDS = "commands.csv"  # file that ``hybridsep fit`` writes beside a machine file: commands of the log to try with

_PACKAGE = Path(__file__).resolve().parents[1]


def data_folder(name: str) -> Path:
    """Return the folder ``fmu_src/…`` or ``models``: inside the package in a wheel, beside it in a checkout."""
    installed = _PACKAGE / "_data" / name
    return installed if installed.is_dir() else _PACKAGE.parent / name


def as_path(path: str | os.PathLike[str], name: str = "path") -> Path:
    """Return a path; ParameterError, with its name, if it is none."""
    check_kind(str | os.PathLike, **{name: path})
    return Path(path)


@contextmanager
def atomic_open(path: str | Path) -> Iterator[IO[bytes]]:
    """Open a binary file that replaces ``path`` when the block ends without an exception; its folder is made.

    A symbolic link is followed, the old file's permissions are kept; other hard links keep the old content. A device or
    a pipe cannot be replaced and is written directly.

    OSError with ``path`` as its file name, if it is a folder or write-protected or cannot be written; an old file is
    unchanged.
    """
    target = Path(os.path.realpath(as_path(path)))
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_name(f".hybridsep-{uuid.uuid4().hex}.tmp")
    try:
        with named_errors(path, part):
            before = Path(path).stat() if Path(path).exists() else None
            if before is not None and not os.access(path, os.W_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
            if before is not None and not stat.S_ISREG(before.st_mode):
                with Path(path).open("wb") as device:
                    yield device
                return
            with part.open("xb") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            if before is not None:
                part.chmod(stat.S_IMODE(before.st_mode))
            part.replace(target)
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def named_errors(path: str | Path, part: str | Path | None = None) -> Iterator[None]:
    """Add the file name to an OSError that has none, as from a write to a full disk, or that of a ``part``."""
    try:
        yield
    except OSError as error:
        if error.filename is not None and str(error.filename) != str(part):
            raise
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error


def write_whole(path: str | Path, content: bytes | str) -> None:
    """Write a file of bytes, or of UTF-8 text with its line ends, as :func:`atomic_open` does."""
    with atomic_open(path) as file:
        file.write(content.encode() if isinstance(content, str) else content)


def plain(value: Any) -> Any:
    """Return records as plain values for JSON: fields by their names, None for a figure that is not finite."""
    if is_dataclass(value):
        return {one.name: plain(getattr(value, one.name)) for one in fields(value)}
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def sha256_of(path: Path) -> str:
    """Return the hash of a file's content, ``"unknown"`` where it is none that can be read again, as a pipe."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "unknown"
