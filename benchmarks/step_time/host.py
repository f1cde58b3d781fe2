"""C host that times a model step by step: build, runs, instruction counts."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybridsep.base.settings import PredictorSettings
from hybridsep.fmi.c_header import c_header
from hybridsep.fmi.compile import FLAGS
from hybridsep.fmi.variables import FmuTable
from hybridsep.fmi.weights import WEIGHTS_FILE, weights_file
from hybridsep.model.physics import ModalModel
from hybridsep.plants.feed_drive import FeedDrive
from hybridsep.plants.plant import simulate
from hybridsep.plants.trajectory import staircase
from hybridsep.predict.predictor import HybridPredictor

Array = NDArray[np.float64]

HERE = Path(__file__).parent
C_SOURCES = HERE.parents[1] / "fmu_src" / "c"

_PAPER = PredictorSettings(averaging=False, Np=100, p=50, q=3, lam=1e-12, T_s=1e-3, t_init=0.3, input_hold="zoh")
PREDICTOR = {**_PAPER.to_fmi(), "dead_time": 0}
"""The paper's settings."""


@dataclass(frozen=True)
class Host:
    """The program that steps the model, and the log it plays."""

    program: Path
    log: Path

    def command(self, values: dict[str, Any], steps: int, times: Path | str) -> list[str]:
        """Return the command that does so many steps and writes their times to a file, or to none with "-"."""
        set_values = [f"{name}={value}" for name, value in values.items()]
        return [str(self.program), str(steps), str(self.log), str(times), *set_values]


def drive_log() -> tuple[Array, Array]:
    """Return commands and measured positions of one staircase, (6000,), m."""
    x_d = staircase()[:-1]
    x = simulate(FeedDrive(m=1.0, c=15.7, k=24674.0, c_nl=100.0, k_nl=1000.0), x_d, 1e-3)
    return x_d, x + np.random.default_rng(0).normal(0.0, 5e-6, len(x))


def build(folder: Path, model: str, parameters: dict[str, Any]) -> Host:
    """Compile the host with a model of the paper's drive."""
    folder.mkdir()
    mode = ModalModel.spring_mass_damper(m=1.0, c=15.7, k=24674.0).modes[0]
    table = FmuTable(model, model, parameters, (asdict(mode),))
    (folder / "hsep_fmu.h").write_text(c_header(table, "{benchmark}"), encoding="utf-8")
    compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    command = compiler.split() if compiler else [sys.executable, "-m", "ziglang", "cc", "-mcpu=baseline"]
    sources = [path for part in ("core", "model") for path in sorted((C_SOURCES / part).rglob("*.c"))]
    includes = [f"-I{path}" for path in (folder, *sorted({path.parent for path in C_SOURCES.rglob("*.h")}))]
    program = folder / "step_time"
    subprocess.run(
        [
            *command,
            *FLAGS,
            *includes,
            str(HERE / "main.c"),
            *map(str, sources),
            "-lm",
            "-o",
            str(program),
        ],
        check=True,
    )
    log = folder / "log.bin"
    log.write_bytes(np.concatenate(drive_log()).astype("<f8").tobytes())
    return Host(program, log)


def warm(predictor: HybridPredictor, folder: Path) -> dict[str, Any]:
    """Return the values that make a run begin with what a predictor has learned, which is written to a new folder."""
    folder.mkdir()
    (folder / WEIGHTS_FILE).write_bytes(weights_file(predictor))
    return {"weights": folder / WEIGHTS_FILE}


def timed(host: Host, values: dict[str, Any], steps: int, folder: Path) -> tuple[dict[str, Any], Array]:
    """Run the host once; return what it prints, and the times of its steps and of an empty loop, (2, steps), ns.

    Parameters
    ----------
    host : Host
    values : mapping
        Parameters that differ from those the host was built with.
    steps : int
    folder : Path
        Where the times are written; exists.
    """
    times = folder / "times.bin"
    done = subprocess.run(host.command(values, steps, times), check=True, capture_output=True, text=True)
    return json.loads(done.stdout), np.fromfile(times).reshape(2, steps)


def longest_step(turns: list[Array]) -> float:
    """Return how long the longest step takes, ns, if nothing interrupts it.

    Parameters
    ----------
    turns : list of array, (steps,)
        Times of the same steps, ns. Of each step the shortest counts: what interrupts one turn, which an empty loop
        shows as well, does not return at the same step of all others.
    """
    return float(np.min(turns, axis=0).max())


def instructions(host: Host, values: dict[str, Any], steps: int, folder: Path) -> Array | None:
    """Return the instructions of each step, (steps,); None without valgrind.

    Parameters
    ----------
    host : Host
    values : mapping
        Parameters that differ from those the host was built with.
    steps : int
        Steps to be counted.
    folder : Path
        Where valgrind writes; made.
    """
    valgrind = shutil.which("valgrind")
    if valgrind is None:
        return None
    folder.mkdir()
    options = ["--tool=callgrind", "--toggle-collect=hsep_model_step", "--dump-after=hsep_model_step"]
    command = [valgrind, *options, f"--callgrind-out-file={folder}/out", *host.command(values, steps, "-")]
    subprocess.run(command, check=True, capture_output=True)
    counts = {}
    for file in folder.glob("out.*"):
        part, total = (
            re.search(pattern, file.read_text(encoding="utf-8", errors="replace"), re.MULTILINE)
            for pattern in (r"^part: (\d+)", r"^(?:summary|totals): (\d+)")
        )
        if part and total:
            counts[int(part[1])] = int(total[1])
    if len(counts) < steps:
        raise SystemExit(f"callgrind wrote {len(counts)} counts for {steps} steps")
    return np.array([counts[k] for k in sorted(counts)][:steps], dtype=np.float64)
