"""The C compiler of this machine, its sanitizers, and how it is called for the C core."""

import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import fmpy
import pytest
from places import ROOT

C_SOURCES = ROOT / "fmu_src" / "c"
FMI_HEADERS = Path(fmpy.__file__).parent / "c-code"
"""fmpy's, for shared libraries: the names of the FMI functions are the plain ones."""

FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Wcast-qual", "-pedantic", "-Werror", "-ffp-contract=off"]

SANITISED = (
    *("-O0", "-g", "-fPIC", "-fno-omit-frame-pointer"),
    *("-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all"),
)
"""Options of builds with sanitizers. Not optimised: that would take three times as long to compile."""


def zig(*options: str) -> list[str]:
    """Return the command of the ziglang wheel's compiler."""
    return [sys.executable, "-m", "ziglang", "cc", *options]


def compiler() -> list[str]:
    """Return the command of a C compiler, or say that there is none."""
    if os.environ.get("CC"):
        return shlex.split(os.environ["CC"])
    for name in ("cc", "gcc", "clang"):
        if path := shutil.which(name):
            return [path]
    if find_spec("ziglang"):
        return zig()
    raise RuntimeError("the C core needs a C compiler: set CC, or install cc, gcc, clang or the ziglang package")


@cache
def sanitising_compiler() -> list[str]:
    """Return the command of a C compiler that brings the address sanitizer as a library of its own; empty if none."""
    for command in (compiler(), ["gcc"], ["cc"]):
        if shutil.which(command[0]) and address_sanitizer(command) and _catches_overflows(command):
            return command
    return []


def _catches_overflows(command: Sequence[str]) -> bool:
    """Return whether a compiler's address sanitizer sees a write past a block; a library found may not be its own."""
    source, program = build_folder() / "overflow.c", build_folder() / "overflow"
    source.write_text(
        "#include <stdlib.h>\nint main(int n, char **a) { char *b = malloc(8); b[7 + n] = **a; free(b); }\n"
    )
    built = subprocess.run([*command, "-fsanitize=address", source, "-o", program], capture_output=True, check=False)
    if built.returncode:
        return False
    done = subprocess.run([program], capture_output=True, check=False)
    return done.returncode != 0 and b"AddressSanitizer" in done.stderr


def address_sanitizer(command: Sequence[str]) -> str:
    """Return the path of a compiler's libasan; empty if it has none."""
    asked = subprocess.run([*command, "-print-file-name=libasan.so"], capture_output=True, text=True, check=False)
    path = asked.stdout.strip()
    return path if Path(path).is_absolute() and Path(path).exists() else ""


def run_compiler(arguments: Sequence[str | Path], *, command: Sequence[str] = ()) -> None:
    """Compile, with the host's compiler if no other is asked for, or raise with what it said."""
    line = [*(command or compiler()), *FLAGS, *map(str, arguments)]
    done = subprocess.run(line, capture_output=True, text=True, check=False, cwd=build_folder())
    if done.returncode:
        raise RuntimeError(f"the C compiler failed:\n{done.stderr}")


@cache
def _temporary() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="hsep_c_core_")


def build_folder() -> Path:
    """Return this process's folder for what is built; it goes when the process ends."""
    return Path(_temporary().name)


needs_sanitisers = pytest.mark.skipif(
    not sanitising_compiler(), reason="no C compiler here brings the address sanitizer; install gcc with libasan"
)


def include_flags() -> list[str]:
    """Return the options with which a file finds every header by its name."""
    return [f"-I{folder}" for folder in sorted({path.parent for path in C_SOURCES.rglob("*.h")})]
