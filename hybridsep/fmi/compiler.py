"""Compilation of an FMU's C file to shared libraries, on this machine for every platform.

Two toolchains: the host's own C compiler for the host, and the ``ziglang`` wheel (``python -m ziglang cc``) for all.
Both give the same bytes for the same sources: they compile in a folder of their own, by relative names, without build
ids, dates or debug information.

The folders follow FMI 2.0: ``linux64``, ``win64`` and ``darwin64`` mean x86, and every other platform goes by FMI 3.0's
tuples. An ARM library is therefore in ``aarch64-linux`` alone, never in ``linux64``, where an importer on x86 would
find it; importers on ARM that look in ``linux64`` only say that they cannot load it, and can compile ``sources/``.
``darwin64`` holds one universal file, for importers that look nowhere else on either kind of Mac.
"""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from ..base.errors import FmuError
from ..base.output import named_errors
from .macho import universal
from .processes import run_together

__all__ = [
    "ALL_TARGETS",
    "TARGETS",
    "TARGET_NAMES",
    "Target",
    "binaries",
    "can_compile",
    "compile_flags",
    "compilers",
    "default_targets",
    "host_target",
]

_FLAGS = ("-std=c99", "-O3", "-ffp-contract=off", "-fvisibility=hidden")
"""Never ``-ffast-math``: every platform is to give the same numbers."""

_STACK_PROTECTOR = "-fstack-protector-strong"
"""An overflow of an array on the stack ends the process before the function returns; gcc 4.9, clang 3.5 and newer."""


@dataclass(frozen=True)
class Target:
    """A platform an FMU can have a binary for.

    Attributes
    ----------
    triple : str
        Zig's name of it.
    folders : tuple of str
        Where importers look for the library, below ``binaries/``.
    suffix : str
    flags : tuple of str
        Options besides :func:`compile_flags`.
    """

    triple: str
    folders: tuple[str, ...]
    suffix: str
    flags: tuple[str, ...] = ()


_ELF = ("-fPIC", "-Wl,--build-id=none", "-lm")

TARGETS: Mapping[str, Target] = {
    # glibc 2.17: every Linux distribution since 2014
    "x86_64-linux": Target("x86_64-linux-gnu.2.17", ("linux64", "x86_64-linux"), ".so", _ELF),
    "aarch64-linux": Target("aarch64-linux-gnu.2.17", ("aarch64-linux",), ".so", _ELF),
    "x86_64-windows": Target("x86_64-windows-gnu", ("win64", "x86_64-windows"), ".dll"),
    # SSE2, not the x87, whose extra digits would give other numbers
    "x86-windows": Target("x86-windows-gnu", ("win32", "x86-windows"), ".dll", ("-msse2", "-mfpmath=sse")),
    "x86_64-darwin": Target("x86_64-macos.11.0", ("x86_64-darwin",), ".dylib", ("-fPIC",)),
    "aarch64-darwin": Target("aarch64-macos.11.0", ("aarch64-darwin",), ".dylib", ("-fPIC",)),
}
"""All platforms; the two Macs together also give ``darwin64``."""

ALL_TARGETS = tuple(TARGETS)
_MACS = ("x86_64-darwin", "aarch64-darwin")
_FMI2_PLATFORMS = {
    "linux64": ("x86_64-linux",),
    "win64": ("x86_64-windows",),
    "win32": ("x86-windows",),
    "darwin64": _MACS,
}
"""FMI 2.0's names of platforms, which users know."""

TARGET_NAMES = ("host", *TARGETS, *_FMI2_PLATFORMS)
"""Allowed targets."""


def host_target() -> str:
    """Return the name of this machine's platform, a key of :data:`TARGETS`.

    Raises
    ------
    FmuError
        If it is another one.
    """
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine().lower())
    name = f"{machine}-{platform.system().lower()}"
    if name not in TARGETS:
        raise FmuError(f"this machine must be one of {', '.join(TARGETS)} to be compiled for, it is {name}")
    return name


def default_targets() -> tuple[str, ...]:
    """Return the targets where none are asked for: all platforms where ``ziglang`` is installed, else this machine."""
    return ALL_TARGETS if find_spec("ziglang") is not None else ("host",)


def binaries(
    sources: Mapping[str, bytes],
    name: str,
    targets: Sequence[str],
    on_target: Callable[[str], object] = lambda _target: None,
) -> dict[str, bytes]:
    """Compile ``all.c`` of the sources.

    Parameters
    ----------
    sources : mapping
        File name → content.
    name : str
        Model identifier: the libraries' stem.
    targets : sequence of str
        Of :data:`TARGET_NAMES`; for any but ``"host"``, ``ziglang`` must be installed.
    on_target : callable, optional
        Called with each platform, a key of :data:`TARGETS`, when its compilation begins.

    Returns
    -------
    dict
        Path below ``binaries/`` → library.

    Raises
    ------
    FmuError
        If a target is unknown, there is no compiler, or it refuses.
    """
    commands = {host_target() if key == "host" else key: command for key, command in compilers(targets).items()}
    built = _compiled(commands, sources, name, on_target)
    placed = {
        f"{place}/{name}{TARGETS[key].suffix}": library
        for key, library in built.items()
        for place in TARGETS[key].folders
    }
    macs = [built[key] for key in _MACS if key in built]
    if macs:
        placed[f"darwin64/{name}.dylib"] = universal(macs) if len(macs) > 1 else macs[0]
    return placed


def compile_flags(command: Sequence[str]) -> list[str]:
    """Return this compiler's options for the sources, the same for every platform.

    Parameters
    ----------
    command : sequence of str
        Of a compiler that understands the options of gcc.
    """
    return [*_FLAGS, *([_STACK_PROTECTOR] if _understands(tuple(command), _STACK_PROTECTOR) else [])]


@cache
def _understands(command: tuple[str, ...], flag: str) -> bool:
    """Return whether a compiler knows an option."""
    with TemporaryDirectory() as place:
        source = Path(place) / "nothing.c"
        source.write_text("int nothing;\n")
        arguments = [*command, "-Werror", flag, "-c", source.name, "-o", "nothing.o"]
        return subprocess.run(arguments, cwd=place, capture_output=True, check=False).returncode == 0


def compilers(targets: Sequence[str]) -> dict[str, list[str]]:
    """Return the compiler's command for ``"host"`` and each key of :data:`TARGETS` that is asked for.

    Raises
    ------
    FmuError
        If one of ``targets`` is not among :data:`TARGET_NAMES`, or there is no compiler for it.
    """
    if unknown := sorted(set(targets) - set(TARGET_NAMES)):
        raise FmuError(f"no target {', '.join(unknown)}; there are {', '.join(TARGET_NAMES)}")
    expanded = dict.fromkeys(key for target in targets for key in _FMI2_PLATFORMS.get(target, (target,)))
    return {target: _host_compiler() if target == "host" else _zig(TARGETS[target].triple) for target in expanded}


def can_compile() -> bool:
    """Return whether a native FMU can be compiled here, for this machine."""
    try:
        host_target()
        return bool(_host_compiler())
    except FmuError:
        return False


def _host_compiler() -> list[str]:
    """Return the host's C compiler: ``$CC``, cc, gcc, clang, or zig."""
    chosen = os.environ.get("CC", "").split()
    if chosen:
        return chosen
    for compiler in ("cc", "gcc", "clang"):
        if shutil.which(compiler):
            return [compiler]
    if find_spec("ziglang") is not None:
        return _zig(TARGETS[host_target()].triple)
    raise FmuError(
        "no C compiler: none of $CC, cc, gcc, clang; install one, or pip install ziglang, or build with "
        "--flavour python"
    )


def _zig(triple: str) -> list[str]:
    if find_spec("ziglang") is None:
        raise FmuError("compiling for other platforms needs ziglang: pip install ziglang, or ask for the target host")
    return [sys.executable, "-m", "ziglang", "cc", "-target", triple, "-fno-sanitize=undefined"]


def _compiled(
    commands: Mapping[str, Sequence[str]],
    sources: Mapping[str, bytes],
    name: str,
    on_target: Callable[[str], object],
) -> dict[str, bytes]:
    """Compile and link ``all.c`` into a stripped shared library for each target, by its compiler's command."""
    with TemporaryDirectory() as place:
        jobs = []
        for key, command in commands.items():
            folder, target = Path(place) / key, TARGETS[key]
            with named_errors(folder):
                folder.mkdir()
                for file, text in sources.items():
                    (folder / file).write_bytes(text)
            flags = [*compile_flags(command), "-g0", "-s", "-shared", "-I."]
            jobs.append(([*command, *flags, "all.c", "-o", f"{name}{target.suffix}", *target.flags], folder))
        keys = list(commands)
        done = run_together(jobs, lambda i: on_target(keys[i]))
        for key, (arguments, _), (status, complaint) in zip(keys, jobs, done, strict=False):
            if status != 0:
                said = f"{' '.join(arguments)}\n{complaint.strip()}"
                raise FmuError(f"{name} cannot be compiled for {TARGETS[key].triple}: {said}")
        return {key: (Path(place) / key / f"{name}{TARGETS[key].suffix}").read_bytes() for key in commands}
