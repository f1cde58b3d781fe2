"""Instructions of a sample of the native FMUs, counted one by one by callgrind: median, 99th percentile, dearest.

HybridPredictor with a window of 100 samples and 50 lags over the log of a staircase, and SepCompensator with windows
of 50, 50 lags and a preview of 200 in closed loop with the drive of eq. (13), within the trajectory's limits, so that
nearly every plan is bounded. Both over 60 windows, with nothing learned before (cold) and with what an earlier run has
learned (warm); the first window, or the first fill of the preview, is left out. Needs valgrind; ends with 1 if a limit
is missed.

Run with ``python -m benchmarks.instructions``.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.step_time.compensator import AVERAGING, COMPENSATOR, TIGHT
from benchmarks.step_time.compensator import trained as trained_in_loop
from benchmarks.step_time.host import PREDICTOR, Host, build, instructions, warm
from benchmarks.step_time.run import trained

WINDOWS = 60
LIMITS = {
    "predictor, cold": 0.32e6,
    "predictor, warm": 0.36e6,
    "predictor, warm, recall": 0.42e6,
    "compensator, cold": 1.5e6,
    "compensator, warm": 1.5e6,
}
"""Instructions of the dearest sample; with recall with its memory of 8192 samples, else without."""


def count(folder: Path) -> dict[str, list[float]]:
    """Return median, 99th percentile and maximum of the instructions of each case; files go to a folder that exists.

    Raises
    ------
    SystemExit
        Without valgrind.
    """
    predictor = build(folder / "predictor", "HybridPredictor", PREDICTOR)
    compensator = build(folder / "compensator", "SepCompensator", COMPENSATOR)
    earlier, in_loop = warm(trained(), folder / "warm"), warm(trained_in_loop(), folder / "warm_in_loop")
    alone, tight = {"averaging": 1, "t_init": -1.0, "recall": 0}, {**AVERAGING, **TIGHT, "recall": 0}
    cases: dict[str, tuple[Host, dict[str, Any], int, int]] = {
        "predictor, cold": (predictor, alone, 100, 100),
        "predictor, warm": (predictor, alone | earlier, 100, 100),
        "predictor, warm, recall": (predictor, alone | earlier | {"recall": 8192}, 100, 100),
        "compensator, cold": (compensator, tight, 50, 200),
        "compensator, warm": (compensator, tight | in_loop, 50, 200),
    }
    found = {}
    for i, (name, (host, values, window, left_out)) in enumerate(cases.items()):
        counted = instructions(host, values, WINDOWS * window, folder / f"callgrind_{i}")
        if counted is None:
            raise SystemExit("valgrind is not installed")
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
