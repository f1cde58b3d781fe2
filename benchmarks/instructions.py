"""Instructions of a sample of the native FMUs, counted one by one by callgrind: median, 99th percentile, dearest.

    python -m benchmarks.instructions      (five minutes; needs valgrind)

HybridPredictor with a window of 100 samples and 50 lags over the log of a staircase, and SepCompensator with windows
of 50, 50 lags and a preview of 200 in closed loop with the drive of eq. (13), within the trajectory's limits, so that
nearly every plan is bounded; both also with the paper's model. Over 60 windows, with nothing learned before (cold) and
with what an earlier run has learned (warm); the first window, or the first fill of the preview, is left out. Ends with
1 if a limit is missed.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from hybridsep.base.settings import CompensatorSettings, Limits, PredictorSettings
from hybridsep.base.signals import Array
from hybridsep.cosim.loop import cosimulate
from hybridsep.evaluate.backtest import backtest
from hybridsep.fmi.c_header import c_header
from hybridsep.fmi.compile import FLAGS
from hybridsep.fmi.variables import FmuTable
from hybridsep.fmi.weights import WEIGHTS_FILE, weights_file
from hybridsep.machines.machine import load_machine
from hybridsep.model.physics import ModalModel
from hybridsep.plants.feed_drive import FeedDrive
from hybridsep.plants.plant import Encoder, simulate
from hybridsep.plants.trajectory import staircase
from hybridsep.predict.predictor import HybridPredictor

HERE = Path(__file__).parent
C_SOURCES = HERE.parent / "fmu_src" / "c"
MODEL = ModalModel.spring_mass_damper(m=1.0, c=15.7, k=24674.0)

_PAPER = PredictorSettings(averaging=False, Np=100, p=50, q=3, lam=1e-12, T_s=1e-3, t_init=0.3, input_hold="zoh")
PREDICTOR = {**_PAPER.to_fmi(), "dead_time": 0}
_TIGHT = Limits(velocity=0.08, acceleration=8.0, jerk=1000.0)
_SETTINGS = CompensatorSettings(preview=200, spacing=2, change_max=1e-3, limits=_TIGHT)
COMPENSATOR = {**PREDICTOR, **_SETTINGS.to_fmi(), **_TIGHT.to_fmi()}
"""The paper's settings, and the trajectory's limits."""

WINDOWS = 60
LIMITS = {
    "predictor, paper's model": 0.32e6,
    "predictor, cold": 0.32e6,
    "predictor, warm": 0.36e6,
    "predictor, warm, recall": 0.42e6,
    "compensator, paper's model": 3.0e6,
    "compensator, cold": 1.5e6,
    "compensator, warm": 1.5e6,
}
"""Instructions of the dearest sample; with recall with its memory of 8192 samples, else without."""


@dataclass(frozen=True)
class Host:
    """The program that steps a model, and the log it plays."""

    program: Path
    log: Path


def drive_log() -> tuple[Array, Array]:
    """Return commands and measured positions of one staircase, (6000,), m."""
    x_d = staircase()[:-1]
    x = simulate(FeedDrive(m=1.0, c=15.7, k=24674.0, c_nl=100.0, k_nl=1000.0), x_d, 1e-3)
    return x_d, x + np.random.default_rng(0).normal(0.0, 5e-6, len(x))


def build(folder: Path, model: str, parameters: dict[str, Any]) -> Host:
    """Compile the program with a model of the paper's drive, to a new folder."""
    folder.mkdir()
    table = FmuTable(model, model, parameters, (asdict(MODEL.modes[0]),))
    (folder / "hsep_fmu.h").write_text(c_header(table, "{benchmark}"), encoding="utf-8")
    compiler = os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    command = compiler.split() if compiler else [sys.executable, "-m", "ziglang", "cc", "-mcpu=baseline"]
    sources = [str(path) for part in ("core", "model") for path in sorted((C_SOURCES / part).rglob("*.c"))]
    includes = [f"-I{path}" for path in (folder, *sorted({path.parent for path in C_SOURCES.rglob("*.h")}))]
    host = Host(folder / "steps", folder / "log.bin")
    subprocess.run(
        [*command, *FLAGS, *includes, str(HERE / "steps.c"), *sources, "-lm", "-o", str(host.program)], check=True
    )
    host.log.write_bytes(np.concatenate(drive_log()).astype("<f8").tobytes())
    return host


def warm(predictor: HybridPredictor, folder: Path) -> dict[str, Any]:
    """Return the values that make a run begin with what a predictor has learned, which is written to a new folder."""
    folder.mkdir()
    (folder / WEIGHTS_FILE).write_bytes(weights_file(predictor))
    return {"weights": folder / WEIGHTS_FILE}


def trained() -> HybridPredictor:
    """Return a predictor that has learned the log: a warm run compares it with what it measures."""
    predictor = HybridPredictor(MODEL, PredictorSettings(lam=1e-12))
    backtest(predictor, *drive_log())
    return predictor


def trained_in_loop() -> HybridPredictor:
    """Return the predictor of the drive's compensator after a part of the staircase, in closed loop."""
    machine = load_machine("spring_mass_damper")
    compensator = machine.new_compensator()
    cosimulate(compensator, machine.new_plant(), staircase()[:2500], encoder=Encoder(5e-6, 7))
    return compensator.predictor


def instructions(host: Host, values: dict[str, Any], steps: int, folder: Path) -> Array:
    """Return the instructions of each step, (steps,), with other values of parameters; valgrind writes to a new folder.

    Raises
    ------
    SystemExit
        Without valgrind.
    """
    valgrind = shutil.which("valgrind")
    if valgrind is None:
        raise SystemExit("valgrind is not installed")
    folder.mkdir()
    options = ["--tool=callgrind", "--toggle-collect=hsep_model_step", "--dump-after=hsep_model_step"]
    command = [valgrind, *options, f"--callgrind-out-file={folder}/out", str(host.program), str(steps), str(host.log)]
    set_values = [f"{name}={value}" for name, value in values.items()]
    subprocess.run([*command, *set_values], check=True, capture_output=True)
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


def count(folder: Path) -> dict[str, list[float]]:
    """Return median, 99th percentile and maximum of the instructions of each case; files go to a folder that exists."""
    predictor = build(folder / "predictor", "HybridPredictor", PREDICTOR)
    compensator = build(folder / "compensator", "SepCompensator", COMPENSATOR)
    earlier, in_loop = warm(trained(), folder / "warm"), warm(trained_in_loop(), folder / "warm_in_loop")
    averaging = {"averaging": 1, "t_init": -1.0, "recall": 0}
    short = {**averaging, "Np": 50}
    cases: dict[str, tuple[Host, dict[str, Any], int, int]] = {
        "predictor, paper's model": (predictor, {}, 100, 100),
        "predictor, cold": (predictor, averaging, 100, 100),
        "predictor, warm": (predictor, averaging | earlier, 100, 100),
        "predictor, warm, recall": (predictor, averaging | earlier | {"recall": 8192}, 100, 100),
        "compensator, paper's model": (compensator, {}, 100, 200),
        "compensator, cold": (compensator, short, 50, 200),
        "compensator, warm": (compensator, short | in_loop, 50, 200),
    }
    found = {}
    for i, (name, (host, values, window, left_out)) in enumerate(cases.items()):
        counted = instructions(host, values, WINDOWS * window, folder / f"callgrind_{i}")
        found[name] = [float(level) for level in np.percentile(counted[left_out:], [50, 99, 100])]
    return found


def main() -> int:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    console, missed = Console(width=100), 0
    with tempfile.TemporaryDirectory(prefix="hsep_instructions_") as name:
        found = count(Path(name))
    table = Table(title=f"instructions of a sample in thousands, {WINDOWS} windows")
    for heading in ("", "median", "p99", "dearest", "limit"):
        table.add_column(heading, justify="right" if heading else "left")
    for name, levels in found.items():
        table.add_row(name, *(f"{level / 1e3:.1f}" for level in (*levels, LIMITS[name])))
        missed += levels[-1] > LIMITS[name]
    console.print(table)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
