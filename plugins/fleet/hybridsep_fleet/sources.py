"""Logs of a fleet: in folders, by patterns, and in object stores that fsspec knows."""

import datetime
import glob
import os
import re
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import fsspec

from hybridsep.base.errors import LogError, first_line
from hybridsep.logs.formats import READERS

_ENDINGS = tuple(sorted({ending for reader in READERS for ending in reader.endings}))
"""Endings of the names by which logs in a folder are told from other files; a pattern takes any."""

_DATE = re.compile(r"(?<!\d)(20\d\d)[-_.]?(0[1-9]|1[0-2])[-_.]?(0[1-9]|[12]\d|3[01])(?!\d)")  # a date in a name


@dataclass(frozen=True)
class LogFile:
    """Log as a store lists it, without reading it."""

    url: str  # path, or address of an object
    machine: str  # the first folder below the source that is no date, or the name without its date where there is none
    size: int  # bytes
    stamp: str  # changes with the content: time of the last change, or an object's ETag
    recorded: str  # day, ISO: the date in the path, else the day of the last change; empty if the store knows none


def find_logs(sources: Iterable[str]) -> list[LogFile]:
    """Return all logs of folders, patterns and addresses such as ``s3://bucket/folder``, by address, each once.

    LogError if a source has none, or its store cannot be reached.
    """
    found: dict[str, LogFile] = {}
    for source in sources:
        logs = list(_remote(source) if "://" in source else _local(source))
        if not logs:
            raise LogError(f"{source}: there are no logs (files that end in {', '.join(_ENDINGS)}, or a pattern)")
        found.update((log.url, log) for log in logs)
    return [found[url] for url in sorted(found)]


@contextmanager
def local_copy(url: str) -> Iterator[Path]:
    """Yield a path with a log's content, its own or a temporary copy's; LogError if the store does not give it."""
    if "://" not in url:
        yield Path(url)
        return
    with TemporaryDirectory(prefix="hybridsep-") as folder:
        path = Path(folder) / url.rstrip("/").rpartition("/")[2]
        try:
            with fsspec.open(url, "rb") as remote, path.open("wb") as copy:
                shutil.copyfileobj(remote, copy)
        except Exception as error:  # each store has errors of its own
            raise LogError(f"{url}: cannot be read: {first_line(f'{type(error).__name__}: {error}')}") from error
        yield path


def _local(source: str) -> Iterator[LogFile]:
    folder = Path(source)
    if folder.is_dir():
        paths = [path for path in folder.rglob("*") if path.name.lower().endswith(_ENDINGS)]
        root = folder
    else:
        paths = [Path(path) for path in glob.glob(source, recursive=True)]  # noqa: PTH207  # of any root
        fixed = re.split(r"[*?\[]", source, maxsplit=1)[0]
        root = Path(fixed) if fixed.endswith(("/", os.sep)) else Path(fixed).parent
    for path in sorted(paths):
        if path.is_file() and not any(part.startswith(".") for part in path.relative_to(root).parts):
            known = path.stat()
            day = datetime.datetime.fromtimestamp(known.st_mtime, tz=datetime.timezone.utc).date().isoformat()
            below = path.relative_to(root).parts
            yield LogFile(
                str(path.absolute()), _machine(below), known.st_size, str(known.st_mtime_ns), _day(below, day)
            )


def _remote(source: str) -> Iterator[LogFile]:
    try:
        store, root = fsspec.core.url_to_fs(source)
        store.invalidate_cache()
        pattern = glob.has_magic(root)
        listed = store.glob(root, detail=True) if pattern else store.find(root, detail=True)
    except Exception as error:  # each store has errors of its own
        raise LogError(f"{source}: cannot be listed: {first_line(f'{type(error).__name__}: {error}')}") from error
    base = re.split(r"[*?\[]", root, maxsplit=1)[0].rpartition("/")[0] if pattern else root.rstrip("/")
    for name, known in sorted(listed.items()):
        if known.get("type") != "file" or not (pattern or name.lower().endswith(_ENDINGS) or name == root):
            continue
        below = tuple(name.removeprefix(base).strip("/").split("/"))
        changed = known.get("LastModified") or known.get("mtime") or known.get("created") or ""
        stamp = str(known.get("ETag") or known.get("etag") or known.get("md5Hash") or changed)
        day = changed.date().isoformat() if isinstance(changed, datetime.datetime) else ""
        url = store.unstrip_protocol(name)
        yield LogFile(url, _machine(below), int(known.get("size") or 0), stamp, _day(below, day))


def _machine(below: tuple[str, ...]) -> str:
    named = [part for part in below[:-1] if not _DATE.fullmatch(part)]
    if named:
        return named[0]
    stem = below[-1].partition(".")[0]
    return _DATE.sub("", stem).strip("_-. ") or stem


def _day(below: tuple[str, ...], changed: str) -> str:
    dates = _DATE.findall("/".join(below))
    return "-".join(dates[-1]) if dates else changed
