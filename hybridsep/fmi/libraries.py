"""Shared libraries of the native FMUs, one for each kind and platform.

A library serves all FMUs of its kind: what one FMU differs in is read from its resources
(:mod:`hybridsep.fmi.table_file`). Building a wheel compiles some (``hatch_build.py``): for this machine, in a release
for all platforms. Others are compiled when they are first asked for and kept, by a hash of sources and compiler, in a
checkout's ``build/binaries`` or the user's cache.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path

from ..base.data_files import data_folder
from ..base.errors import FmuError
from ..base.output import written_whole
from .c_header import KINDS, kind_header
from .c_sources import c_sources, fmi_headers
from .compiler import ALL_TARGETS, FLAGS, TARGETS, ZIG, compiled, compiler_for, expanded, host_target

__all__ = [
    "Library",
    "check_available",
    "chosen_targets",
    "default_targets",
    "has_native",
    "is_kept_here",
    "kept",
    "libraries",
    "library_paths",
    "missing",
    "ready_targets",
]

_SHIPPED = Path(__file__).resolve().parents[1] / "_data" / "binaries"
_KEPT_VERSIONS = 4
"""Versions of the sources whose libraries are kept in a checkout: a few branches, at 8 MB each."""

Library = tuple[str, str]
"""A kind and a platform, a key of :data:`hybridsep.fmi.compiler.TARGETS`."""


def libraries(kind: str, targets: Sequence[str]) -> dict[str, bytes]:
    """Return the libraries of a kind: platform → library.

    Parameters
    ----------
    kind : str
        Of :data:`hybridsep.fmi.c_header.KINDS`.
    targets : sequence of str
        Of :data:`hybridsep.fmi.compiler.TARGET_NAMES`.

    Raises
    ------
    FmuError
        If a target is unknown, or a library is not there and cannot be compiled.
    """
    paths = library_paths([(kind, target) for target in expanded(targets)])
    return {target: path.read_bytes() for (_, target), path in paths.items()}


def library_paths(
    wanted: Sequence[Library], on_library: Callable[[Library], object] = lambda _wanted: None
) -> dict[Library, Path]:
    """Return the files of libraries; missing ones are compiled, and each is kept as soon as it is there.

    Parameters
    ----------
    wanted : sequence of pairs
    on_library : callable, optional
        Called with each library that had to be compiled, when it is there.

    Raises
    ------
    FmuError
        As :func:`libraries`.
    """
    compilers = {target: compiler_for(target) for _, target in missing(wanted)}
    jobs = {(kind, target): (compilers[target], _sources(kind)) for kind, target in missing(wanted)}

    for library, content in compiled(jobs):
        place = _place(compilers[library[1]].name, library)
        with written_whole(place) as file:
            file.write(content)
        on_library(library)
    if jobs:
        _forget_old_versions()
    return {library: kept(library) or _place(compiler_for(library[1]).name, library) for library in wanted}


def missing(wanted: Iterable[Library]) -> list[Library]:
    """Return the libraries that have to be compiled; FmuError where no compiler is there for one."""
    absent = [library for library in wanted if kept(library) is None]
    return [one for one in absent if not _place(compiler_for(one[1]).name, one).is_file()]


def kept(library: Library) -> Path | None:
    """Return the file of a library of the wheel, or one that was compiled before by :data:`ZIG`; None without one."""
    shipped = _SHIPPED / library[0] / f"{library[1]}{TARGETS[library[1]].suffix}"
    places = (shipped, _place(ZIG, library))
    return next((place for place in places if place.is_file()), None)


def is_kept_here(kind: str) -> bool:
    """Return whether a kind's library for this machine is there, and need not be compiled."""
    try:
        return kept((kind, host_target())) is not None
    except FmuError:  # a platform that no library is for
        return False


def check_available(targets: Sequence[str]) -> None:
    """Check, before any work, that the libraries for some platforms are there or can be compiled.

    Raises
    ------
    FmuError
        If not, or a target is unknown.
    """
    for target in expanded(targets):
        if not _all_kept(target):
            compiler_for(target)


def has_native() -> bool:
    """Return whether native FMUs that run on this machine can be built."""
    try:
        check_available(("host",))
    except FmuError:
        return False
    return True


def default_targets() -> tuple[str, ...]:
    """Return the targets where none are asked for: ``$HYBRIDSEP_TARGETS`` if it is set, else :func:`ready_targets`."""
    return (os.environ.get("HYBRIDSEP_TARGETS") and chosen_targets()) or ready_targets()


def chosen_targets() -> tuple[str, ...]:
    """Return the platforms of ``$HYBRIDSEP_TARGETS``, names with commas or ``none``; this one if it is not set.

    Raises
    ------
    FmuError
        If a name is unknown, or none is set and this machine is none of the platforms.
    """
    chosen = os.environ.get("HYBRIDSEP_TARGETS") or "host"
    return expanded(() if chosen == "none" else chosen.split(","))


def ready_targets() -> tuple[str, ...]:
    """Return all platforms where nothing has to be compiled for that, else this one."""
    return ALL_TARGETS if all(map(_all_kept, ALL_TARGETS)) else ("host",)


def _all_kept(target: str) -> bool:
    return all(kept((kind, target)) is not None for kind in KINDS)


def _sources(kind: str) -> dict[str, bytes]:
    return {**c_sources(), "hsep_fmu.h": kind_header(kind).encode(), **fmi_headers()}


def _place(compiler: str, library: Library) -> Path:
    """Return where a library that a compiler made is kept."""
    kind, target = library
    return _cache() / _version(compiler) / kind / f"{target}{TARGETS[target].suffix}"


@cache
def _version(compiler: str) -> str:
    """Return a hash of all that libraries are made of: sources, headers of the kinds, options and compiler."""
    digest = hashlib.sha256(repr((compiler, FLAGS, dict(TARGETS))).encode())
    for name, content in [*c_sources().items(), *((kind, kind_header(kind).encode()) for kind in KINDS)]:
        digest.update(name.encode() + hashlib.sha256(content).digest())
    return digest.hexdigest()[:16]


def _cache() -> Path:
    """Return the folder of compiled libraries: ``$HYBRIDSEP_LIBRARIES``, in a checkout its own, else the user's."""
    if chosen := os.environ.get("HYBRIDSEP_LIBRARIES"):
        return Path(chosen)
    root = data_folder("fmu_src").parent
    if (root / "pyproject.toml").is_file():
        return root / "build" / "binaries"
    user = os.environ.get("LOCALAPPDATA") or os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(user) / "hybridsep" / "binaries"


def _forget_old_versions() -> None:
    """Remove the libraries of all but the latest versions."""
    versions = sorted(_cache().iterdir(), key=lambda folder: folder.stat().st_mtime, reverse=True)
    for folder in versions[_KEPT_VERSIONS:]:
        shutil.rmtree(folder, ignore_errors=True)
