"""Atomic file output: written beside the target, flushed to the disk, and moved over it.

The target is unchanged until the last byte is on the disk, so that a full disk, an exception, Ctrl-C or the end of the
process loses the new file only. A killed process leaves ``.hybridsep-….tmp`` in the target's folder, which the next
write there removes: while a process lives, it holds a lock on its own.
"""

from __future__ import annotations

import errno
import io
import os
import re
import stat
import sys
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

if sys.platform != "win32":
    import fcntl

__all__ = ["named_errors", "written_text", "written_whole"]

_PART = re.compile(r"\.hybridsep-[0-9a-f]{32}\.tmp")

_ORPHAN_AGE = 3600.0
"""Time without a write after which a file counts as left behind, where there are no locks (Windows), s."""


@contextmanager
def written_whole(path: str | Path) -> Iterator[IO[bytes]]:
    """Open a binary file that replaces ``path`` when the block ends without an exception; its folder is made.

    A symbolic link is followed. The new file takes over the permissions and, where allowed, the owner of the old one;
    other hard links keep the old content. A device or a pipe cannot be replaced and is written directly.

    Raises
    ------
    OSError
        With ``path`` as its file name, if it is a folder or write-protected or cannot be written; an old file is
        unchanged.
    """
    target = Path(os.path.realpath(path))
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        before = Path(path).stat() if Path(path).exists() else None
        if before is not None and not os.access(path, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        if before is not None and not stat.S_ISREG(before.st_mode):
            with Path(path).open("wb") as device:
                yield device
            return
        _remove_orphans(target.parent)
        with _new_part(target.parent) as part:
            with part.open("wb") as file:
                yield file
                file.flush()
                if before is not None:
                    _take_over(file.fileno(), before)
                os.fsync(file.fileno())
            part.replace(target)
        _sync_folder(target.parent)
    except BaseException as error:
        if isinstance(error, OSError) and (error.filename is None or _PART.fullmatch(Path(str(error.filename)).name)):
            raise OSError(error.errno, error.strerror or str(error), str(path)) from error
        raise


def _remove_orphans(folder: Path) -> None:
    """Remove what killed processes have left in a folder; what another process writes now stays."""
    with suppress(OSError):
        for part in [entry for entry in folder.iterdir() if _PART.fullmatch(entry.name)]:
            with suppress(OSError), _orphan(part):
                part.unlink()


@contextmanager
def _new_part(folder: Path) -> Iterator[Path]:
    """Make a file for new content, which other processes' :func:`_remove_orphans` spares; remove it if it stays."""
    while True:
        part = folder / f".hybridsep-{uuid.uuid4().hex}.tmp"
        descriptor = os.open(str(part), os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o666)
        try:
            if sys.platform == "win32":
                os.close(descriptor)
            else:
                with suppress(OSError):  # some network file systems have no locks
                    fcntl.flock(descriptor, fcntl.LOCK_EX)
                if not os.fstat(descriptor).st_nlink:  # removed before it was locked
                    continue
            try:
                yield part
            finally:
                with suppress(OSError):
                    part.unlink(missing_ok=True)
            return
        finally:
            if sys.platform != "win32":
                os.close(descriptor)


@contextmanager
def _orphan(part: Path) -> Iterator[None]:
    """Hold a file that no living process writes; OSError if one may."""
    if sys.platform == "win32":
        if time.time() - part.stat().st_mtime < _ORPHAN_AGE:
            raise BlockingIOError
        yield
        return
    descriptor = os.open(part, os.O_RDONLY | os.O_NONBLOCK)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(descriptor)


@contextmanager
def named_errors(path: str | Path) -> Iterator[None]:
    """Add the file name to an OSError that has none, as from a write to a full disk."""
    try:
        yield
    except OSError as error:
        if error.filename is not None:
            raise
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error


@contextmanager
def written_text(path: str | Path) -> Iterator[IO[str]]:
    """Open a UTF-8 text file, line ends untranslated, as :func:`written_whole` does."""
    with written_whole(path) as file:
        text = io.TextIOWrapper(file, encoding="utf-8", newline="")
        yield text
        text.detach()  # what is buffered goes to the file, which stays open


def _take_over(descriptor: int, before: os.stat_result) -> None:
    """Copy owner and permissions of the file that is replaced to the new one."""
    if sys.platform != "win32":
        with suppress(PermissionError):
            os.fchown(descriptor, before.st_uid, before.st_gid)
        os.fchmod(descriptor, stat.S_IMODE(before.st_mode))


def _sync_folder(folder: Path) -> None:
    """Flush a folder's entries; Windows has no such call."""
    if sys.platform != "win32":
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            with suppress(OSError):  # some network file systems refuse it
                os.fsync(descriptor)
        finally:
            os.close(descriptor)
