"""Compilation of shared libraries for every platform, on this machine.

Two toolchains: the ``ziglang`` wheel (``python -m ziglang cc``) for all platforms, and the host's own C compiler for
the host. Both give the same bytes for the same sources: they compile in a folder of their own, by relative names,
without build ids, dates or debug information.

Every library lies in one folder. In FMI 2.0 these are the names that it has: ``linux64``, ``win64``, ``win32`` and
``darwin64``, all of them x86; a platform without one goes by FMI 3.0's tuple. An ARM library is therefore in
``aarch64-linux``, never in ``linux64``, where an importer on x86 would find it; importers on ARM that look in
``linux64`` only say that they cannot load it, and can compile ``sources/``. ``darwin64`` holds one universal file for
both kinds of Mac, as importers look nowhere else on either.
"""

import hashlib
import os
import platform
import shutil
import struct
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from ..base.errors import FmuError
from ..base.files import data_folder, named_errors, write_whole
from .c_header import KINDS, c_sources, fmi_headers, kind_header
from .flavours import FMI_VERSIONS

ZIG = "ziglang 0.17.1"  # the compiler of the libraries in the wheel, which pyproject.toml pins as a build requirement

FLAGS = ("-std=c99", "-O3", "-ffp-contract=off", "-fvisibility=hidden", "-fstack-protector-strong")
"""Options of every compiler, gcc 4.9, clang 3.5 or newer. Never ``-ffast-math``: every platform is to give the same
numbers. An overflow of an array on the stack ends the process before the function returns."""


@dataclass(frozen=True)
class _Target:
    triple: str  # zig's name of it
    folder: str  # where importers of FMI 2.0 look for the library, below ``binaries/``
    suffix: str  # of the library's name
    flags: tuple[str, ...] = ()  # options besides :data:`FLAGS`


_ELF = ("-fPIC", "-Wl,--build-id=none", "-lm", "-ldl")

TARGETS: Mapping[str, _Target] = {
    # glibc 2.17: every Linux distribution since 2014
    "x86_64-linux": _Target("x86_64-linux-gnu.2.17", "linux64", ".so", _ELF),
    "aarch64-linux": _Target("aarch64-linux-gnu.2.17", "aarch64-linux", ".so", _ELF),
    "x86_64-windows": _Target("x86_64-windows-gnu", "win64", ".dll"),
    # SSE2, not the x87, whose extra digits would give other numbers
    "x86-windows": _Target("x86-windows-gnu", "win32", ".dll", ("-msse2", "-mfpmath=sse")),
    "x86_64-darwin": _Target("x86_64-macos.11.0", "darwin64", ".dylib", ("-fPIC",)),
    "aarch64-darwin": _Target("aarch64-macos.11.0", "darwin64", ".dylib", ("-fPIC",)),
}
"""All platforms; the two Macs share a universal file."""

ALL_TARGETS = tuple(TARGETS)

_FOLDERS = {one.folder: tuple(key for key in TARGETS if TARGETS[key].folder == one.folder) for one in TARGETS.values()}
"""Platforms by their folder, FMI 2.0's name of them, which users know."""

TARGET_NAMES = ("host", "all", *dict.fromkeys((*TARGETS, *_FOLDERS)))  # allowed targets

Library = tuple[str, str]  # a kind and a platform, a key of :data:`TARGETS`
Compiler = tuple[tuple[str, ...], str]  # its command, and a key that differs where its libraries may differ


def host_target() -> str:
    """Return the name of this machine's platform, a key of :data:`TARGETS`; FmuError if it is another one."""
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine().lower())
    name = f"{machine}-{platform.system().lower()}"
    if name not in TARGETS:
        raise FmuError(f"this machine must be one of {', '.join(TARGETS)} to be compiled for, it is {name}")
    return name


def expanded(targets: Sequence[str]) -> tuple[str, ...]:
    """Return the platforms, keys of :data:`TARGETS`, of some of :data:`TARGET_NAMES`; FmuError if a name is unknown."""
    if unknown := sorted(set(targets) - set(TARGET_NAMES)):
        raise FmuError(f"no target {', '.join(unknown)}; there are {', '.join(TARGET_NAMES)}")
    several = {**_FOLDERS, "all": ALL_TARGETS}
    keys = (key for target in targets for key in several.get(target, (target,)))
    return tuple(dict.fromkeys(host_target() if key == "host" else key for key in keys))


def placed(libraries: Mapping[str, bytes], name: str, fmi: str = FMI_VERSIONS[0]) -> dict[str, bytes]:
    """Return where libraries, by the keys of :data:`TARGETS`, lie in an archive: path below ``binaries/`` → library.

    The model identifier is their stem; FMI 3.0 has one folder for each platform, which is called as the platform is.
    """
    files: dict[str, list[bytes]] = {}  # the two Macs' libraries have one place in FMI 2.0
    for key in (key for key in TARGETS if key in libraries):
        folder = key if fmi == "3" else TARGETS[key].folder
        files.setdefault(f"{folder}/{name}{TARGETS[key].suffix}", []).append(libraries[key])
    return {path: universal(both) if len(both) > 1 else both[0] for path, both in files.items()}


def compiler_for(target: str) -> Compiler:
    """Return a platform's compiler: ``ziglang``, or for the host ``$CC``, cc, gcc or clang; FmuError without one."""
    if find_spec("ziglang") is not None:
        zig = (sys.executable, "-m", "ziglang", "cc", "-target", TARGETS[target].triple, "-fno-sanitize=undefined")
        return zig, f"ziglang {version('ziglang')}"
    if target != host_target():
        raise FmuError(f"compiling for {target} needs ziglang: pip install {ZIG.replace(' ', '==')}, or --target host")
    chosen = os.environ.get("CC", "").split()
    for command in (chosen, ["cc"], ["gcc"], ["clang"]):
        if command and shutil.which(command[0]):
            said = subprocess.run([*command, "--version"], capture_output=True, text=True).stdout
            return tuple(command), f"{' '.join(command)} {said}"
    raise FmuError("no C compiler: no ziglang and none of $CC, cc, gcc, clang; pip install ziglang")


def _compiled(folder: Path, library: Library, compiler: Sequence[str]) -> bytes:
    """Return the stripped shared library of ``all.c``, compiled and linked in a folder; FmuError if it is refused."""
    (kind, target), folder = library, folder.joinpath(*library)
    with named_errors(folder):
        folder.mkdir(parents=True)
        for file, text in _sources(kind).items():
            (folder / file).write_bytes(text)
    # dladdr is no part of POSIX
    flags = [*FLAGS, "-D_GNU_SOURCE", "-g0", "-s", "-shared", "-I."]
    output = f"{kind}{TARGETS[target].suffix}"
    command = [*compiler, *flags, "all.c", "-o", output, *TARGETS[target].flags]
    done = subprocess.run(command, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, errors="replace")
    if done.returncode != 0:
        said = f"{' '.join(command)}\n{done.stderr.strip()}"
        raise FmuError(f"{kind} cannot be compiled for {TARGETS[target].triple}: {said}")
    return (folder / output).read_bytes()


def universal(libraries: Sequence[bytes]) -> bytes:
    """Return the universal file of 64-bit Mach-O libraries, one for each processor."""
    alignment = 14  # 16 KiB, the page of Apple's ARM processors; x86 has 4 KiB
    page = 1 << alignment
    header = struct.pack(">2I", 0xCAFEBABE, len(libraries))
    body = b""
    for library in libraries:
        _, cpu, subtype = struct.unpack_from("<3I", library)
        header += struct.pack(">5I", cpu, subtype, page + len(body), len(library), alignment)
        body += library.ljust(-(-len(library) // page) * page, b"\0")
    return header.ljust(page, b"\0") + body


_SHIPPED = Path(__file__).resolve().parents[1] / "_data" / "binaries"


def libraries(kind: str, targets: Sequence[str]) -> dict[str, bytes]:
    """Return the libraries of a kind for targets of :data:`TARGET_NAMES`: platform → library.

    FmuError if a target is unknown, or a library is not there and cannot be compiled.
    """
    paths = library_paths([(kind, target) for target in expanded(targets)])
    return {target: path.read_bytes() for (_, target), path in paths.items()}


def library_paths(
    wanted: Iterable[Library], on_library: Callable[[Library, float], object] = lambda _library, _done: None
) -> dict[Library, Path]:
    """Return the files of libraries; missing ones are compiled, as many at a time as there are processors.

    ``on_library`` is told each that had to be compiled, when it is there and kept, and the fraction done.

    FmuError as :func:`libraries`.
    """
    paths = {library: kept(library) for library in wanted}
    compilers = {library: compiler_for(library[1]) for library, path in paths.items() if path is None}
    paths |= {library: _place(compiler, library) for library, (_, compiler) in compilers.items()}
    places = {library: path for library, path in paths.items() if path is not None}
    with TemporaryDirectory() as folder, ThreadPoolExecutor(os.cpu_count()) as pool:
        running = {
            library: pool.submit(_compiled, Path(folder), library, command)
            for library, (command, _) in compilers.items()
            if not places[library].is_file()
        }
        try:
            for i, (library, compiled) in enumerate(running.items(), start=1):
                write_whole(places[library], compiled.result())
                on_library(library, i / len(running))
        finally:  # after a failure or Ctrl-C no other one begins
            pool.shutdown(cancel_futures=True)
    if running:
        _forget_old_versions()
    return places


def kept(library: Library) -> Path | None:
    """Return the file of a library of the wheel, or one that was compiled before by :data:`ZIG`; None without one."""
    shipped = _SHIPPED / library[0] / f"{library[1]}{TARGETS[library[1]].suffix}"
    return next((place for place in (shipped, _place(ZIG, library)) if place.is_file()), None)


def check_available(targets: Sequence[str]) -> None:
    """Check that the libraries for some targets are there or can be compiled; FmuError if not, or one is unknown."""
    for target in expanded(targets):
        if not _all_kept(target):
            compiler_for(target)


def no_native() -> str:
    """Return why no native FMUs for this machine can be built; empty if they can."""
    try:
        check_available(("host",))
    except FmuError as error:
        return str(error)
    return ""


def default_targets() -> tuple[str, ...]:
    """Return the targets where none are asked for: ``$HYBRIDSEP_TARGETS`` if it is set, else :func:`ready_targets`."""
    return (os.environ.get("HYBRIDSEP_TARGETS") and chosen_targets()) or ready_targets()


def chosen_targets() -> tuple[str, ...]:
    """Return the platforms of ``$HYBRIDSEP_TARGETS``, names with commas or ``none``; this one if it is not set.

    FmuError if a name is unknown, or none is set and this machine is none of the platforms.
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
    versions = sorted(_cache().iterdir(), key=lambda folder: folder.stat().st_mtime, reverse=True)
    for folder in versions[4:]:  # a few branches of a checkout keep theirs, at 8 MB each
        shutil.rmtree(folder, ignore_errors=True)
