"""Mutated tables of FMUs whose libraries serve all FMUs of their kind, under the sanitizers.

Run as a program, ``python tests/support/fuzz_tables.py --n 100000``, it tries so many of each kind;
``tests/c/fuzz_tables.c`` says what a finding is.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Sequence
from pathlib import Path

from c_compiler import run_compiler, sanitising_compiler
from places import ROOT

from hybridsep import build_fmu, load_machine
from hybridsep.fmi.c_header import KINDS, c_sources, fmi_headers, kind_header

__all__ = ["MACHINES", "fuzz"]

MACHINES = dict.fromkeys(KINDS, "spring_mass_damper") | {"StageDrive": "als25010_x"}
"""The machine whose FMU a kind is tried with."""

_FLAGS = ["-O0", "-g", "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all", "-D_GNU_SOURCE"]


def fuzz(kind: str, folder: Path, n: int, seed: int = 1) -> tuple[bool, str]:
    """Try mutated tables of a kind; return whether there was no finding, and what the program said.

    Parameters
    ----------
    kind : str
        Of :data:`hybridsep.fmi.c_header.KINDS`.
    folder : Path
        For what is built; empty.
    n : int
        Number of tables.
    seed : int
        Of the mutations.
    """
    machine = load_machine(MACHINES[kind])
    name = "FeedDrive_als25010_x" if kind == "StageDrive" else kind
    with zipfile.ZipFile(build_fmu(machine, name, folder, targets=("host",))) as archive:
        archive.extractall(folder, [member for member in archive.namelist() if member.startswith("resources/")])
    for file, content in {**c_sources(), **fmi_headers(), "hsep_fmu.h": kind_header(kind).encode()}.items():
        (folder / file).write_bytes(content)
    program, resources = folder / "fuzz", folder / "resources"
    own = (resources / "variables.bin").rename(folder / "variables.bin")
    sources: list[str | Path] = [f"-I{folder}", ROOT / "tests" / "c" / "fuzz_tables.c", "-lm", "-ldl", "-o", program]
    run_compiler([*_FLAGS, *sources], command=sanitising_compiler())
    options = {"ASAN_OPTIONS": "detect_leaks=0:allocator_may_return_null=1"}  # blocks are counted
    command: Sequence[str | Path] = [program, own, resources, str(n), str(seed)]
    done = subprocess.run(command, env=os.environ | options, capture_output=True, text=True, check=False)
    return done.returncode == 0 and "no finding" in done.stdout, done.stdout + done.stderr


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kind", choices=list(KINDS), nargs="+", default=list(KINDS))
    parser.add_argument("--n", type=int, default=100_000, help="tables of each kind")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    held = True
    for kind in given.kind:
        begin = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            one, said = fuzz(kind, Path(folder), given.n, given.seed)
        held &= one
        print(f"{kind}: {said.strip()} ({time.perf_counter() - begin:.0f} s)", flush=True)
    return int(not held)


if __name__ == "__main__":
    sys.exit(main())
