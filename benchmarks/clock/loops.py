"""Closed loops of FMUs at the times of importers: figures against the figures of exact steps.

SepCompensator and FeedDrive, and HybridPredictor and FeedDrive, over the staircase. What an importer calls the time is
rounded, and so are its steps: whole nanoseconds, single precision up to 100 s, sums of steps. Where steps jitter, as
differences of times in single precision do by 0.4 % of 1 ms, the drive moves otherwise, because it is integrated over
the steps that it gets: what the look-ahead's clock adds to that is the difference from a loop whose look-ahead alone
has exact steps. Ends with 1 if that is more than 1e-3 of an RMS, or if an RMS at times whose steps do not jitter
differs by more from the RMS of exact steps.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from hybridsep import FmuInstance, build_fmu, load_machine, staircase

Array = NDArray[np.float64]

DEVIATION_MAX = 1e-3
FLAVOURS = {"2.0": ("", "native", "2"), "3.0": ("Fmi3", "native", "3"), "Python": ("Py", "python", "2")}


def exact(n: int, T_s: float) -> tuple[Array, Array]:
    return np.arange(n, dtype=np.float64) * T_s, np.full(n, T_s)


def whole_nanoseconds(n: int, T_s: float) -> tuple[Array, Array]:
    """Return steps of a whole number of them, as libcosim's."""
    step = round(T_s * 1e9) * 1e-9
    return np.arange(n, dtype=np.float64) * step, np.full(n, step)


def rounded_to_nanoseconds(n: int, T_s: float) -> tuple[Array, Array]:
    times = np.round(np.arange(n + 1) * T_s, 9)
    return times[:-1], np.diff(times)


def single_precision(n: int, T_s: float) -> tuple[Array, Array]:
    """Return the last times before 100 s, and steps that are T_s in the same precision."""
    return _before_100_s(n, T_s)[:-1], np.full(n, float(np.float32(T_s)))


def single_differences(n: int, T_s: float) -> tuple[Array, Array]:
    """Return the same times with their differences as steps, which jitter."""
    times = _before_100_s(n, T_s)
    return times[:-1], np.diff(times)


def _before_100_s(n: int, T_s: float) -> Array:
    return (100.0 + (np.arange(n + 1) - n) * T_s).astype(np.float32).astype(np.float64)


def sum_of_steps(n: int, T_s: float) -> tuple[Array, Array]:
    times = np.cumsum(np.full(n + 1, T_s))
    return times[:-1], np.diff(times)


TIMES: dict[str, Callable[[int, float], tuple[Array, Array]]] = {
    "steps of whole ns": whole_nanoseconds,
    "times in ns": rounded_to_nanoseconds,
    "single precision": single_precision,
    "its differences": single_differences,
    "sum of steps": sum_of_steps,
}


JITTERS = "its differences"

Grid = tuple[Array, Array]


def loop(controller: Path, plant: Path, command: Array, T_s: float, grid: Grid, drives: Grid) -> dict[str, float]:
    """Return the errors that the controller's FMU reports at the end of a loop; times and steps of both FMUs."""
    names = ("rms_e", "rms_pb", "rms_h") if "Sep" in controller.name else ("rms_pb", "rms_h")
    sent = "x_dm" if "Sep" in controller.name else "x_d"
    with FmuInstance(controller) as ahead, FmuInstance(plant) as drive:
        ahead.initialise({"T_s": T_s}, start_time=float(grid[0][0]))
        drive.initialise(start_time=float(drives[0][0]))
        rows = zip(*(signal.tolist() for signal in (command, *grid, *drives)), strict=True)
        for r, t, h, t_drive, h_drive in rows:
            ahead.set("x_d_ahead", r)
            ahead.set("x_meas", drive.get("x_meas"))
            drive.set("x_d", ahead.get(sent))
            ahead.step(t, h)
            drive.step(t_drive, h_drive)
        return {name: ahead.get(name) for name in names}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=3.0, help="of the staircase")
    parser.add_argument("--flavour", choices=list(FLAVOURS), nargs="+", default=list(FLAVOURS))
    options = parser.parse_args()
    machine, missed = load_machine("spring_mass_damper"), 0
    table = Table(title="RMS with rounded times over RMS with exact steps, minus 1")
    for heading in ("T_s, ms", "FMU", "of", "exact, µm", *TIMES, "by the clock"):
        table.add_column(heading, justify="right")
    path, seconds = staircase(), options.seconds
    with tempfile.TemporaryDirectory() as folder:
        for flavour in options.flavour:
            suffix, how, fmi = FLAVOURS[flavour]
            given: dict[str, Any] = {"fmi": fmi, "targets": ("host",)} if how == "native" else {}
            built = {
                kind: build_fmu(machine, f"{kind}{suffix}", folder, how, **given)
                for kind in ("HybridPredictor", "SepCompensator", "FeedDrive")
            }
            for T_s in (1e-3, 1e-3 / 3):
                n = round(seconds / T_s)
                command = np.interp(np.arange(n) * T_s, np.arange(len(path)) * machine.T_s, path)
                for kind in ("HybridPredictor", "SepCompensator"):
                    pair = built[kind], built["FeedDrive"]
                    grids = [times(n, T_s) for times in TIMES.values()]
                    truth = loop(*pair, command, T_s, exact(n, T_s), exact(n, T_s))
                    found = [loop(*pair, command, T_s, grid, grid) for grid in grids]
                    there = [loop(*pair, command, T_s, exact(n, T_s), grid) for grid in grids]
                    for name, value in truth.items():
                        off = {times: each[name] / value - 1 for times, each in zip(TIMES, found, strict=True)}
                        own = max(abs(a[name] / b[name] - 1) for a, b in zip(found, there, strict=True))
                        judged = [abs(each) for times, each in off.items() if times != JITTERS]
                        missed += max(*judged, own) > DEVIATION_MAX
                        cells = (f"{1e3 * T_s:.4g}", f"{kind} {flavour}", name, f"{1e6 * value:.3f}")
                        table.add_row(*cells, *(f"{each:.1e}" for each in off.values()), f"{own:.1e}")
    Console(width=170).print(table)
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
