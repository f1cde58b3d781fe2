"""Build and calls of ``main.c``, which runs the C core for long and counts the allocator's calls."""

from __future__ import annotations

import json
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hybridsep.fmi.c_sources import fmi_headers
from hybridsep.fmi.fmu import table_of
from hybridsep.fmi.native_flavour import sources
from hybridsep.machines.paper import paper_machine

Array = NDArray[np.float64]

MAIN = Path(__file__).parent / "main.c"


@dataclass(frozen=True)
class Calls:
    """Calls of the allocator up to the end of the initialization, and after it; RMS errors early and late, m."""

    before: int
    after: int
    early: float = 0.0
    late: float = 0.0


class Host:
    """The program around the HybridPredictor of the paper's drive.

    Parameters
    ----------
    folder : Path
        Where it is built and works.
    compiler : list of str
        Command of a C compiler for glibc's Linux, whose allocator the program can stand in for.
    flags : list of str
        Compiler options.
    """

    def __init__(self, folder: Path, compiler: list[str], flags: list[str]) -> None:
        self.folder, self.program = folder, folder / "long_run"
        machine = paper_machine("spring_mass_damper")
        table = table_of(machine, "HybridPredictor", "HybridPredictor")
        for file, content in (sources(table, "{long run}") | fmi_headers()).items():
            (folder / file).write_bytes(content)
        (folder / "all.c").unlink()  # what main.c calls has internal linkage there
        files = [f"-I{folder}", str(MAIN), *map(str, folder.glob("*.c")), "-lm", "-o", str(self.program)]
        command = [*compiler, *flags, *files]
        subprocess.run(command, check=True)

    def fold(self, rows: Array, lam: float, repetitions: int) -> tuple[Array, Calls]:
        """Fold rows ``[φ | target]``, (m, n + 1), over and over; return the weights, (n,), and all calls."""
        data, weights = self.folder / "rows.bin", self.folder / "weights.out"
        data.write_bytes(np.ascontiguousarray(rows, dtype="<f8").tobytes())
        m, width = rows.shape
        calls = self._call("fold", data, m, width - 1, repr(lam), repetitions, weights)
        return np.fromfile(weights), calls

    def step(self, samples: int, trust: bool) -> Calls:
        """Step the FMU so many samples; return the allocator's calls, and its errors."""
        return self._call("step", samples, int(trust))

    def _call(self, *arguments: object) -> Calls:
        done = subprocess.run([self.program, *map(str, arguments)], check=True, capture_output=True, text=True)
        return Calls(**json.loads(done.stdout))
