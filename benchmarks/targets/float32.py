"""Errors of the C library in single precision relative to double precision, on random drives.

    python -m benchmarks.targets.float32 [--n 120] [--seed 211]

Each drive's log is replayed by ``fmu_src/c/examples/replay.c`` with the first mode of its model, in both precisions.
"""

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from random_drives.generator import RandomDrive, random_drives

from benchmarks.targets.targets import C_SOURCES, FLOAT32, core_sources, include_options

WINDOWS = (20, 100)


def built(folder: Path, name: str, *options: str) -> Path:
    """Compile the replay with gcc; return the program."""
    command = ["gcc", "-std=c99", "-O2", "-ffp-contract=off", *options, *include_options()]
    sources = [str(path) for path in (*core_sources(), C_SOURCES / "examples" / "replay.c")]
    subprocess.run([*command, *sources, "-lm", "-o", str(folder / name)], check=True)
    return folder / name


def hybrid_error(program: Path, log: Path, Np: int, drive: RandomDrive) -> float:
    """Return the RMS of the hybrid's error as the replay prints it, µm."""
    mode = drive.model.modes[0]
    command = [str(program), str(log), str(Np), str(mode.f_n), str(mode.zeta)]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return float(re.findall(r"hybrid (\S+);", said)[0])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=int, default=120, help="drives")
    parser.add_argument("--seed", type=int, default=211)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="hsep_float32_") as name:
        folder = Path(name)
        programs = built(folder, "single", *FLOAT32), built(folder, "double")
        ratios: dict[int, list[float]] = {Np: [] for Np in WINDOWS}
        for drive in random_drives(range(options.n), options.seed):
            log = folder / "log.csv"
            rows = np.stack((1e-3 * np.arange(len(drive.x_d)), drive.x_d, drive.x_meas), axis=1)
            np.savetxt(log, rows, delimiter=",", header="t,x_d,x", comments="", fmt="%.17g")
            for Np, of_window in ratios.items():
                single, double = (hybrid_error(program, log, Np, drive) for program in programs)
                of_window.append(single / double)
    for Np, of_window in ratios.items():
        mean, median, worst = np.exp(np.mean(np.log(of_window))), np.median(of_window), max(of_window)
        print(f"Np = {Np}: geometric mean {mean:.3f}, median {median:.4f}, worst {worst:.2f} × double precision")
    return 0


if __name__ == "__main__":
    sys.exit(main())
