"""Accumulation test of the C core's clock over 10⁹ communication steps, and importers' rounded times over 10⁶.

The clock's time is compared after each step with the exact sum of the step sizes, in 128-bit integers, and the number
of instants reached with the rule's. The importer's time is its own rounded sum, which drifts. Ends with 1 if the clock
is ever off by more than 1e-9 of T_s, a count is another one, or a sample was lost or doubled.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rich.console import Console
from rich.table import Table

from hybridsep.fmi.compiler import compile_flags

HERE = Path(__file__).resolve().parent
CORE = HERE.parents[1] / "fmu_src" / "c" / "core"
DEVIATION_MAX = 1e-9
CASES = (
    (0.0, 1e-3, (1e-3,)),
    (0.0, 1e-3, (3e-4,)),
    (1e6, 1e-3, (3.7e-3,)),
    (1e9, 1e-3, (1e-3,)),
    (1e9, 1e-3, (12.2e-3, 3e-4, 1e-3, 0.37)),
    (1e9, 1.25e-4, (3e-4, 1e-3)),
)
"""Start s, T_s s, and the step sizes s that take turns."""

ROUNDED = (
    ("whole nanoseconds", 1_000_000, 1 / 3000, 333_333e-9, False),
    ("whole nanoseconds", 1_000_000, 1 / 7000, 142_857e-9, False),
    ("single precision", 100_000, 1e-3, 1e-3, True),
    ("single precision", 300_000, 1 / 3000, 1 / 3000, True),
    ("single precision", 800_000, 1.25e-4, 1.25e-4, True),
)
"""Importers' times from 0 to 100 s or for 10⁶ samples: steps, T_s s, step size s, and whether their times are float32.
Each step brings one sample."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=1_000_000_000, help="steps of each case")
    options = parser.parse_args()
    compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    command = compiler.split() if compiler else [sys.executable, "-m", "ziglang", "cc"]
    table = Table(title=f"{options.steps} steps")
    for heading in ("start s", "T_s s", "steps s", "off by, T_s", "other counts", "importer's drift, T_s", "ns a step"):
        table.add_column(heading, justify="right")
    missed = 0
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "clock"
        sources = [HERE / "main.c", *CORE.rglob("hsep_clock.c")]
        includes = [f"-I{path}" for path in sorted({path.parent for path in CORE.rglob("*.h")})]
        subprocess.run([*command, *compile_flags(command), *includes, *sources, "-lm", "-o", program], check=True)
        for start, T_s, sizes in CASES:
            began = perf_counter()
            if not (found := run(program, options.steps, start, T_s, False, *sizes)):
                return 1
            worst, wrong, _, drift = found
            missed += float(worst) > DEVIATION_MAX or int(wrong) > 0
            time = 1e9 * (perf_counter() - began) / options.steps
            row = (f"{start:g}", f"{T_s:g}", " ".join(map(str, sizes)), worst, wrong, drift, f"{time:.0f}")
            table.add_row(*row)
        rounded = Table(title="rounded times, one sample a step")
        for heading in ("times", "steps", "T_s s", "off by, T_s", "other counts", "samples lost or doubled"):
            rounded.add_column(heading, justify="right")
        for name, n_steps, T_s, size, single in ROUNDED:
            if not (found := run(program, n_steps, 0.0, T_s, single, size)):
                return 1
            worst, wrong, counted, _ = found
            lost = n_steps - int(counted)
            missed += float(worst) > DEVIATION_MAX or int(wrong) > 0 or lost != 0
            rounded.add_row(name, str(n_steps), f"{T_s:g}", worst, wrong, str(lost))
    Console().print(rounded)
    Console().print(table)
    return int(missed > 0)


def run(program: Path, n_steps: int, start: float, T_s: float, single: bool, *sizes: float) -> list[str]:
    """Return what the program prints; nothing, with its message shown, if it fails."""
    arguments = [str(n_steps), repr(start), repr(T_s), str(int(single)), *map(repr, sizes)]
    done = subprocess.run([program, *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        print(done.stderr, file=sys.stderr)
    return done.stdout.split()


if __name__ == "__main__":
    sys.exit(main())
