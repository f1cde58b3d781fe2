"""The processors: how a replay is built for one, run on it, and measured."""

import os
import re
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.targets.cases import Case, header
from hybridsep.base.signals import Array

HERE = Path(__file__).parent
C_SOURCES = HERE.parents[1] / "fmu_src" / "c"
_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-ffunction-sections", "-fdata-sections")
_STRICT = ("-Wall", "-Wextra", "-Werror")
_PLAIN = tuple(f"-fno-builtin-{name}" for name in ("exp", "pow", "tanh", "sin", "cos"))
"""Calls of these stay calls, and reach plain_math.c."""
_STACK_PAINTED = int(re.findall(r"#define STACK_PAINTED (\d+)", (HERE / "replay.c").read_text(encoding="utf-8"))[0])


@dataclass(frozen=True)
class Target:
    """A processor with its compiler, its C library and what emulates it."""

    name: str  # as the table has it
    compiler: tuple[str, ...]  # with the options of the processor
    # C file of the board; linker script, empty for a program of this machine
    board: str
    script: str = ""
    emulator: tuple[str, ...] = ()  # command before the program's name; empty: it runs here
    unit: int = 0  # instructions in a unit of the board's counter; 0: callgrind counts them
    slow: bool = False  # whether it has no doubles: each operation is a call
    # of the compiler's binutils
    size_tool: str = "size"
    nm: str = "nm"
    packages: str = ""  # Debian's, which bring all of it

    def missing(self) -> str:
        """Return what is not installed here; empty if nothing."""
        needed = [self.compiler[0], *self.emulator[:1], self.size_tool]
        lacking = [name for name in needed if not shutil.which(name)]
        if not lacking and self.script:
            # Where picolibc is, only its specifications know.
            command = [*self.compiler, "-x", "c", "-", "-lm", "-o", os.devnull]
            tried = subprocess.run(
                command,
                input="int main(void) { return 0; }",
                capture_output=True,
                text=True,
                env=os.environ | {"LC_ALL": "C"},
            )
            lacking = ["a C library for it"] if "cannot find" in tried.stderr else []
        return ", ".join(lacking)


def _qemu(program: str, board: str, *options: str) -> tuple[str, ...]:
    semihosting = ("-chardev", "stdio,id=out", "-semihosting-config", "enable=on,target=native,chardev=out")
    quiet = ("-display", "none", "-monitor", "none", "-serial", "none")
    return (program, "-M", board, *options, "-icount", "shift=0", *quiet, *semihosting, "-kernel")


def _cortex_m(name: str, board: str, *options: str, slow: bool = False) -> Target:
    return Target(
        name,
        ("arm-none-eabi-gcc", "-mthumb", "-mfloat-abi=hard", *options),
        "board_mps2.c",
        "mps2.ld",
        _qemu("qemu-system-arm", board),
        unit=40,
        slow=slow,
        size_tool="arm-none-eabi-size",
        nm="arm-none-eabi-nm",
        packages="gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm",
    )


_PICOLIBC = "--specs=/usr/lib/picolibc/{}/picolibc.specs"
_M7 = ("-mcpu=cortex-m7", "-mfpu=fpv5-d16")
_M4F = ("-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16")
FLOAT32 = ("-DHSEP_FLOAT32", "-fsingle-precision-constant")
"""Options of single precision; constants too, as each operation of a double would be a call."""
_AARCH64 = "aarch64-linux-gnu"
TARGETS = {
    "x86-64": Target("x86-64", ("gcc",), "board_host.c", packages="gcc valgrind"),
    "aarch64": Target(
        "aarch64 (Cortex-A53)",
        (f"{_AARCH64}-gcc", "-mcpu=cortex-a53", "-fno-pic", "-fno-pie", "-no-pie", _PICOLIBC.format(_AARCH64)),
        "board_virt.c",
        "virt.ld",
        _qemu("qemu-system-aarch64", "virt", "-cpu", "cortex-a53", "-nic", "none"),  # its boot ROM is another package
        unit=1,
        size_tool=f"{_AARCH64}-size",
        nm=f"{_AARCH64}-nm",
        packages=f"gcc-{_AARCH64} picolibc-{_AARCH64} qemu-system-arm",
    ),
    "m7": _cortex_m("Cortex-M7", "mps2-an500", *_M7),
    "m7-picolibc": _cortex_m("Cortex-M7, picolibc", "mps2-an500", *_M7, _PICOLIBC.format("arm-none-eabi")),
    "m4f": _cortex_m("Cortex-M4F", "mps2-an386", *_M4F, slow=True),
    "m4f-float32": _cortex_m("Cortex-M4F, float32", "mps2-an386", *_M4F, *FLOAT32),
}


@dataclass(frozen=True)
class Replay:
    """What a replay has printed."""

    # bytes of the block, and of the stack that the library needed
    block: int
    stack: int
    began: int  # hsep_began
    counts: NDArray[np.int64]  # (n,): instructions of each sample; zeros where the board does not count
    outputs: Array  # (n, 2), m


@dataclass(frozen=True)
class Sizes:
    """Bytes of the library, with what it takes from libm, libgcc and the C library's strings."""

    text: int
    data: int


def core_sources() -> list[Path]:
    """Return the sources of the library."""
    return [
        path
        for path in sorted((C_SOURCES / "core").rglob("*.c"))
        if path.parent.name != "drives" and path.name != "hsep_clock.c"
    ]


def include_options() -> list[str]:
    """Return the options with which a file finds every header by its name."""
    return [f"-I{folder}" for folder in sorted({path.parent for path in C_SOURCES.rglob("*.h")})]


def _run(command: list[str | Path], folder: Path) -> str:
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False, cwd=folder)
    if done.returncode:
        raise RuntimeError(f"{command[0]} failed:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done.stdout


def build(target: Target, case: Case, folder: Path, *, plain_math: bool = False, options: tuple[str, ...] = ()) -> Path:
    """Compile a replay; return the program.

    Parameters
    ----------
    target : Target
    case : Case
    folder : Path
        Where it is built; made.
    plain_math : bool
        Take exp, pow, tanh, sin and cos from plain_math.c instead of the target's libm.
    options : tuple of str
        Of the compiler, after the others.
    """
    folder.mkdir(parents=True)
    (folder / "case.h").write_text(header(case), encoding="utf-8")
    sources = [HERE / "replay.c", *core_sources()]
    return program(target, sources, folder, plain_math=plain_math, options=(*include_options(), *options))


def program(
    target: Target, sources: Sequence[Path], folder: Path, *, plain_math: bool = False, options: Sequence[str] = ()
) -> Path:
    """Compile a program for a board, with headers in its folder; return it."""
    flags = [*_FLAGS, *_STRICT, *(_PLAIN if plain_math else ()), f"-I{HERE}", f"-I{folder}", *options]
    given = [*sources, HERE / target.board, *([HERE / "plain_math.c"] if plain_math else [])]
    _run([*target.compiler, *flags, *given, *_linked(target), "-o", "program"], folder)
    return folder / "program"


def sizes(target: Target, kind: str, folder: Path) -> Sizes:
    """Return the sizes of the functions that a predictor or a compensator needs, linked by itself."""
    folder.mkdir(parents=True)
    found = []
    for define in ([f"-DKIND={kind}"], []):
        sources = [HERE / "interface.c", HERE / target.board, *(core_sources() if define else [])]
        _run([*target.compiler, *_FLAGS, *define, *include_options(), *sources, *_linked(target), "-o", "all"], folder)
        text, data, bss = map(int, _run([target.size_tool, "all"], folder).splitlines()[1].split()[:3])
        found.append((text, data + bss))
    (text, data), (text_without, data_without) = found
    return Sizes(text - text_without, data - data_without)


def _linked(target: Target) -> list[str]:
    """Return the options of the linker, after the sources."""
    own = ["-nostartfiles", f"-T{HERE / target.script}"] if target.script else []
    return ["-Wl,--gc-sections", "-lm", *own]


def run(target: Target, program: Path) -> str:
    """Run a program; return what it writes."""
    return _run([*target.emulator, program], program.parent)


def replay(target: Target, program: Path, *, count: bool = True) -> Replay:
    """Run a replay.

    Raises
    ------
    RuntimeError
        If the program fails, or its stack is deeper than what is watched.
    """
    first, *lines, last = run(target, program).splitlines()
    block, began = (int(word, 16) for word in first.split())
    rows = [line.split() for line in lines]
    bits = np.array([[int(word, 16) for word in row[1:]] for row in rows], dtype=np.uint64)
    counts = np.array([int(row[0], 16) for row in rows], dtype=np.int64) * target.unit
    if count and not target.unit:
        counts = _callgrind(program, len(rows))
    stack = int(last, 16)
    if stack >= _STACK_PAINTED:
        raise RuntimeError("the stack is deeper than what replay.c watches: raise STACK_PAINTED")
    return Replay(block, stack, began, counts, bits.view(np.float64))


def _callgrind(program: Path, n: int) -> NDArray[np.int64]:
    """Return the instructions of each sample by valgrind, (n,); zeros without it."""
    valgrind = shutil.which("valgrind")
    if valgrind is None:
        return np.zeros(n, dtype=np.int64)
    folder = program.parent / "callgrind"
    folder.mkdir(exist_ok=True)
    options = ["--tool=callgrind", "--toggle-collect=replay_sample", "--dump-after=replay_sample"]
    _run([valgrind, *options, f"--callgrind-out-file={folder}/out", program], folder)
    counts = {}
    for file in folder.glob("out.*"):
        text = file.read_text(encoding="utf-8", errors="replace")
        part = re.search(r"^part: (\d+)", text, re.MULTILINE)
        total = re.search(r"^(?:summary|totals): (\d+)", text, re.MULTILINE)
        if part and total:
            counts[int(part[1])] = int(total[1])
    if len(counts) < n:
        raise RuntimeError(f"callgrind wrote {len(counts)} counts for {n} samples")
    return np.array([counts[k] for k in sorted(counts)][:n], dtype=np.int64)
